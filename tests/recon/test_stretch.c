/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <complex.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "recon/coherent/stretch.h"
#include "tests/recon/reference.h"
#include "tests/worse.h"

#define POINT 32 /* 32 powers, or 16 re and 16 im */
#define N     300

static const double band_hz[2] = {2000.0, 20000.0}, c_m_s = 343.0;
static const double halves_m[3] = {0.0, 0.12, 0.4};

static struct stretch_config config(bool power, double t0_s)
{
    return (struct stretch_config){
        .sound_speed_m_s = c_m_s,
        .power = power,
        .band_hz = {band_hz[0], band_hz[1]},
        .in = {t0_s, 36000.0, 11000.0, N},
        .out = {t0_s, 36000.0, 11000.0, N},
        .n_offsets = 3,
        .half_offset_m = halves_m,
    };
}

/* There and back: in [N][POINT] of an offset to out [N][POINT]. */
static void pass(const struct stretch_config *cfg, size_t offset, const float *in,
                 float *out)
{
    struct stretch *s;
    assert_int_equal(stretch_create(&s, cfg), 0);
    float *rows = malloc(stretch_rows(s) * POINT * sizeof *rows);
    assert_non_null(rows);
    stretch_in(s, offset, in, rows);
    stretch_out(s, rows, out);
    free(rows);
    stretch_destroy(s);
}

/* Lane q holds an echo of delay delays_s[q]. */
static void echoes(const struct stretch_config *cfg, const double *delays_s, float *in)
{
    for (size_t n = 0; n < N; n++) {
        double t = cfg->in.t0_s + (double)n / cfg->in.rate_hz;
        for (size_t l = 0; l < 16; l++) {
            double a = reference_pulse(band_hz, t - delays_s[l]);
            double complex z =
                reference_echo(band_hz, cfg->in.carrier_hz, delays_s[l], t);
            in[n * POINT + l] = (float)(cfg->power ? a * a : creal(z));
            in[n * POINT + 16 + l] = (float)(cfg->power ? 0.5 * a * a : cimag(z));
        }
    }
}

/* Delays spread over the input, 20 samples clear of its ends. */
static void spread(const struct stretch_config *cfg, double *delays_s)
{
    for (size_t l = 0; l < 16; l++)
        delays_s[l] = cfg->in.t0_s + (22.0 + 15.37 * (double)l) / cfg->in.rate_hz;
}

/* What moveout of offset h should leave at t0 of an echo of delay d. */
static double complex expected_at(const struct stretch_config *cfg, double half_m,
                                  double delay_s, double t0)
{
    double t = hypot(t0, 2.0 * half_m / c_m_s), a = reference_pulse(band_hz, t - delay_s);
    if (cfg->power)
        return a * a * c_m_s * t * c_m_s * t;
    return 0.5 * c_m_s * t0 * reference_echo(band_hz, 11000.0, delay_s, t) *
           cexp(2.0 * M_PI * I * 11000.0 * (t - t0));
}

static void expect_moveout(const struct stretch_config *cfg, size_t offset,
                           double tolerance)
{
    static float in[N * POINT], out[N * POINT];
    double delays_s[16], worst = 0.0, loudest = 0.0;
    spread(cfg, delays_s);
    echoes(cfg, delays_s, in);
    pass(cfg, offset, in, out);
    for (size_t l = 0; l < 16; l++) {
        for (size_t n = 10; n + 10 < N; n++) {
            double t0 = cfg->out.t0_s + (double)n / cfg->out.rate_hz;
            double t = hypot(t0, 2.0 * halves_m[offset] / c_m_s);
            double end_s = cfg->in.t0_s + (N - 16) / cfg->in.rate_hz;
            if (t / t0 > 1.65 || t > end_s)
                continue; /* muted there */
            double complex e = expected_at(cfg, halves_m[offset], delays_s[l], t0);
            double re = out[n * POINT + l], im = out[n * POINT + 16 + l];
            double error = cfg->power ? fabs(re - creal(e)) : cabs(re + I * im - e);
            double scale = cabs(expected_at(cfg, 0.0, delays_s[l], delays_s[l]));
            worst = worse(worst, error / scale);
            loudest = fmax(loudest, cabs(e) / scale);
            if (cfg->power)
                assert_near(im, 0.5 * re, 1e-5 * scale);
        }
    }
    assert_below(worst, tolerance);
    assert_below(0.5, loudest);
}

static void there_and_back_returns_the_echo(void **state)
{
    (void)state;
    for (int power = 0; power < 2; power++) {
        struct stretch_config cfg = config(power, 0.008);
        expect_moveout(&cfg, 0, 0.01);
    }
}

