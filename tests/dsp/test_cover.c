/* SPDX-License-Identifier: MIT */
/* Direct sound of a line of elements, 1 / distance, of which some are covered. */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "dsp/cover.h"
#include "tests/dsp/near.h"

enum { N = 8 };

struct rig {
    struct cover *cover;
    double distance_m[N][N];
    double speaker_db[N], microphone_db[N]; /* what covers them takes so much */
    double noise_db;
};

static int setup_with(struct rig *r)
{
    *r = (struct rig){.noise_db = -60.0};
    for (int j = 0; j < N; j++)
        for (int m = 0; m < N; m++)
            r->distance_m[j][m] = fabs(0.1 * (m - j) + 0.05);
    return cover_create(&r->cover, N, N, &r->distance_m[0][0], 35.0);
}

static void ping(struct rig *r, size_t j)
{
    double direct[N], noise[N];

    for (size_t m = 0; m < N; m++) {
        double gain_db = -r->speaker_db[j] - r->microphone_db[m];
        noise[m] = pow(10.0, 0.1 * r->noise_db);
        direct[m] = pow(10.0, 0.1 * gain_db) /
                    (r->distance_m[j][m] * r->distance_m[j][m]);
        direct[m] = fmax(direct[m], noise[m]);
    }
    cover_take(r->cover, j, direct, noise, NULL);
}

static void rounds(struct rig *r, int n)
{
    for (int k = 0; k < n * N; k++)
        ping(r, (size_t)(k % N));
}

/* Which ones; -1: none. */
static void assert_covered(const struct rig *r, int speaker, int microphone)
{
    for (int i = 0; i < N; i++) {
        assert_int_equal(cover_speaker(r->cover, (size_t)i), i == speaker);
        assert_int_equal(cover_microphone(r->cover, (size_t)i), i == microphone);
    }
}

static void a_row_that_drops_is_a_covered_speaker(void **state)
{
    struct rig r;

    (void)state;
    for (int j = 0; j < N; j++) {
        assert_int_equal(setup_with(&r), 0);
        rounds(&r, COVER_ROUNDS);
        assert_covered(&r, -1, -1);
        r.speaker_db[j] = 15.0;
        rounds(&r, 1);
        assert_covered(&r, j, -1);
        r.speaker_db[j] = 8.0; /* not free yet */
        rounds(&r, 1);
        assert_covered(&r, j, -1);
        r.speaker_db[j] = 0.0;
        rounds(&r, 1);
        assert_covered(&r, -1, -1);
        cover_destroy(r.cover);
    }
}

static void a_column_that_drops_is_a_covered_microphone_within_a_round(void **state)
{
    struct rig r;

    (void)state;
    for (int m = 0; m < N; m++) {
        assert_int_equal(setup_with(&r), 0);
        rounds(&r, COVER_ROUNDS);
        r.microphone_db[m] = 25.0;
        rounds(&r, 1);
        assert_covered(&r, -1, m);
        r.microphone_db[m] = 0.0;
        rounds(&r, 1);
        assert_covered(&r, -1, -1);
        cover_destroy(r.cover);
    }
}

static void a_few_decibels_cover_nothing(void **state)
{
    struct rig r;

    (void)state;
    assert_int_equal(setup_with(&r), 0);
    rounds(&r, COVER_ROUNDS);
    for (int i = 0; i < N; i++) {
        r.speaker_db[i] = i % 2 ? 3.0 : -3.0;
        r.microphone_db[i] = i % 3 ? 3.0 : -3.0;
    }
    rounds(&r, 3);
    assert_covered(&r, -1, -1);
    cover_destroy(r.cover);
}

static void what_was_covered_from_the_start_does_not_fit_the_others(void **state)
{
    struct rig r;

    (void)state;
    assert_int_equal(setup_with(&r), 0);
    r.microphone_db[2] = 20.0;
    r.speaker_db[5] = 20.0;
    rounds(&r, COVER_ROUNDS + 1);
    assert_covered(&r, 5, 2);
    cover_destroy(r.cover);
}

