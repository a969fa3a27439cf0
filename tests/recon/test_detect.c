/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <complex.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "recon/detection/detect.h"
#include "recon/detection/peak.h"
#include "tests/recon/reference.h"

#define N      36
#define VOXELS ((size_t)N * N * N)
#define MAX    16

static const struct grid grid = {{-0.35, -0.2, 0.9}, {0.02, 0.02, 0.01}, {N, N, N}};

struct scene {
    float complex *amplitude; /* [VOXELS] */
    float *volume;
    struct detect_config cfg;
    struct detection found[MAX];
    size_t n;
};

static float complex *noise; /* [VOXELS], made once */

/* Running sums along one axis of a cube, with the shape of a point's image. */
static void smooth(const float complex *in, size_t stride, float complex *out)
{
    double power = 0.0;
    for (int k = -5; k <= 5; k++)
        power += exp(-(double)(k * k) / (1.5 * 1.5));
    for (size_t v = 0; v < VOXELS; v++) {
        size_t line = v / stride % N;
        double complex sum = 0.0;
        for (int k = -5; k <= 5; k++) {
            size_t from = (line + N + (size_t)k) % N; /* the cube is its own neighbour */
            sum += exp(-0.5 * k * k / (1.5 * 1.5)) *
                   in[v - line * stride + from * stride];
        }
        out[v] = (float complex)(sum / sqrt(power));
    }
}

/* Complex Gaussian noise of power 1, so that its intensity is exponentially distributed,
 * as smooth as the image of a point. */
static int make_noise(void **state)
{
    (void)state;
    unsigned long long seed = 31;
    float complex *a = malloc(VOXELS * sizeof *a), *b = malloc(VOXELS * sizeof *b);
    if (!a || !b) {
        free(a);
        free(b);
        return -1;
    }
    for (size_t v = 0; v < VOXELS; v++)
        a[v] = (float complex)(sqrt(-log(reference_random(&seed))) *
                               cexp(2.0 * M_PI * I * reference_random(&seed)));
    smooth(a, 1, b);
    smooth(b, N, a);
    smooth(a, (size_t)N * N, b);
    free(a);
    noise = b;
    return 0;
}

static int forget_noise(void **state)
{
    (void)state;
    free(noise);
    return 0;
}

static void scene_open(struct scene *s, bool noisy)
{
    memset(s, 0, sizeof *s);
    s->amplitude = calloc(VOXELS, sizeof *s->amplitude);
    s->volume = calloc(VOXELS, sizeof *s->volume);
    assert_true(s->amplitude && s->volume);
    detect_config_default(&s->cfg);
    if (noisy)
        memcpy(s->amplitude, noise, VOXELS * sizeof *noise);
}

static void scene_close(struct scene *s)
{
    free(s->amplitude);
    free(s->volume);
}

/* A box of size_m (0: a point) seen with a Gaussian of sigma 1.5 voxels, which is half as
 * strong at the box's faces. */
static void add_object(struct scene *s, const double at_m[3], const double size_m[3],
                       double level_db)
{
    for (size_t v = 0; v < VOXELS; v++) {
        const size_t i[3] = {v % N, v / N % N, v / (N * N)};
        double sum = pow(10.0, 0.05 * level_db);
        for (int a = 0; a < 3; a++) {
            double sigma_m = 1.5 * M_SQRT2 * grid.step_m[a]; /* of the amplitude */
            double d = grid.origin_m[a] + grid.step_m[a] * (double)i[a] - at_m[a];
            double half = 0.5 * size_m[a];
            if (half > 0.0)
                sum *= 0.5 * (erf((d + half) / (M_SQRT2 * sigma_m)) -
                              erf((d - half) / (M_SQRT2 * sigma_m)));
            else
                sum *= exp(-0.5 * d * d / (sigma_m * sigma_m));
        }
        s->amplitude[v] += (float)sum;
    }
}

static void add_point(struct scene *s, double x, double y, double z, double level_db)
{
    const double at_m[3] = {x, y, z}, size_m[3] = {0};
    add_object(s, at_m, size_m, level_db);
}

