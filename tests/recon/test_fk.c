/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "recon/coherent/fk.h"
#include "tests/recon/rig.h"

#define NX 8
#define NY 10
#define C  343.0

#define GAIN_POWER 0.5 /* plane waves are weighted by kz to this power */

struct site {
    double x_m[NX], y_m[NY];
    struct fk_config cfg;
    struct rig rig; /* its grid, band and format */
    float weight[NX * NY];
};

static void site_default(struct site *s)
{
    rig_default(&s->rig);
    for (size_t q = 0; q < NX; q++)
        s->x_m[q] = 0.04 * ((double)q - 3.5);
    for (size_t q = 0; q < NY; q++)
        s->y_m[q] = 0.03 * ((double)q - 4.5);
    for (size_t q = 0; q < NX * NY; q++)
        s->weight[q] = 1.0f;
    s->rig.format.rate_hz = 21600.0;
    rig_listen(&s->rig, 0.7, 1.75);
    s->cfg = (struct fk_config){
        .sound_speed_m_s = C,
        .nx = NX,
        .ny = NY,
        .x_m = s->x_m,
        .y_m = s->y_m,
        .band_hz = {2000.0, 20000.0},
    };
}

/* What co-located pairs hear, fading as 1 / r. */
static float complex *listen(const struct site *s, const struct scatterer *points,
                             size_t n_points)
{
    const struct trace_format *f = &s->rig.format;
    size_t cells = s->cfg.nx * s->cfg.ny;
    float complex *gather = calloc(cells * f->n_samples, sizeof *gather);
    assert_non_null(gather);
    for (size_t q = 0; q < cells * f->n_samples; q++) {
        size_t cell = q / f->n_samples;
        const double at[3] = {s->x_m[cell / s->cfg.ny], s->y_m[cell % s->cfg.ny],
                              s->cfg.plane_z_m};
        double t = f->t0_s + (double)(q % f->n_samples) / f->rate_hz;
        double complex sum = 0.0;
        for (size_t p = 0; p < n_points; p++) {
            double r = reference_distance(at, points[p].at_m);
            sum += points[p].gain / r *
                   reference_echo(s->cfg.band_hz, f->carrier_hz, 2.0 * r / C, t);
        }
        gather[q] = (float complex)sum;
    }
    return gather;
}

static float *migrate_gather(const struct site *s, const float complex *gather,
                             size_t n_threads)
{
    struct fk_config cfg = s->cfg;
    struct fk *m;
    float *image = malloc(grid_size(&s->rig.grid) * sizeof *image);
    assert_non_null(image);
    cfg.trace = s->rig.format;
    cfg.grid = s->rig.grid;
    assert_int_equal(pool_create(&cfg.pool, n_threads), 0);
    assert_int_equal(fk_create(&m, &cfg), 0);
    fk_migrate(m, gather, s->weight, image);
    fk_destroy(m);
    pool_destroy(cfg.pool);
    return image;
}

static float *migrate(const struct site *s, const struct scatterer *points,
                      size_t n_points)
{
    float complex *gather = listen(s, points, n_points);
    float *image = migrate_gather(s, gather, 1);
    free(gather);
    return image;
}

/* Amplitudes over the grid against the integral over plane waves, summed voxel by voxel
 * in double.  They differ by the steepest angles, which migration leaves out, and by what
 * wraps around its period. */
static void expect_exact(const struct site *s, const struct scatterer *points,
                         size_t n_points)
{
    const struct grid *g = &s->rig.grid;
    float *image = migrate(s, points, n_points);
    double *exact = malloc(grid_size(g) * sizeof *exact);
    double ab = 0.0, aa = 0.0, bb = 0.0, largest = 0.0;
    assert_non_null(exact);
    for (size_t v = 0; v < grid_size(g); v++) {
        const double p[3] = {
            g->origin_m[0] + g->step_m[0] * (double)(v % g->n[0]),
            g->origin_m[1] + g->step_m[1] * (double)(v / g->n[0] % g->n[1]),
            g->origin_m[2] + g->step_m[2] * (double)(v / (g->n[0] * g->n[1]))};
        exact[v] = cabs(reference_migrated(s->cfg.band_hz, C, s->x_m, s->cfg.nx, s->y_m,
                                           s->cfg.ny, s->cfg.plane_z_m, GAIN_POWER,
                                           points, n_points, p));
        ab += exact[v] * sqrt(image[v]);
        aa += exact[v] * exact[v];
        bb += image[v];
        largest = fmax(largest, exact[v]);
    }
    assert_below(1.0 - ab / sqrt(aa * bb), 5e-3);
    for (size_t v = 0; v < grid_size(g); v++)
        assert_near(sqrt(image[v]) * sqrt(aa / bb) / largest, exact[v] / largest, 0.08);
    free(exact);
    free(image);
}

