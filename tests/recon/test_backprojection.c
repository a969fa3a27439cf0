/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "recon/imaging/imager_options.h"
#include "tests/recon/rig.h"
#include "tests/worse.h"

static void a_point_is_where_it_is(void **state)
{
    (void)state;
    static const double places[5][3] = {{0.0, 0.0, 1.1},
                                        {0.0137, -0.0241, 1.0531},
                                        {-0.1, 0.08, 1.2017},
                                        {0.25, 0.0, 1.2},
                                        {0.12, -0.31, 1.3}};
    for (int q = 0; q < 5; q++) {
        struct rig r;
        rig_default(&r);
        rig_look_at(&r, places[q][0] + 0.004, places[q][1] - 0.003, places[q][2] + 0.0017,
                    13, 0.008);
        rig_expect_point(&r, "backprojection", places[q], 2e-3, 1e-3);
    }
}

static void so_is_one_at_half_a_metre(void **state)
{
    (void)state;
    const double at[3] = {0.053, -0.061, 0.5};
    struct rig r;
    rig_default(&r);
    r.gate_m[0] = 0.2;
    rig_listen(&r, 0.3, 1.0);
    rig_look_at(&r, 0.05, -0.06, 0.503, 15, 0.006);
    rig_expect_point(&r, "backprojection", at, 1e-3, 0.5e-3);
}

static void an_array_that_is_not_plane_images_too(void **state)
{
    (void)state;
    unsigned long long seed = 11;
    const double at[3] = {0.031, -0.043, 1.1023};
    struct rig r;
    rig_default(&r);
    for (size_t e = 0; e < 4; e++) {
        for (int a = 0; a < 3; a++) {
            r.speakers_m[e][a] += 0.1 * reference_random(&seed);
            r.microphones_m[e][a] += 0.1 * reference_random(&seed);
        }
    }
    r.geometry.stage_axis[0] = 0.96;
    r.geometry.stage_axis[2] = 0.28;
    rig_look_at(&r, 0.03, -0.04, 1.1, 15, 0.008);
    rig_expect_point(&r, "backprojection", at, 2e-3, 1e-3);
}

static void set_positions(struct rig *r, size_t n)
{
    r->geometry.n_positions = n;
    for (size_t k = 0; k < n; k++)
        r->positions_m[k] = 0.04 * ((double)k - 0.5 * (double)(n - 1));
}

static double complex exact_sum(const struct rig *r, const struct scatterer *point,
                                const double voxel[3])
{
    double complex sum = 0.0;
    for (size_t q = 0; q < r->geometry.n_positions * 16; q++) {
        double s[3], m[3];
        geometry_speaker(&r->geometry, q / 16, q / 4 % 4, s);
        geometry_microphone(&r->geometry, q / 16, 0, q % 4, m);
        double r_s = reference_distance(s, point->at_m);
        double r_m = reference_distance(m, point->at_m);
        double t = (reference_distance(s, voxel) + reference_distance(m, voxel)) / 343.0;
        sum += reference_echo(r->band_hz, 11000.0, (r_s + r_m) / 343.0, t) *
               cexp(2.0 * M_PI * I * 11000.0 * t) / (r_s * r_m);
    }
    return sum;
}

static void expect_exact(size_t n_positions, double step_m)
{
    const struct scatterer point = {{0.03, -0.02, 1.1}, 1.0};
    struct rig r;
    rig_default(&r);
    set_positions(&r, n_positions);
    for (size_t e = 0; e < 4; e++) /* no two of the pairs share a midpoint */
        r.microphones_m[e][1] = 0.02 * ((double)e - 1.5);
    rig_look_at(&r, 0.02, -0.01, 1.1, 7, step_m);
    float *image = rig_image(&r, "backprojection", &point, 1, 1);
    double exact[343], ab = 0.0, bb = 0.0, largest = 0.0;
    for (size_t v = 0; v < 343; v++) {
        double p[3] = {r.grid.origin_m[0] + step_m * (double)(v % 7),
                       r.grid.origin_m[1] + step_m * (double)(v / 7 % 7),
                       r.grid.origin_m[2] + step_m * (double)(v / 49)};
        double a = cabs(exact_sum(&r, &point, p));
        exact[v] = p[2] * p[2] * a * a;
        ab += exact[v] * image[v];
        bb += (double)image[v] * image[v];
        largest = fmax(largest, exact[v]);
    }
    for (size_t v = 0; v < 343; v++)
        assert_near(image[v] * ab / bb / largest, exact[v] / largest, 0.01);
    free(image);
}

/* The definition, in double, voxel by voxel, up to one factor; with stage steps (0.04)
 * that are whole voxels and such that are not. */
static void each_voxel_sums_every_pair_at_its_own_delay(void **state)
{
    (void)state;
    expect_exact(3, 0.021);
    expect_exact(9, 0.011);
    expect_exact(8, 0.02);
    expect_exact(11, 0.008);
    expect_exact(9, 0.04);
}

