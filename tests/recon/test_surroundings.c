/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <errno.h>
#include <stdlib.h>

#include "recon/imaging/surroundings.h"
#include "recon/planning/trace_set.h"
#include "tests/recon/rig.h"

struct scene {
    struct rig rig;
    struct trace_set set;
    struct pool *pool;
};

/* 8 pairs upright, 16 positions. */
static void open_scene(struct scene *s, const struct scatterer *point)
{
    struct rig *r = &s->rig;

    rig_pairs(r);
    r->geometry.n_positions = 16;
    for (size_t k = 0; k < r->geometry.n_positions; k++)
        r->positions_m[k] = 0.02 * ((double)k - 7.5);
    rig_look_at(r, 0.0, 0.0, 1.1, 17, 0.02);
    s->set = rig_traces(r, point, 1);
    assert_int_equal(pool_create(&s->pool, 1), 0);
}

static void close_scene(struct scene *s)
{
    pool_destroy(s->pool);
    rig_free_traces(&s->set);
}

static struct surroundings *look(const struct scene *s)
{
    const struct imager_config wanted = trace_set_imager(&s->set, &s->rig.grid, s->pool);
    struct surroundings *out;

    assert_int_equal(surroundings_create(&out, &wanted), 0);
    assert_int_equal(trace_set_feed(&s->set, surroundings_imager(out), s->pool), 0);
    return out;
}

/* Of two that are next to each other one would not be the brightest there. */
static bool are_apart(const struct surroundings_view *v, const float p[4],
                      const float q[4])
{
    bool apart = p[3] == q[3];

    for (int a = 0; a < 3; a++)
        apart |= fabs((double)p[a] - (double)q[a]) > 1.5 * v->grid.step_m[a];
    return apart;
}

/* The volume reaches .16 m from its middle; the point stands beyond it on one side. */
static void what_stands_beside_the_volume_is_the_brightest_where_it_stands(void **state)
{
    (void)state;

    for (int side = 0; side < 6; side++) {
        struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
        struct scene s;
        int axis = side / 2;
        point.at_m[axis] += (side % 2 ? 1.0 : -1.0) * (axis < 2 ? 0.35 : 0.3);
        open_scene(&s, &point);
        struct surroundings *around = look(&s);
        const struct surroundings_view *v = surroundings_image(around);
        assert_true(v->n_spots > 0);
        for (int a = 0; a < 3; a++)
            assert_near(v->spots[0][a], point.at_m[a], 1.5 * v->grid.step_m[a]);
        for (size_t i = 1; i < v->n_spots; i++)
            assert_true(v->spots[i][3] <= v->spots[i - 1][3]);
        for (size_t i = 1; i < v->n_spots; i++)
            for (size_t j = 0; j < i; j++)
                assert_true(are_apart(v, v->spots[i], v->spots[j]));
        for (size_t i = 0; i < grid_size(&v->grid); i++)
            assert_true(v->intensity[i] < 0.5f * v->spots[0][3]);
        surroundings_destroy(around);
        close_scene(&s);
    }
}

/* A third of 1.26 m is 42 cm. */
static void it_looks_a_third_of_the_range_aside_and_25_cm_behind(void **state)
{
    (void)state;

    for (int side = 0; side < 5; side++) {
        int axis = side / 2;
        double way = side % 2 && axis < 2 ? -1.0 : 1.0;
        double reach_m = 0.16 + (axis < 2 ? 0.42 : 0.25);
        for (int beyond = 0; beyond <= 1; beyond++) {
            struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
            double middle_m = point.at_m[axis];
            struct scene s;
            point.at_m[axis] += way * (reach_m + (beyond ? 0.11 : -0.03));
            open_scene(&s, &point);
            struct surroundings *around = look(&s);
            const struct surroundings_view *v = surroundings_image(around);
            assert_true(v->n_spots > 0);
            if (!beyond)
                assert_near(v->spots[0][axis], point.at_m[axis],
                            1.5 * v->grid.step_m[axis]);
            for (size_t i = 0; i < v->n_spots; i++)
                assert_true(way * (v->spots[i][axis] - middle_m) < reach_m + 0.05);
            surroundings_destroy(around);
            close_scene(&s);
        }
    }
}

static void beside_a_plane_there_is_nothing(void **state)
{
    (void)state;
    const struct scatterer point = {{0.35, 0.0, 1.1}, 1.0};

    for (size_t n = 1; n <= 2; n++) {
        bool beside = false;
        struct scene s;
        open_scene(&s, &point);
        s.rig.grid.n[1] = n;
        s.rig.grid.origin_m[1] = 0.0;
        struct surroundings *around = look(&s);
        const struct surroundings_view *v = surroundings_image(around);
        assert_true(v->n_spots > 0);
        assert_near(v->spots[0][0], 0.35, 1.5 * v->grid.step_m[0]);
        for (size_t i = 0; i < v->n_spots; i++)
            beside |= v->spots[i][1] < -0.01f || v->spots[i][1] > 0.03f;
        assert_int_equal(beside, n > 1);
        surroundings_destroy(around);
        close_scene(&s);
    }
}

