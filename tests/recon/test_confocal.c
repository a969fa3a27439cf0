/* SPDX-License-Identifier: MIT */
/* `--method confocal` and `--method lct`. */
#include "tests/recon/near.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "recon/imaging/imager.h"
#include "tests/recon/rig.h"

/* One voxel at a place of the lattice after the other. */
static void as_measured_is_the_power_at_each_place(void **state)
{
    (void)state;
    const struct scatterer point = {{0.013, -0.021, 1.1}, 1.0};
    struct rig r;
    rig_pairs(&r);
    for (int q = 0; q < 3; q++) {
        double x = 0.04 * (2 * q - 2.5 + 1.0), y = 0.05 * (2 * q - 1.5);
        const double s[3] = {x - 0.015, y, 0.0}, m[3] = {x + 0.015, y, 0.0};
        double r_s = reference_distance(s, point.at_m);
        double r_m = reference_distance(m, point.at_m);
        double largest = 0.0;
        r.grid = (struct grid){{x, y, 1.05}, {0.01, 0.01, 0.003}, {1, 1, 50}};
        float *image = rig_image(&r, "confocal", &point, 1, 1);
        double expected[50];
        for (int z = 0; z < 50; z++) {
            double range_m = 1.05 + 0.003 * z;
            double t = 2.0 * hypot(range_m, 0.015) / r.geometry.sound_speed_m_s;
            double delay_s = (r_s + r_m) / r.geometry.sound_speed_m_s;
            double echo = reference_pulse(r.band_hz, t - delay_s) / (r_s * r_m);
            expected[z] = range_m * range_m * echo * echo;
            largest = fmax(largest, expected[z]);
        }
        for (int z = 0; z < 50; z++)
            assert_near(image[z] / largest, expected[z] / largest, 0.03);
        free(image);
    }
}

static void a_point_is_where_it_is(void **state)
{
    (void)state;
    static const double places[3][3] = {
        {0.0, 0.0, 1.1}, {0.05, -0.06, 0.98}, {-0.04, 0.05, 1.2}};
    for (int q = 0; q < 3; q++) {
        struct rig r;
        rig_pairs(&r);
        rig_look_at(&r, places[q][0], places[q][1], places[q][2], 21, 0.006);
        rig_expect_point(&r, "lct", places[q], 0.02, 0.006); /* half a cell */
    }
}

static void a_voxel_outside_the_lattice_is_dark(void **state)
{
    (void)state;
    const struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
    static const char *const methods[2] = {"confocal", "lct"};
    for (int q = 0; q < 2; q++) {
        struct rig r;
        rig_pairs(&r);
        rig_look_at(&r, 0.4, 0.0, 1.1, 9, 0.02);
        float *image = rig_image(&r, methods[q], &point, 1, 2);
        for (size_t v = 0; v < grid_size(&r.grid); v++)
            assert_near(image[v], 0.0, 0.0);
        free(image);
    }
}

static void the_gain_of_a_recording_does_not_matter(void **state)
{
    (void)state;
    struct scatterer point = {{0.02, 0.01, 1.1}, 1.0};
    struct rig r;
    rig_pairs(&r);
    float *plain = rig_image(&r, "lct", &point, 1, 1);
    point.gain = 1e3;
    float *loud = rig_image(&r, "lct", &point, 1, 1);
    for (size_t v = 0; v < grid_size(&r.grid); v++)
        loud[v] *= 1e-6f;
    assert_below(rig_difference(&r, plain, loud), 1e-5);
    free(plain);
    free(loud);
}

static void what_is_not_finite_gives_a_finite_image(void **state)
{
    (void)state;
    struct rig r;
    struct pool *pool;
    rig_pairs(&r);
    assert_int_equal(pool_create(&pool, 1), 0);
    struct imager *im = rig_imager(&r, "lct", pool);
    size_t n = r.geometry.n_microphones * r.format.n_samples;
    float complex *traces = malloc(n * sizeof *traces);
    float *image = malloc(grid_size(&r.grid) * sizeof *image);
    for (size_t i = 0; i < n; i++)
        traces[i] = i % 97 == 0 ? NAN : i % 89 == 0 ? INFINITY : 1e10f;
    imager_add(im, 0, 0, traces, NULL);
    imager_image(im, image);
    for (size_t v = 0; v < grid_size(&r.grid); v++)
        assert_true(isfinite(image[v]) && image[v] >= 0.0f);
    imager_reset(im);
    imager_image(im, image);
    for (size_t v = 0; v < grid_size(&r.grid); v++)
        assert_near(image[v], 0.0, 0.0);
    imager_destroy(im);
    pool_destroy(pool);
    free(traces);
    free(image);
}

static void one_position_or_one_speaker_is_enough(void **state)
{
    (void)state;
    const struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
    for (int q = 0; q < 2; q++) {
        struct rig r;
        struct peak_fit fit;
        rig_pairs(&r);
        if (q) {
            r.geometry.n_positions = 1;
            r.positions_m[0] = 0.0;
        } else {
            r.geometry.n_speakers = r.geometry.n_microphones = 1;
            r.speakers_m[0][1] = r.microphones_m[0][1] = 0.0;
        }
        r.grid = (struct grid){{0.0, 0.0, 1.0}, {0.01, 0.01, 0.005}, {1, 1, 41}};
        float *image = rig_image(&r, "confocal", &point, 1, 1);
        rig_peak(&r, image, &fit);
        assert_near(fit.position_m[2], 1.1, 0.004);
        free(image);
        image = rig_image(&r, "lct", &point, 1, 1);
        rig_peak(&r, image, &fit); /* finite */
        free(image);
    }
}

static void an_array_without_pairs_on_a_lattice_is_refused_with_a_reason(void **state)
{
    (void)state;
    struct rig r;
    struct pool *pool;
    struct imager *im = NULL;
    const char *why = "";
    rig_default(&r); /* speakers and microphones of different pitch */
    assert_int_equal(pool_create(&pool, 1), 0);
    assert_int_equal(rig_try(&r, "lct", pool, &im, &why), -ENOTSUP);
    assert_non_null(strstr(why, "even pitch"));
    rig_pairs(&r);
    r.grid.origin_m[2] = 9.0; /* behind what the traces hold */
    assert_int_equal(rig_try(&r, "confocal", pool, &im, &why), -ENOTSUP);
    assert_non_null(strstr(why, "gate"));
    assert_null(im);
    pool_destroy(pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(as_measured_is_the_power_at_each_place),
        cmocka_unit_test(a_point_is_where_it_is),
        cmocka_unit_test(a_voxel_outside_the_lattice_is_dark),
        cmocka_unit_test(the_gain_of_a_recording_does_not_matter),
        cmocka_unit_test(what_is_not_finite_gives_a_finite_image),
        cmocka_unit_test(one_position_or_one_speaker_is_enough),
        cmocka_unit_test(an_array_without_pairs_on_a_lattice_is_refused_with_a_reason),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
