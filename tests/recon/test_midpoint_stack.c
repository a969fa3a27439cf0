/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <complex.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "recon/coherent/midpoint_stack.h"
#include "tests/recon/rig.h"
#include "tests/worse.h"

struct bench { /* do not copy: the rig's geometry points into it */
    struct rig rig;
    struct midpoints *midpoints;
    struct pool *pool;
    struct midpoint_stack *stack;
    const float complex *gather; /* [nx][ny][n_samples] */
    const float *weight;         /* [nx][ny] */
};

static struct midpoint_stack_config config_of(const struct bench *b, bool dip)
{
    return (struct midpoint_stack_config){
        .geometry = &b->rig.geometry,
        .midpoints = b->midpoints,
        .in = b->rig.format,
        .out = b->rig.format,
        .band_hz = {b->rig.band_hz[0], b->rig.band_hz[1]},
        .mute_s = 2.0 * b->rig.gate_m[0] / b->rig.geometry.sound_speed_m_s,
        .dip = dip,
        .pool = b->pool,
    };
}

static void bench_start(struct bench *b, bool dip)
{
    const char *why = "";
    assert_int_equal(pool_create(&b->pool, 1), 0);
    assert_int_equal(midpoints_create(&b->midpoints, &b->rig.geometry, &why), 0);
    struct midpoint_stack_config cfg = config_of(b, dip);
    assert_int_equal(midpoint_stack_create(&b->stack, &cfg, &why), 0);
}

/* The rig, which hears from 0.9 to 1.5 m. */
static struct bench *bench_create(bool dip)
{
    struct bench *b = calloc(1, sizeof *b);
    assert_non_null(b);
    rig_default(&b->rig);
    rig_listen(&b->rig, 0.9, 1.5);
    bench_start(b, dip);
    return b;
}

/* One pair, 2 HALF_M long, drawn along itself past 64 places: dip moveout needs an offset
 * at all midpoints around the one that it is for. */
#define HALF_M 0.12

static struct bench *bench_drawn(double near_m, double far_m, bool dip)
{
    struct bench *b = calloc(1, sizeof *b);
    assert_non_null(b);
    struct rig *r = &b->rig;
    rig_default(r);
    rig_listen(r, near_m, far_m);
    r->geometry.n_speakers = r->geometry.n_microphones = 1;
    r->geometry.n_positions = RIG_MAX;
    r->geometry.stage_axis[0] = 0.0;
    r->geometry.stage_axis[1] = 1.0;
    r->speakers_m[0][1] = -HALF_M;
    r->microphones_m[0][1] = HALF_M;
    for (size_t k = 0; k < RIG_MAX; k++)
        r->positions_m[k] = 0.01 * ((double)k - 0.5 * (RIG_MAX - 1));
    bench_start(b, dip);
    return b;
}

static void bench_destroy(struct bench *b)
{
    midpoint_stack_destroy(b->stack);
    midpoints_destroy(b->midpoints);
    pool_destroy(b->pool);
    free(b);
}

static void add_all(struct bench *b, const struct scatterer *point, const bool *masked)
{
    const struct geometry *g = &b->rig.geometry;
    size_t n = g->n_microphones * b->rig.format.n_samples;
    float complex *traces = malloc(n * sizeof *traces);
    assert_non_null(traces);
    for (size_t p = 0; p < g->n_positions * g->n_speakers; p++) {
        rig_ping(&b->rig, p / g->n_speakers, p % g->n_speakers, point, 1, traces);
        midpoint_stack_add(b->stack, p / g->n_speakers, p % g->n_speakers, traces,
                           masked);
    }
    midpoint_stack_finish(b->stack, &b->gather, &b->weight);
    free(traces);
}

/* What a co-located pair at a midpoint hears, faded as 1 / r: largest difference of the
 * stack of any midpoint in the middle, over the largest of all. */