static void the_number_of_threads_does_not_change_a_bit(void **state)
{
    (void)state;
    const struct scatterer point = {{0.03, -0.02, 1.1}, 1.0};
    for (size_t n_positions = 15; n_positions <= 16; n_positions++) {
        struct rig r;
        rig_default(&r);
        set_positions(&r, n_positions);
        rig_look_at(&r, 0.03, -0.02, 1.1, 19, 0.01);
        float *one = rig_image(&r, "backprojection", &point, 1, 1);
        for (size_t n = 2; n <= 3; n++) {
            float *image = rig_image(&r, "backprojection", &point, 1, n);
            assert_memory_equal(one, image, grid_size(&r.grid) * sizeof *one);
            free(image);
        }
        free(one);
    }
}

/* Microphone 3 four times more, to within a nanometre, with midpoints half-way between
 * whole millimetres: rounding must not tell them apart. */
static void midpoints_that_agree_to_a_nanometre_are_one(void **state)
{
    (void)state;
    const struct scatterer point = {{0.03, -0.02, 1.1}, 1.0};
    struct rig r;
    rig_default(&r);
    for (size_t e = 0; e < 4; e++) /* no two of the pairs share a midpoint */
        r.microphones_m[e][1] = 0.02 * ((double)e - 1.5) + 0.001;
    float *single = rig_image(&r, "backprojection", &point, 1, 1);
    for (size_t e = 4; e < 8; e++)
        r.microphones_m[e][1] = r.microphones_m[3][1] + (e % 2 ? 1e-9 : -1e-9);
    r.geometry.n_microphones = 8;
    float *many = rig_image(&r, "backprojection", &point, 1, 1);
    assert_below(rig_difference(&r, single, many), 1e-4);
    free(single);
    free(many);
}

static struct imager *imager_of(const struct rig *r, struct pool *pool, double coherence)
{
    struct imager_options options;
    struct imager *im = NULL;
    imager_options_default(&options);
    options.coherence = coherence;
    struct imager_config cfg = {.method = "backprojection",
                                .geometry = &r->geometry,
                                .format = r->format,
                                .band_hz = {r->band_hz[0], r->band_hz[1]},
                                .gate_m = {r->gate_m[0], r->gate_m[1]},
                                .grid = r->grid,
                                .pool = pool,
                                .options = &options};
    assert_int_equal(imager_create(&im, &cfg, NULL), 0);
    return im;
}

static float *image_of(const struct rig *r, const struct scatterer *points,
                       size_t n_points, double coherence)
{
    float *image = malloc(grid_size(&r->grid) * sizeof *image);
    struct pool *pool;
    assert_non_null(image);
    assert_int_equal(pool_create(&pool, 2), 0);
    struct imager *im = imager_of(r, pool, coherence);
    rig_add(r, im, points, n_points);
    imager_image(im, image);
    imager_destroy(im);
    pool_destroy(pool);
    return image;
}

static float *noise_image(const struct rig *r, double coherence)
{
    unsigned long long seed = 21;
    size_t n = r->geometry.n_microphones * r->format.n_samples;
    float complex *traces = malloc(n * sizeof *traces);
    float *image = malloc(grid_size(&r->grid) * sizeof *image);
    struct pool *pool;
    assert_true(traces && image);
    assert_int_equal(pool_create(&pool, 1), 0);
    struct imager *im = imager_of(r, pool, coherence);
    for (size_t k = 0; k < r->geometry.n_positions; k++) {
        for (size_t j = 0; j < r->geometry.n_speakers; j++) {
            for (size_t q = 0; q < n; q++)
                traces[q] = (float complex)(reference_random(&seed) - 0.5 +
                                            I * (reference_random(&seed) - 0.5));
            assert_true(imager_add(im, k, j, traces, NULL));
        }
    }
    imager_image(im, image);
    imager_destroy(im);
    pool_destroy(pool);
    free(traces);
    return image;
}

static void expect_dark(const struct rig *r, size_t n_voxels)
{
    float *image = noise_image(r, 0.0);
    for (size_t v = 0; v < n_voxels; v++)
        assert_near(image[v], 0.0, 0.0);
    free(image);
}

static void nothing_is_seen_before_the_gate(void **state)
{
    (void)state;
    for (size_t n_positions = 15; n_positions <= 16; n_positions++) {
        struct rig r;
        rig_default(&r);
        set_positions(&r, n_positions);
        r.gate_m[0] = 1.1;
        /* Half paths to the 6 nearer planes are below hypot(1.0, 0.22, 0.26) = 1.06. */
        rig_look_at(&r, 0.0, 0.0, 1.1, 9, 0.02);
        r.grid.origin_m[2] = 0.9;
        expect_dark(&r, 81 * 6);
        r.grid.origin_m[2] = 1.2;
        float *image = noise_image(&r, 0.0);
        for (size_t v = 0; v < 729; v++)
            assert_true(image[v] > 0.0f);
        free(image);
    }
}

