/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <complex.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "recon/coherent/dmo.h"
#include "tests/recon/reference.h"
#include "tests/worse.h"

#define POINT 32 /* 16 re, 16 im, or 32 powers */

/* -- the phase --------------------------------------------------------------------------
 */

/* Lindell 2019, Eq. 14, as printed; the 64 bits of a long double's mantissa make up for
 * what it cancels. */
static long double printed_phase(long double kh, long double w)
{
    long double a = sqrtl(1.0L + (2.0L * kh / w) * (2.0L * kh / w));
    return w / 2.0L * (a - 1.0L - logl((1.0L + a) / 2.0L));
}

static void the_phase_is_the_paper_s_over_twelve_decades(void **state)
{
    (void)state;
    for (double exponent = -6.0; exponent <= 6.0; exponent += 0.25) {
        for (double w = 1e-3; w < 1e5; w *= 17.0) {
            double kh = 0.5 * w * pow(10.0, exponent);
            double expected = (double)printed_phase(kh, w);
            /* The printed formula keeps 64 - 40 bits at the low end. */
            double tolerance = exponent < -3.0 ? 1e-6 : 2e-12;
            assert_near(dmo_phase(kh, w) / expected, 1.0, tolerance);
        }
    }
}

/* phi = (k h)^2 / (2 W) (1 - (k h / W)^2 / 2 + ...) where the printed formula has nothing
 * left. */
static void small_phases_keep_their_digits(void **state)
{
    (void)state;
    for (double x = 1e-12; x < 1e-3; x *= 10.0)
        assert_near(dmo_phase(x * 40.0, 40.0) /
                        (0.5 * x * x * 40.0 * (1.0 - 0.5 * x * x)),
                    1.0, 1e-11);
}

static void without_log_frequency_the_phase_is_k_h(void **state)
{
    (void)state;
    assert_near(dmo_phase(28.0, 0.0), 28.0, 1e-12);
    assert_near(dmo_phase(-28.0, 0.0), 28.0, 1e-12);
    assert_near(dmo_phase(28.0, 1e-300), 28.0, 1e-12);
    assert_near(dmo_phase(0.0, 0.0), 0.0, 0.0);
    assert_near(dmo_phase(0.0, 7.0), 0.0, 0.0);
    assert_near(dmo_phase(28.0, INFINITY), 0.0, 0.0);
}

static void the_phase_is_odd_in_frequency_and_even_in_offset(void **state)
{
    (void)state;
    for (double kh = 0.01; kh < 1e4; kh *= 7.0) {
        assert_near(dmo_phase(kh, -30.0), -dmo_phase(kh, 30.0), 0.0);
        assert_near(dmo_phase(-kh, 30.0), dmo_phase(kh, 30.0), 0.0);
    }
}

static void extremes_stay_finite(void **state)
{
    (void)state;
    static const double values[] = {0.0, 1e-300, 1e-38, 1e-6, 1.0, 1e6, 1e38, 1e150};
    for (size_t a = 0; a < 8; a++)
        for (size_t b = 0; b < 8; b++)
            assert_true(isfinite(dmo_phase(values[a], values[b])));
}

/* -- the stack --------------------------------------------------------------------------
 */

#define LINES 24

struct bench { /* one bin's worth of inputs */
    struct pool *pool;
    struct dmo *dmo;
    uint32_t offset[3 * LINES], line[3 * LINES];
    float in[3 * LINES * POINT], out[LINES * POINT];
};

static const double halves_m[3] = {0.0, 0.11, 0.43};

static struct bench *bench_create(const double *w, size_t n_bins)
{
    struct bench *b = calloc(1, sizeof *b);
    unsigned long long seed = 5;
    assert_non_null(b);
    assert_int_equal(pool_create(&b->pool, 2), 0);
    for (size_t q = 0; q < 3 * LINES; q++) {
        b->offset[q] = (uint32_t)(q / LINES);
        b->line[q] = (uint32_t)(q % LINES);
    }
    struct dmo_config cfg = {.n_lines = LINES,
                             .pitch_m = 0.033,
                             .n_offsets = 3,
                             .half_offset_m = halves_m,
                             .n_inputs = 3 * LINES,
                             .offset = b->offset,
                             .line = b->line,
                             .n_bins = n_bins,
                             .w = w,
                             .pool = b->pool};
    assert_int_equal(dmo_create(&b->dmo, &cfg), 0);
    for (size_t q = 0; q < 3 * LINES * POINT; q++)
        b->in[q] = (float)(reference_random(&seed) - 0.5);
    return b;
}

static void bench_destroy(struct bench *b)
{
    dmo_destroy(b->dmo);
    pool_destroy(b->pool);
    free(b);
}

/* The convolution in double precision, by a sum over wavenumbers of its own: the same
 * period as recon/coherent/dmo documents (clear of the offset on both sides) but the
 * printed phase. */