static void moveout_puts_echoes_where_co_located_pairs_hear_them(void **state)
{
    (void)state;
    for (int power = 0; power < 2; power++) {
        struct stretch_config cfg = config(power, 0.0075);
        expect_moveout(&cfg, 1, 0.01);
        expect_moveout(&cfg, 2, 0.01);
    }
}

/* Where t = 0 has no logarithm and the first samples lie a factor of 300 from the last:
 * the hard gate. */
static void a_gate_that_begins_with_the_emission_keeps_its_echoes(void **state)
{
    (void)state;
    for (int power = 0; power < 2; power++) {
        double tolerance = power ? 0.01 : 0.03;
        struct stretch_config cfg = config(power, 0.0);
        expect_moveout(&cfg, 0, tolerance);
        cfg = config(power, 1.0 / 36000.0);
        expect_moveout(&cfg, 0, tolerance);
    }
}

static void times_that_no_offset_can_have_are_silent(void **state)
{
    (void)state;
    static float in[N * POINT], out[N * POINT];
    struct stretch_config cfg = config(true, 0.0);
    for (size_t q = 0; q < N * POINT; q++)
        in[q] = 1.0f;
    cfg.mute_s = 0.003;
    pass(&cfg, 2, in, out);
    for (size_t n = 0; n < N; n++) {
        double t0 = (double)n / 36000.0, t = hypot(t0, 0.8 / c_m_s);
        float y = out[n * POINT];
        assert_true(isfinite(y));
        if (t / t0 > 2.2 || t0 < 0.0028 || t > (N + 4) / 36000.0)
            assert_near(y, 0.0, 1e-3);
        if (t / t0 < 1.6 && t0 > 0.0035 && t < (N - 20) / 36000.0)
            assert_near(y / (c_m_s * t * c_m_s * t), 1.0, 0.01);
    }
}

/* What lies beside the taps of a sample does not reach it: no NaN spreads. */
static void samples_far_from_a_bad_one_are_not_touched(void **state)
{
    (void)state;
    static float in[N * POINT], out[N * POINT];
    struct stretch_config cfg = config(true, 0.008);
    memset(in, 0, sizeof in);
    in[150 * POINT + 3] = NAN;
    pass(&cfg, 0, in, out);
    for (size_t n = 0; n < N; n++)
        for (size_t l = 0; l < POINT; l++)
            if (l != 3 || n < 138 || n > 162)
                assert_near(out[n * POINT + l], 0.0, 0.0);
}

static void frequencies_are_those_of_the_transform(void **state)
{
    (void)state;
    struct stretch *s;
    struct stretch_config cfg = config(true, 0.008);
    assert_int_equal(stretch_create(&s, &cfg), 0);
    size_t n = stretch_rows(s);
    double dw = stretch_frequency(s, 1);
    assert_near(stretch_frequency(s, 0), 0.0, 0.0);
    assert_true(isinf(stretch_frequency(s, n / 2)));
    for (size_t q = 1; q < n / 2; q++) {
        assert_near(stretch_frequency(s, q), dw * (double)q, 1e-9 * dw * (double)n);
        assert_near(stretch_frequency(s, n - q), -stretch_frequency(s, q), 1e-9);
    }
    stretch_destroy(s);
}

static void senseless_configurations_are_refused(void **state)
{
    (void)state;
    struct stretch *s = NULL;
    struct stretch_config cfg = config(true, 0.008);
    cfg.in.n_samples = 7;
    assert_int_equal(stretch_create(&s, &cfg), -EINVAL);
    cfg = config(true, 0.008);
    cfg.in.t0_s = -1.0;
    assert_int_equal(stretch_create(&s, &cfg), -EINVAL);
    cfg = config(true, 0.008);
    cfg.band_hz[1] = cfg.band_hz[0];
    assert_int_equal(stretch_create(&s, &cfg), -EINVAL);
    assert_null(s);
    stretch_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(there_and_back_returns_the_echo),
        cmocka_unit_test(moveout_puts_echoes_where_co_located_pairs_hear_them),
        cmocka_unit_test(a_gate_that_begins_with_the_emission_keeps_its_echoes),
        cmocka_unit_test(times_that_no_offset_can_have_are_silent),
        cmocka_unit_test(samples_far_from_a_bad_one_are_not_touched),
        cmocka_unit_test(frequencies_are_those_of_the_transform),
        cmocka_unit_test(senseless_configurations_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
