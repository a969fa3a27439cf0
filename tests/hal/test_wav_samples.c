/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "hal/recording/riff.h"

enum { CHANNELS = 2, SLOTS = 2, SLOT = 10, FRAMES = 24 };

struct rig {
    struct wav_samples w;
    float samples[CHANNELS][FRAMES];
    uint32_t clipped[SLOTS][CHANNELS], not_finite[SLOTS][CHANNELS];
};

/* Ramps that repeat nothing and stay below 0.4. */
static struct rig make(bool is_float)
{
    struct rig r = {.w = {.n_channels = CHANNELS,
                          .n_frames = FRAMES,
                          .n_slots = SLOTS,
                          .slot_samples = SLOT,
                          .is_float = is_float}};
    for (int c = 0; c < CHANNELS; c++)
        for (int i = 0; i < FRAMES; i++)
            r.samples[c][i] = 0.01f * (float)(i + 1);
    return r;
}

static void count(struct rig *r)
{
    wav_samples_count(&r->w, r->samples[0], FRAMES, r->clipped[0], r->not_finite[0]);
}

static void hold(struct rig *r, int channel, int from, int n, float value)
{
    for (int i = from; i < from + n; i++)
        r->samples[channel][i] = value;
}

static void four_equal_samples_near_the_top_are_clipped_in_float(void **state)
{
    (void)state;
    struct rig r = make(true);
    hold(&r, 0, 2, 3, 0.9f);
    hold(&r, 1, 2, 4, 0.9f);
    count(&r);
    assert_int_equal(r.clipped[0][0], 0);
    assert_int_equal(r.clipped[0][1], 4);
}

static void low_or_wandering_floats_are_not_clipped(void **state)
{
    (void)state;
    struct rig r = make(true);
    r.samples[0][20] = 1.0f;
    hold(&r, 0, 2, 6, 0.49f); /* below half of the maximum */
    for (int i = 0; i < 6; i++)
        r.samples[1][2 + i] = 0.9f + 0.001f * (float)i;
    count(&r);
    for (int k = 0; k < SLOTS * CHANNELS; k++)
        assert_int_equal(r.clipped[k / CHANNELS][k % CHANNELS], 0);
}

static void three_samples_at_full_scale_are_clipped_in_pcm(void **state)
{
    (void)state;
    struct rig r = make(false);
    hold(&r, 0, 3, 2, 1.0f);
    hold(&r, 1, 3, 2, 1.0f);
    r.samples[1][5] = -1.0f; /* either end, and not equal */
    count(&r);
    assert_int_equal(r.clipped[0][0], 0);
    assert_int_equal(r.clipped[0][1], 3);
}

static void what_follows_the_last_slot_counts_into_it(void **state)
{
    (void)state;
    struct rig r = make(false);
    hold(&r, 0, 12, 3, 1.0f);
    hold(&r, 0, 21, 3, 1.0f);
    r.samples[1][23] = NAN;
    r.samples[1][4] = INFINITY;
    count(&r);
    assert_int_equal(r.clipped[0][0], 0);
    assert_int_equal(r.clipped[1][0], 6);
    assert_int_equal(r.not_finite[0][1], 1);
    assert_int_equal(r.not_finite[1][1], 1);
    assert_true(r.samples[1][23] == 0.0f && r.samples[1][4] == 0.0f);
}

static void frames_become_channels_and_the_rest_zeros(void **state)
{
    (void)state;
    struct rig r = make(false);
    float frames[3][CHANNELS] = {{1, 2}, {3, 4}, {5, 6}};
    wav_samples_separate(&r.w, frames[0], 7, 3, r.samples[0]);
    wav_samples_finish(&r.w, 10, r.samples[0]);
    for (int i = 0; i < 3; i++)
        for (int c = 0; c < CHANNELS; c++)
            assert_true(r.samples[c][7 + i] == frames[i][c]);
    assert_true(r.samples[0][6] == 0.07f && r.samples[1][6] == 0.07f);
    for (int i = 10; i < FRAMES; i++)
        assert_true(r.samples[0][i] == 0.0f && r.samples[1][i] == 0.0f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(four_equal_samples_near_the_top_are_clipped_in_float),
        cmocka_unit_test(low_or_wandering_floats_are_not_clipped),
        cmocka_unit_test(three_samples_at_full_scale_are_clipped_in_pcm),
        cmocka_unit_test(what_follows_the_last_slot_counts_into_it),
        cmocka_unit_test(frames_become_channels_and_the_rest_zeros),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
