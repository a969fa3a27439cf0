/* SPDX-License-Identifier: MIT */
/* F-k migration against golden vectors, direct sums of plane waves in double precision:
 * a point near, off centre, before midpoints too far apart or all on one line, and sound
 * that propagates nowhere. */
#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "recon/coherent/fk.h"
#include "tests/golden/golden.h"
#include "tests/recon/reference.h"
#include "tests/worse.h"

#define LINES 12

struct scene {
    struct golden *golden;
    struct fk_config cfg;
    double x_m[LINES], y_m[LINES];
    struct scatterer point;
    bool alternating;
    size_t cells;
    float complex *gather;
    float weight[LINES * LINES];
};

static void set_lines(double *at_m, size_t n, double pitch_m)
{
    for (size_t i = 0; i < n; i++)
        at_m[i] = pitch_m * ((double)i - 0.5 * (double)(n - 1));
}

/* What co-located pairs hear, fading as 1 / r, 0.4 m beyond the point. */
static void listen(struct scene *s)
{
    double near_m = 0.6 * s->point.at_m[2], far_m = s->point.at_m[2] + 0.6;
    struct trace_format *f = &s->cfg.trace;
    double c = s->cfg.sound_speed_m_s;
    *f = (struct trace_format){2.0 * near_m / c, 36000.0, 11000.0, 0};
    f->n_samples = (size_t)(2.0 * (far_m - near_m) / c * f->rate_hz);
    s->gather = malloc(s->cells * f->n_samples * sizeof *s->gather);
    assert_non_null(s->gather);
    for (size_t q = 0; q < s->cells * f->n_samples; q++) {
        size_t cell = q / f->n_samples;
        const double at[3] = {s->x_m[cell / s->cfg.ny], s->y_m[cell % s->cfg.ny], 0.0};
        double t = f->t0_s + (double)(q % f->n_samples) / f->rate_hz;
        double r = reference_distance(at, s->point.at_m);
        s->gather[q] = (float complex)(
            reference_echo(s->cfg.band_hz, f->carrier_hz, 2.0 * r / c, t) / r);
    }
}

static void scene_open(struct scene *s, const char *name)
{
    s->golden = golden_open(name);
    const double *v = golden_table(s->golden, "setup", NULL, NULL);
    s->cfg = (struct fk_config){
        .sound_speed_m_s = v[9],
        .nx = (size_t)v[0],
        .ny = (size_t)v[1],
        .x_m = s->x_m,
        .y_m = s->y_m,
        .band_hz = {v[7], v[8]},
        .grid = {.step_m = {v[10], v[11], v[12]}, .n = {7, 7, 9}},
    };
    s->point = (struct scatterer){{v[4], v[5], v[6]}, 1.0};
    s->alternating = v[13] != 0.0;
    s->cells = s->cfg.nx * s->cfg.ny;
    set_lines(s->x_m, s->cfg.nx, v[2]);
    set_lines(s->y_m, s->cfg.ny, v[3]);
    for (int a = 0; a < 3; a++)
        s->cfg.grid.origin_m[a] = s->point.at_m[a] -
                                  s->cfg.grid.step_m[a] * (double)(s->cfg.grid.n[a] / 2);
    assert_int_equal(pool_create(&s->cfg.pool, 1), 0);
    listen(s);
}

static void scene_close(struct scene *s)
{
    free(s->gather);
    pool_destroy(s->cfg.pool);
    golden_close(s->golden);
}

/* Amplitudes; returns the largest. */
static double migrate(struct scene *s, bool alternating, float *image)
{
    struct fk *m;
    double largest = 0.0;
    for (size_t q = 0; q < s->cells; q++)
        s->weight[q] = alternating && (q / s->cfg.ny + q % s->cfg.ny) % 2 ? -1.0f : 1.0f;
    assert_int_equal(fk_create(&m, &s->cfg), 0);
    fk_migrate(m, s->gather, s->weight, image);
    fk_destroy(m);
    for (size_t v = 0; v < grid_size(&s->cfg.grid); v++) {
        assert_true(isfinite(image[v]) && image[v] >= 0.0f);
        image[v] = sqrtf(image[v]);
        largest = fmax(largest, image[v]);
    }
    return largest;
}

/* Amplitudes over the largest one that the point has when all midpoints count alike: near
 * the sum of those waves that migration uses; less so of all, because it leaves out what
 * is steeper than the aperture sees the image. */
static void expect_golden(const char *name, double tolerance, double tolerance_of_all)
{
    struct scene s;
    float image[7 * 7 * 9];
    double worst = 0.0, worst_of_all = 0.0;
    scene_open(&s, name);
    const double *used = golden_table(s.golden, "image", NULL, NULL);
    const double *all = golden_table(s.golden, "image_of_all", NULL, NULL);
    double scale = migrate(&s, false, image);
    if (s.alternating)
        migrate(&s, true, image);
    for (size_t v = 0; v < 7 * 7 * 9; v++) {
        worst = worse(worst, fabs(image[v] / scale - used[v]));
        worst_of_all = worse(worst_of_all, fabs(image[v] / scale - all[v]));
    }
    assert_below(worst, tolerance);
    assert_below(worst_of_all, tolerance_of_all);
    scene_close(&s);
}

static void a_point_at_2_5_m_is_that_of_the_direct_sum(void **state)
{
    (void)state;
    expect_golden("fk_far_2.5_m", 0.005, 0.08);
}

static void a_point_at_0_3_m_is_that_of_the_direct_sum(void **state)
{
    (void)state;
    expect_golden("fk_near_0.3_m", 0.005, 0.08);
}

static void a_point_beside_the_array_is_that_of_the_direct_sum(void **state)
{
    (void)state;
    expect_golden("fk_off_centre_19_degrees", 0.005, 0.08);
}

static void midpoints_too_far_apart_alias_as_the_direct_sum_does(void **state)
{
    (void)state;
    expect_golden("fk_aliased_12_cm", 0.005, 0.08);
}

static void a_single_line_images_as_the_direct_sum_does(void **state)
{
    (void)state;
    expect_golden("fk_single_line", 0.01, 0.15);
}

/* Signs that alternate from midpoint to midpoint are waves shorter than sound has at
 * these frequencies. */
static void sound_that_does_not_propagate_makes_no_image(void **state)
{
    (void)state;
    expect_golden("fk_evanescent", 0.001, 0.01);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_at_2_5_m_is_that_of_the_direct_sum),
        cmocka_unit_test(a_point_at_0_3_m_is_that_of_the_direct_sum),
        cmocka_unit_test(a_point_beside_the_array_is_that_of_the_direct_sum),
        cmocka_unit_test(midpoints_too_far_apart_alias_as_the_direct_sum_does),
        cmocka_unit_test(a_single_line_images_as_the_direct_sum_does),
        cmocka_unit_test(sound_that_does_not_propagate_makes_no_image),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
