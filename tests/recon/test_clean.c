/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "recon/detection/clean.h"
#include "tests/recon/dice.h"
#include "tests/recon/rig.h"

#define MAX 16

struct scene {
    struct rig rig;
    struct trace_set set;
    float complex *traces;
    bool *heard;
    float *image;
    struct pool *pool;
    struct imager *imager;
    struct detect_config detect;
    struct detection found[MAX];
    size_t n;
};

static double off_m; /* rms, of elements from where they are thought to be */

/* By as much again: the same numbers each time, and back. */
static void move_elements(struct rig *r, double sign)
{
    unsigned long long seed = 11;

    for (size_t i = 0; i < r->geometry.n_speakers; i++)
        for (int a = 0; a < 3; a++)
            r->speakers_m[i][a] += sign * off_m * dice_normal(&seed);
    for (size_t i = 0; i < r->geometry.n_microphones; i++)
        for (int a = 0; a < 3; a++)
            r->microphones_m[i][a] += sign * off_m * dice_normal(&seed);
}

static void hear(struct scene *s, const struct scatterer *points, size_t n, double noise)
{
    const struct geometry *g = &s->rig.geometry;
    size_t pairs = trace_set_pairs(&s->set), samples = s->rig.format.n_samples;
    unsigned long long seed = 7;

    s->traces = calloc(g->n_positions * pairs * samples, sizeof *s->traces);
    s->heard = malloc(g->n_positions * pairs * sizeof *s->heard);
    assert_true(s->traces && s->heard);
    for (size_t q = 0; q < g->n_positions * pairs; q++)
        s->heard[q] = true;
    move_elements(&s->rig, 1.0);
    for (size_t q = 0; n && q < g->n_positions; q++)
        for (size_t e = 0; e < g->n_speakers; e++)
            rig_ping(&s->rig, q, e, points, n,
                     s->traces + (q * pairs + e * g->n_microphones) * samples);
    move_elements(&s->rig, -1.0);
    for (size_t i = 0; i < g->n_positions * pairs * samples; i++) {
        double re = dice_normal(&seed), im = dice_normal(&seed);
        s->traces[i] += (float)noise * ((float)re + (float)im * I);
    }
    s->set.traces = s->traces;
    s->set.heard = s->heard;
}

/* 2 to 6 kHz, no grating lobes: an image of what n points, and noise, make in the traces,
 * and what is found in it. */
static void open_scene(struct scene *s, const char *method,
                       const struct scatterer *points, size_t n, double noise)
{
    struct rig *r = &s->rig;
    struct geometry *g = &r->geometry;

    rig_default(r);
    g->n_positions = 16;
    for (size_t k = 0; k < g->n_positions; k++)
        r->positions_m[k] = 0.04 * ((double)k - 7.5);
    r->band_hz[1] = 6000.0;
    r->format.rate_hz = 10000.0;
    r->format.carrier_hz = 4000.0;
    rig_listen(r, 0.5, 2.2);
    rig_look_at(r, 0.0, 0.0, 1.1, 51, 0.02);
    s->set = (struct trace_set){.geometry = &r->geometry,
                                .format = r->format,
                                .band_hz = {r->band_hz[0], r->band_hz[1]},
                                .gate_m = {r->gate_m[0], r->gate_m[1]}};
    hear(s, points, n, noise);
    assert_int_equal(pool_create(&s->pool, 1), 0);
    s->imager = rig_imager(r, method, s->pool);
    s->image = malloc(grid_size(&r->grid) * sizeof *s->image);
    assert_non_null(s->image);
    assert_int_equal(trace_set_feed(&s->set, s->imager, s->pool), 0);
    imager_image(s->imager, s->image);
    detect_config_default(&s->detect);
    assert_int_equal(detect_objects(&s->detect, &r->grid, s->image, s->found, MAX, &s->n),
                     0);
}

static void look_behind(struct scene *s)
{
    const struct clean clean = {.set = &s->set, .imager = s->imager, .pool = s->pool};

    assert_int_equal(
        clean_find(&clean, &s->detect, &s->rig.grid, s->image, s->found, MAX, &s->n), 0);
}

static void close_scene(struct scene *s)
{
    imager_destroy(s->imager);
    pool_destroy(s->pool);
    free(s->image);
    free(s->traces);
    free(s->heard);
}

