/* SPDX-License-Identifier: MIT */
#include <complex.h>
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "recon/walls/wall_crosstalk.h"

#define RATE_HZ  48000.0
#define SLOT_S   0.024
#define DIRECT_S 0.003
#define N        2304 /* of a ping: two slots */

static const struct chirp up = {2000, 20000, 0.02, false},
                          down = {20000, 2000, 0.02, false};

struct pair {
    struct pulse_compress *filters[2];
    struct trace_format format;
    struct wall_crosstalk *crosstalk;
    float ping[N];
    float complex *own, *other, *clean; /* [format.n_samples] */
};

static void open_pair(struct pair *p)
{
    struct pulse_compress_config cfg = {.sample_rate_hz = RATE_HZ,
                                        .n_samples = N,
                                        .chirp = up,
                                        .window = WINDOW_HANN,
                                        .gate_s = {0.0, SLOT_S + DIRECT_S + 1e-4},
                                        .oversampling = 2.0,
                                        .n_channels = 1};
    assert_int_equal(pulse_compress_create(&p->filters[0], &cfg), 0);
    cfg.chirp = down;
    assert_int_equal(pulse_compress_create(&p->filters[1], &cfg), 0);
    pulse_compress_format(p->filters[0], &p->format);
    const struct wall_crosstalk_config c = {.filters = {p->filters[0], p->filters[1]},
                                            .chirps = {up, down},
                                            .sample_rate_hz = RATE_HZ,
                                            .n_samples = N,
                                            .direct_s = DIRECT_S,
                                            .slot_s = SLOT_S};
    assert_int_equal(wall_crosstalk_create(&p->crosstalk, &c), 0);
    p->own = calloc(p->format.n_samples, sizeof *p->own);
    p->other = calloc(p->format.n_samples, sizeof *p->other);
    p->clean = calloc(p->format.n_samples, sizeof *p->clean);
    assert_true(p->own && p->other && p->clean);
}

static void close_pair(struct pair *p)
{
    wall_crosstalk_destroy(p->crosstalk);
    pulse_compress_destroy(p->filters[0]);
    pulse_compress_destroy(p->filters[1]);
    free(p->own);
    free(p->other);
    free(p->clean);
}

/* A linear chirp from f0 to f1 that arrives at a delay. */
static void add(float *ping, double f0, double f1, double delay_s, double gain)
{
    for (int i = 0; i < N; i++) {
        double t = i / RATE_HZ - delay_s;
        if (t >= 0.0 && t < 0.02)
            ping[i] +=
                (float)(gain * cos(2 * M_PI * (f0 * t + (f1 - f0) / 0.04 * t * t)));
    }
}

static double rms_db(const struct pair *p, const float complex *a, const float complex *b)
{
    size_t from = (size_t)(0.004 * p->format.rate_hz),
           to = (size_t)(0.022 * p->format.rate_hz);
    double sum = 0.0;
    for (size_t i = from; i < to; i++)
        sum += pow(cabsf(a[i] - b[i]), 2);
    return 10.0 * log10(sum / (double)(to - from));
}

/* Own direct sound and echo, and the other's direct sound of this slot and of the next.
 */
static void what_the_other_chirp_leaves_goes_and_an_echo_stays(void **state)
{
    (void)state;
    static struct pair p;
    open_pair(&p);
    for (int k = 0; k < 2; k++) {
        double f0 = k ? 20000 : 2000, f1 = k ? 2000 : 20000;
        for (int i = 0; i < N; i++)
            p.ping[i] = 0.0f;
        add(p.ping, f0, f1, 0.0011, 0.7);
        add(p.ping, f0, f1, 0.0128, 0.1);
        pulse_compress_execute(p.filters[k], p.ping, N, p.clean);
        add(p.ping, f1, f0, 0.0008, 1.0);
        add(p.ping, f1, f0, SLOT_S + 0.0009, 1.0);
        pulse_compress_execute(p.filters[k], p.ping, N, p.own);
        pulse_compress_execute(p.filters[1 - k], p.ping, N, p.other);
        assert_true(rms_db(&p, p.own, p.clean) > -28.0); /* -25.6 dB, 20 ms x 18 kHz */
        wall_crosstalk_remove(p.crosstalk, k, p.own, p.other);
        assert_true(rms_db(&p, p.own, p.clean) < -48.0);
        size_t echo = (size_t)lround(0.0128 * p.format.rate_hz);
        double left = cabsf(p.own[echo]) / cabsf(p.clean[echo]);
        assert_true(left > 0.8 && left < 1.05); /* windows of 3.3 of 20 ms */
        assert_true(cabsf(p.own[echo]) > cabsf(p.own[echo - 1]) &&
                    cabsf(p.own[echo]) > cabsf(p.own[echo + 2]));
    }
    close_pair(&p);
}

static void silence_stays_silence(void **state)
{
    (void)state;
    static struct pair p;
    open_pair(&p);
    wall_crosstalk_remove(p.crosstalk, 0, p.own, p.other);
    for (size_t i = 0; i < p.format.n_samples; i++)
        assert_true(p.own[i] == 0.0f);
    close_pair(&p);
}

static void traces_that_end_within_direct_sound_are_refused(void **state)
{
    (void)state;
    static struct pair p;
    struct wall_crosstalk *x = NULL;
    open_pair(&p);
    const struct wall_crosstalk_config c = {.filters = {p.filters[0], p.filters[1]},
                                            .chirps = {up, down},
                                            .sample_rate_hz = RATE_HZ,
                                            .n_samples = N,
                                            .direct_s = 2.0 * DIRECT_S,
                                            .slot_s = SLOT_S};
    assert_int_equal(wall_crosstalk_create(&x, &c), -EINVAL);
    assert_null(x);
    close_pair(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_the_other_chirp_leaves_goes_and_an_echo_stays),
        cmocka_unit_test(silence_stays_silence),
        cmocka_unit_test(traces_that_end_within_direct_sound_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