/* Positive definite by its leading minors. */
static void expect_covariance(const double c[6])
{
    double det = c[0] * (c[3] * c[5] - c[4] * c[4]) - c[1] * (c[1] * c[5] - c[4] * c[2]) +
                 c[2] * (c[1] * c[4] - c[3] * c[2]);
    for (int q = 0; q < 6; q++)
        assert_true(isfinite(c[q]));
    assert_true(c[0] > 0.0 && c[0] * c[3] > c[1] * c[1] && det > 0.0);
}

static void search(struct scene *s, double scale)
{
    for (size_t v = 0; v < VOXELS; v++) {
        double a = cabs(s->amplitude[v]);
        s->volume[v] = (float)(scale * a * a);
    }
    assert_int_equal(detect_objects(&s->cfg, &grid, s->volume, s->found, MAX, &s->n), 0);
    for (size_t d = 0; d < s->n; d++) {
        const struct detection *o = &s->found[d];
        expect_covariance(o->covariance_m2);
        assert_true(isfinite(o->level_db));
        assert_true(o->existence >= 0.0 && o->existence <= 1.0);
        if (d > 0)
            assert_true(o->level_db <= s->found[d - 1].level_db);
        for (int a = 0; a < 3; a++) {
            assert_true(isfinite(o->position_m[a]));
            assert_true(o->extent_m[a] >= 0.0);
        }
    }
}

static const double places[3][3] = {
    {-0.213, 0.107, 1.0037}, {0.141, -0.052, 1.1512}, {0.0523, 0.3131, 1.0821}};

static void expect_at(const struct detection *d, const double at_m[3], double voxels)
{
    for (int a = 0; a < 3; a++)
        assert_near(d->position_m[a], at_m[a], voxels * grid.step_m[a]);
}

static void points_are_found_between_the_voxels_strongest_first(void **state)
{
    (void)state;
    static const double levels_db[3] = {40.0, 37.0, 33.0};
    struct scene s;
    scene_open(&s, true);
    for (int q = 2; q >= 0; q--)
        add_point(&s, places[q][0], places[q][1], places[q][2], levels_db[q]);
    search(&s, 1.0);
    assert_int_equal(s.n, 3);
    for (int q = 0; q < 3; q++) {
        expect_at(&s.found[q], places[q], 0.2);
        assert_near(s.found[q].level_db, levels_db[q], 1.6);
        assert_true(s.found[q].existence > 0.8);
        for (int a = 0; a < 3; a++)
            assert_near(s.found[q].extent_m[a], 0.0, 0.0);
    }
    scene_close(&s);
}

/* Three and a half sigma of what the covariance says hold the truth. */
static void the_covariance_holds_the_error(void **state)
{
    (void)state;
    static const int diagonal[3] = {0, 3, 5};
    for (int level = 16; level <= 40; level += 8) {
        struct scene s;
        scene_open(&s, true);
        add_point(&s, places[1][0], places[1][1], places[1][2], level);
        search(&s, 1.0);
        assert_int_equal(s.n, 1);
        for (int a = 0; a < 3; a++)
            assert_near(s.found[0].position_m[a], places[1][a],
                        3.5 * sqrt(s.found[0].covariance_m2[diagonal[a]]));
        scene_close(&s);
    }
}

static void noise_alone_has_no_objects(void **state)
{
    (void)state;
    struct scene s;
    scene_open(&s, true);
    search(&s, 1.0);
    assert_int_equal(s.n, 0);
    scene_close(&s);
}

static void what_is_under_the_threshold_is_left_out(void **state)
{
    (void)state;
    struct scene s;
    scene_open(&s, true);
    add_point(&s, places[0][0], places[0][1], places[0][2], 22.0);
    s.cfg.threshold_db = 25.0;
    search(&s, 1.0);
    assert_int_equal(s.n, 0);
    s.cfg.threshold_db = 19.0;
    search(&s, 1.0);
    assert_int_equal(s.n, 1);
    scene_close(&s);
}