/* Its coarse image is that of the volume, and no spot is in it. */
static void what_stands_in_the_volume_is_no_spot(void **state)
{
    (void)state;
    const struct scatterer point = {{0.04, -0.06, 1.12}, 1.0};
    struct scene s;
    size_t best = 0, at[3];

    open_scene(&s, &point);
    struct surroundings *around = look(&s);
    const struct surroundings_view *v = surroundings_image(around);
    for (size_t i = 1; i < grid_size(&v->grid); i++)
        best = v->intensity[i] > v->intensity[best] ? i : best;
    grid_place(&v->grid, best, at);
    for (int a = 0; a < 3; a++) {
        const struct grid *g = &v->grid, *wanted = &s.rig.grid;
        double near_m = wanted->origin_m[a];
        double far_m = near_m + wanted->step_m[a] * (double)(wanted->n[a] - 1);
        double end_m = g->origin_m[a] + g->step_m[a] * (double)(g->n[a] - 1);
        assert_near(g->origin_m[a] + g->step_m[a] * (double)at[a], point.at_m[a],
                    1.5 * g->step_m[a]);
        assert_true(g->origin_m[a] <= near_m && g->origin_m[a] > near_m - g->step_m[a]);
        assert_true(end_m >= far_m && end_m < far_m + g->step_m[a]);
    }
    for (size_t i = 0; i < v->n_spots; i++) {
        bool outside = false;
        for (int a = 0; a < 3; a++) {
            const struct grid *g = &s.rig.grid;
            double far_m = g->origin_m[a] + g->step_m[a] * (double)(g->n[a] - 1);
            outside |= v->spots[i][a] < g->origin_m[a] || v->spots[i][a] > far_m;
        }
        assert_true(outside);
        assert_true(v->spots[i][3] < v->intensity[best]);
    }
    surroundings_destroy(around);
    close_scene(&s);
}

/* What is before the array is not imaged. */
static void it_looks_no_nearer_than_half_of_the_way_to_the_array(void **state)
{
    (void)state;
    const struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
    struct scene s;

    open_scene(&s, &point);
    s.rig.grid.n[2] +=
        (size_t)ceil((s.rig.grid.origin_m[2] - 0.3) / s.rig.grid.step_m[2]);
    s.rig.grid.origin_m[2] = 0.3;
    struct surroundings *around = look(&s);
    const struct surroundings_view *v = surroundings_image(around);
    for (size_t i = 0; i < v->n_spots; i++)
        assert_true(v->spots[i][2] > 0.15 - s.rig.grid.step_m[2]);
    surroundings_destroy(around);
    close_scene(&s);
}

static void an_array_of_which_no_such_image_is_possible_has_none(void **state)
{
    (void)state;
    static const double places_m[16][2][3];
    const struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
    struct scene s;
    struct surroundings *around;

    open_scene(&s, &point);
    struct geometry turning = s.rig.geometry;
    turning.pings_m = places_m;
    struct imager_config wanted = trace_set_imager(&s.set, &s.rig.grid, s.pool);
    wanted.geometry = &turning;
    assert_int_equal(surroundings_create(&around, &wanted), -ENOTSUP);
    wanted.geometry = &s.rig.geometry;
    wanted.grid.step_m[1] = 1e-9; /* across, of a quarter of a metre */
    assert_int_equal(surroundings_create(&around, &wanted), -ENOTSUP);
    wanted.grid.step_m[1] = s.rig.grid.step_m[1];
    for (int a = 0; a < 3; a++)
        wanted.grid.n[a] = 600; /* 12 m */
    assert_int_equal(surroundings_create(&around, &wanted), -ENOTSUP);
    wanted.grid = s.rig.grid;
    s.rig.speakers_m[3][2] += 0.3;
    assert_int_equal(surroundings_create(&around, &wanted), -ENOTSUP);
    close_scene(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_stands_beside_the_volume_is_the_brightest_where_it_stands),
        cmocka_unit_test(it_looks_a_third_of_the_range_aside_and_25_cm_behind),
        cmocka_unit_test(beside_a_plane_there_is_nothing),
        cmocka_unit_test(what_stands_in_the_volume_is_no_spot),
        cmocka_unit_test(it_looks_no_nearer_than_half_of_the_way_to_the_array),
        cmocka_unit_test(an_array_of_which_no_such_image_is_possible_has_none),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
