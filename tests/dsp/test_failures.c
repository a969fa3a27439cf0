/* SPDX-License-Identifier: MIT */
/* What allocates, when memory gives out at each place where it may: -ENOMEM, nothing left
 * behind, nothing half made. */
#include <complex.h>
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "dsp/background.h"
#include "dsp/band_transform.h"
#include "dsp/cfar.h"
#include "dsp/channels.h"
#include "dsp/cover.h"
#include "dsp/deramp.h"
#include "dsp/drift.h"
#include "dsp/interpolator.h"
#include "dsp/lane_fft.h"
#include "dsp/noise_floor.h"
#include "dsp/pool.h"
#include "dsp/pulse_compress.h"
#include "dsp/stationary.h"
#include "dsp/time_zero.h"
#include "dsp/timescale.h"
#include "dsp/trace_mean.h"
#include "tests/failing.h"

#define FORMAT                                                                           \
    {                                                                                    \
        .t0_s = 0.0035, .rate_hz = 36000.0, .carrier_hz = 11000.0, .n_samples = 800      \
    }

static const struct trace_format format = FORMAT;

#define SAMPLE_RATE_HZ 48000.0
#define CHIRP                                                                            \
    {                                                                                    \
        2000.0, 20000.0, 0.0625, false                                                   \
    }

/* Makes one and takes it away again; *out stays NULL if there is none. */
#define CREATES(name, ...)                                                               \
    static int name##_work(void *context, struct error *why)                             \
    {                                                                                    \
        struct name *made = NULL;                                                        \
        (void)context;                                                                   \
        (void)why;                                                                       \
        int err = name##_create(&made, __VA_ARGS__);                                     \
        if (err)                                                                         \
            assert_null(made);                                                           \
        name##_destroy(made);                                                            \
        return err;                                                                      \
    }

static const struct pulse_compress_config compressor = {.sample_rate_hz = SAMPLE_RATE_HZ,
                                                        .n_samples = 4200,
                                                        .chirp = CHIRP,
                                                        .window = WINDOW_HANN,
                                                        .gate_s = {0.006, 0.025},
                                                        .oversampling = 2.0,
                                                        .n_channels = 1};
static const struct pulse_compress_config many = {.sample_rate_hz = SAMPLE_RATE_HZ,
                                                  .n_samples = 4200,
                                                  .chirp = CHIRP,
                                                  .window = WINDOW_HANN,
                                                  .gate_s = {0.006, 0.025},
                                                  .oversampling = 2.0,
                                                  .n_channels = 16};
static const struct deramp_config deramper = {.sample_rate_hz = SAMPLE_RATE_HZ,
                                              .n_samples = 4200,
                                              .chirp = CHIRP,
                                              .window = WINDOW_HANN,
                                              .gate_s = {0.006, 0.025},
                                              .n_channels = 1,
                                              .rate_hz = 144000.0};
static const struct drift_config drifting = {
    .format = FORMAT, .band_hz = {2000.0, 20000.0}, .n_channels = 4};
static const struct cfar_config cells = {.kind = CFAR_ORDERED,
                                         .false_alarm_rate = 1e-3,
                                         .rank = 0.75,
                                         .n = {20, 1, 20},
                                         .pitch = {1, 1, 1},
                                         .guard = {1, 0, 1},
                                         .training = {3, 0, 4}};

static const struct noise_floor_config floor_of = {
    .n_speakers = 4, .n_channels = 2, .n_samples = 800, .from = 100, .until = 700};
static const double distances_m[4] = {0.1, 0.2, 0.2, 0.1};

static struct interpolator *interpolator; /* of those that keep one */

CREATES(background, 4, 2, 100)
CREATES(cfar, &cells)
CREATES(cover, 2, 2, distances_m, 35.0)
CREATES(deramp, &deramper)
CREATES(drift, &drifting)
CREATES(drift_search, &format, 20000.0, 0.005, interpolator)
CREATES(interpolator, 0.5)
CREATES(lane_fft, 48)
CREATES(noise_floor, &floor_of)
CREATES(pool, 3)
CREATES(pulse_compress, context)
CREATES(stationary, 2048, true)
CREATES(timescale, &format, interpolator)
CREATES(trace_mean, 4, 2, 100)