/* As strong, it counts when nothing outshines it. */
static void what_is_outshone_is_left_out(void **state)
{
    (void)state;
    struct scene s;
    scene_open(&s, true);
    s.cfg.dynamic_range_db = 15.0;
    add_point(&s, places[1][0], places[1][1], places[1][2], 24.0);
    search(&s, 1.0);
    assert_int_equal(s.n, 1);
    add_point(&s, places[0][0], places[0][1], places[0][2], 42.0);
    search(&s, 1.0);
    assert_int_equal(s.n, 1);
    expect_at(&s.found[0], places[0], 0.2);
    s.cfg.dynamic_range_db = 22.0;
    search(&s, 1.0);
    assert_int_equal(s.n, 2);
    scene_close(&s);
}

static void what_lies_close_together_is_one_object(void **state)
{
    (void)state;
    static const double cluster_m[2] = {0.25, 0.04};
    for (int q = 0; q < 2; q++) {
        struct scene s;
        scene_open(&s, true);
        add_point(&s, -0.1, 0.1, 1.05, 36.0);
        add_point(&s, 0.14, 0.1, 1.05, 35.0);
        s.cfg.cluster_m = cluster_m[q];
        search(&s, 1.0);
        assert_int_equal(s.n, q + 1);
        scene_close(&s);
    }
}

static void expect_plate(bool known_resolution)
{
    const double at_m[3] = {0.013, 0.148, 1.08}, size_m[3] = {0.36, 0.24, 0.0};
    struct scene s;
    scene_open(&s, true);
    for (int a = 0; known_resolution && a < 3;
         a++) /* a factor of 4 of exp(-d^2 / 2 s^2) */
        s.cfg.resolution_m[a] = 2.0 * sqrt(2.0 * log(4.0)) * 1.5 * grid.step_m[a];
    add_object(&s, at_m, size_m, 36.0);
    search(&s, 1.0);
    assert_int_equal(s.n, 1);
    expect_at(&s.found[0], at_m, 1.0);
    for (int a = 0; a < 2; a++)
        assert_near(s.found[0].extent_m[a], size_m[a], 2.0 * grid.step_m[a]);
    assert_true(s.found[0].extent_m[2] < 8.0 * grid.step_m[2]);
    scene_close(&s);
}

static void a_plate_has_a_middle_and_a_size(void **state)
{
    (void)state;
    expect_plate(true);
}

/* Its own even top says nothing of how wide a point would be. */
static void so_it_has_when_the_resolution_must_be_estimated(void **state)
{
    (void)state;
    expect_plate(false);
}

static void existence_grows_with_the_level(void **state)
{
    (void)state;
    double before = 0.0;
    size_t seen = 0;
    for (int level = 14; level <= 34; level += 2) {
        struct scene s;
        scene_open(&s, true);
        add_point(&s, places[1][0], places[1][1], places[1][2], level);
        s.cfg.threshold_db = 11.0;
        search(&s, 1.0);
        for (size_t d = 0; d < s.n; d++) {
            if (reference_distance(s.found[d].position_m, places[1]) > 0.05)
                continue;
            assert_true(s.found[d].existence >= before - 1e-9);
            before = s.found[d].existence;
            seen++;
        }
        scene_close(&s);
    }
    assert_true(seen >= 9);
    assert_true(before > 0.99);
}

static void what_noise_makes_hardly_exists(void **state)
{
    (void)state;
    struct scene s;
    scene_open(&s, true);
    s.cfg.threshold_db = 6.0;
    search(&s, 1.0);
    assert_true(s.n > 0);
    for (size_t d = 0; d < s.n; d++)
        assert_true(s.found[d].existence < 0.5);
    scene_close(&s);
}

static void the_fainter_of_several_exist_less_surely(void **state)
{
    (void)state;
    static const double levels_db[3] = {44.0, 36.0, 28.0};
    struct scene s;
    scene_open(&s, true);
    s.cfg.dynamic_range_db = 20.0;
    for (int q = 0; q < 3; q++)
        add_point(&s, places[q][0], places[q][1], places[q][2], levels_db[q]);
    search(&s, 1.0);
    assert_int_equal(s.n, 3);
    for (int q = 1; q < 3; q++)
        assert_true(s.found[q].existence <= s.found[q - 1].existence);
    assert_true(s.found[2].existence < s.found[0].existence);
    scene_close(&s);
}

