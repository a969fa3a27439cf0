/* SPDX-License-Identifier: MIT */
/* Pings of a vehicle on the move: noise, from sample BEHIND on the direct sound of the
 * next speaker, which stays as it is, and now and then something else. */
#include <complex.h>
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "dsp/rank.h"
#include "recon/frontend/own_sound.h"
#include "tests/recon/dice.h"

enum { SPEAKERS = 2, MICS = 4, N = 200, BEHIND = 150 };

#define NOISE  1e-3f
#define DIRECT 1.0f

struct rig {
    struct own_sound *own;
    unsigned long long seed;
    float complex x[MICS][N];
};

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);

    if (!r || own_sound_create(&r->own, SPEAKERS, MICS, N, BEHIND))
        return -1;
    r->seed = 7;
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    own_sound_destroy(r->own);
    free(r);
    return 0;
}

static float complex direct(size_t speaker, int mic, int k)
{
    return DIRECT * cexpf(I * (float)(3 * (int)speaker + mic + k));
}

/* What a ping of the speaker has before anything is done to it. */
static void hear(struct rig *r, size_t speaker)
{
    for (int m = 0; m < MICS; m++)
        for (int k = 0; k < N; k++) {
            r->x[m][k] =
                NOISE * ((float)dice_normal(&r->seed) + I * (float)dice_normal(&r->seed));
            r->x[m][k] += direct(speaker, m, k);
        }
}

static void take(struct rig *r, size_t speaker, bool moves)
{
    own_sound_subtract(r->own, speaker, moves, &r->x[0][0]);
}

static void mute(struct rig *r, size_t speaker)
{
    own_sound_mute(r->own, speaker, &r->x[0][0]);
}

static void learn(struct rig *r, size_t speaker, int rounds)
{
    for (int i = 0; i < rounds; i++) {
        hear(r, speaker);
        take(r, speaker, true);
    }
}

static double power(const struct rig *r, int from, int until)
{
    double sum = 0.0;

    for (int m = 0; m < MICS; m++)
        for (int k = from; k < until; k++)
            sum += pow((double)cabsf(r->x[m][k]), 2.0);
    return sum / MICS / (until - from);
}

/* Of noise; its median over n rounds adds some pi / 2 of it over n. */
static const double noise = 2.0 * (double)NOISE * (double)NOISE;

static void what_stays_goes_and_an_echo_stays(void **state)
{
    struct rig *r = *state;
    const int at[] = {60, 170};

    learn(r, 0, 9);
    hear(r, 0);
    float complex was[2];
    for (int i = 0; i < 2; i++) {
        for (int m = 0; m < MICS; m++)
            r->x[m][at[i]] += 2.0f * NOISE;
        was[i] = r->x[1][at[i]] - direct(0, 1, at[i]);
    }
    take(r, 0, true);
    mute(r, 0);
    for (int i = 0; i < 2; i++) {
        assert_true(cabsf(r->x[1][at[i]] - was[i]) < 3.0f * NOISE);
        assert_true(cabsf(r->x[1][at[i]]) > 0.0f);
    }
    double left = power(r, 0, N);
    assert_true(left > noise && left < 1.4 * noise);
}

/* Nine numbers' median, of each part of each sample, against sorting them. */
static void it_is_the_median_of_nine(void **state)
{
    struct rig *r = *state;
    static double parts[2 * MICS * N][9];

    for (int i = 0; i < 11; i++) { /* the first two are forgotten */
        hear(r, 0);
        const float *x = (const float *)r->x;
        for (int k = 0; k < 2 * MICS * N; k++)
            parts[k][i % 9] = (double)x[k];
        take(r, 0, true);
    }
    memset(r->x, 0, sizeof r->x);
    take(r, 0, false);
    const float *left = (const float *)r->x;
    for (int k = 0; k < 2 * MICS * N; k++)
        assert_true((double)left[k] == -rank_double(parts[k], 9, 5));
}

static void behind_the_slot_nothing_is_heard_before_it_is_known(void **state)
{
    struct rig *r = *state;

    for (int i = 0; i < 3; i++) {
        float complex was[MICS][N];
        hear(r, 0);
        memcpy(was, r->x, sizeof was);
        take(r, 0, true);
        mute(r, 0);
        assert_true(power(r, BEHIND, N) == 0.0);
        for (int m = 0; m < MICS; m++)
            assert_memory_equal(was[m], r->x[m], BEHIND * sizeof **was);
    }
    hear(r, 0);
    take(r, 0, true);
    mute(r, 0);
    assert_true(power(r, BEHIND, N) > 0.5 * noise);
    assert_true(power(r, 0, BEHIND) < 2.0 * noise);
}

/* What stands still on a vehicle that does would be taken for direct sound. */
static void a_vehicle_that_stands_teaches_nothing(void **state)
{
    struct rig *r = *state;

    for (int i = 0; i < 9; i++) {
        hear(r, 0);
        take(r, 0, false);
    }
    assert_true(power(r, BEHIND, N) > 0.9 * (double)DIRECT * (double)DIRECT);
}

static void each_speaker_has_its_own(void **state)
{
    struct rig *r = *state;

    learn(r, 0, 9);
    hear(r, 1);
    take(r, 1, true);
    assert_true(power(r, BEHIND, N) > 0.9 * (double)DIRECT * (double)DIRECT);
    learn(r, 1, 9);
    hear(r, 1);
    take(r, 1, false);
    assert_true(power(r, BEHIND, N) < 1.6 * noise);
}

/* Four rounds of nine passed close by something a hundred times louder: of a mean it
 * would leave 33 dB over the direct sound. */
static void what_passes_by_close_is_muted_and_not_learnt(void **state)
{
    struct rig *r = *state;

    learn(r, 0, 5);
    for (int i = 0; i < 4; i++) {
        hear(r, 0);
        for (int m = 0; m < MICS; m++)
            for (int k = 180; k < N; k++)
                r->x[m][k] += 100.0f * cexpf(I * (float)(5 * i + k));
        take(r, 0, true);
        mute(r, 0);
        for (int m = 0; m < MICS; m++)
            for (int k = 177; k < N; k++)
                assert_true(r->x[m][k] == 0.0f);
        assert_true(power(r, BEHIND, 177) > 0.0);
    }
    hear(r, 0);
    take(r, 0, true);
    assert_true(power(r, BEHIND, N) < 10.0 * noise);
}

static void it_asks_for_traces_that_reach_it(void **state)
{
    struct own_sound *e;

    (void)state;
    assert_int_equal(own_sound_create(&e, SPEAKERS, MICS, N, N + 1), -EINVAL);
    assert_int_equal(own_sound_create(&e, 0, MICS, N, BEHIND), -EINVAL);
    assert_int_equal(own_sound_create(&e, SPEAKERS, 0, N, BEHIND), -EINVAL);
    own_sound_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(what_stays_goes_and_an_echo_stays, setup,
                                        teardown),
        cmocka_unit_test_setup_teardown(it_is_the_median_of_nine, setup, teardown),
        cmocka_unit_test_setup_teardown(
            behind_the_slot_nothing_is_heard_before_it_is_known, setup, teardown),
        cmocka_unit_test_setup_teardown(a_vehicle_that_stands_teaches_nothing, setup,
                                        teardown),
        cmocka_unit_test_setup_teardown(each_speaker_has_its_own, setup, teardown),
        cmocka_unit_test_setup_teardown(what_passes_by_close_is_muted_and_not_learnt,
                                        setup, teardown),
        cmocka_unit_test(it_asks_for_traces_that_reach_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