static void look(struct site *s, double x_m, double y_m, double z_m)
{
    rig_look_at(&s->rig, x_m, y_m, z_m, 7, 0.025);
    s->rig.grid.n[2] = 9;
    s->rig.grid.step_m[2] = 0.006;
    s->rig.grid.origin_m[2] = z_m - 4 * 0.006;
}

static void the_image_is_the_sum_over_all_plane_waves(void **state)
{
    (void)state;
    static const struct scatterer points[2] = {{{0.01, -0.005, 1.1}, 1.0},
                                               {{0.13, -0.11, 1.2}, 1.0}};
    for (int q = 0; q < 2; q++) {
        struct site s;
        site_default(&s);
        look(&s, points[q].at_m[0], points[q].at_m[1], points[q].at_m[2]);
        expect_exact(&s, &points[q], 1);
    }
}

/* Then most wavenumbers of the transform hold none. */
static void steps_may_be_finer_than_any_wave(void **state)
{
    (void)state;
    static const struct scatterer point = {{0.03, -0.02, 1.1}, 1.0};
    static const double steps_m[] = {0.008, 0.005, 0.0035};
    for (int q = 0; q < 3; q++) {
        struct site s;
        site_default(&s);
        look(&s, point.at_m[0], point.at_m[1], point.at_m[2]);
        for (int a = 0; a < 2; a++) {
            s.rig.grid.step_m[a] = steps_m[q];
            s.rig.grid.origin_m[a] = point.at_m[a] - 3.0 * steps_m[q];
        }
        expect_exact(&s, &point, 1);
    }
}

static void midpoints_may_stand_on_uneven_lines(void **state)
{
    (void)state;
    static const double x_m[NX] = {-0.2, -0.17, -0.1, -0.07, 0.02, 0.03, 0.11, 0.16};
    static const double y_m[NY] = {-0.2,  -0.12, -0.09, -0.04, 0.0,
                                   0.015, 0.06,  0.1,   0.11,  0.15};
    const struct scatterer points[2] = {{{0.05, 0.0, 1.1}, 1.0},
                                        {{-0.04, 0.06, 1.12}, -0.7}};
    struct site s;
    site_default(&s);
    memcpy(s.x_m, x_m, sizeof x_m);
    memcpy(s.y_m, y_m, sizeof y_m);
    look(&s, 0.0, 0.03, 1.11);
    expect_exact(&s, points, 2);
}

static void the_plane_of_the_midpoints_may_stand_anywhere(void **state)
{
    (void)state;
    const struct scatterer point = {{0.03, 0.02, 1.5}, 1.0};
    struct site s;
    site_default(&s);
    s.cfg.plane_z_m = 0.4;
    look(&s, 0.02, 0.01, 1.5);
    expect_exact(&s, &point, 1);
}

static void a_point_is_where_it_is(void **state)
{
    (void)state;
    static const double places[5][3] = {{0.0, 0.0, 1.1},
                                        {0.0137, -0.0241, 0.9531},
                                        {-0.1, 0.08, 1.3017},
                                        {0.2, 0.0, 1.2},
                                        {0.15, -0.22, 1.05}};
    for (int q = 0; q < 5; q++) {
        const double *p = places[q];
        const struct scatterer point = {{p[0], p[1], p[2]}, 1.0};
        struct site s;
        struct peak_fit fit;
        site_default(&s);
        rig_look_at(&s.rig, p[0] + 0.004, p[1] - 0.003, p[2] + 0.0017, 13, 0.012);
        s.rig.grid.step_m[2] = 0.005;
        s.rig.grid.origin_m[2] = p[2] + 0.0017 - 6 * 0.005;
        float *image = migrate(&s, &point, 1);
        rig_peak(&s.rig, image, &fit);
        free(image);
        assert_near(fit.position_m[0], p[0], 2e-3);
        assert_near(fit.position_m[1], p[1], 2e-3);
        assert_near(fit.position_m[2], p[2], 1e-3);
    }
}

/* But for a factor, and to what wraps around the periods of the two grids, which differ.
 */