static void nothing_is_seen_outside_the_traces(void **state)
{
    (void)state;
    for (size_t n_positions = 15; n_positions <= 16; n_positions++) {
        struct rig r;
        rig_default(&r);
        set_positions(&r, n_positions);
        rig_listen(&r, 0.9, 1.2);
        rig_look_at(&r, 0.0, 0.0, 0.6, 7, 0.02); /* before */
        expect_dark(&r, 343);
        rig_look_at(&r, 0.0, 0.0, 1.5, 7, 0.02); /* beyond */
        expect_dark(&r, 343);
    }
}

static void a_volume_around_the_array_leaves_numbers(void **state)
{
    (void)state;
    struct rig r;
    rig_default(&r);
    r.format.t0_s = 0.0;
    r.gate_m[0] = 0.0;
    rig_look_at(&r, 0.0, 0.0, 0.0, 7, 0.03); /* some voxels are elements */
    float *image = noise_image(&r, 0.0);
    for (size_t v = 0; v < 343; v++)
        assert_true(isfinite(image[v]));
    free(image);
}

/* -- against the definition, in double --------------------------------------------------
 */

struct expected { /* of one voxel, pairs weighted as they are numbered */
    double complex sum;
    double power, weights;
};

/* Pairs of one speaker and one microphone place count 1 / (pairs with their midpoint). */
static double weight_of(const struct rig *r, size_t pair, size_t position)
{
    double n = 0.0, s[3], m[3], other_s[3], other_m[3];
    geometry_speaker(&r->geometry, position, pair / 4, s);
    geometry_microphone(&r->geometry, position, 0, pair % 4, m);
    for (size_t q = 0; q < r->geometry.n_positions * 16; q++) {
        bool same = true;
        geometry_speaker(&r->geometry, q / 16, q / 4 % 4, other_s);
        geometry_microphone(&r->geometry, q / 16, 0, q % 4, other_m);
        for (int a = 0; a < 3; a++)
            same = same && fabs(s[a] + m[a] - other_s[a] - other_m[a]) < 1e-6;
        n += same;
    }
    return 1.0 / n;
}

static void expect_sums(const struct rig *r, const struct scatterer *points,
                        size_t n_points, const double *weights, const double voxel[3],
                        struct expected *out)
{
    memset(out, 0, sizeof *out);
    for (size_t q = 0; q < r->geometry.n_positions * 16; q++) {
        double complex x = 0.0;
        double s[3], m[3];
        geometry_speaker(&r->geometry, q / 16, q / 4 % 4, s);
        geometry_microphone(&r->geometry, q / 16, 0, q % 4, m);
        double t = (reference_distance(s, voxel) + reference_distance(m, voxel)) / 343.0;
        for (size_t p = 0; p < n_points; p++) {
            double r_s = reference_distance(s, points[p].at_m);
            double r_m = reference_distance(m, points[p].at_m);
            x += points[p].gain / (r_s * r_m) *
                 reference_echo(r->band_hz, 11000.0, (r_s + r_m) / 343.0, t);
        }
        x *= cexp(2.0 * M_PI * I * 11000.0 * t);
        out->sum += weights[q] * x;
        out->power += weights[q] * creal(x * conj(x));
        out->weights += weights[q];
    }
}

static void voxel_at(const struct grid *g, size_t v, double out[3])
{
    const size_t at[3] = {v % g->n[0], v / g->n[0] % g->n[1], v / (g->n[0] * g->n[1])};
    for (int a = 0; a < 3; a++)
        out[a] = g->origin_m[a] + g->step_m[a] * (double)at[a];
}

/* Worst difference of amplitudes over the largest, in dB, up to one factor. */
static double error_db(size_t n_positions, double step_m, double coherence)
{
    static const struct scatterer points[3] = {{{0.03, -0.02, 1.1}, 1.0},
                                               {{-0.05, 0.06, 1.13}, -0.7},
                                               {{0.01, 0.04, 1.07}, 0.5}};
    struct rig r;
    rig_default(&r);
    set_positions(&r, n_positions);
    rig_listen(&r, 0.7, 2.0);
    rig_look_at(&r, 0.0, 0.01, 1.1, 9, step_m);
    float *image = image_of(&r, points, 3, coherence);
    double *weights = malloc(n_positions * 16 * sizeof *weights);
    double exact[729], ab = 0.0, bb = 0.0, largest = 0.0, worst = 0.0;
    assert_non_null(weights);
    for (size_t q = 0; q < n_positions * 16; q++)
        weights[q] = weight_of(&r, q % 16, q / 16);
    for (size_t v = 0; v < 729; v++) {
        struct expected e;
        double at[3];
        voxel_at(&r.grid, v, at);
        expect_sums(&r, points, 3, weights, at, &e);
        double sum2 = creal(e.sum * conj(e.sum));
        exact[v] = at[2] * sqrt(sum2 * pow(sum2 / (e.weights * e.power), coherence));
        ab += exact[v] * sqrt(image[v]);
        bb += image[v];
        largest = fmax(largest, exact[v]);
    }
    for (size_t v = 0; v < 729; v++)
        worst = worse(worst, fabs(sqrt(image[v]) * ab / bb - exact[v]));
    free(weights);
    free(image);
    return 20.0 * log10(worst / largest);
}

