/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "recon/detection/beyond.h"
#include "recon/detection/peak.h"
#include "tests/recon/rig.h"

#define RANGE_DB 15.0
#define MAX      16

/* 8 pairs upright, 16 positions: an aperture of 35 cm by 30 cm. */
struct scene {
    struct rig rig;
    struct trace_set set;
    struct pool *pool;
};

static void open_scene(struct scene *s, const struct scatterer *points, size_t n)
{
    struct rig *r = &s->rig;
    struct geometry *g = &r->geometry;

    rig_pairs(r);
    g->n_positions = 16;
    for (size_t k = 0; k < g->n_positions; k++)
        r->positions_m[k] = 0.02 * ((double)k - 7.5);
    rig_look_at(r, 0.0, 0.0, 1.1, 17, 0.02);
    s->set = rig_traces(r, points, n);
    assert_int_equal(pool_create(&s->pool, 1), 0);
}

static void close_scene(struct scene *s)
{
    pool_destroy(s->pool);
    rig_free_traces(&s->set);
}

static struct detection seen(const struct scatterer *point)
{
    return (struct detection){
        .position_m = {point->at_m[0], point->at_m[1], point->at_m[2]},
        .level_db = 30.0,
        .existence = 1.0};
}

/* -- by hand: a coarse image of 6 x 5 x 4 voxels, 10 cm apart, and a spot of 1 outside --
 */

struct view {
    struct grid grid;
    float intensity[120], spots[1][4];
};

static float *voxel(struct view *v, size_t x, size_t y, size_t z)
{
    return &v->intensity[(z * 5 + y) * 6 + x];
}

static struct detection at(size_t x, size_t y, size_t z)
{
    return (struct detection){
        .position_m = {0.1 * (double)x, 0.1 * (double)y, 1.0 + 0.1 * (double)z},
        .existence = 1.0};
}

static void judge(const struct view *v, size_t n_spots, struct detection *found, size_t n)
{
    const struct surroundings_view around = {.grid = v->grid,
                                             .intensity = v->intensity,
                                             .n_spots = n_spots,
                                             .spots = v->spots};
    const struct beyond b = {.around = &around, .range_db = RANGE_DB, .of_power = true};

    assert_int_equal(beyond_judge(&b, found, n), 0);
}

static const struct view darkness = {
    .grid = {{0.0, 0.0, 1.0}, {0.1, 0.1, 0.1}, {6, 5, 4}},
    .spots = {{2.0f, 0.0f, 1.0f, 1.0f}}};

static void existence_is_even_odds_at_the_range_and_ten_to_one_5_db_off(void **state)
{
    (void)state;
    static const double cases[3][2] = {
        {0.0, 0.5}, {5.0, 10.0 / 11.0}, {-5.0, 1.0 / 11.0}};

    for (int q = 0; q < 3; q++) {
        struct view v = darkness;
        struct detection d = at(2, 2, 2);
        *voxel(&v, 2, 2, 2) = (float)pow(10.0, (cases[q][0] - RANGE_DB) / 10.0);
        judge(&v, 1, &d, 1);
        assert_near(d.existence, cases[q][1], 1e-6);
    }
}

/* It is as bright as the brightest of what it covers, and a point as what is next to it,
 * up to the ends of the image; what is farther off is another thing. */