static void a_coarse_grid_holds_the_fine_image_at_its_voxels(void **state)
{
    (void)state;
    const struct scatterer points[2] = {{{0.03, -0.02, 1.1}, 1.0},
                                        {{-0.06, 0.05, 1.13}, 0.8}};
    struct site s;
    site_default(&s);
    rig_look_at(&s.rig, 0.0, 0.0, 1.1, 19, 0.008);
    float *fine = migrate(&s, points, 2);
    for (int a = 0; a < 3; a++) {
        s.rig.grid.n[a] = 4;
        s.rig.grid.step_m[a] = 0.048;
    }
    float *coarse = migrate(&s, points, 2);
    double same[64], ab = 0.0, bb = 0.0, largest = 0.0;
    for (size_t v = 0; v < 64; v++) {
        same[v] = fine[(v / 16 * 6 * 19 + v / 4 % 4 * 6) * 19 + v % 4 * 6];
        ab += sqrt(same[v] * coarse[v]);
        bb += coarse[v];
    }
    for (size_t v = 0; v < 19 * 19 * 19; v++)
        largest = fmax(largest, fine[v]);
    for (size_t v = 0; v < 64; v++)
        assert_near(sqrt(coarse[v] / largest) * ab / bb, sqrt(same[v] / largest), 0.08);
    free(fine);
    free(coarse);
}

/* |a + b|^2 + |a - b|^2 = 2 |a|^2 + 2 |b|^2 holds for complex amplitudes that add. */
/* From the middle of the grid along x to a quarter of its intensity, in voxels. */
static double half_width(const struct site *s, const float *image)
{
    const struct grid *g = &s->rig.grid;
    const float *line = image + (g->n[2] / 2 * g->n[1] + g->n[1] / 2) * g->n[0];
    float level = 0.25f * line[g->n[0] / 2];
    size_t i = g->n[0] / 2;
    while (i + 1 < g->n[0] && line[i] > level)
        i++;
    return (double)(i - g->n[0] / 2) -
           (double)((level - line[i]) / (line[i - 1] - line[i]));
}

/* Of a band with Hann's window, times the power of the frequency. */
static double mean_frequency(double power)
{
    double sum = 0.0, weight = 0.0;
    for (double x = 0.005; x < 1.0; x += 0.01) {
        double f = 2.0 + 18.0 * x, w = pow(sin(M_PI * x), 2.0) * pow(f, power);
        sum += w * f;
        weight += w;
    }
    return sum / weight;
}

/* A point is as wide as waves are long, in the mean over the band. */
static void weight_on_high_sounds_makes_points_narrower(void **state)
{
    (void)state;
    static const struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
    struct site s;
    site_default(&s);
    rig_look_at(&s.rig, 0.0, 0.0, 1.1, 61, 0.002);
    float *plain = migrate(&s, &point, 1);
    s.cfg.sharpen = 2.0;
    float *sharp = migrate(&s, &point, 1);
    double expected = mean_frequency(0.5) / mean_frequency(2.5);
    assert_near(half_width(&s, sharp) / half_width(&s, plain), expected, 0.04);
    assert_below(expected, 0.9);
    struct peak_fit at;
    assert_true(rig_peak(&s.rig, sharp, &at) > 0.0f);
    assert_near(at.position_m[0], 0.0, 5e-4);
    assert_near(at.position_m[2], 1.1, 5e-4);
    free(plain);
    free(sharp);
}

static void amplitudes_superpose(void **state)
{
    (void)state;
    struct scatterer both[2] = {{{0.03, -0.02, 1.1}, 1.0}, {{-0.02, 0.01, 1.11}, 0.8}};
    struct site s;
    site_default(&s);
    look(&s, 0.0, 0.0, 1.1);
    float *a = migrate(&s, &both[0], 1), *b = migrate(&s, &both[1], 1);
    float *sum = migrate(&s, both, 2);
    both[1].gain = -0.8;
    float *difference = migrate(&s, both, 2);
    double largest = 0.0;
    for (size_t v = 0; v < grid_size(&s.rig.grid); v++)
        largest = fmax(largest, a[v]);
    for (size_t v = 0; v < grid_size(&s.rig.grid); v++)
        assert_near((sum[v] + difference[v]) / largest, 2.0 * (a[v] + b[v]) / largest,
                    1e-4);
    free(a);
    free(b);
    free(sum);
    free(difference);
}

