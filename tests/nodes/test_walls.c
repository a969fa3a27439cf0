/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "msgs/convert.h"
#include "recon/walls/walls.h"
#include "tests/nodes/near.h"
#include "tests/nodes/wall_message.h"

static void a_message_comes_in_as_it_is(void **state)
{
    (void)state;
    struct wall_message m;
    struct walls w;
    wall_message_make(&m);
    m.list.n_free_view_m = 6;
    memcpy(m.free_view_m, (double[]){0, 0, 1, 0, 0, 2}, 6 * sizeof(double));
    assert_int_equal(walls_from_message(&w, &m.list, NULL), 0);
    assert_int_equal(w.n, 1);
    assert_int_equal(w.list[0].id, 3);
    assert_near(w.list[0].plane.normal[0], 1.0, 0.0);
    assert_near(w.list[0].plane.covariance[5], 4e-4, 0.0);
    assert_near(w.list[0].gate_m[1], 9.0, 0.0);
    assert_int_equal(w.n_corners, 3);
    assert_true(walls_in_free_view(&w, (double[]){0.2, 9.0, 0.2}));
    assert_false(walls_in_free_view(&w, (double[]){0.6, 0.0, 1.0}));
    assert_false(walls_in_free_view(&w, (double[]){-0.1, 0.0, 0.1}));
}

static void what_is_no_wall_is_refused(void **state)
{
    (void)state;
    static const char *const words[] = {
        "without id", "length 1.1",   "without id", "covariance", "covariance",
        "covariance", "gate 10 to 9", "corners",    "no number",  "without id",
        "1 ends",     "from < to",    "from < to"};
    static double ends[3][2] = {{-1, 1}, {1, -1}, {-1, INFINITY}};
    for (int k = 0; k < 13; k++) {
        struct wall_message m;
        struct walls w;
        struct error why = {""};
        wall_message_make(&m);
        if (k == 0)
            m.wall.normal = NULL;
        else if (k == 1)
            m.normal.x = 1.1;
        else if (k == 2)
            m.wall.distance_m = NAN;
        else if (k == 3)
            m.covariance[0] = -1.0;
        else if (k == 4)
            m.covariance[2] = 1.0; /* more correlated than there is */
        else if (k == 5)
            m.wall.n_covariance = 5;
        else if (k == 6)
            m.wall.gate_near_m = 10.0;
        else if (k == 7)
            m.list.n_free_view_m = 3;
        else if (k == 8) {
            m.list.n_free_view_m = 6;
            memcpy(m.free_view_m, (double[]){0, 0, 1, NAN, 0, 2}, 6 * sizeof(double));
        } else if (k >= 10) {
            m.wall.n_ends_m = k == 10 ? 1 : 2;
            m.wall.ends_m = ends[k - 10];
        } else
            m.wall.id = 0;
        assert_int_equal(walls_from_message(&w, &m.list, &why), -EINVAL);
        if (!strstr(why.text, words[k]))
            fail_msg("%d: %s", k, why.text);
    }
}

/* Correlations r12, r13, r23 of unit variances: each pair of them may be, and yet not the
 * three, by the sign of 1 + 2 r12 r13 r23 - r12^2 - r13^2 - r23^2. */
static void correlations_must_be_possible_together(void **state)
{
    (void)state;
    static const struct {
        double r[3];
        int err;
    } cases[] = {
        {{0.9, 0.9, 0.9}, 0},             /* 0.028 */
        {{0.9, 0.9, -0.9}, -EINVAL},      /* -2.89 */
        {{-0.5, -0.5, -0.5}, 0},          /* 0: just */
        {{-0.55, -0.55, -0.55}, -EINVAL}, /* -0.24 */
        {{0.8, 0.6, 0.0}, 0},             /* 0: just */
        {{0.8, 0.0, 0.61}, -EINVAL},      /* -0.01 */
        {{0.0, 0.8, 0.61}, -EINVAL},
    };
    for (size_t q = 0; q < sizeof cases / sizeof *cases; q++) {
        const double *r = cases[q].r;
        const struct walls w = {
            .n = 1,
            .list = {{.id = 1,
                      .plane = {.normal = {1, 0, 0},
                                .distance_m = 5.0,
                                .covariance = {1, r[0], r[1], 1, r[2], 1}}}}};
        assert_int_equal(walls_check(&w, NULL), cases[q].err);
    }
}

/* The array stands 3.6 m before the vehicle's origin and looks forward, its x to the
 * left: 5 m before the origin is 1.4 m before the array.  It is 0.2 m to the side, so a
 * turn of the wall about the vehicle's upright changes its distance by 0.2 m for each
 * radian.  It ends 1 m to the left of the vehicle and 2 m to the right, 0.8 and 2.2 m of
 * the array. */