static double complex convolve(const struct bench *b, double w, size_t line, size_t lane)
{
    size_t period = 2 * (LINES + (size_t)ceil(0.43 / 0.033) + 1);
    double complex sum = 0.0;
    for (size_t q = 0; q < 3 * LINES; q++) {
        double complex x = b->in[q * POINT + lane] + I * b->in[q * POINT + 16 + lane];
        double complex kernel = 0.0;
        for (size_t m = 0; m < period; m++) {
            double turns = m <= period / 2 ? (double)m : (double)m - (double)period;
            double k = 2.0 * M_PI * turns / ((double)period * 0.033);
            double kh = fabs(k) * halves_m[b->offset[q]];
            double complex shift =
                kh == 0.0  ? 1.0
                : w == 0.0 ? cos(kh)
                           : cexp(-I * (double)copysignl(printed_phase(kh, fabs(w)), w));
            kernel += shift * cos(k * 0.033 * ((double)line - (double)b->line[q]));
        }
        sum += x * kernel / (double)period;
    }
    return sum;
}

static void the_stack_is_that_of_double_precision(void **state)
{
    (void)state;
    static const double w[4] = {0.0, 3.7, -55.0, 1200.0};
    struct bench *b = bench_create(w, 4);
    double worst = 0.0, largest = 0.0;
    for (size_t bin = 0; bin < 4; bin++) {
        dmo_stack(b->dmo, bin, b->in, POINT, b->out, POINT);
        for (size_t line = 0; line < LINES; line += 5) {
            for (size_t lane = 0; lane < 16; lane += 5) {
                double complex expected = convolve(b, w[bin], line, lane);
                const float *y = b->out + line * POINT + lane;
                worst = worse(worst, cabs(expected - (y[0] + I * y[16])));
                largest = fmax(largest, cabs(expected));
            }
        }
    }
    assert_below(worst, 3e-6 * largest);
    bench_destroy(b);
}

static void no_offset_changes_nothing(void **state)
{
    (void)state;
    static const double w[3] = {0.0, 20.0, -300.0};
    struct bench *b = bench_create(w, 3);
    memset(b->in + LINES * POINT, 0, 2 * LINES * POINT * sizeof(float));
    for (size_t bin = 0; bin < 3; bin++) {
        dmo_stack(b->dmo, bin, b->in, POINT, b->out, POINT);
        for (size_t q = 0; q < LINES * POINT; q++)
            assert_near(b->out[q], b->in[q], 1e-6);
    }
    bench_destroy(b);
}

static void what_is_real_stays_real_at_frequency_0_and_at_the_shared_bin(void **state)
{
    (void)state;
    static const double w[2] = {0.0, INFINITY};
    struct bench *b = bench_create(w, 2);
    for (size_t q = 0; q < 3 * LINES; q++)
        memset(b->in + q * POINT + 16, 0, 16 * sizeof(float));
    for (size_t bin = 0; bin < 2; bin++) {
        dmo_stack(b->dmo, bin, b->in, POINT, b->out, POINT);
        for (size_t q = 0; q < LINES; q++)
            for (size_t l = 16; l < 32; l++)
                assert_near(b->out[q * POINT + l], 0.0, 0.0);
    }
    bench_destroy(b);
}

static void senseless_configurations_are_refused(void **state)
{
    (void)state;
    static const double half_m[1] = {0.1}, bad_m[1] = {-0.1}, w[1] = {1.0};
    static const uint32_t zero[1] = {0}, one[1] = {1};
    struct pool *pool;
    struct dmo *d = NULL;
    assert_int_equal(pool_create(&pool, 1), 0);
    const struct dmo_config good = {1, 0.1, 1, half_m, 1, zero, zero, 1, w, pool};
    struct dmo_config cfg = good;
    cfg.half_offset_m = bad_m;
    assert_int_equal(dmo_create(&d, &cfg), -EINVAL);
    cfg = good;
    cfg.line = one;
    assert_int_equal(dmo_create(&d, &cfg), -EINVAL);
    cfg = good;
    cfg.offset = one;
    assert_int_equal(dmo_create(&d, &cfg), -EINVAL);
    cfg = good;
    cfg.pitch_m = 0.0;
    assert_int_equal(dmo_create(&d, &cfg), -EINVAL);
    assert_int_equal(dmo_create(&d, &good), 0);
    dmo_destroy(d);
    dmo_destroy(NULL);
    pool_destroy(pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_phase_is_the_paper_s_over_twelve_decades),
        cmocka_unit_test(small_phases_keep_their_digits),
        cmocka_unit_test(without_log_frequency_the_phase_is_k_h),
        cmocka_unit_test(the_phase_is_odd_in_frequency_and_even_in_offset),
        cmocka_unit_test(extremes_stay_finite),
        cmocka_unit_test(the_stack_is_that_of_double_precision),
        cmocka_unit_test(no_offset_changes_nothing),
        cmocka_unit_test(what_is_real_stays_real_at_frequency_0_and_at_the_shared_bin),
        cmocka_unit_test(senseless_configurations_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