static void no_more_than_asked_for_are_written(void **state)
{
    (void)state;
    struct scene s;
    struct detection two[3];
    size_t n = 99;
    scene_open(&s, true);
    for (int q = 0; q < 3; q++)
        add_point(&s, places[q][0], places[q][1], places[q][2], 40.0 - 3.0 * q);
    search(&s, 1.0);
    assert_int_equal(s.n, 3);
    memset(two, 0x5a, sizeof two);
    assert_int_equal(detect_objects(&s.cfg, &grid, s.volume, two, 2, &n), 0);
    assert_int_equal(n, 2);
    expect_at(&two[0], places[0], 0.3);
    expect_at(&two[1], places[1], 0.3);
    assert_int_equal(((unsigned char *)&two[2])[0], 0x5a);
    assert_int_equal(detect_objects(&s.cfg, &grid, s.volume, NULL, 0, &n), 0);
    assert_int_equal(n, 0);
    scene_close(&s);
}

static void the_scale_of_the_intensity_does_not_matter(void **state)
{
    (void)state;
    static const double scales[2] = {1e-24, 1e24};
    struct scene s;
    scene_open(&s, true);
    add_point(&s, places[0][0], places[0][1], places[0][2], 38.0);
    for (int q = 0; q < 2; q++) {
        search(&s, scales[q]);
        assert_int_equal(s.n, 1);
        expect_at(&s.found[0], places[0], 0.2);
        assert_near(s.found[0].level_db, 38.0, 1.6);
    }
    scene_close(&s);
}

static void without_noise_there_are_numbers_too(void **state)
{
    (void)state;
    struct scene s;
    scene_open(&s, false);
    add_point(&s, places[2][0], places[2][1], places[2][2], 0.0);
    search(&s, 1.0);
    assert_int_equal(s.n, 1);
    expect_at(&s.found[0], places[2], 0.05);
    assert_true(s.found[0].existence > 0.99);
    scene_close(&s);
}

static void a_lone_bright_voxel_is_a_point_there(void **state)
{
    (void)state;
    struct scene s;
    scene_open(&s, false);
    s.amplitude[(7 * N + 8) * N + 9] = 3.0f;
    search(&s, 1.0);
    assert_int_equal(s.n, 1);
    assert_near(s.found[0].position_m[0], -0.35 + 9 * 0.02, 1e-9);
    assert_near(s.found[0].position_m[1], -0.2 + 8 * 0.02, 1e-9);
    assert_near(s.found[0].position_m[2], 0.9 + 7 * 0.01, 1e-9);
    scene_close(&s);
}

/* Two points 4 cm apart, one of them between two voxels along the diagonal. */
static void isolated_points_are_joined_where_they_touch_alone(void **state)
{
    (void)state;
    struct scene s;
    scene_open(&s, false);
    s.amplitude[(7 * N + 8) * N + 9] = 3.0f;
    s.amplitude[(8 * N + 9) * N + 10] = 2.0f;
    s.amplitude[(7 * N + 8) * N + 12] = 2.9f;
    search(&s, 1.0);
    assert_int_equal(s.n, 1);
    detect_config_method(&s.cfg, "sparse", &grid);
    search(&s, 1.0);
    assert_int_equal(s.n, 2);
    assert_near(s.found[0].position_m[0], -0.35 + 9 * 0.02, 0.011);
    assert_near(s.found[1].position_m[0], -0.35 + 12 * 0.02, 1e-9);
    const double share = 4.0 /
                         (9.0 + 4.0); /* of the power, that is in the second voxel */
    assert_near(s.found[0].middle_m[0], -0.35 + (9 + share) * 0.02, 1e-6);
    assert_near(s.found[0].middle_m[2], 0.9 + (7 + share) * 0.01, 1e-6);
    assert_near(s.found[1].middle_m[0], -0.35 + 12 * 0.02, 1e-6);
    scene_close(&s);
}

static const int diagonal[3] = {0, 3, 5};