static void weights_multiply_their_traces(void **state)
{
    (void)state;
    const struct scatterer point = {{0.03, -0.02, 1.1}, 1.0};
    struct site s;
    site_default(&s);
    look(&s, 0.0, 0.0, 1.1);
    size_t n = s.rig.format.n_samples;
    float complex *gather = listen(&s, &point, 1);
    float *plain = migrate_gather(&s, gather, 1);
    for (size_t q = 0; q < NX * NY; q++) {
        s.weight[q] = 1.0f / (float)(1 + q % 5);
        for (size_t t = 0; t < n; t++)
            gather[q * n + t] *= (float)(1 + q % 5);
    }
    float *weighted = migrate_gather(&s, gather, 1);
    assert_below(rig_difference(&s.rig, plain, weighted), 1e-5);
    for (size_t q = 0; q < NX * NY; q++)
        s.weight[q] = 0.0f;
    float *none = migrate_gather(&s, gather, 1);
    for (size_t v = 0; v < grid_size(&s.rig.grid); v++)
        assert_near(none[v], 0.0, 0.0);
    free(plain);
    free(weighted);
    free(none);
    free(gather);
}

static void the_number_of_threads_does_not_matter(void **state)
{
    (void)state;
    const struct scatterer point = {{0.03, -0.02, 1.1}, 1.0};
    struct site s;
    site_default(&s);
    float complex *gather = listen(&s, &point, 1);
    float *one = migrate_gather(&s, gather, 1);
    for (size_t n = 2; n <= 3; n++) {
        float *image = migrate_gather(&s, gather, n);
        assert_below(rig_difference(&s.rig, one, image), 1e-5);
        free(image);
    }
    free(one);
    free(gather);
}

/* Another start, rate and carrier of the same sound. */
static void the_sampling_of_the_traces_does_not_matter(void **state)
{
    (void)state;
    static const struct trace_format formats[4] = {{.00411, 21600.0, 11000.0, 132},
                                                   {.0040333, 26400.0, 10000.0, 170},
                                                   {.00395, 36000.0, 11000.0, 240},
                                                   {.0041, 48000.0, 0.0, 300}};
    const struct scatterer point = {{0.03, -0.02, 1.1}, 1.0};
    struct site s;
    site_default(&s);
    look(&s, 0.02, -0.01, 1.1);
    float *usual = migrate(&s, &point, 1);
    for (int q = 0; q < 4; q++) {
        s.rig.format = formats[q];
        float *other = migrate(&s, &point, 1);
        struct peak_fit fit;
        float peak = rig_peak(&s.rig, usual, &fit);
        float other_peak = rig_peak(&s.rig, other, &fit);
        for (size_t v = 0; v < grid_size(&s.rig.grid); v++)
            assert_near(other[v] / other_peak, usual[v] / peak, 0.02);
        free(other);
    }
    free(usual);
}

static void silence_makes_no_image(void **state)
{
    (void)state;
    struct site s;
    site_default(&s);
    look(&s, 0.0, 0.0, 1.1);
    float *image = migrate(&s, NULL, 0);
    for (size_t v = 0; v < grid_size(&s.rig.grid); v++)
        assert_near(image[v], 0.0, 0.0);
    free(image);
}

static void one_midpoint_and_one_voxel_are_enough(void **state)
{
    (void)state;
    const struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
    struct site s;
    struct peak_fit fit;
    site_default(&s);
    s.cfg.nx = s.cfg.ny = 1;
    s.x_m[0] = s.y_m[0] = 0.0;
    rig_look_at(&s.rig, 0.0, 0.0, 1.1, 1, 0.01);
    float *image = migrate(&s, &point, 1);
    assert_true(isfinite(image[0]) && image[0] > 0.0f);
    free(image);
    /* All voxels of a column below it: the echo is as deep as the point. */
    s.rig.grid.n[2] = 41;
    s.rig.grid.step_m[2] = 0.005;
    s.rig.grid.origin_m[2] = 1.0;
    image = migrate(&s, &point, 1);
    rig_peak(&s.rig, image, &fit);
    assert_near(fit.position_m[2], 1.1, 2e-3);
    free(image);
}

static double plane_waves(const struct site *s)
{
    struct fk_config cfg = s->cfg;
    struct fk *m;
    cfg.trace = s->rig.format;
    cfg.grid = s->rig.grid;
    assert_int_equal(pool_create(&cfg.pool, 1), 0);
    assert_int_equal(fk_create(&m, &cfg), 0);
    double n = fk_plane_waves(m);
    fk_destroy(m);
    pool_destroy(cfg.pool);
    return n;
}

/* A lone voxel has no step, and what gate and aperture take is the same for two as for
 * many: 48 steps of a metre were 48 m, and a million times the plane waves. */
