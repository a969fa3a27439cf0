/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <complex.h>
#include <errno.h>
#include <string.h>

#include "recon/coherent/nmo.h"
#include "tests/recon/reference.h"

#define N_IN  260
#define N_OUT 160

static const double band_hz[2] = {2000.0, 20000.0};
static const double half_offsets_m[4] = {0.0, 0.05, 0.12, 0.2};

static struct nmo_config config(double c)
{
    return (struct nmo_config){
        .sound_speed_m_s = c,
        .in = {.t0_s = 2.0 * 0.55 / c, .rate_hz = 36000.0, 11000.0, N_IN},
        .out = {.t0_s = 2.0 * 0.7 / c, .rate_hz = 21600.0, 11000.0, N_OUT},
        .mute_s = 2.0 * 0.3 / c,
        .band_hz = 18000.0,
        .n_offsets = 4,
        .half_offset_m = half_offsets_m,
    };
}

static void stack_pair(const struct nmo_config *cfg, size_t offset, double depth_m,
                       float complex *out)
{
    const double s[3] = {0.0, half_offsets_m[offset], 0.0};
    const double m[3] = {0.0, -half_offsets_m[offset], 0.0};
    const struct scatterer below = {{0.0, 0.0, depth_m}, 1.0};
    float complex in[N_IN];
    struct nmo *n;
    reference_trace(&cfg->in, band_hz, cfg->sound_speed_m_s, s, m, &below, 1, in);
    assert_int_equal(nmo_create(&n, cfg), 0);
    nmo_stack(n, offset, in, out);
    nmo_destroy(n);
}

/* The moveout of a point below the midpoint, from the continuous echo; the ends of the
 * trace may fade over 8 samples. */
static void every_sample_is_the_echo_at_its_moved_out_time(void **state)
{
    (void)state;
    static const double speeds[3] = {300.0, 343.0, 360.0};
    for (int q = 0; q < 12; q++) {
        double c = speeds[q / 4], h = half_offsets_m[q % 4], z = 1.137;
        struct nmo_config cfg = config(c);
        float complex out[N_OUT] = {0};
        stack_pair(&cfg, (size_t)q % 4, z, out);
        double delay_s = 2.0 * hypot(z, h) / c, gain = 1.0 / (z * z + h * h);
        for (size_t n = 8; n < N_OUT - 8; n++) {
            double t0 = cfg.out.t0_s + (double)n / cfg.out.rate_hz;
            double t = hypot(t0, 2.0 * h / c);
            double complex expected = 0.5 * c * t0 * gain *
                                      reference_echo(band_hz, 11000.0, delay_s, t) *
                                      cexp(2.0 * M_PI * I * 11000.0 * (t - t0));
            assert_below(cabs(out[n] - expected), 2e-3 / z);
        }
    }
}

/* At the echo itself the phase is that of sound that went straight down and back. */
static void a_point_below_the_midpoint_echoes_as_to_a_co_located_pair(void **state)
{
    (void)state;
    for (size_t offset = 0; offset < 4; offset++) {
        struct nmo_config cfg = config(343.0);
        double h = half_offsets_m[offset];
        size_t n = 70;
        double t0 = cfg.out.t0_s + (double)n / cfg.out.rate_hz;
        double z = 0.5 * 343.0 * t0;
        float complex out[N_OUT] = {0};
        stack_pair(&cfg, offset, z, out);
        double complex expected = z / (z * z + h * h) *
                                  reference_echo(band_hz, 11000.0, t0, t0);
        assert_below(cabs(out[n] - expected) / cabs(expected), 2e-3);
        for (size_t q = 8; q < N_OUT - 8; q++)
            assert_true(cabsf(out[q]) <= cabsf(out[n]) * 1.01f);
    }
}

static void stacking_adds(void **state)
{
    (void)state;
    struct nmo_config cfg = config(343.0);
    float complex once[N_OUT] = {0}, twice[N_OUT] = {0};
    stack_pair(&cfg, 1, 1.1, once);
    stack_pair(&cfg, 1, 1.1, twice);
    stack_pair(&cfg, 1, 1.1, twice);
    for (size_t n = 0; n < N_OUT; n++)
        assert_below(cabsf(twice[n] - 2.0f * once[n]), 1e-6);
}

static void moveout_is_linear(void **state)
{
    (void)state;
    struct nmo_config cfg = config(343.0);
    struct nmo *n;
    unsigned long long seed = 5;
    const float complex a = 2.0f - 1.5f * I, b = -0.7f * I;
    float complex x[N_IN], y[N_IN], sum[N_IN];
    float complex out_x[N_OUT] = {0}, out_y[N_OUT] = {0}, out_sum[N_OUT] = {0};
    for (size_t q = 0; q < N_IN; q++) {
        x[q] = (float complex)(reference_random(&seed) - I * reference_random(&seed));
        y[q] = (float complex)(reference_random(&seed) + I * reference_random(&seed));
        sum[q] = a * x[q] + b * y[q];
    }
    assert_int_equal(nmo_create(&n, &cfg), 0);
    nmo_stack(n, 2, x, out_x);
    nmo_stack(n, 2, y, out_y);
    nmo_stack(n, 2, sum, out_sum);
    nmo_destroy(n);
    for (size_t q = 0; q < N_OUT; q++)
        assert_below(cabsf(out_sum[q] - a * out_x[q] - b * out_y[q]), 2e-5);
}