static void expect_known(const struct detection *d, int axis, bool known)
{
    double sigma_m = sqrt(d->covariance_m2[diagonal[axis]]);

    if (known)
        assert_below(sigma_m, grid.step_m[axis]);
    else
        assert_near(sigma_m, PEAK_UNKNOWN_M, 1e-3);
}

/* At a border: of the axes that end there nothing is known, of the others as much as a
 * point's image (amplitudes of 1.5 steps, one sigma) or what is seen of a body is wide;
 * but beside an end in depth as much as the front of an echo, a sphere, is wide where it
 * has come back by a point's four voxels. */
static void expect_known_beside(const struct detection *d, const double seen_m[3])
{
    double range_m = hypot(hypot(d->position_m[0], d->position_m[1]), d->position_m[2]);
    double front_m = sqrt(2.0 * range_m * 4.0 * grid.step_m[2]);
    bool depth = d->at_border & (PEAK_BORDER(2, 0) | PEAK_BORDER(2, 1));

    for (int a = 0; a < 3; a++) {
        double sigma_m = sqrt(d->covariance_m2[diagonal[a]]);
        bool open = d->at_border & (PEAK_BORDER(a, 0) | PEAK_BORDER(a, 1));
        double least_m = seen_m[a] > 0.0 ? seen_m[a] / sqrt(12.0)
                                         : 1.5 * M_SQRT1_2 * grid.step_m[a];
        bool exact = seen_m[a] > 0.0 || (a < 2 && depth); /* whatever the noise is */
        if (a < 2 && depth)
            least_m = hypot(least_m, front_m);
        if (open)
            assert_near(sigma_m, PEAK_UNKNOWN_M, 1e-3);
        else
            assert_true(sigma_m > (exact ? 0.95 : 0.8) * least_m &&
                        sigma_m < (exact ? 1.1 : 1.6) * least_m);
    }
}

static const double point_m[3] = {0.0, 0.0, 0.0};

static void a_peak_on_the_rim_is_found_there(void **state)
{
    (void)state;
    static const int corners[4][3] = {
        {0, 0, 0}, {N - 1, N - 1, N - 1}, {0, 20, N - 1}, {17, 0, 9}};
    for (int q = 0; q < 4; q++) {
        struct scene s;
        double at_m[3];
        scene_open(&s, true);
        for (int a = 0; a < 3; a++)
            at_m[a] = grid.origin_m[a] + grid.step_m[a] * corners[q][a];
        add_point(&s, at_m[0], at_m[1], at_m[2], 38.0);
        search(&s, 1.0);
        assert_int_equal(s.n, 1);
        expect_at(&s.found[0], at_m, 0.2);
        for (int a = 0; a < 3; a++)
            assert_int_equal(!!(s.found[0].at_border & (3u << 2 * a)),
                             corners[q][a] == 0 || corners[q][a] == N - 1);
        expect_known_beside(&s.found[0], point_m);
        scene_close(&s);
    }
}

/* What shows at the border is the flank of something that stands 3 cm outside: its error
 * there is in no relation to the noise. */
static void
what_lies_outside_is_not_known_along_the_axis_that_it_is_outside_of(void **state)
{
    (void)state;
    for (int q = 0; q < 6; q++) {
        int axis = q / 2, far = q % 2;
        struct scene s;
        double at_m[3] = {0.0, 0.15, 1.05};
        scene_open(&s, true);
        at_m[axis] = far ? grid.origin_m[axis] + grid.step_m[axis] * (N - 1) + 0.03
                         : grid.origin_m[axis] - 0.03;
        add_point(&s, at_m[0], at_m[1], at_m[2], 45.0);
        search(&s, 1.0);
        assert_int_equal(s.n, 1);
        assert_int_equal(s.found[0].at_border, PEAK_BORDER(axis, far));
        for (int a = 0; a < 3; a++) {
            double sigma_m = sqrt(s.found[0].covariance_m2[diagonal[a]]);
            assert_below(fabs(s.found[0].position_m[a] - at_m[a]), 4.0 * sigma_m);
        }
        expect_known_beside(&s.found[0], point_m);
        scene_close(&s);
    }
}