static void expect(const char *name, int (*run)(void *, struct error *), void *context,
                   size_t calls)
{
    const struct failing_work work = {
        .name = name, .run = run, .context = context, .wordless = true};

    assert_true(failing_each(&work) >= calls);
}

static void what_is_made_is_made_whole_or_not_at_all(void **state)
{
    (void)state;
    assert_int_equal(interpolator_create(&interpolator, 0.5), 0);
    expect("background", background_work, NULL, 3);
    expect("cfar", cfar_work, NULL, 5);
    expect("cover", cover_work, NULL, 5);
    expect("deramp", deramp_work, NULL, 12);
    expect("drift", drift_work, NULL, 3);
    expect("drift_search", drift_search_work, NULL, 4);
    expect("interpolator", interpolator_work, NULL, 1);
    expect("lane_fft", lane_fft_work, NULL, 3);
    expect("noise_floor", noise_floor_work, NULL, 6);
    expect("pulse_compress", pulse_compress_work, (void *)&compressor, 8);
    expect("pulse_compress of many", pulse_compress_work, (void *)&many, 8);
    expect("stationary", stationary_work, NULL, 5);
    expect("timescale", timescale_work, NULL, 4);
    expect("trace_mean", trace_mean_work, NULL, 2);
    interpolator_destroy(interpolator);
}

/* Threads may be wanting too, which is another error. */
static int threads_work(void *context, struct error *why)
{
    int err = pool_work(context, why);

    return err == -EAGAIN ? -ENOMEM : err;
}

static void a_pool_without_its_threads_is_none(void **state)
{
    (void)state;
    expect("pool", threads_work, NULL, 4);
}

/* -- what fits measurements
 * --------------------------------------------------------------
 */

enum { N = 4 };

static int time_zero_work(void *context, struct error *why)
{
    struct time_zero_pair pairs[N];
    struct time_zero fit;

    (void)context;
    (void)why;
    for (int i = 0; i < N; i++)
        pairs[i] = (struct time_zero_pair){0.5 + 0.2 * i, (0.5 + 0.2 * i) / 343.0};
    int err = time_zero_fit(&fit, pairs, N, 343.0);
    return err ? err : time_zero_fit_speed(&fit, pairs, N, 340.0);
}

static int levels_work(void *context, struct error *why)
{
    const double level_db[N * N] = {1.0, -1.0, 2.0};
    double speaker_db[N], microphone_db[N];
    struct levels out;

    (void)context;
    (void)why;
    return levels_fit(&out, N, N, level_db, speaker_db, microphone_db);
}

static int polarity_work(void *context, struct error *why)
{
    const double complex peaks[N * N] = {1.0, -1.0, 2.0 * I};
    bool speakers[N], microphones[N];

    (void)context;
    (void)why;
    return polarity_find(N, N, peaks, speakers, microphones);
}

static int order_work(void *context, struct error *why)
{
    double heard[N * N], expected[N * N];
    struct channel_place out[N];

    (void)context;
    (void)why;
    for (int i = 0; i < N * N; i++)
        heard[i] = expected[i] = 1e-3 * i;
    return channel_order_find(N, N, heard, expected, 1e-5, out);
}

static void a_calibration_without_memory_is_none(void **state)
{
    (void)state;
    expect("time_zero", time_zero_work, NULL, 2);
    expect("levels", levels_work, NULL, 3);
    expect("polarity", polarity_work, NULL, 2);
    expect("channel_order", order_work, NULL, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_made_is_made_whole_or_not_at_all),
        cmocka_unit_test(a_pool_without_its_threads_is_none),
        cmocka_unit_test(a_calibration_without_memory_is_none),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