static void an_object_is_heard_wherever_it_is(void **state)
{
    (void)state;
    static const struct {
        size_t at[3], bright[3];
        double extent_m[3];
        bool heard;
    } cases[] = {{{2, 2, 1}, {2, 2, 1}, {0.0}, true},
                 {{2, 2, 1}, {3, 3, 2}, {0.0}, true},
                 {{2, 2, 1}, {1, 1, 0}, {0.0}, true},
                 {{2, 2, 1}, {4, 2, 1}, {0.0}, false},
                 {{2, 2, 1}, {0, 2, 1}, {0.0}, false},
                 {{2, 2, 1}, {2, 4, 1}, {0.0}, false},
                 {{2, 2, 1}, {2, 2, 3}, {0.0}, false},
                 {{2, 2, 1}, {4, 2, 1}, {0.4, 0.0, 0.0}, true},
                 {{2, 2, 1}, {5, 2, 1}, {0.4, 0.0, 0.0}, false},
                 {{2, 2, 1}, {2, 4, 1}, {0.0, 0.4, 0.0}, true},
                 {{2, 2, 1}, {2, 2, 3}, {0.0, 0.0, 0.4}, true},
                 {{5, 4, 3}, {5, 4, 3}, {0.0}, true},
                 {{0, 0, 0}, {0, 0, 0}, {0.0}, true}};

    for (size_t q = 0; q < sizeof cases / sizeof *cases; q++) {
        const size_t *p = cases[q].bright;
        struct detection d = at(cases[q].at[0], cases[q].at[1], cases[q].at[2]);
        struct view v = darkness;
        memcpy(d.extent_m, cases[q].extent_m, sizeof d.extent_m);
        *voxel(&v, p[0], p[1], p[2]) = 0.9f;
        judge(&v, 1, &d, 1);
        if (cases[q].heard ? d.existence < 0.99 : d.existence > 0.01)
            fail_msg("case %zu: %.3f", q, d.existence);
    }
}

static void where_nothing_is_brighter_nothing_is_doubted(void **state)
{
    (void)state;
    struct detection d = at(2, 2, 2);

    judge(&darkness, 0, &d, 1);
    assert_true(d.existence == 1.0);
}

/* 13 dB below the brightest, whichever of them that is, and 15 more: even odds. */
static void of_an_image_of_power_each_may_be_a_sidelobe_of_any(void **state)
{
    (void)state;

    for (size_t brightest = 0; brightest < 3; brightest++) {
        static const size_t places[3][3] = {{0, 0, 0}, {2, 4, 3}, {5, 0, 0}};
        struct detection found[3];
        struct view v = darkness;
        for (size_t i = 0; i < 3; i++) {
            const size_t *p = places[i];
            found[i] = at(p[0], p[1], p[2]);
            *voxel(&v, p[0], p[1], p[2]) = i == brightest ? 1.0f : powf(10.0f, -2.8f);
        }
        judge(&v, 0, found, 3);
        for (size_t i = 0; i < 3; i++)
            if (i == brightest)
                assert_true(found[i].existence > 0.999);
            else
                assert_near(found[i].existence, 0.5, 0.01);
    }
}

/* -- of echoes --------------------------------------------------------------------------
 */

/* One inside, and one 24 cm beyond a side that is louder by so many decibels. */
static double existence_beside(double louder_db, double inside_z_m, bool of_power)
{
    const struct scatterer points[2] = {
        {{-0.12, 0.13, inside_z_m}, 0.05},
        {{0.40, 0.0, 1.2}, 0.05 * pow(10.0, louder_db / 20.0)}};
    struct detection d = seen(&points[0]);
    struct scene s;

    open_scene(&s, points, 2);
    assert_int_equal(
        beyond_judge_traces(&s.set, &s.rig.grid, RANGE_DB, of_power, s.pool, &d, 1), 0);
    close_scene(&s);
    assert_true(d.existence >= 0.0 && d.existence <= 1.0);
    return d.existence;
}

static void what_is_nearly_as_loud_as_what_stands_outside_exists(void **state)
{
    (void)state;

    assert_true(existence_beside(-6.0, 1.13, false) > 0.999);
    assert_true(existence_beside(6.0, 1.13, false) > 0.9);
    assert_true(existence_beside(6.0, 1.13, true) > 0.9);
}

static void what_is_far_fainter_may_be_its_sidelobe(void **state)
{
    (void)state;

    assert_true(existence_beside(26.0, 1.13, false) < 0.3);
    assert_true(existence_beside(26.0, 1.13, true) < 0.3);
}