/* The image ends with the gate; behind it is nothing. */
static void what_lies_behind_the_gate_is_not_known_in_depth(void **state)
{
    (void)state;
    struct scene s;
    scene_open(&s, true);
    add_point(&s, 0.0, 0.15, grid.origin_m[2] + grid.step_m[2] * 30.0, 45.0);
    for (size_t v = 0; v < VOXELS; v++)
        if (v / (N * N) > 28)
            s.amplitude[v] = 0.0f;
    search(&s, 1.0);
    assert_int_equal(s.n, 1);
    assert_int_equal(s.found[0].at_border, PEAK_BORDER(2, 1));
    expect_known_beside(&s.found[0], point_m);
    scene_close(&s);
}

static void a_plate_that_goes_on_outside_has_no_known_middle_there(void **state)
{
    (void)state;
    static const double size_m[3] = {0.3, 0.2, 0.0};
    struct scene s;
    const double at_m[3] = {grid.origin_m[0] + 0.05, 0.15, 1.05};
    scene_open(&s, true);
    s.cfg.cluster_m = 0.2;
    add_object(&s, at_m, size_m, 45.0);
    search(&s, 1.0);
    assert_int_equal(s.n, 1);
    assert_int_equal(s.found[0].at_border, PEAK_BORDER(0, 0));
    expect_known_beside(&s.found[0], s.found[0].extent_m);
    scene_close(&s);
}

/* Of a method that has no negative values: what lies within the volume does not end where
 * its image is less than nothing beside it; where there is nothing up to the end, it may.
 */
/* A Gaussian is 6 dB down at 3.33 of its sigma, here of 1.5 voxels; of that a twentieth,
 * whatever the noise lets know. */
static void a_place_in_an_image_of_power_is_known_to_a_part_of_its_width(void **state)
{
    (void)state;
    double variance_m2[2][3];

    for (int power = 0; power <= 1; power++) {
        struct scene s;
        scene_open(&s, true);
        s.cfg.clipped = power;
        add_point(&s, places[0][0], places[0][1], places[0][2], 60.0);
        search(&s, 1.0);
        assert_int_equal(s.n, 1);
        for (int a = 0; a < 3; a++)
            variance_m2[power][a] = s.found[0].covariance_m2[diagonal[a]];
        scene_close(&s);
    }
    for (int a = 0; a < 3; a++) {
        double more_m = sqrt(variance_m2[1][a] - variance_m2[0][a]);
        assert_near(more_m / grid.step_m[a], 0.05 * 3.3302 * 1.5, 0.02);
    }
}

static void what_is_clipped_beside_a_point_is_no_border(void **state)
{
    (void)state;
    for (int q = 0; q < 4; q++) { /* the point is in plane 15 */
        const double at_m[3] = {0.0, 0.15, 1.05};
        size_t plane = q % 2 ? 16 : 14, last = q % 2 ? N - 1 : 0;
        bool ends = q / 2;
        struct scene s;
        scene_open(&s, true);
        detect_config_method(&s.cfg, "paper", &grid);
        add_point(&s, at_m[0], at_m[1], at_m[2], 45.0);
        for (size_t v = 0; v < VOXELS; v++) {
            size_t z = v / (N * N);
            bool cut = q % 2 ? z > plane : z < plane;
            if (z == plane || (ends && cut) || (!ends && cut && z != last))
                s.amplitude[v] = 0.0f;
        }
        search(&s, 1.0);
        assert_int_equal(s.n, 1);
        const struct detection *d = &s.found[0];
        assert_int_equal(d->at_border, ends ? PEAK_BORDER(2, q % 2) : 0);
        if (ends)
            expect_known_beside(d, point_m);
        for (int a = 0; !ends && a < 3; a++) {
            expect_known(d, a, true);
            assert_below(fabs(d->position_m[a] - at_m[a]), 0.5 * grid.step_m[a]);
        }
        scene_close(&s);
    }
}

