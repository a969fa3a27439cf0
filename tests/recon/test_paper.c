/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "tests/recon/rig.h"
#include "tests/worse.h"

/* 6 x 6 elements on 24 stage positions: midpoints 0.69 x 0.6 m on lines of 3 cm. */
static void array_default(struct rig *r)
{
    rig_default(r);
    r->geometry.n_speakers = r->geometry.n_microphones = 6;
    r->geometry.n_positions = 24;
    for (size_t e = 0; e < 6; e++) {
        r->speakers_m[e][1] = 0.12 * ((double)e - 2.5);
        r->microphones_m[e][1] = 0.12 * ((double)e - 2.5);
        r->microphones_m[e][0] = 0.03;
    }
    for (size_t k = 0; k < 24; k++)
        r->positions_m[k] = 0.03 * ((double)k - 11.5);
    r->gate_m[0] = 0.8;
    rig_listen(r, 0.7, 1.9);
    rig_look_at(r, 0.0, 0.0, 1.3, 25, 0.02);
    r->grid.step_m[2] = 0.005;
    r->grid.n[2] = 61;
    r->grid.origin_m[2] = 1.3 - 30 * 0.005;
}

static struct imager *imager_with(const struct rig *r, const struct imager_options *o,
                                  struct pool *pool)
{
    struct imager *im;
    struct imager_config cfg = {.method = "paper",
                                .geometry = &r->geometry,
                                .format = r->format,
                                .band_hz = {r->band_hz[0], r->band_hz[1]},
                                .gate_m = {r->gate_m[0], r->gate_m[1]},
                                .grid = r->grid,
                                .pool = pool,
                                .options = o};
    assert_int_equal(imager_create(&im, &cfg, NULL), 0);
    return im;
}

/* The echo of a mirror z = 1.3 m that faces the array: one path for each pair. */
static void add_mirror(const struct rig *r, struct imager *im)
{
    const struct trace_format *f = &r->format;
    float complex *traces = malloc(6 * f->n_samples * sizeof *traces);
    assert_non_null(traces);
    for (size_t p = 0; p < 24 * 6; p++) {
        for (size_t q = 0; q < 6 * f->n_samples; q++) {
            double s[3], m[3], t = f->t0_s + (double)(q % f->n_samples) / f->rate_hz;
            geometry_speaker(&r->geometry, p / 6, p % 6, s);
            geometry_microphone(&r->geometry, p / 6, 0, q / f->n_samples, m);
            double path_m = hypot(2.6, hypot(s[0] - m[0], s[1] - m[1]));
            traces[q] = (float complex)reference_echo(r->band_hz, f->carrier_hz,
                                                      path_m / 343.0, t);
        }
        imager_add(im, p / 6, p % 6, traces, NULL);
    }
    free(traces);
}

/* Of points, or, when there are none, of the mirror. */
static float *image_with(const struct rig *r, int lightcone,
                         const struct scatterer *points, size_t n_points)
{
    struct pool *pool;
    struct imager_options o;
    imager_options_default(&o);
    o.lightcone = lightcone;
    assert_int_equal(pool_create(&pool, 2), 0);
    struct imager *im = imager_with(r, &o, pool);
    float *image = malloc(grid_size(&r->grid) * sizeof *image);
    assert_non_null(image);
    if (n_points)
        rig_add(r, im, points, n_points);
    else
        add_mirror(r, im);
    imager_image(im, image);
    imager_destroy(im);
    pool_destroy(pool);
    return image;
}

static void points_are_where_they_are(void **state)
{
    (void)state;
    static const double places[3][3] = {
        {0.0, 0.0, 1.3}, {0.113, -0.0641, 1.3231}, {-0.11, 0.1, 1.25}};
    for (int q = 0; q < 3; q++) {
        struct rig r;
        array_default(&r);
        /* an eighth of its width */
        rig_expect_point(&r, "paper", places[q], 1.5e-2, 3e-3);
    }
}

static double width_m(const struct rig *r, const float *image)
{
    struct peak_fit fit;
    rig_peak(r, image, &fit);
    return fit.width_m[0];
}