static double error_at(const double at_m[3], double near_m, double far_m, bool dip)
{
    const struct scatterer point = {{at_m[0], at_m[1], at_m[2]}, 1.0};
    struct bench *b = bench_drawn(near_m, far_m, dip);
    const struct midpoints *m = b->midpoints;
    const struct trace_format *f = &b->rig.format;
    double worst = 0.0, largest = 0.0, c = b->rig.geometry.sound_speed_m_s;
    add_all(b, &point, NULL);
    for (size_t y = m->ny / 3; y < 2 * m->ny / 3; y++) {
        const double at[3] = {m->x_m[0], m->y_m[y], m->plane_z_m};
        double r = reference_distance(at, point.at_m);
        for (size_t n = 0; n < f->n_samples; n++) {
            double t = f->t0_s + (double)n / f->rate_hz;
            double complex expected =
                reference_echo(b->rig.band_hz, f->carrier_hz, 2.0 * r / c, t) / r;
            double complex is = (double)b->weight[y] *
                                (double complex)b->gather[y * f->n_samples + n];
            worst = worse(worst, cabs(is - expected));
            largest = fmax(largest, cabs(expected));
        }
    }
    bench_destroy(b);
    return worst / largest;
}

static void far_targets_need_no_dip_moveout(void **state)
{
    (void)state;
    const double at_m[3] = {0.0, 0.05, 2.5};
    assert_below(error_at(at_m, 2.2, 2.9, false), 0.015);
    assert_below(error_at(at_m, 2.2, 2.9, true), 0.015);
}

/* h^2 sin^2 a / r is 4 mm here, an eighth of a wavelength and in and out of it. */
static void near_ones_aside_do(void **state)
{
    (void)state;
    const double at_m[3] = {0.0, 0.1, 0.5};
    assert_below(0.5, error_at(at_m, 0.3, 1.2, false));
    assert_below(error_at(at_m, 0.3, 1.2, true), 0.08);
}

static size_t count_pairs(const struct bench *b, size_t cell, const bool *masked)
{
    const struct geometry *g = &b->rig.geometry;
    double x_m = b->midpoints->x_m[cell / b->midpoints->ny];
    double y_m = b->midpoints->y_m[cell % b->midpoints->ny];
    size_t n = 0;
    for (size_t p = 0; p < g->n_positions * g->n_speakers; p++)
        for (size_t i = 0; i < g->n_microphones; i++) {
            double s[3], m[3];
            geometry_speaker(g, p / g->n_speakers, p % g->n_speakers, s);
            geometry_microphone(g, p / g->n_speakers, 0, i, m);
            n += !(masked && masked[i]) && fabs(0.5 * (s[0] + m[0]) - x_m) < 1e-3 &&
                 fabs(0.5 * (s[1] + m[1]) - y_m) < 1e-3;
        }
    return n;
}

static void a_midpoint_counts_once_however_many_pairs_it_has(void **state)
{
    (void)state;
    static const bool masks[2][4] = {{false}, {true, false, true, true}};
    const struct scatterer point = {{0.0, 0.0, 1.2}, 1.0};
    for (int q = 0; q < 2; q++) {
        struct bench *b = bench_create(false);
        size_t empty = 0;
        add_all(b, &point, masks[q]);
        for (size_t c = 0; c < b->midpoints->nx * b->midpoints->ny; c++) {
            size_t pairs = count_pairs(b, c, masks[q]);
            assert_near(b->weight[c], pairs ? 1.0 / (double)pairs : 0.0, 1e-6);
            empty += !pairs;
        }
        assert_int_equal(empty, q ? 8 * 6 : 0); /* one microphone: 4 of 10 lines */
        bench_destroy(b);
    }
}

