/* SPDX-License-Identifier: MIT */
/* An echo on a floor of its own, before an array of 100 samples to a metre of way. */
#include <complex.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "recon/frontend/backgrounds.h"
#include "recon/frontend/interference.h"

enum { MICROPHONES = 4, SAMPLES = 300, SLOT_NS = 20000000 };

static double speakers_m[2][3] = {{0, 0, 0}, {0.1, 0, 0}};
static const bool fit[MICROPHONES] = {false};

struct rig {
    struct interference *i;
    float complex y[MICROPHONES][SAMPLES];
    int64_t now_ns;
    uint32_t speaker;
    bool subtracted;
    double speed_m_s;
};

static int setup(void **state)
{
    const struct survey s = {.sample_rate_hz = 48000.0,
                             .slot_samples = 960,
                             .sound_speed_m_s = 340.0,
                             .chirp_start_hz = 2000.0,
                             .chirp_stop_hz = 19000.0,
                             .n_speakers = 2,
                             .n_microphones = MICROPHONES,
                             .speakers_m = speakers_m};
    const struct trace_format format = {.rate_hz = 34000.0, .n_samples = SAMPLES};
    struct rig *r = calloc(1, sizeof *r);

    if (!r || interference_create(&r->i, &s, &format, format.n_samples))
        return -1;
    r->now_ns = 1;
    r->subtracted = true;
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    interference_destroy(r->i);
    free(r);
    return 0;
}

/* The next ping, of the other speaker, with a pulse at a sample. */
static const uint8_t *hear(struct rig *r, size_t at)
{
    r->now_ns += SLOT_NS;
    r->speaker = !r->speaker;
    for (size_t m = 0; m < MICROPHONES; m++)
        for (size_t k = 0; k < SAMPLES; k++)
            r->y[m][k] = k == at ? 10.0f : 1.0f;
    const struct ping ping = {.capture_ns = r->now_ns, .speaker = r->speaker};
    return interference_ping(r->i,
                             &(struct interference_ping){.ping = &ping,
                                                         .subtracted = r->subtracted,
                                                         .speed_m_s = r->speed_m_s,
                                                         .traces = &r->y[0][0],
                                                         .masked = fit});
}

static uint64_t hits(const struct rig *r)
{
    struct interference_levels l;

    interference_levels(r->i, &l);
    return l.pings;
}

static bool is_present(const struct rig *r)
{
    struct interference_levels l;

    interference_levels(r->i, &l);
    return l.present;
}

/* 0.1 m from speaker to speaker, and 2 x 2.5 m/s x 20 ms: 20 samples, and one for the way
 * between two samples.  The vehicle's own 5 m/s make 20 more. */
static void an_echo_may_move_as_far_as_speakers_and_speed_let_it(void **state)
{
    static const struct {
        double speed_m_s;
        size_t moved;
        bool hit;
    } cases[] = {
        {0, 21, false}, {0, 22, true}, {5, 41, false}, {5, 42, true}, {-5, 41, false}};
    struct rig *r = *state;

    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        uint64_t before = hits(r);
        interference_break(r->i);
        r->speed_m_s = cases[k].speed_m_s;
        hear(r, 100);
        hear(r, 100);
        hear(r, 100 + cases[k].moved);
        assert_int_equal(hits(r) - before, cases[k].hit);
    }
}

/* A pulse that jumps by 100 samples is foreign in each ping but the first two. */
static void it_is_present_from_the_twelfth_hit_on_and_taken_out_then(void **state)
{
    static const size_t at[] = {50, 150, 250};
    struct rig *r = *state;

    for (size_t n = 0; n < 40; n++) {
        const uint8_t *foreign = hear(r, at[n % 3]);
        size_t hit = n < 2 ? 0 : n - 1;
        assert_int_equal(hits(r), hit);
        assert_true(is_present(r) == (hit >= INTERFERENCE_SOME));
        assert_true((foreign != NULL) == is_present(r));
        /* The pulse's main lobe, 1 / 17 kHz = 2 samples, twice on either side. */
        for (size_t k = 0; foreign && k < SAMPLES; k++)
            assert_int_equal(foreign[k], k + 4 >= at[n % 3] && k <= at[n % 3] + 4);
    }
    /* Silence: as long as 8 of the newest 48 are hits, of which 38 were the last. */
    for (size_t n = 0; n < INTERFERENCE_PINGS; n++) {
        assert_null(hear(r, SAMPLES));
        size_t left = n + 1 < 48 - 38 ? 38 : 48 - (n + 1);
        assert_true(is_present(r) == (left >= INTERFERENCE_FEW));
    }
}

