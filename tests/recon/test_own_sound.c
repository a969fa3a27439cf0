/* SPDX-License-Identifier: MIT */
/* recon/frontend/own_sound.c: what stays from ping to ping of a vehicle on the move goes,
 * as the median of the rounds before, and what is too loud behind the slot is muted.  The
 * pings are noise and a direct sound that stays as it is, and now and then something
 * else. */
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

#include "recon/frontend/own_sound.h"
#include "tests/recon/dice.h"

enum { SPEAKERS = 2, MICS = 4, N = 201, BEHIND = 150, SPREAD = 3 };

#define NOISE  1e-3f
#define DIRECT 1.0f

struct rig {
    struct own_sound *own;
    unsigned long long seed;
    float complex x[MICS][N];
    bool masked[MICS];
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
    own_sound_subtract(r->own, speaker, moves, r->masked, &r->x[0][0]);
}

static void mute(struct rig *r)
{
    own_sound_mute(r->own, &r->x[0][0]);
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
    mute(r);
    for (int i = 0; i < 2; i++) {
        assert_true(cabsf(r->x[1][at[i]] - was[i]) < 3.0f * NOISE);
        assert_true(cabsf(r->x[1][at[i]]) > 0.0f);
    }
    double left = power(r, 0, N);
    assert_true(left > noise && left < 1.4 * noise);
}

static int by_value(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;

    return (x > y) - (x < y);
}

/* Each part of each sample has its own.  Of fewer than nine rounds the first ones count
 * twice or more; of three and of five their median is the plain one all the same. */
static void it_is_the_median_of_the_newest_nine_rounds(void **state)
{
    static const struct {
        int rounds, n, of[9];
    } medians[] = {{3, 3, {0, 1, 2}},
                   {3, 9, {0, 0, 0, 1, 1, 1, 2, 2, 2}},
                   {4, 9, {0, 0, 0, 1, 1, 2, 2, 3, 3}},
                   {5, 5, {0, 1, 2, 3, 4}},
                   {5, 9, {0, 0, 1, 1, 2, 2, 3, 3, 4}},
                   {8, 9, {0, 0, 1, 2, 3, 4, 5, 6, 7}},
                   {9, 9, {0, 1, 2, 3, 4, 5, 6, 7, 8}},
                   {11, 9, {2, 3, 4, 5, 6, 7, 8, 9, 10}}};
    static float parts[11][2 * MICS * N];
    struct rig *r = *state;
    const float *x = (const float *)r->x;

    for (int rounds = 1; rounds <= 11; rounds++) {
        hear(r, 0);
        memcpy(parts[rounds - 1], x, sizeof *parts);
        take(r, 0, true);
        memset(r->x, 0, sizeof r->x);
        take(r, 0, false);
        for (size_t i = 0; i < sizeof medians / sizeof *medians; i++)
            for (int k = 0; medians[i].rounds == rounds && k < 2 * MICS * N; k++) {
                float sorted[9];
                for (int j = 0; j < medians[i].n; j++)
                    sorted[j] = parts[medians[i].of[j]][k];
                qsort(sorted, (size_t)medians[i].n, sizeof *sorted, by_value);
                assert_true(x[k] == -sorted[medians[i].n / 2]);
            }
    }
}

static void behind_the_slot_nothing_is_heard_before_it_is_known(void **state)
{
    struct rig *r = *state;

    for (int i = 0; i < 3; i++) {
        float complex was[MICS][N];
        hear(r, 0);
        memcpy(was, r->x, sizeof was);
        take(r, 0, true);
        mute(r);
        assert_true(power(r, BEHIND, N) == 0.0);
        for (int m = 0; m < MICS; m++)
            assert_memory_equal(was[m], r->x[m], BEHIND * sizeof **was);
    }
    hear(r, 0);
    take(r, 0, true);
    mute(r);
    assert_true(power(r, BEHIND, N) > 0.5 * noise);
    assert_true(power(r, 0, BEHIND) < 2.0 * noise);
}

/* After three rounds on the move it is known, whether or not the vehicle goes on. */
static void what_is_known_is_heard_while_the_vehicle_stands(void **state)
{
    struct rig *r = *state;

    learn(r, 0, 2);
    for (int rounds = 2; rounds <= 3; rounds++) {
        hear(r, 0);
        take(r, 0, false);
        mute(r);
        assert_true((power(r, BEHIND, N) == 0.0) == (rounds == 2));
        assert_true(power(r, BEHIND, N) < 4.0 * noise);
        learn(r, 0, 1);
    }
    hear(r, 1); /* nothing is known of another speaker's */
    take(r, 1, true);
    mute(r);
    assert_true(power(r, BEHIND, N) == 0.0);
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
    for (size_t speaker = 0; speaker < SPEAKERS; speaker++) {
        hear(r, speaker);
        take(r, speaker, false);
        assert_true(power(r, BEHIND, N) < 1.6 * noise);
    }
}

/* Before the slot's end it is left, and at other microphones. */
static void what_is_loud_is_muted_by_a_pulse_to_both_sides(void **state)
{
    static const int loud[][2] = {
        {BEHIND, BEHIND}, {BEHIND + 2, BEHIND + 2}, {170, 170},         {170, 174},
        {170, 177},       {N - 1, N - 1},           {BEHIND - 1, N - 5}};
    struct rig *r = *state;

    learn(r, 0, 9);
    for (size_t i = 0; i < sizeof loud / sizeof *loud; i++) {
        hear(r, 0);
        r->x[1][loud[i][0]] += 1.0f;
        r->x[1][loud[i][1]] += 1.0f;
        take(r, 0, false);
        mute(r);
        for (int m = 0; m < MICS; m++)
            for (int k = 0; k < N; k++) {
                bool muted = false;
                for (int j = 0; j < 2; j++)
                    muted |= loud[i][j] >= BEHIND && abs(k - loud[i][j]) <= SPREAD;
                muted &= m == 1 && k >= BEHIND;
                assert_true((r->x[m][k] == 0.0f) == muted);
            }
    }
}