static void what_was_forgotten_leaves_nothing(void **state)
{
    (void)state;
    const struct scatterer point = {{0.02, -0.03, 1.2}, 1.0};
    for (int dip = 0; dip < 2; dip++) {
        struct bench *b = bench_create(dip);
        size_t cells = b->midpoints->nx * b->midpoints->ny;
        size_t n = cells * b->rig.format.n_samples;
        float complex *first = malloc(n * sizeof *first);
        assert_non_null(first);
        add_all(b, &point, NULL);
        memcpy(first, b->gather, n * sizeof *first);
        midpoint_stack_reset(b->stack);
        midpoint_stack_finish(b->stack, &b->gather, &b->weight);
        for (size_t q = 0; q < n; q++)
            assert_true(b->gather[q] == 0.0f);
        for (size_t q = 0; !dip && q < cells; q++)
            assert_true(b->weight[q] == 0.0f);
        add_all(b, &point, NULL);
        assert_memory_equal(first, b->gather, n * sizeof *first);
        free(first);
        bench_destroy(b);
    }
}

static void uneven_lines_are_refused_with_dip_moveout_alone(void **state)
{
    (void)state;
    struct bench *b = calloc(1, sizeof *b);
    const char *why = "";
    assert_non_null(b);
    rig_default(&b->rig);
    b->rig.positions_m[3] += 0.017;
    assert_int_equal(pool_create(&b->pool, 1), 0);
    assert_int_equal(midpoints_create(&b->midpoints, &b->rig.geometry, &why), 0);
    struct midpoint_stack_config cfg = config_of(b, true);
    assert_int_equal(midpoint_stack_create(&b->stack, &cfg, &why), -ENOTSUP);
    assert_null(b->stack);
    assert_non_null(strstr(why, "evenly spaced"));
    cfg.dip = false;
    assert_int_equal(midpoint_stack_create(&b->stack, &cfg, &why), 0);
    bench_destroy(b);
}

/* Where a method images a point. */
static void place(const struct rig *r, const char *method, int dmo,
                  const struct scatterer *point, double at_m[3])
{
    struct imager_options options;
    struct peak_fit fit;
    struct imager *im = NULL;
    struct pool *pool;
    const char *why = "";
    imager_options_default(&options);
    options.dmo = dmo;
    assert_int_equal(pool_create(&pool, 1), 0);
    const struct imager_config cfg = {.method = method,
                                      .geometry = &r->geometry,
                                      .format = r->format,
                                      .band_hz = {r->band_hz[0], r->band_hz[1]},
                                      .gate_m = {r->gate_m[0], r->gate_m[1]},
                                      .grid = r->grid,
                                      .pool = pool,
                                      .options = &options};
    assert_int_equal(imager_create(&im, &cfg, &why), 0);
    rig_add(r, im, point, 1);
    float *image = malloc(grid_size(&r->grid) * sizeof *image);
    assert_non_null(image);
    imager_image(im, image);
    rig_peak(r, image, &fit);
    memcpy(at_m, fit.position_m, sizeof fit.position_m);
    free(image);
    imager_destroy(im);
    pool_destroy(pool);
}

static void near_points_are_where_back_projection_has_them(void **state)
{
    (void)state;
    const struct scatterer point = {{0.0, 0.15, 0.5}, 1.0};
    double exact_m[3], dip_m[3], plain_m[3];
    struct bench *b = bench_drawn(0.3, 1.0, false);
    struct rig *r = &b->rig;
    rig_look_at(r, 0.0, 0.15, 0.5, 21, 0.004);
    r->grid.n[0] = 1; /* across it sees nothing */
    r->grid.origin_m[0] = 0.0;
    place(r, "backprojection", -1, &point, exact_m);
    place(r, "fast", 1, &point, dip_m);
    place(r, "fast", 0, &point, plain_m);
    for (int a = 0; a < 3; a++) {
        assert_near(exact_m[a], point.at_m[a], 5e-4);
        assert_near(dip_m[a], exact_m[a], 1e-3);
    }
    assert_below(3e-3, fabs(plain_m[1] - exact_m[1]));
    bench_destroy(b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(far_targets_need_no_dip_moveout),
        cmocka_unit_test(near_ones_aside_do),
        cmocka_unit_test(a_midpoint_counts_once_however_many_pairs_it_has),
        cmocka_unit_test(what_was_forgotten_leaves_nothing),
        cmocka_unit_test(uneven_lines_are_refused_with_dip_moveout_alone),
        cmocka_unit_test(near_points_are_where_back_projection_has_them),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