static void a_long_step_costs_no_more_than_a_short_one(void **state)
{
    (void)state;
    const struct scatterer point = {{0.02, -0.01, 1.1}, 1.0};
    struct site s;
    site_default(&s);
    rig_look_at(&s.rig, 0.0, 0.0, 1.1, 1, 0.01);
    float *fine = migrate(&s, &point, 1);
    double needed = plane_waves(&s);
    for (double step_m = 1.0; step_m < 2000.0; step_m *= 10.0) {
        rig_look_at(&s.rig, 0.0, 0.0, 1.1, 1, step_m);
        assert_below(plane_waves(&s), 1.5 * needed);
        float *coarse = migrate(&s, &point, 1);
        assert_near(sqrt(coarse[0] / fine[0]), 1.0, 0.1);
        free(coarse);
    }
    free(fine);
}

static void expect_refused(const struct fk_config *cfg)
{
    struct fk *m = NULL;
    assert_int_equal(fk_create(&m, cfg), -EINVAL);
    assert_null(m);
}

static void values_that_make_no_sense_are_refused(void **state)
{
    (void)state;
    struct site s;
    struct fk_config bad[12];
    struct pool *pool;
    site_default(&s);
    s.cfg.trace = s.rig.format;
    s.cfg.grid = s.rig.grid;
    assert_int_equal(pool_create(&pool, 1), 0);
    s.cfg.pool = pool;
    for (int q = 0; q < 12; q++)
        bad[q] = s.cfg;
    bad[0].nx = 0;
    bad[1].ny = 0;
    bad[2].grid.n[1] = 0;
    bad[3].grid.origin_m[2] = 0.0;  /* on the plane */
    bad[4].grid.origin_m[2] = -1.1; /* behind it */
    bad[5].trace.n_samples = 0;
    bad[6].band_hz[1] = bad[6].band_hz[0];
    bad[7].plane_z_m = NAN;
    bad[8].band_hz[0] = NAN;
    bad[9].band_hz[1] = 1e170; /* more waves than can be counted */
    bad[10].grid.step_m[0] = 1e-12;
    bad[11].sound_speed_m_s = 1e-9;
    for (int q = 0; q < 12; q++)
        expect_refused(&bad[q]);
    pool_destroy(pool);
    fk_destroy(NULL);
}

static void scales_that_make_no_sense_are_refused(void **state)
{
    (void)state;
    static const double wrong[3] = {0.0, -1.0, NAN};
    struct site s;
    struct pool *pool;
    site_default(&s);
    s.cfg.trace = s.rig.format;
    s.cfg.grid = s.rig.grid;
    assert_int_equal(pool_create(&pool, 1), 0);
    s.cfg.pool = pool;
    for (int q = 0; q < 3; q++) {
        struct fk_config bad = s.cfg;
        bad.sound_speed_m_s = wrong[q];
        expect_refused(&bad);
        bad = s.cfg;
        bad.trace.rate_hz = wrong[q];
        expect_refused(&bad);
        bad = s.cfg;
        bad.grid.step_m[1] = wrong[q];
        expect_refused(&bad);
    }
    pool_destroy(pool);
}

/* Fewer samples than the interpolation has taps. */
static void a_trace_of_few_samples_is_migrated_or_refused(void **state)
{
    (void)state;
    static const size_t counts[6] = {1, 2, 4, 7, 12, 20};
    for (size_t q = 0; q < 6; q++) {
        size_t n = counts[q];
        struct site s;
        struct fk *m = NULL;
        float complex gather[NX * NY * 20];
        float image[7 * 7 * 9];
        site_default(&s);
        look(&s, 0.0, 0.0, 1.1);
        s.cfg.trace = s.rig.format;
        s.cfg.trace.n_samples = n;
        s.cfg.grid = s.rig.grid;
        for (size_t t = 0; t < NX * NY * 20; t++)
            gather[t] = 1.0f;
        assert_int_equal(pool_create(&s.cfg.pool, 1), 0);
        int err = fk_create(&m, &s.cfg);
        assert_int_equal(err, n < FK_MIN_SAMPLES ? -EINVAL : 0);
        if (!err) {
            fk_migrate(m, gather, s.weight, image);
            for (size_t v = 0; v < sizeof image / sizeof *image; v++)
                assert_true(isfinite(image[v]));
            fk_destroy(m);
        }
        pool_destroy(s.cfg.pool);
    }
}

