/* SPDX-License-Identifier: MIT */
/* The light-cone transform against golden vectors in double precision: signal to noise
 * from -20 to 60 dB, lattices that are odd, not square, one measurement wide, one plane
 * deep, or begin at the wall. */
#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "dsp/fft.h"
#include "dsp/lane_fft.h"
#include "recon/power/lightcone.h"
#include "tests/golden/golden.h"
#include "tests/worse.h"

static const char *const cases[5] = {"lightcone_6x5", "lightcone_7x3_odd",
                                     "lightcone_1x9_line", "lightcone_5x4_depth_1",
                                     "lightcone_9x2_from_0"};

struct scene {
    struct golden *golden;
    struct lightcone_config cfg;
    size_t n_rho, n_tau;
    float *rho, *tau;
};

static size_t count(double value)
{
    return (size_t)value;
}

static void scene_open(struct scene *s, const char *name)
{
    s->golden = golden_open(name);
    const double *v = golden_table(s->golden, "lattice", NULL, NULL);
    s->cfg = (struct lightcone_config){
        .nx = count(v[0]),
        .ny = count(v[1]),
        .pitch_x_m = v[2],
        .pitch_y_m = v[3],
        .nt = count(v[4]),
        .range_m = v[5],
        .range_step_m = v[6],
        .nz = count(v[7]),
        .depth_m = v[8],
        .depth_step_m = v[9],
        .n_squared = count(v[10]),
        .falloff = 2.0,
        .snr = 1.0,
    };
    /* The inverse depends on how it is padded; the reference was padded like this. */
    assert_int_equal(fft_size(s->cfg.n_squared, 1.06), s->cfg.n_squared);
    assert_int_equal(lane_fft_size(2 * s->cfg.nx), count(v[11]));
    assert_int_equal(lane_fft_size(2 * s->cfg.ny), count(v[12]));
    assert_int_equal(pool_create(&s->cfg.pool, 1), 0);
    s->n_rho = s->cfg.nx * s->cfg.ny * s->cfg.nz;
    s->n_tau = s->cfg.nx * s->cfg.ny * s->cfg.nt;
    s->rho = calloc(s->n_rho, sizeof *s->rho);
    s->tau = calloc(s->n_tau, sizeof *s->tau);
    assert_true(s->rho && s->tau);
}

static void scene_close(struct scene *s)
{
    free(s->rho);
    free(s->tau);
    pool_destroy(s->cfg.pool);
    golden_close(s->golden);
}

static void load(const struct scene *s, const char *table, size_t n, float *out)
{
    size_t rows, columns;
    const double *values = golden_table(s->golden, table, &rows, &columns);
    assert_int_equal(rows * columns, n);
    for (size_t i = 0; i < n; i++)
        out[i] = (float)values[i];
}

static void what_is_measured_is_that_of_double_precision(void **state)
{
    (void)state;
    for (size_t q = 0; q < 5; q++) {
        struct scene s;
        struct lightcone *l;
        scene_open(&s, cases[q]);
        const double *expected = golden_table(s.golden, "measured", NULL, NULL);
        double scale = *golden_table(s.golden, "measured_scale", NULL, NULL);
        load(&s, "scatterers", s.n_rho, s.rho);
        assert_int_equal(lightcone_create(&l, &s.cfg), 0);
        lightcone_forward(l, s.rho, s.tau);
        lightcone_destroy(l);
        for (size_t i = 0; i < s.n_tau; i++)
            assert_near(s.tau[i] / scale, expected[i], 1e-6);
        scene_close(&s);
    }
}

/* Of the image's maximum.  What the kernel lacks is divided by less and less as trust in
 * the data grows, and so is the rounding of single precision. */
static double tolerance(double snr_db)
{
    return snr_db < 30.0 ? 2e-6 : snr_db < 50.0 ? 1e-4 : 5e-3;
}

static void expect_image(const struct scene *s, size_t column)
{
    struct lightcone *l;
    size_t n;
    double snr_db = golden_table(s->golden, "snr_db", NULL, &n)[column];
    double scale = golden_table(s->golden, "image_scale", NULL, NULL)[column];
    const double *expected = golden_table(s->golden, "image", NULL, NULL);
    struct lightcone_config cfg = s->cfg;
    double worst = 0.0;
    cfg.snr = pow(10.0, 0.1 * snr_db);
    assert_int_equal(lightcone_create(&l, &cfg), 0);
    lightcone_inverse(l, s->tau, s->rho);
    lightcone_destroy(l);
    for (size_t i = 0; i < s->n_rho; i++) {
        double error = fabs(s->rho[i] / scale - expected[i * n + column]);
        worst = worse(worst, error);
    }
    assert_below(worst, tolerance(snr_db));
}

static void the_inverse_is_that_of_double_precision_from_minus_20_to_60_db(void **state)
{
    (void)state;
    for (size_t q = 0; q < 5; q++) {
        struct scene s;
        scene_open(&s, cases[q]);
        load(&s, "heard", s.n_tau, s.tau);
        for (size_t column = 0; column < 5; column++)
            expect_image(&s, column);
        scene_close(&s);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_measured_is_that_of_double_precision),
        cmocka_unit_test(the_inverse_is_that_of_double_precision_from_minus_20_to_60_db),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