/* Unless one says so: a point is migrated, a mirror that faces the array is not. */
static void it_sees_whether_an_object_scatters_or_mirrors(void **state)
{
    (void)state;
    const struct scatterer point = {{0.02, 0.01, 1.3}, 1.0};
    struct rig r;
    array_default(&r);
    float *ask = image_with(&r, -1, &point, 1), *always = image_with(&r, 1, &point, 1);
    float *never = image_with(&r, 0, &point, 1);
    assert_near(rig_difference(&r, ask, always), 0.0, 0.0);
    assert_below(2.0 * width_m(&r, always), width_m(&r, never));
    free(ask);
    free(always);
    free(never);
    ask = image_with(&r, -1, NULL, 0);
    always = image_with(&r, 1, NULL, 0);
    never = image_with(&r, 0, NULL, 0);
    assert_near(rig_difference(&r, ask, never), 0.0, 0.0);
    assert_below(0.1, rig_difference(&r, ask, always));
    free(ask);
    free(always);
    free(never);
}

/* Every midpoint before it shows the mirror at its depth, as bright as its neighbours. */
static void a_mirror_is_shown_as_it_is(void **state)
{
    (void)state;
    struct rig r;
    array_default(&r);
    float *image = image_with(&r, 0, NULL, 0);
    size_t side = r.grid.n[0] * r.grid.n[1];
    for (size_t v = 0; v < side; v++) {
        size_t best = 0;
        for (size_t z = 0; z < r.grid.n[2]; z++)
            best = image[z * side + v] > image[best * side + v] ? z : best;
        assert_int_equal(best, 30);
        assert_near(image[30 * side + v] / image[30 * side + side / 2], 1.0, 0.1);
    }
    free(image);
}

static void gain_only_scales(void **state)
{
    (void)state;
    struct rig r;
    array_default(&r);
    const struct scatterer point = {{0.02, 0.01, 1.3}, 1.0};
    float *one = rig_image(&r, "paper", &point, 1, 1);
    for (int q = -1; q <= 1; q += 2) {
        double gain = pow(10.0, 12.0 * q), worst = 0.0, peak = 0.0;
        const struct scatterer other = {{0.02, 0.01, 1.3}, gain};
        float *image = rig_image(&r, "paper", &other, 1, 1);
        for (size_t v = 0; v < grid_size(&r.grid); v++) {
            worst = worse(worst, fabs(image[v] / (gain * gain) - one[v]));
            peak = fmax(peak, one[v]);
        }
        assert_below(worst, 1e-3 * peak);
        free(image);
    }
    free(one);
}

static void silence_is_dark(void **state)
{
    (void)state;
    struct rig r;
    array_default(&r);
    float *image = rig_image(&r, "paper", NULL, 0, 2);
    for (size_t v = 0; v < grid_size(&r.grid); v++)
        assert_near(image[v], 0.0, 0.0);
    free(image);
}

static void expect_refused(const struct rig *r)
{
    struct pool *pool;
    struct imager *im = NULL;
    const char *why = NULL;
    assert_int_equal(pool_create(&pool, 1), 0);
    assert_int_equal(rig_try(r, "paper", pool, &im, &why), -ENOTSUP);
    assert_null(im);
    assert_true(strlen(why) > 10);
    pool_destroy(pool);
}

static void what_it_cannot_do_is_refused_with_a_reason(void **state)
{
    (void)state;
    struct rig r;
    array_default(&r);
    r.speakers_m[1][2] = 0.04;
    expect_refused(&r);
    array_default(&r);
    r.positions_m[5] += 0.01;
    expect_refused(&r);
    array_default(&r);
    r.gate_m[0] = 1.88;
    r.gate_m[1] = 1.9;
    expect_refused(&r);
}

static void a_gate_from_the_first_sample_stays_finite(void **state)
{
    (void)state;
    const struct scatterer point = {{0.02, 0.01, 1.3}, 1.0};
    struct rig r;
    array_default(&r);
    r.gate_m[0] = 0.0;
    rig_listen(&r, 0.0, 1.9);
    r.grid.origin_m[2] = 0.02;
    r.grid.step_m[2] = 0.02;
    r.grid.n[2] = 70;
    float *image = rig_image(&r, "paper", &point, 1, 2);
    struct peak_fit fit;
    rig_peak(&r, image, &fit); /* fails on what is not finite */
    assert_near(fit.position_m[2], 1.3, 0.02);
    free(image);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_are_where_they_are),
        cmocka_unit_test(it_sees_whether_an_object_scatters_or_mirrors),
        cmocka_unit_test(a_mirror_is_shown_as_it_is),
        cmocka_unit_test(gain_only_scales),
        cmocka_unit_test(silence_is_dark),
        cmocka_unit_test(what_it_cannot_do_is_refused_with_a_reason),
        cmocka_unit_test(a_gate_from_the_first_sample_stays_finite),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
