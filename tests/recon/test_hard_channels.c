/* SPDX-License-Identifier: MIT */
/* Channels that are silent, hold what is no number, or clip, for every method. */
#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "dsp/pulse_compress.h"
#include "tests/dsp/echo.h"
#include "tests/recon/hard.h"

#define BROKEN 3 /* the microphone */

static struct hard hard;

static int record(void **state)
{
    (void)state;
    hard_create(&hard, 343.0, 10, 8, 8);
    return 0;
}

static int forget(void **state)
{
    (void)state;
    hard_clear(&hard);
    return 0;
}

static size_t n_samples(void)
{
    return hard.rig.format.n_samples;
}

static void expect_dark(const char *method)
{
    float *image = hard_image(&hard, method, NULL);
    for (size_t v = 0; v < grid_size(&hard.rig.grid); v++)
        if (image[v] != 0.0f)
            fail_msg("%s: voxel %zu is %g", method, v, image[v]);
    free(image);
}

static void fill_all(float value)
{
    for (size_t n = 0; n < hard_pings(&hard) * 8 * n_samples(); n++)
        hard.traces[n] = value;
}

static void silence_is_dark(void **state)
{
    (void)state;
    fill_all(0.0f);
    hard_every_method(expect_dark);
}

static void what_is_all_no_number_is_dark(void **state)
{
    (void)state;
    fill_all(NAN);
    hard_every_method(expect_dark);
    fill_all(-INFINITY);
    hard_every_method(expect_dark);
}

static void expect_point(const char *method)
{
    float *image = hard_image(&hard, method, NULL);
    hard_expect_point(&hard, method, image);
    free(image);
}

static void a_silent_channel_does_not_move_the_point(void **state)
{
    (void)state;
    for (size_t p = 0; p < hard_pings(&hard); p++)
        memset(hard_trace(&hard, p, BROKEN), 0, n_samples() * sizeof(float complex));
    hard_every_method(expect_point);
}

/* To the last bit, and the point is where it is. */
static void expect_as_masked(const char *method)
{
    bool masked[8] = {false};
    masked[BROKEN] = true;
    float *without = hard_image(&hard, method, masked);
    float *image = hard_image(&hard, method, NULL);
    if (memcmp(image, without, grid_size(&hard.rig.grid) * sizeof *image) != 0)
        fail_msg("%s: not as without the channel", method);
    hard_expect_point(&hard, method, image);
    free(image);
    free(without);
}

/* In one sample of each ping, at the depth of the point. */
static void one_sample_that_is_no_number_masks_its_channel(void **state)
{
    (void)state;
    static const float bad[4] = {NAN, INFINITY, -INFINITY, 2e13f};
    for (int q = 0; q < 4; q++) {
        for (size_t p = 0; p < hard_pings(&hard); p++) {
            float *x = (float *)hard_trace(&hard, p, BROKEN);
            x[2 * 84 + p % 2] = bad[q]; /* 1.1 m; re or im */
        }
        hard_every_method(expect_as_masked);
    }
}

/* -- clipping ---------------------------------------------------------------------------
 */

static const struct sweep sweep = {48000.0, 2000.0, 20000.0, 0.03, -0.5 * M_PI};

static struct pulse_compress *compressor(void)
{
    struct pulse_compress *pc;
    double c = hard.rig.geometry.sound_speed_m_s;
    const struct pulse_compress_config cfg = {
        .sample_rate_hz = sweep.rate_hz,
        .n_samples = 2048,
        .chirp = {sweep.f0_hz, sweep.f1_hz, sweep.duration_s, true},
        .window = WINDOW_HANN,
        .gate_s = {2.0 * 0.7 / c, 2.0 * 1.75 / c},
        .oversampling = 2.0,
        .n_channels = 1,
    };
    assert_int_equal(pulse_compress_create(&pc, &cfg), 0);
    return pc;
}

/* The recording as a converter heard it that stops at `full` of the echo's amplitude;
 * microphones other than `which` (all: 8) have room enough. */
static void record_clipped(double full, size_t which)
{
    struct pulse_compress *pc = compressor();
    const struct geometry *g = &hard.rig.geometry;
    pulse_compress_format(pc, &hard.rig.format);
    free(hard.traces);
    hard.traces = calloc(hard_pings(&hard) * 8 * n_samples(), sizeof *hard.traces);
    assert_non_null(hard.traces);
    for (size_t q = 0; q < hard_pings(&hard) * 8; q++) {
        float raw[2048] = {0.0f};
        double s[3], m[3];
        geometry_speaker(g, q / 64, q / 8 % 8, s);
        geometry_microphone(g, q / 64, 0, q % 8, m);
        double path_m = reference_distance(s, hard.point.at_m) +
                        reference_distance(m, hard.point.at_m);
        double stop = which == 8 || which == q % 8 ? full : 1.0;
        echo_add(&sweep, raw, 2048, path_m / g->sound_speed_m_s, 1.0);
        for (size_t n = 0; n < 2048; n++)
            raw[n] = (float)fmin(fmax(raw[n], -stop), stop);
        pulse_compress_execute(pc, raw, 2048, hard_trace(&hard, q / 8, q % 8));
    }
    pulse_compress_destroy(pc);
}

/* A clipped chirp is a chirp and its odd overtones, which aliasing sweeps at other rates:
 * compression spreads them out. */
static void clipped_recordings_do_not_move_the_point(void **state)
{
    (void)state;
    record_clipped(0.1, 8);
    hard_every_method(expect_point);
    record_clipped(0.01, BROKEN);
    hard_every_method(expect_point);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(silence_is_dark, record, forget),
        cmocka_unit_test_setup_teardown(what_is_all_no_number_is_dark, record, forget),
        cmocka_unit_test_setup_teardown(a_silent_channel_does_not_move_the_point, record,
                                        forget),
        cmocka_unit_test_setup_teardown(one_sample_that_is_no_number_masks_its_channel,
                                        record, forget),
        cmocka_unit_test_setup_teardown(clipped_recordings_do_not_move_the_point, record,
                                        forget),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
