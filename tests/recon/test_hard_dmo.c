/* SPDX-License-Identifier: MIT */
/* Dip moveout against golden vectors: its phase in 60 digits, its convolution as an
 * integral in double precision, for 2 k h / W from 1e-6 to 1e6 and W = 0. */
#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "recon/coherent/dmo.h"
#include "tests/golden/golden.h"
#include "tests/worse.h"

#define POINT 32 /* 16 re, 16 im */

/* To 3 units of the last place. */
static void the_phase_has_all_digits_of_a_double(void **state)
{
    (void)state;
    struct golden *g = golden_open("dmo_phase_ratio_1e-6_to_1e6");
    size_t n;
    const double *row = golden_table(g, "phase", &n, NULL);
    assert_true(n > 100);
    for (size_t q = 0; q < n; q++, row += 3)
        assert_near(dmo_phase(row[0], row[1]) / row[2], 1.0, 3 * 2.2e-16);
    golden_close(g);
}

/* out [n_lines][POINT] of an impulse on the first line. */
static void respond(double half_m, double w, double longest_m, size_t n_lines, float *out)
{
    const double halves_m[2] = {half_m, longest_m};
    const uint32_t zero[1] = {0};
    float in[POINT] = {1.0f};
    struct dmo_config cfg = {.n_lines = n_lines,
                             .pitch_m = 0.0125,
                             .n_offsets = 2,
                             .half_offset_m = halves_m,
                             .n_inputs = 1,
                             .offset = zero,
                             .line = zero,
                             .n_bins = 1,
                             .w = &w};
    struct dmo *d;
    assert_int_equal(pool_create(&cfg.pool, 1), 0);
    assert_int_equal(dmo_create(&d, &cfg), 0);
    dmo_stack(d, 0, in, POINT, out, POINT);
    dmo_destroy(d);
    pool_destroy(cfg.pool);
}

/* Largest difference from the integral, over all distances, offsets, and frequencies from
 * |least_w| on. */
static double worst_error(double longest_m, double least_w)
{
    struct golden *g = golden_open("dmo_kernel_pitch_0.0125_lines_12");
    size_t n, columns;
    double worst = 0.0;
    const double *row = golden_table(g, "kernel", &n, &columns);
    size_t n_lines = (columns - 2) / 2;
    float *out = malloc(n_lines * POINT * sizeof *out);
    assert_non_null(out);
    assert_true(n >= 18);
    for (size_t q = 0; q < n; q++, row += columns) {
        if (fabs(row[1]) < least_w)
            continue;
        respond(row[0], row[1], longest_m, n_lines, out);
        for (size_t d = 0; d < n_lines; d++) {
            double re = fabs(out[d * POINT] - row[2 + 2 * d]);
            double im = fabs(out[d * POINT + 16] - row[3 + 2 * d]);
            worst = worse(worst, re);
            worst = worse(worst, im);
        }
    }
    free(out);
    golden_close(g);
    return worst;
}

/* What the copies of the convolution, a period apart, leave in each other is 1e-2 of the
 * impulse, 1e-3 at the log-frequencies of sound (2 pi f t).  A long offset among the
 * others moves them far apart; then single precision is all that remains. */
static void the_convolution_is_the_integral_over_wavenumbers(void **state)
{
    (void)state;
    assert_below(worst_error(40.0, 0.0), 3e-6);
    assert_below(worst_error(0.5, 0.0), 1e-2);
    assert_below(worst_error(0.5, 250.0), 2e-3);
    assert_below(worst_error(0.5, 700.0), 1e-3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_phase_has_all_digits_of_a_double),
        cmocka_unit_test(the_convolution_is_the_integral_over_wavenumbers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