/* Whatever there is before the mute, none of it comes through. */
static void expect_mute(double mute_m)
{
    struct nmo_config cfg = config(343.0);
    cfg.mute_s = 2.0 * mute_m / 343.0;
    float complex in[N_IN];
    struct nmo *n;
    for (size_t q = 0; q < N_IN; q++)
        in[q] = 1.0f;
    assert_int_equal(nmo_create(&n, &cfg), 0);
    for (size_t offset = 0; offset < 4; offset++) {
        float complex out[N_OUT] = {0};
        double loudest = 0.0;
        nmo_stack(n, offset, in, out);
        for (size_t q = 0; q < N_OUT; q++) {
            loudest = fmax(loudest, cabsf(out[q]));
            if (cfg.out.t0_s + (double)q / cfg.out.rate_hz < cfg.mute_s)
                assert_near(cabsf(out[q]), 0.0, 0.0);
        }
        assert_true(loudest > 0.1);
    }
    nmo_destroy(n);
}

static void nothing_comes_before_the_mute(void **state)
{
    (void)state;
    for (int q = 0; q < 8; q++)
        expect_mute(0.9 + 0.0013 * q);
}

static void times_outside_the_input_add_nothing(void **state)
{
    (void)state;
    struct nmo_config cfg = config(343.0);
    cfg.in.t0_s = 2.0 * 0.9 / 343.0;
    cfg.in.n_samples = 60; /* to 1.19 m */
    float complex in[60];
    struct nmo *n;
    for (size_t q = 0; q < 60; q++)
        in[q] = 1.0f;
    assert_int_equal(nmo_create(&n, &cfg), 0);
    for (size_t offset = 0; offset < 4; offset++) {
        float complex out[N_OUT] = {0};
        size_t heard = 0;
        nmo_stack(n, offset, in, out);
        for (size_t q = 0; q < N_OUT; q++) {
            double t0 = cfg.out.t0_s + (double)q / cfg.out.rate_hz;
            double t = hypot(t0, 2.0 * half_offsets_m[offset] / 343.0);
            heard += cabsf(out[q]) > 0.0f;
            if (t < cfg.in.t0_s || t > cfg.in.t0_s + 59.0 / cfg.in.rate_hz)
                assert_near(cabsf(out[q]), 0.0, 0.0);
        }
        assert_true(heard > 20);
    }
    nmo_destroy(n);
}

/* Eight samples hold what is between the fourth and the fifth of them, from the fourth
 * itself on, and no more: three before and four after. */
static void what_lies_between_the_middle_samples_is_heard_to_its_beginning(void **state)
{
    (void)state;
    struct nmo_config cfg = config(343.0);
    float complex in[8] = {0}, out[17] = {0};
    struct nmo *n;
    cfg.in.n_samples = 8;
    cfg.out = cfg.in;
    cfg.out.n_samples = 17;
    cfg.out.t0_s = cfg.in.t0_s + (3.0 + 1e-4 - 8.0) / cfg.in.rate_hz;
    cfg.n_offsets = 1; /* none */
    in[3] = 1.0f;
    assert_int_equal(nmo_create(&n, &cfg), 0);
    nmo_stack(n, 0, in, out);
    nmo_destroy(n);
    double z_m = 0.5 * 343.0 * (cfg.in.t0_s + 3.0 / cfg.in.rate_hz);
    for (size_t q = 0; q < 17; q++)
        assert_near(cabsf(out[q]), q == 8 ? z_m : 0.0, 1e-3);
}

static void silence_stays_silence(void **state)
{
    (void)state;
    struct nmo_config cfg = config(343.0);
    float complex in[N_IN] = {0}, out[N_OUT] = {0};
    struct nmo *n;
    assert_int_equal(nmo_create(&n, &cfg), 0);
    nmo_stack(n, 3, in, out);
    nmo_destroy(n);
    for (size_t q = 0; q < N_OUT; q++)
        assert_near(cabsf(out[q]), 0.0, 0.0);
}

static void values_that_make_no_sense_are_refused(void **state)
{
    (void)state;
    const struct nmo_config good = config(343.0);
    struct nmo_config bad[10];
    struct nmo *n = NULL;
    for (int q = 0; q < 10; q++)
        bad[q] = good;
    bad[0].sound_speed_m_s = 0.0;
    bad[1].sound_speed_m_s = NAN;
    bad[2].in.rate_hz = 0.0;
    bad[3].in.rate_hz = NAN;
    bad[4].out.rate_hz = 0.0;
    bad[5].out.rate_hz = -1.0;
    bad[6].out.n_samples = 0;
    bad[7].in.n_samples = 0;
    bad[8].in.n_samples = 3;
    bad[9].sound_speed_m_s = -343.0;
    for (int q = 0; q < 10; q++) {
        assert_int_equal(nmo_create(&n, &bad[q]), -EINVAL);
        assert_null(n);
    }
    nmo_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_sample_is_the_echo_at_its_moved_out_time),
        cmocka_unit_test(a_point_below_the_midpoint_echoes_as_to_a_co_located_pair),
        cmocka_unit_test(stacking_adds),
        cmocka_unit_test(moveout_is_linear),
        cmocka_unit_test(nothing_comes_before_the_mute),
        cmocka_unit_test(times_outside_the_input_add_nothing),
        cmocka_unit_test(what_lies_between_the_middle_samples_is_heard_to_its_beginning),
        cmocka_unit_test(silence_stays_silence),
        cmocka_unit_test(values_that_make_no_sense_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