/* 16 times the power in the later half of what comes before, of the third of four
 * microphones: 1, 2, 3 and 4 times 1e-2. */
static void twelve_db_over_what_comes_before_is_loud(void **state)
{
    static const float times[MICS] = {2.0f, 4.0f, 1.0f, 3.0f};
    struct rig *r = *state;

    for (int i = 0; i < 3; i++) {
        memset(r->x, 0, sizeof r->x);
        take(r, 0, true);
    }
    for (int m = 0; m < MICS; m++)
        for (int k = 0; k < N; k++)
            r->x[m][k] = k < BEHIND / 2 ? 10.0f : I * 0.1f * sqrtf(times[m]);
    r->x[0][160] = 0.1f * sqrtf(0.99f * 16.0f * 3.0f);
    r->x[0][180] = 0.1f * sqrtf(1.01f * 16.0f * 3.0f);
    take(r, 0, false);
    mute(r);
    for (int m = 0; m < MICS; m++)
        for (int k = 0; k < N; k++)
            assert_true((r->x[m][k] == 0.0f) == (m == 0 && abs(k - 180) <= SPREAD));
}

static void nothing_of_traces_that_end_with_the_slot_is_muted(void **state)
{
    struct rig *r = *state;
    float complex was[MICS][N];

    own_sound_destroy(r->own);
    assert_int_equal(own_sound_create(&r->own, SPEAKERS, MICS, N, N), 0);
    hear(r, 0);
    memcpy(was, r->x, sizeof was);
    take(r, 0, true);
    mute(r);
    assert_memory_equal(was, r->x, sizeof was);
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
        mute(r);
        for (int m = 0; m < MICS; m++)
            for (int k = 180 - SPREAD; k < N; k++)
                assert_true(r->x[m][k] == 0.0f);
        assert_true(power(r, BEHIND, 180 - SPREAD) > 0.0);
    }
    hear(r, 0);
    take(r, 0, true);
    assert_true(power(r, BEHIND, N) < 10.0 * noise);
}

static void learn_without(struct rig *r, int mic, int rounds)
{
    r->masked[mic] = true;
    for (int i = 0; i < rounds; i++) {
        hear(r, 0);
        memset(r->x[mic], 0, sizeof r->x[mic]);
        take(r, 0, true);
        for (int k = 0; k < N; k++)
            assert_true(r->x[mic][k] == 0.0f);
    }
    r->masked[mic] = false;
}

static void silence_of_a_masked_microphone_is_neither_its_sound_nor_learnt(void **state)
{
    struct rig *r = *state;

    learn(r, 0, 9);
    learn_without(r, 1, 9);
    hear(r, 0);
    take(r, 0, true);
    assert_true(power(r, 0, N) < 2.0 * noise);
}

static void
a_microphone_that_was_masked_is_known_after_three_rounds_of_its_own(void **state)
{
    struct rig *r = *state;

    learn_without(r, 2, 5);
    for (int i = 0; i < 4; i++) {
        hear(r, 0);
        take(r, 0, true);
        mute(r);
        assert_true(cabsf(r->x[1][BEHIND + SPREAD]) > 0.0f);
        assert_int_equal(cabsf(r->x[2][BEHIND + SPREAD]) > 0.0f, i == 3);
    }
    assert_true(power(r, 0, N) < 4.0 * noise);
}

static void it_asks_for_traces_that_reach_it(void **state)
{
    struct own_sound *e;

    (void)state;
    assert_int_equal(own_sound_create(&e, SPEAKERS, MICS, N, N + 1), -EINVAL);
    assert_int_equal(own_sound_create(&e, 0, MICS, N, BEHIND), -EINVAL);
    assert_int_equal(own_sound_create(&e, SPEAKERS, 0, N, BEHIND), -EINVAL);
    assert_int_equal(own_sound_create(&e, SPEAKERS, MICS, 0, 0), -EINVAL);
    own_sound_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(what_stays_goes_and_an_echo_stays, setup,
                                        teardown),
        cmocka_unit_test_setup_teardown(it_is_the_median_of_the_newest_nine_rounds, setup,
                                        teardown),
        cmocka_unit_test_setup_teardown(
            behind_the_slot_nothing_is_heard_before_it_is_known, setup, teardown),
        cmocka_unit_test_setup_teardown(what_is_known_is_heard_while_the_vehicle_stands,
                                        setup, teardown),
        cmocka_unit_test_setup_teardown(a_vehicle_that_stands_teaches_nothing, setup,
                                        teardown),
        cmocka_unit_test_setup_teardown(each_speaker_has_its_own, setup, teardown),
        cmocka_unit_test_setup_teardown(what_is_loud_is_muted_by_a_pulse_to_both_sides,
                                        setup, teardown),
        cmocka_unit_test_setup_teardown(twelve_db_over_what_comes_before_is_loud, setup,
                                        teardown),
        cmocka_unit_test_setup_teardown(nothing_of_traces_that_end_with_the_slot_is_muted,
                                        setup, teardown),
        cmocka_unit_test_setup_teardown(what_passes_by_close_is_muted_and_not_learnt,
                                        setup, teardown),
        cmocka_unit_test_setup_teardown(
            silence_of_a_masked_microphone_is_neither_its_sound_nor_learnt, setup,
            teardown),
        cmocka_unit_test_setup_teardown(
            a_microphone_that_was_masked_is_known_after_three_rounds_of_its_own, setup,
            teardown),
        cmocka_unit_test(it_asks_for_traces_that_reach_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