/* The gate ends in the middle of a plate that is seen from the front of a box. */
static void nor_has_what_goes_on_behind_the_gate(void **state)
{
    (void)state;
    static const double size_m[3] = {0.3, 0.2, 0.12};
    struct scene s;
    const double at_m[3] = {0.0, 0.15, grid.origin_m[2] + grid.step_m[2] * 24.0};
    scene_open(&s, true);
    s.cfg.cluster_m = 0.2;
    add_object(&s, at_m, size_m, 45.0);
    for (size_t v = 0; v < VOXELS; v++)
        if (v / (N * N) > 20)
            s.amplitude[v] = 0.0f;
    search(&s, 1.0);
    assert_int_equal(s.n, 1);
    assert_true(s.found[0].extent_m[0] > 0.0);
    assert_int_equal(s.found[0].at_border, PEAK_BORDER(2, 1));
    expect_known_beside(&s.found[0], s.found[0].extent_m);
    scene_close(&s);
}

/* 0.2 m of the plate are in the grid: of those the place is told, somewhere in them. */
static void what_is_followed_has_the_place_of_what_is_seen_of_it(void **state)
{
    (void)state;
    static const double size_m[3] = {0.3, 0.2, 0.0};
    const double at_m[3] = {grid.origin_m[0] + 0.05, 0.15, 1.05};
    const double seen_m = 0.2, uniform_m = seen_m / sqrt(12.0);
    struct scene s;

    scene_open(&s, true);
    s.cfg.cluster_m = 0.2;
    s.cfg.followed = true;
    add_object(&s, at_m, size_m, 45.0);
    search(&s, 1.0);
    assert_int_equal(s.n, 1);
    const struct detection *d = &s.found[0];
    double sigma_m = sqrt(d->covariance_m2[0]);
    assert_int_equal(d->at_border, PEAK_BORDER(0, 0));
    assert_true(sigma_m >= 0.9 * uniform_m && sigma_m < 2.0 * uniform_m);
    assert_below(fabs(d->position_m[0] - grid.origin_m[0] - 0.5 * seen_m), sigma_m);
    for (int a = 1; a < 3; a++)
        expect_known(d, a, true);
    scene_close(&s);
}

/* Noise is 10 dB louder on one side. */
static void with_cfar_each_place_has_a_threshold_of_its_own(void **state)
{
    (void)state;
    static const double width_m[3] = {0.1, 0.1, 0.05};
    const double at_m[3] = {-0.05, 0.15, 1.25};
    struct scene s;
    struct cfar *cfar;

    scene_open(&s, true);
    for (size_t v = 0; v < VOXELS; v++)
        s.amplitude[v] *= powf(10.0f, 0.5f * (float)(v % N) / (float)N);
    add_point(&s, at_m[0], at_m[1], at_m[2], 31.0);
    for (size_t v = 0; v < VOXELS; v++)
        s.volume[v] = powf(cabsf(s.amplitude[v]), 2.0f);
    for (int kind = CFAR_AVERAGING; kind <= CFAR_ORDERED; kind++) {
        assert_int_equal(detect_cfar(&cfar, kind, 1e-6, &grid, width_m), 0);
        s.cfg.cfar = cfar;
        assert_int_equal(detect_objects(&s.cfg, &grid, s.volume, s.found, MAX, &s.n), 0);
        assert_int_equal(s.n, 1);
        expect_at(&s.found[0], at_m, 0.4);
        assert_true(s.found[0].level_db > 22.0 && s.found[0].level_db < 30.0);
        assert_true(s.found[0].existence > 0.9);
        cfar_destroy(cfar);
    }
    scene_close(&s);
}

static void a_box_is_extended_and_a_point_a_point(void **state)
{
    (void)state;
    static const double width_m[3] = {0.1, 0.1, 0.05};
    const double box_at[3] = {-0.1, 0.1, 1.0}, size_m[3] = {0.2, 0.2, 0.1};
    struct scene s;

    scene_open(&s, false);
    add_object(&s, box_at, size_m, 30.0);
    add_point(&s, 0.2, 0.3, 1.2, 30.0);
    memcpy(s.cfg.resolution_m, width_m, sizeof width_m);
    search(&s, 1.0);
    assert_int_equal(s.n, 2);
    for (size_t i = 0; i < 2; i++) {
        bool box = s.found[i].position_m[2] < 1.1;
        assert_int_equal(s.found[i].shape.shape, box ? SHAPE_EXTENDED : SHAPE_POINT);
        assert_true(s.found[i].shape.probability > 0.7);
    }
    scene_close(&s);
}