/* Its transform is short, but not so short that what the traces hold of nearer ranges
 * comes round to it.  Sidelobes of a pulse as wide as c / 2B fall as 1 / x: 0.06 at 5 cm.
 */
static void what_lies_before_a_lone_voxel_does_not_wrap_into_it(void **state)
{
    (void)state;
    struct site s;
    double focus = 0.0;
    site_default(&s);
    rig_listen(&s.rig, 0.7, 1.35);
    rig_look_at(&s.rig, 0.0, 0.0, 1.2, 1, 0.01);
    for (int q = 0; q < 40; q++) {
        const struct scatterer point = {{0.0, 0.0, q ? 1.16 - 0.01 * q : 1.2}, 1.0};
        float *image = migrate(&s, &point, 1);
        focus = q ? focus : sqrt(image[0]);
        if (q)
            assert_below(sqrt(image[0]), 0.1 * focus);
        free(image);
    }
}

/* Whatever stands in the others of the gather.  Lines in another order, as of an aperture
 * that is covered twice, are the same lines. */
static void lines_that_a_range_leaves_out_are_silent(void **state)
{
    (void)state;
    const struct scatterer point = {{0.03, -0.02, 1.1}, 1.0};
    static const size_t range[NY][2] = {{0, 3}, {0, 5}, {1, 6}, {1, 6}, {2, 7},
                                        {2, 7}, {3, 8}, {3, 8}, {4, 8}, {5, 8}};
    static const size_t order[NX] = {0, 2, 4, 6, 1, 3, 5, 7};
    struct site s, turned;
    site_default(&s);
    look(&s, 0.0, 0.0, 1.1);
    size_t n = s.rig.format.n_samples;
    float complex *gather = listen(&s, &point, 1);
    float complex *other = malloc(NX * NY * n * sizeof *other);
    assert_non_null(other);
    s.cfg.x_range = range;
    float *ranged = migrate_gather(&s, gather, 1);
    for (size_t q = 0; q < NX * NY; q++)
        if (q / NY < range[q % NY][0] || q / NY >= range[q % NY][1])
            memset(gather + q * n, 0, n * sizeof *gather);
    s.cfg.x_range = NULL;
    float *silent = migrate_gather(&s, gather, 1);
    assert_below(rig_difference(&s.rig, ranged, silent), 1e-6);
    memcpy(&turned, &s, sizeof s);
    turned.cfg.y_m = turned.y_m;
    turned.cfg.x_m = turned.x_m;
    turned.cfg.copies = 2;
    for (size_t x = 0; x < NX; x++) {
        turned.x_m[x] = s.x_m[order[x]];
        memcpy(other + x * NY * n, gather + order[x] * NY * n, NY * n * sizeof *other);
    }
    float *twice = migrate_gather(&turned, other, 1);
    for (size_t v = 0; v < grid_size(&s.rig.grid); v++)
        twice[v] *= 0.25f; /* amplitudes are those of half as many lines */
    assert_below(rig_difference(&s.rig, twice, silent), 1e-4);
    free(gather);
    free(other);
    free(ranged);
    free(silent);
    free(twice);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_that_a_range_leaves_out_are_silent),
        cmocka_unit_test(the_image_is_the_sum_over_all_plane_waves),
        cmocka_unit_test(steps_may_be_finer_than_any_wave),
        cmocka_unit_test(midpoints_may_stand_on_uneven_lines),
        cmocka_unit_test(the_plane_of_the_midpoints_may_stand_anywhere),
        cmocka_unit_test(a_point_is_where_it_is),
        cmocka_unit_test(a_coarse_grid_holds_the_fine_image_at_its_voxels),
        cmocka_unit_test(weight_on_high_sounds_makes_points_narrower),
        cmocka_unit_test(amplitudes_superpose),
        cmocka_unit_test(weights_multiply_their_traces),
        cmocka_unit_test(the_number_of_threads_does_not_matter),
        cmocka_unit_test(the_sampling_of_the_traces_does_not_matter),
        cmocka_unit_test(silence_makes_no_image),
        cmocka_unit_test(what_lies_before_a_lone_voxel_does_not_wrap_into_it),
        cmocka_unit_test(one_midpoint_and_one_voxel_are_enough),
        cmocka_unit_test(a_long_step_costs_no_more_than_a_short_one),
        cmocka_unit_test(values_that_make_no_sense_are_refused),
        cmocka_unit_test(scales_that_make_no_sense_are_refused),
        cmocka_unit_test(a_trace_of_few_samples_is_migrated_or_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