static void a_given_wall_comes_from_the_vehicle_frame(void **state)
{
    (void)state;
    const struct survey s = {.has_mount = true,
                             .mount_origin_m = {3.6, 0.2, 0.5},
                             .mount_x_axis = {0, 1, 0},
                             .mount_y_axis = {0, 0, 1}};
    struct wall_message m;
    struct walls w;
    double ends[2] = {-1.0, 2.0};
    wall_message_make(&m);
    m.wall.n_ends_m = 2;
    m.wall.ends_m = ends;
    assert_int_equal(walls_from_message(&w, &m.list, NULL), 0);
    walls_to_array(&w, &s);
    const struct wall *p = &w.list[0].plane;
    assert_near(p->normal[2], 1.0, 1e-12);
    assert_near(p->distance_m, 1.4, 1e-12);
    assert_near(p->covariance[0], 1e-4, 1e-15);
    assert_near(p->covariance[5], 4e-4 + 0.04e-4, 1e-12);
    assert_near(fabs(p->covariance[2]), 0.2e-4, 1e-12);
    assert_near(p->ends_m[0], -0.8, 1e-12);
    assert_near(p->ends_m[1], 2.2, 1e-12);
    m.normal.x = -1.0; /* the same wall, told from its other side */
    m.wall.distance_m = -5.0;
    ends[0] = -2.0;
    ends[1] = 1.0;
    assert_int_equal(walls_from_message(&w, &m.list, NULL), 0);
    walls_to_array(&w, &s);
    assert_near(p->normal[2], 1.0, 1e-12);
    assert_near(p->distance_m, 1.4, 1e-12);
    assert_near(p->ends_m[0], -0.8, 1e-12);
    assert_near(p->ends_m[1], 2.2, 1e-12);
}

/* 0.5 m forward and 90 degrees to the left: what was ahead is to the right. */
static void walls_stay_where_they_are_when_the_vehicle_moves(void **state)
{
    (void)state;
    const struct survey s = {.has_mount = true,
                             .mount_origin_m = {1.0, 0.0, 0.5},
                             .mount_x_axis = {0, 1, 0},
                             .mount_y_axis = {0, 0, 1}};
    const struct ego_step step = {0.5, 0.0, 0.5 * M_PI};
    struct walls w = {
        .n = 1,
        .list = {
            {.id = 1,
             .plane = {.normal = {0, 0, 1}, .distance_m = 2.0, .ends_m = {-1.0, 1.5}}}}};
    walls_step(&w, &s, &step);
    /* The wall is 3 m before the old origin, so 2.5 m to the right of the new one, and of
     * the array, which stands 1 m ahead of it along the wall.  Its end on the left is
     * beside the array then, and that on the right 2.5 m behind it: along -z. */
    assert_near(w.list[0].plane.normal[0], -1.0, 1e-12);
    assert_near(w.list[0].plane.distance_m, 2.5, 1e-12);
    assert_near(w.list[0].plane.ends_m[0], 0.0, 1e-12);
    assert_near(w.list[0].plane.ends_m[1], 2.5, 1e-12);
}

static void a_survey_names_one_wall_or_several(void **state)
{
    (void)state;
    struct survey s = {
        .has_wall = true, .wall_normal = {0, 0, 1}, .wall_distance_m = 1.25};
    struct walls w;
    walls_from_survey(&w, &s);
    assert_int_equal(w.n, 1);
    assert_near(w.list[0].plane.distance_m, 1.25, 0.0);
    assert_near(w.list[0].plane.covariance[5], 0.0, 0.0);
    assert_near(w.existence[0], 1.0, 0.0);
    s.n_walls = 2;
    s.walls[0] = (struct survey_wall){{0, 0, 1}, 1.25, {0, 2}};
    s.walls[1] = (struct survey_wall){{1, 0, 0}, 3.0, {2, 4}};
    walls_from_survey(&w, &s);
    assert_int_equal(w.n, 2);
    assert_int_equal(w.list[1].id, 2);
    assert_near(w.list[1].gate_m[0], 2.0, 0.0);
    assert_near(w.existence[1], 1.0, 0.0);
    walls_from_survey(&w, &(struct survey){.n_walls = 0});
    assert_int_equal(w.n, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_message_comes_in_as_it_is),
        cmocka_unit_test(what_is_no_wall_is_refused),
        cmocka_unit_test(correlations_must_be_possible_together),
        cmocka_unit_test(a_given_wall_comes_from_the_vehicle_frame),
        cmocka_unit_test(walls_stay_where_they_are_when_the_vehicle_moves),
        cmocka_unit_test(a_survey_names_one_wall_or_several),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