/* But of an image of power, or far below it. */
static void a_sidelobe_is_at_the_range_of_what_makes_it(void **state)
{
    (void)state;

    assert_true(existence_beside(18.0, 0.95, false) > 0.95);
    assert_true(existence_beside(18.0, 0.95, true) < 0.5);
    assert_true(existence_beside(50.0, 0.95, false) < 0.3);
}

/* A point in the volume has sidelobes outside, and a faint one beside it is no sidelobe
 * of those: that is judged in the image. */
static void what_is_outside_may_be_a_sidelobe_itself(void **state)
{
    (void)state;
    const struct scatterer points[2] = {{{0.06, 0.02, 1.1}, 1.0},
                                        {{-0.08, 0.02, 1.1}, 0.05}};
    struct scene s;

    open_scene(&s, points, 2);
    for (int first = 0; first <= 1; first++) {
        struct detection found[2] = {seen(&points[first]), seen(&points[!first])};
        assert_int_equal(
            beyond_judge_traces(&s.set, &s.rig.grid, RANGE_DB, false, s.pool, found, 2),
            0);
        assert_true(found[0].existence == 1.0 && found[1].existence == 1.0);
    }
    close_scene(&s);
}

/* What is brighter inside, but at another range, does not make it: it stands there, and
 * may have made what is faint at its own range. */
static void what_is_brighter_at_another_range_explains_nothing(void **state)
{
    (void)state;
    const double spot = 0.05 * pow(10.0, 26.0 / 20.0);
    const struct scatterer points[3] = {
        {{-0.12, 0.13, 1.13}, 0.05},
        {{0.40, 0.0, 1.2}, spot},
        {{0.1, -0.1, 0.95}, spot * pow(10.0, 14.0 / 20.0)}};
    struct detection found[2] = {seen(&points[0]), seen(&points[2])};
    struct scene s;

    open_scene(&s, points, 3);
    assert_int_equal(
        beyond_judge_traces(&s.set, &s.rig.grid, RANGE_DB, false, s.pool, found, 2), 0);
    close_scene(&s);
    assert_true(found[0].existence < 0.3);
    assert_true(found[1].existence > 0.999);
}

/* An image of power shows what no phases agree about as objects; what is there, as far
 * down as the coarse image tells, stays. */
static void of_an_image_of_power_what_no_pings_agree_about_is_none(void **state)
{
    (void)state;
    const struct scatterer points[2] = {{{0.06, 0.02, 1.1}, 1.0},
                                        {{-0.08, 0.02, 1.0}, 0.15}};
    const struct scatterer nothing = {{-0.12, -0.1, 1.2}, 1.0};

    for (int power = 0; power <= 1; power++) {
        struct detection found[3] = {seen(&points[0]), seen(&points[1]), seen(&nothing)};
        struct scene s;
        open_scene(&s, points, 2);
        assert_int_equal(
            beyond_judge_traces(&s.set, &s.rig.grid, RANGE_DB, power, s.pool, found, 3),
            0);
        assert_true(found[0].existence > 0.999);
        assert_true(found[1].existence > 0.9);
        assert_true(power ? found[2].existence < 0.3 : found[2].existence > 0.999);
        close_scene(&s);
    }
}

/* A plate is as bright as its brightest part. */
static void what_is_wide_is_heard_where_it_is_loudest(void **state)
{
    (void)state;
    const struct scatterer points[2] = {{{0.12, 0.0, 1.1}, 1.0}, {{0.40, 0.0, 1.1}, 2.0}};
    struct detection wide = seen(&points[0]), narrow;
    struct scene s;

    wide.position_m[0] = -0.12;
    narrow = wide;
    wide.extent_m[0] = 0.5;
    open_scene(&s, points, 2);
    assert_int_equal(
        beyond_judge_traces(&s.set, &s.rig.grid, RANGE_DB, true, s.pool, &wide, 1), 0);
    assert_int_equal(
        beyond_judge_traces(&s.set, &s.rig.grid, RANGE_DB, true, s.pool, &narrow, 1), 0);
    close_scene(&s);
    assert_true(wide.existence > 0.8);
    assert_true(narrow.existence < 0.3);
}