/* A longer slot, by a sixteenth, every fifth ping; what is not ours comes earlier by as
 * much from then on: 43 of 34000 samples a second. */
static bool look(struct rig *r, size_t at, bool jumps)
{
    for (size_t n = 0; n < 4; n++)
        hear(r, at);
    r->now_ns += SLOT_NS / 16;
    hear(r, jumps ? at - 43 : at);
    return is_present(r);
}

/* In each round of five the look and the ping after it are hit: by 12 of 48 it is never
 * known. */
static void one_with_slots_like_ours_is_known_at_looks(void **state)
{
    struct rig *r = *state;

    for (size_t n = 0; n < 20; n++) /* an echo of ours stays */
        assert_false(look(r, 250, false));
    assert_false(look(r, 250, true));
    assert_false(look(r, 207, false));
    assert_false(look(r, 207, true));
    for (size_t n = 0; n < 6; n++) /* two of 8 are not enough, nor two apart */
        assert_false(look(r, 164, false));
    assert_false(look(r, 164, true));
    assert_false(look(r, 121, true));
    assert_true(look(r, 78, true));
    for (size_t n = 0; n < 14; n++) /* two of the newest 16 are left */
        assert_true(look(r, 35, false));
    assert_false(look(r, 35, false));
}

/* It is no look. */
static void a_ping_that_is_missing_makes_no_longer_slot(void **state)
{
    struct rig *r = *state;

    for (size_t n = 0; n < 6; n++) {
        size_t at = n % 2 ? 50 : 250;
        for (size_t k = 0; k < 8; k++)
            hear(r, at);
        r->now_ns += SLOT_NS;
        hear(r, n % 2 ? 250 : 50);
        assert_false(is_present(r));
    }
}

static void with_a_background_and_without_are_not_held_against_each_other(void **state)
{
    struct rig *r = *state;

    hear(r, 50);
    hear(r, 50);
    r->subtracted = false;
    hear(r, 250);
    hear(r, 250);
    assert_int_equal(hits(r), 0);
    hear(r, 50);
    assert_int_equal(hits(r), 1);
}

/* Of two pings, 1 and 5, the mean is 3; where the second is another array's it stays 1.
 */
static void what_is_taken_out_does_not_count_into_the_background(void **state)
{
    struct mean_background *b;
    float complex y[4];
    const uint8_t foreign[4] = {0, 1, 0, 0};

    (void)state;
    assert_int_equal(mean_background_create(&b, 1, 1, 4, 10.0), 0);
    for (int n = 0; n < 3; n++) {
        for (int k = 0; k < 4; k++)
            y[k] = n == 1 ? 5.0f : 1.0f;
        mean_background_subtract(b, 0, 1 + INT64_C(1000000000) * n, fit, y);
        if (n == 1)
            mean_background_excise(b, foreign);
    }
    const float complex *mean = mean_background_of(b, 0);
    for (int k = 0; k < 4; k++)
        assert_true(cabsf(mean[k] - (foreign[k] ? 1.0f : 3.0f)) < 1e-6f);
    mean_background_destroy(b);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(an_echo_may_move_as_far_as_speakers_and_speed_let_it),
        TEST(it_is_present_from_the_twelfth_hit_on_and_taken_out_then),
        TEST(one_with_slots_like_ours_is_known_at_looks),
        TEST(a_ping_that_is_missing_makes_no_longer_slot),
        TEST(with_a_background_and_without_are_not_held_against_each_other),
        cmocka_unit_test(what_is_taken_out_does_not_count_into_the_background),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