/* Noise drowns the direct sound, and so says nothing of cover: what was known stays. */
static void noise_covers_nothing_and_frees_nothing(void **state)
{
    struct rig r;

    (void)state;
    assert_int_equal(setup_with(&r), 0);
    rounds(&r, COVER_ROUNDS);
    assert_true(cover_expects(r.cover, 3, 3, 1.0));
    r.noise_db = 40.0;
    rounds(&r, 3);
    assert_covered(&r, -1, -1);
    assert_false(cover_expects(r.cover, 3, 3, 1e4));
    assert_near(cover_snr_db(r.cover), 0.0, 1e-6); /* the peak is that of the noise */
    r.noise_db = -60.0;
    r.speaker_db[4] = 20.0;
    rounds(&r, 1);
    assert_covered(&r, 4, -1);
    r.noise_db = 40.0;
    rounds(&r, 1);
    assert_covered(&r, 4, -1);
    cover_destroy(r.cover);
}

/* A cable that is out: the sound of others, 60 dB below, is no direct sound of its own.
 */
static void what_is_dead_is_not_called_covered(void **state)
{
    struct rig r;

    (void)state;
    assert_int_equal(setup_with(&r), 0);
    rounds(&r, COVER_ROUNDS);
    r.speaker_db[1] = 60.0;
    r.microphone_db[6] = 200.0;
    rounds(&r, 2);
    assert_covered(&r, -1, -1);
    cover_destroy(r.cover);
}

static void the_loudest_direct_sound_over_noise_is_told(void **state)
{
    struct rig r;

    (void)state;
    assert_int_equal(setup_with(&r), 0);
    assert_true(isnan(cover_snr_db(r.cover)));
    rounds(&r, COVER_ROUNDS);
    assert_near(cover_snr_db(r.cover), 60.0 - 20.0 * log10(0.05), 1e-6);
    cover_destroy(r.cover);
}

/* Zeros in the place of samples would be 200 dB down. */
static void samples_that_are_none_cover_nothing(void **state)
{
    static const bool unfit[N] = {[2] = true};
    struct rig r;

    (void)state;
    assert_int_equal(setup_with(&r), 0);
    rounds(&r, COVER_ROUNDS);
    for (size_t j = 0; j < N; j++) {
        double direct[N], noise[N];
        for (size_t m = 0; m < N; m++) {
            noise[m] = 1e-6;
            direct[m] = pow(r.distance_m[j][m], -2.0) * (m == 2 ? 0.01 : 1.0);
        }
        cover_take(r.cover, j, direct, noise, unfit);
    }
    assert_covered(&r, -1, -1);
    r.microphone_db[2] = 20.0; /* the same, of samples that are some */
    rounds(&r, 1);
    assert_covered(&r, -1, 2);
    cover_destroy(r.cover);
}

static void elements_without_a_distance_are_refused(void **state)
{
    static const double bad[] = {0.0, -0.1, NAN};
    struct cover *c;

    (void)state;
    for (int i = 0; i < 3; i++) {
        const double distance_m[4] = {0.1, 0.1, bad[i], 0.1};
        assert_int_equal(cover_create(&c, 2, 2, distance_m, 35.0), -EINVAL);
        assert_null(c);
    }
    assert_int_equal(cover_create(&c, 0, 2, bad, 35.0), -EINVAL);
    assert_int_equal(cover_create(&c, 2, 0, bad, 35.0), -EINVAL);
    cover_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_row_that_drops_is_a_covered_speaker),
        cmocka_unit_test(a_column_that_drops_is_a_covered_microphone_within_a_round),
        cmocka_unit_test(a_few_decibels_cover_nothing),
        cmocka_unit_test(what_was_covered_from_the_start_does_not_fit_the_others),
        cmocka_unit_test(noise_covers_nothing_and_frees_nothing),
        cmocka_unit_test(what_is_dead_is_not_called_covered),
        cmocka_unit_test(the_loudest_direct_sound_over_noise_is_told),
        cmocka_unit_test(samples_that_are_none_cover_nothing),
        cmocka_unit_test(elements_without_a_distance_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