/* Of a point beyond a side or an end nothing is reported but what is at that border, or
 * beside it. */
static void nothing_is_reported_but_at_the_border_that_it_lies_beyond(void **state)
{
    (void)state;
    static const char *const methods[4] = {"fast", "confocal", "lct", "paper"};

    for (int q = 0; q < 48; q++) {
        const char *method = methods[q % 4];
        int axis = q / 4 % 6 / 2, far = q / 4 % 2;
        struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
        struct detect_config cfg;
        struct detection found[MAX];
        struct scene s;
        size_t n;
        point.at_m[axis] += (far ? 1.0 : -1.0) * (0.16 + (q < 24 ? 0.03 : 0.06));
        open_scene(&s, &point, 1);
        float *image = rig_image(&s.rig, method, &point, 1, 1);
        detect_config_default(&cfg);
        detect_config_method(&cfg, method, &s.rig.grid);
        geometry_resolution(&s.rig.geometry, s.rig.band_hz, 1.1, cfg.resolution_m);
        assert_int_equal(detect_objects(&cfg, &s.rig.grid, image, found, MAX, &n), 0);
        free(image);
        assert_int_equal(beyond_judge_traces(&s.set, &s.rig.grid, RANGE_DB, cfg.clipped,
                                             s.pool, found, n),
                         0);
        for (size_t i = 0; i < n; i++) {
            if (found[i].existence < 0.5)
                continue;
            if (!(found[i].at_border & PEAK_BORDER(axis, far)))
                fail_msg("%s: beyond %d %d, told at %.2f %.2f %.2f", method, axis, far,
                         found[i].position_m[0], found[i].position_m[1],
                         found[i].position_m[2]);
        }
        close_scene(&s);
    }
}

static void an_array_that_cannot_be_imaged_so_is_left_alone(void **state)
{
    (void)state;
    const struct scatterer points[2] = {{{-0.06, 0.0, 1.1}, 0.05},
                                        {{0.40, 0.0, 1.1}, 1.0}};
    struct detection d = seen(&points[0]);
    struct scene s;

    open_scene(&s, points, 2);
    s.rig.speakers_m[3][2] += 0.3;
    assert_int_equal(
        beyond_judge_traces(&s.set, &s.rig.grid, RANGE_DB, false, s.pool, &d, 1), 0);
    assert_true(d.existence == 1.0);
    close_scene(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(existence_is_even_odds_at_the_range_and_ten_to_one_5_db_off),
        cmocka_unit_test(an_object_is_heard_wherever_it_is),
        cmocka_unit_test(where_nothing_is_brighter_nothing_is_doubted),
        cmocka_unit_test(of_an_image_of_power_each_may_be_a_sidelobe_of_any),
        cmocka_unit_test(what_is_nearly_as_loud_as_what_stands_outside_exists),
        cmocka_unit_test(what_is_far_fainter_may_be_its_sidelobe),
        cmocka_unit_test(a_sidelobe_is_at_the_range_of_what_makes_it),
        cmocka_unit_test(what_is_outside_may_be_a_sidelobe_itself),
        cmocka_unit_test(what_is_brighter_at_another_range_explains_nothing),
        cmocka_unit_test(of_an_image_of_power_what_no_pings_agree_about_is_none),
        cmocka_unit_test(what_is_wide_is_heard_where_it_is_loudest),
        cmocka_unit_test(nothing_is_reported_but_at_the_border_that_it_lies_beyond),
        cmocka_unit_test(an_array_that_cannot_be_imaged_so_is_left_alone),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