/* The existence of what was found within 3 cm of a point; 0: nothing was. */
static double existence_at(const struct scene *s, const double at_m[3], size_t *number)
{
    for (size_t i = 0; i < s->n; i++) {
        if (reference_distance(s->found[i].position_m, at_m) > 0.03)
            continue;
        *number = i;
        return s->found[i].existence;
    }
    return 0.0;
}

static const struct scatterer pair_db22[2] = {{{0.05, -0.05, 1.0}, 1.0},
                                              {{-0.25, 0.2, 1.3}, 0.08}};

static void is_found_beside(const char *method)
{
    struct scene s;
    size_t which = 0;

    open_scene(&s, method, pair_db22, 2, 1e-3);
    assert_true(existence_at(&s, pair_db22[1].at_m, &which) == 0.0);
    look_behind(&s);
    assert_true(existence_at(&s, pair_db22[1].at_m, &which) > 0.5);
    /* -22 dB, less what the way there and back takes from an amplitude */
    double way_db = 40.0 * log10(1.35 / 1.0);
    double below_db = s.found[0].level_db - s.found[which].level_db;
    assert_true(fabs(below_db - 22.0) < way_db);
    close_scene(&s);
}

static void what_is_22_db_weaker_is_found_beside_what_hides_it(void **state)
{
    (void)state;
    is_found_beside("fast");
    is_found_beside("backprojection");
}

/* Elements stand 2 mm (rms, each axis) from where they are thought to: what the model
 * does not explain of a point goes in other directions, as far away as the point. */
static void what_a_model_leaves_of_a_point_is_no_object(void **state)
{
    (void)state;
    struct scene s;
    size_t before;

    off_m = 2e-3;
    open_scene(&s, "fast", pair_db22, 1, 1e-3);
    off_m = 0.0;
    before = s.n;
    look_behind(&s);
    assert_int_equal(s.n, before);
    close_scene(&s);
}

static void a_lone_point_hides_nothing(void **state)
{
    (void)state;
    struct scene s;
    size_t before;

    open_scene(&s, "fast", pair_db22, 1, 1e-3);
    before = s.n;
    look_behind(&s);
    for (size_t i = before; i < s.n; i++)
        assert_true(s.found[i].existence < 0.5);
    close_scene(&s);
}

/* The voxel of a loud echo is no new object, however it differs from a point's. */
static void what_was_found_is_not_found_again(void **state)
{
    (void)state;
    const struct scatterer body[3] = {
        {{0.0, 0.0, 1.0}, 1.0}, {{0.02, 0.01, 1.0}, 0.8}, {{0.01, -0.03, 1.01}, -0.6}};
    struct scene s;
    size_t before;

    open_scene(&s, "fast", body, 3, 1e-3);
    before = s.n;
    look_behind(&s);
    for (size_t i = before; i < s.n; i++)
        assert_true(reference_distance(s.found[i].position_m, body[0].at_m) > 0.1);
    close_scene(&s);
}

static void of_noise_nothing_is_made(void **state)
{
    (void)state;
    struct scene s;
    size_t before;

    open_scene(&s, "fast", NULL, 0, 1.0);
    before = s.n;
    look_behind(&s);
    assert_int_equal(s.n, before);
    close_scene(&s);
}

static void there_is_no_room_for_more_than_asked(void **state)
{
    (void)state;
    struct scene s;

    open_scene(&s, "fast", pair_db22, 2, 1e-3);
    const struct clean clean = {.set = &s.set, .imager = s.imager, .pool = s.pool};
    size_t full = s.n;
    assert_int_equal(
        clean_find(&clean, &s.detect, &s.rig.grid, s.image, s.found, full, &s.n), 0);
    assert_int_equal(s.n, full);
    close_scene(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_22_db_weaker_is_found_beside_what_hides_it),
        cmocka_unit_test(what_a_model_leaves_of_a_point_is_no_object),
        cmocka_unit_test(a_lone_point_hides_nothing),
        cmocka_unit_test(what_was_found_is_not_found_again),
        cmocka_unit_test(of_noise_nothing_is_made),
        cmocka_unit_test(there_is_no_room_for_more_than_asked),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