static void the_worst_voxel_is_within_40_db_of_double_precision(void **state)
{
    (void)state;
    assert_below(error_db(11, 0.011, 0.0), -40.0); /* any geometry */
    assert_below(error_db(16, 0.02, 0.0), -40.0);  /* scans */
    assert_below(error_db(19, 0.01, 0.0), -40.0);
    assert_below(error_db(33, 0.04, 0.0), -40.0);
}

/* -- coherence --------------------------------------------------------------------------
 */

static void so_it_is_with_the_coherence_factor(void **state)
{
    (void)state;
    static const double exponents[3] = {0.5, 1.0, 2.0};
    for (int q = 0; q < 3; q++) {
        assert_below(error_db(11, 0.011, exponents[q]), -40.0);
        assert_below(error_db(17, 0.02, exponents[q]), -40.0);
    }
}

/* Its pairs differ by spreading alone: by 1 part in 50 at 2 m, so the factor is 1 to
 * their variance. */
static void a_lone_point_keeps_its_peak(void **state)
{
    (void)state;
    static const size_t n_positions[2] = {11, 16};
    const struct scatterer point = {{0.01, -0.02, 2.0}, 1.0};
    for (int q = 0; q < 2; q++) {
        struct rig r;
        rig_default(&r);
        set_positions(&r, n_positions[q]);
        r.gate_m[1] = 2.5;
        rig_listen(&r, 1.7, 2.4);
        rig_look_at(&r, 0.01, -0.02, 2.0, 5, 0.01);
        float *off = image_of(&r, &point, 1, 0.0), *on = image_of(&r, &point, 1, 1.0);
        assert_near(on[62] / off[62], 1.0, 0.01); /* the voxel in the middle */
        for (size_t v = 0; v < 125; v++)
            assert_true(on[v] <= off[v]);
        free(off);
        free(on);
    }
}

/* Of pairs that have nothing in common, |sum w x|^2 is sum w^2 |x|^2 on average: the
 * factor is sum w^2 / (sum w)^2, 1 / N for equal weights. */
static void noise_is_attenuated_by_the_number_of_pairs(void **state)
{
    (void)state;
    static const size_t n_positions[2] = {11, 16};
    for (int q = 0; q < 2; q++) {
        struct rig r;
        rig_default(&r);
        set_positions(&r, n_positions[q]);
        rig_look_at(&r, 0.0, 0.0, 1.1, 9, 0.04);
        double sums[2] = {0.0, 0.0}, squares = 0.0;
        float *off = noise_image(&r, 0.0), *on = noise_image(&r, 1.0);
        for (size_t v = 0; v < 729; v++) {
            sums[0] += off[v];
            sums[1] += on[v];
        }
        for (size_t p = 0; p < 16 * n_positions[q]; p++)
            squares += pow(weight_of(&r, p % 16, p / 16), 2.0);
        double cells = 10.0 * (double)n_positions[q];
        /* |sum|^2 is exponential: its mean square is twice its squared mean. */
        assert_near(sums[1] / sums[0] / (2.0 * squares / (cells * cells)), 1.0, 0.2);
        free(off);
        free(on);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_is_where_it_is),
        cmocka_unit_test(so_is_one_at_half_a_metre),
        cmocka_unit_test(an_array_that_is_not_plane_images_too),
        cmocka_unit_test(each_voxel_sums_every_pair_at_its_own_delay),
        cmocka_unit_test(the_number_of_threads_does_not_change_a_bit),
        cmocka_unit_test(midpoints_that_agree_to_a_nanometre_are_one),
        cmocka_unit_test(nothing_is_seen_before_the_gate),
        cmocka_unit_test(nothing_is_seen_outside_the_traces),
        cmocka_unit_test(a_volume_around_the_array_leaves_numbers),
        cmocka_unit_test(the_worst_voxel_is_within_40_db_of_double_precision),
        cmocka_unit_test(so_it_is_with_the_coherence_factor),
        cmocka_unit_test(a_lone_point_keeps_its_peak),
        cmocka_unit_test(noise_is_attenuated_by_the_number_of_pairs),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