static void expect_nothing(const struct grid *g, float value)
{
    struct detect_config cfg;
    struct detection found[MAX];
    size_t n = 99;
    float *volume = malloc(grid_size(g) * sizeof *volume);
    assert_non_null(volume);
    for (size_t v = 0; v < grid_size(g); v++)
        volume[v] = value;
    detect_config_default(&cfg);
    assert_int_equal(detect_objects(&cfg, g, volume, found, MAX, &n), 0);
    assert_int_equal(n, 0);
    free(volume);
}

static void an_even_volume_has_no_objects(void **state)
{
    (void)state;
    const struct grid one = {{0.0, 0.0, 1.0}, {0.01, 0.01, 0.01}, {1, 1, 1}};
    const struct grid column = {{0.0, 0.0, 1.0}, {0.01, 0.01, 0.01}, {1, 1, 9}};
    static const float values[4] = {0.0f, 1.0f, 1e-30f, 1e30f};
    for (int q = 0; q < 4; q++) {
        expect_nothing(&grid, values[q]);
        expect_nothing(&one, values[q]);
        expect_nothing(&column, values[q]);
    }
}

static void the_defaults_are_sane(void **state)
{
    (void)state;
    struct detect_config cfg;
    memset(&cfg, 0xff, sizeof cfg);
    detect_config_default(&cfg);
    assert_true(cfg.threshold_db > 6.0 && cfg.threshold_db < 20.0);
    assert_true(cfg.dynamic_range_db > 6.0 && cfg.dynamic_range_db <= 18.0);
    assert_true(cfg.cluster_m > 0.0 && cfg.cluster_m < 0.5);
    for (int a = 0; a < 3; a++)
        assert_near(cfg.resolution_m[a], 0.0, 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_are_found_between_the_voxels_strongest_first),
        cmocka_unit_test(the_covariance_holds_the_error),
        cmocka_unit_test(noise_alone_has_no_objects),
        cmocka_unit_test(what_is_under_the_threshold_is_left_out),
        cmocka_unit_test(what_is_outshone_is_left_out),
        cmocka_unit_test(what_lies_close_together_is_one_object),
        cmocka_unit_test(a_plate_has_a_middle_and_a_size),
        cmocka_unit_test(so_it_has_when_the_resolution_must_be_estimated),
        cmocka_unit_test(existence_grows_with_the_level),
        cmocka_unit_test(what_noise_makes_hardly_exists),
        cmocka_unit_test(the_fainter_of_several_exist_less_surely),
        cmocka_unit_test(no_more_than_asked_for_are_written),
        cmocka_unit_test(the_scale_of_the_intensity_does_not_matter),
        cmocka_unit_test(without_noise_there_are_numbers_too),
        cmocka_unit_test(a_lone_bright_voxel_is_a_point_there),
        cmocka_unit_test(isolated_points_are_joined_where_they_touch_alone),
        cmocka_unit_test(a_peak_on_the_rim_is_found_there),
        cmocka_unit_test(
            what_lies_outside_is_not_known_along_the_axis_that_it_is_outside_of),
        cmocka_unit_test(what_lies_behind_the_gate_is_not_known_in_depth),
        cmocka_unit_test(nor_has_what_goes_on_behind_the_gate),
        cmocka_unit_test(a_place_in_an_image_of_power_is_known_to_a_part_of_its_width),
        cmocka_unit_test(what_is_clipped_beside_a_point_is_no_border),
        cmocka_unit_test(a_plate_that_goes_on_outside_has_no_known_middle_there),
        cmocka_unit_test(what_is_followed_has_the_place_of_what_is_seen_of_it),
        cmocka_unit_test(with_cfar_each_place_has_a_threshold_of_its_own),
        cmocka_unit_test(a_box_is_extended_and_a_point_a_point),
        cmocka_unit_test(an_even_volume_has_no_objects),
        cmocka_unit_test(the_defaults_are_sane),
    };
    return cmocka_run_group_tests(tests, make_noise, forget_noise);
}
