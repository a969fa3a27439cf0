/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <errno.h>

#include "recon/ego.h"
#include "tests/recon/reference.h"

#define MS 1000000LL

static void assert_step(const struct ego_step *s, double dx_m, double dy_m, double dyaw,
                        double tolerance)
{
    assert_near(s->dx_m, dx_m, tolerance);
    assert_near(s->dy_m, dy_m, tolerance);
    assert_near(s->dyaw, dyaw, tolerance);
}

static void add(struct ego_path *p, int64_t stamp_ns, double speed_m_s, double yaw_rate)
{
    const struct ego_motion m = {speed_m_s, yaw_rate};
    assert_int_equal(ego_path_add(p, stamp_ns, &m), 0);
}

/* -- steps ------------------------------------------------------------------------------
 */

static void a_quarter_turn_to_the_left_ends_a_radius_ahead_and_a_radius_left(void **state)
{
    (void)state;
    const struct ego_motion m = {2.0, M_PI / 2.0};
    struct ego_step s;
    ego_motion_step(&m, 1.0, &s);
    assert_step(&s, 4.0 / M_PI, 4.0 / M_PI, M_PI / 2.0, 1e-15);
}

static void without_turning_the_way_is_speed_times_time(void **state)
{
    (void)state;
    const struct ego_motion straight = {3.0, 0.0}, nearly = {3.0, 1e-12};
    struct ego_step s;
    ego_motion_step(&straight, 0.5, &s);
    assert_step(&s, 1.5, 0.0, 0.0, 0.0);
    ego_motion_step(&nearly, 0.5, &s);
    assert_step(&s, 1.5, 0.0, 0.0, 1e-11);
}

static void turning_on_the_spot_moves_points_to_the_right(void **state)
{
    (void)state;
    const struct ego_motion m = {0.0, 0.5};
    const double ahead[3] = {10.0, 0.0, 1.0};
    struct ego_step s;
    double p[3];
    ego_motion_step(&m, 0.2, &s);
    ego_step_point(&s, ahead, p);
    assert_near(p[0], 10.0 * cos(0.1), 1e-14);
    assert_near(p[1], -10.0 * sin(0.1), 1e-14);
    assert_near(p[2], 1.0, 0.0);
}

static void driving_on_brings_what_stands_ahead_nearer(void **state)
{
    (void)state;
    const struct ego_motion m = {2.0, 0.0};
    struct ego_step s;
    double p[3] = {5.0, 1.0, 0.5};
    ego_motion_step(&m, 0.25, &s);
    ego_step_point(&s, p, p);
    assert_near(p[0], 4.5, 1e-15);
    assert_near(p[1], 1.0, 1e-15);
    assert_near(p[2], 0.5, 0.0);
}

/* Half a circle in one step and in two unequal ones. */
static void two_steps_joined_are_the_whole(void **state)
{
    (void)state;
    const struct ego_motion m = {-1.5, 0.7};
    struct ego_step a, b, joined, whole;
    ego_motion_step(&m, 0.3, &a);
    ego_motion_step(&m, 1.9, &b);
    ego_motion_step(&m, 2.2, &whole);
    ego_step_join(&a, &b, &joined);
    assert_step(&joined, whole.dx_m, whole.dy_m, whole.dyaw, 1e-14);
}

static void points_keep_their_distances_and_directions_turn_with_them(void **state)
{
    (void)state;
    const struct ego_step s = {0.3, -0.2, 0.4};
    const double p[3] = {1.0, 2.0, 0.0}, q[3] = {-0.5, 4.0, 1.0};
    const double way[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
    double p1[3], q1[3], way1[3];
    ego_step_point(&s, p, p1);
    ego_step_point(&s, q, q1);
    ego_step_turn(&s, way, way1);
    for (int a = 0; a < 3; a++)
        assert_near(way1[a], q1[a] - p1[a], 1e-15);
    assert_near(reference_distance(p1, q1), reference_distance(p, q), 1e-15);
}

/* -- path -------------------------------------------------------------------------------
 */

static void along_a_path_of_one_motion_it_is_one_step(void **state)
{
    (void)state;
    struct ego_path p = {0};
    struct ego_step s;
    for (int k = 0; k <= 50; k++)
        add(&p, k * 20 * MS, 2.0, 0.3);
    assert_int_equal(ego_path_between(&p, 33 * MS, 977 * MS, &s), 0);
    double radius_m = 2.0 / 0.3, turn = 0.3 * 0.944;
    assert_step(&s, radius_m * sin(turn), radius_m * (1.0 - cos(turn)), turn, 1e-12);
}

static void speed_that_rises_between_stamps_is_integrated(void **state)
{
    (void)state;
    struct ego_path p = {0};
    struct ego_step s;
    struct ego_motion m;
    for (int k = 0; k <= 10; k++)
        add(&p, k * 50 * MS, 1.0 + 0.2 * k, 0.0); /* 4 m/s^2 */
    assert_int_equal(ego_path_between(&p, 10 * MS, 430 * MS, &s), 0);
    assert_step(&s, 0.42 + 2.0 * (0.43 * 0.43 - 0.01 * 0.01), 0.0, 0.0, 1e-12);
    assert_int_equal(ego_path_at(&p, 130 * MS, &m), 0);
    assert_near(m.speed_m_s, 1.0 + 4.0 * 0.13, 1e-12);
}

/* Steering in: yaw t^2 at 3 m/s, against a sum of a million small ways.  Between stamps
 * the heading's bow of 2 x 0.02^2 / 8 counts as straight, two thirds of it on average. */
static void a_yaw_rate_that_rises_bends_the_path_more_and_more(void **state)
{
    (void)state;
    struct ego_path p = {0};
    struct ego_step s;
    double x = 0.0, y = 0.0, dt = 1e-6;
    for (int k = 0; k <= 50; k++)
        add(&p, k * 20 * MS, 3.0, 2.0 * 0.02 * k);
    for (int q = 0; q < 1000000; q++) {
        double t = (q + 0.5) * dt;
        x += 3.0 * dt * cos(t * t);
        y += 3.0 * dt * sin(t * t);
    }
    assert_int_equal(ego_path_between(&p, 0, 1000 * MS, &s), 0);
    assert_step(&s, x, y, 1.0, 3.0 * 0.67e-4);
}

static void back_in_time_is_the_way_back(void **state)
{
    (void)state;
    struct ego_path p = {0};
    struct ego_step there, back, both;
    for (int k = 0; k <= 20; k++)
        add(&p, k * 20 * MS, 1.0 + 0.1 * k, 0.2 - 0.05 * k);
    assert_int_equal(ego_path_between(&p, 15 * MS, 387 * MS, &there), 0);
    assert_int_equal(ego_path_between(&p, 387 * MS, 15 * MS, &back), 0);
    ego_step_join(&there, &back, &both);
    assert_step(&both, 0.0, 0.0, 0.0, 1e-14);
}

static void the_newest_motion_holds_for_a_tenth_of_a_second(void **state)
{
    (void)state;
    struct ego_path p = {0};
    struct ego_step s = {1.0, 1.0, 1.0};
    struct ego_motion m;
    add(&p, 1000 * MS, 2.0, 0.0);
    assert_int_equal(ego_path_at(&p, 1100 * MS, &m), 0);
    assert_near(m.speed_m_s, 2.0, 0.0);
    assert_int_equal(ego_path_between(&p, 1000 * MS, 1100 * MS, &s), 0);
    assert_step(&s, 0.2, 0.0, 0.0, 1e-15);
    assert_int_equal(ego_path_at(&p, 1100 * MS + 1, &m), -ENODATA);
    assert_near(m.speed_m_s, 0.0, 0.0);
    assert_int_equal(ego_path_between(&p, 1000 * MS, 1100 * MS + 1, &s), -ENODATA);
    assert_step(&s, 0.0, 0.0, 0.0, 0.0);
}

static void before_the_oldest_and_in_a_long_gap_nothing_is_known(void **state)
{
    (void)state;
    struct ego_path p = {0};
    struct ego_step s;
    struct ego_motion m;
    assert_int_equal(ego_path_at(&p, 0, &m), -ENODATA);
    assert_int_equal(ego_path_between(&p, 0, 0, &s), -ENODATA);
    add(&p, 0, 1.0, 0.0);
    add(&p, 20 * MS, 1.0, 0.0);
    add(&p, 180 * MS, 1.0, 0.0);
    assert_int_equal(ego_path_at(&p, -1, &m), -ENODATA);
    assert_int_equal(ego_path_between(&p, -1, 10 * MS, &s), -ENODATA);
    assert_int_equal(ego_path_between(&p, 10 * MS, 110 * MS, &s), 0);
    assert_int_equal(ego_path_between(&p, 10 * MS, 190 * MS, &s), -ENODATA);
    assert_int_equal(ego_path_between(&p, 180 * MS, 190 * MS, &s), 0);
    assert_int_equal(ego_path_at(&p, 150 * MS, &m), -ENODATA);
}

static void what_comes_late_or_is_no_number_is_refused(void **state)
{
    (void)state;
    struct ego_path p = {0};
    struct ego_motion m = {1.0, 0.0}, bad = {NAN, 0.0}, worse = {0.0, INFINITY};
    add(&p, 100 * MS, 1.0, 0.0);
    assert_int_equal(ego_path_add(&p, 100 * MS, &m), -EINVAL);
    assert_int_equal(ego_path_add(&p, 99 * MS, &m), -EINVAL);
    assert_int_equal(ego_path_add(&p, 101 * MS, &bad), -EINVAL);
    assert_int_equal(ego_path_add(&p, 101 * MS, &worse), -EINVAL);
    assert_int_equal(p.n, 1);
}

static void what_is_faster_than_a_vehicle_is_not_believed(void **state)
{
    (void)state;
    struct ego_path p = {0};
    const struct ego_motion fast = {-100.0, 10.0};
    const struct ego_motion none[] = {
        {100.1, 0.0}, {-100.1, 0.0}, {1.0, 10.1}, {1.0, -10.1}};
    assert_int_equal(ego_path_add(&p, 100 * MS, &fast), 0);
    for (size_t i = 0; i < 4; i++)
        assert_int_equal(ego_path_add(&p, 120 * MS, &none[i]), -EINVAL);
    assert_int_equal(p.n, 1);
}

static void the_oldest_motions_make_room_for_the_newest(void **state)
{
    (void)state;
    struct ego_path p = {0};
    struct ego_step s;
    const int n = EGO_PATH_MOTIONS + 100;
    for (int k = 0; k < n; k++)
        add(&p, k * 20 * MS, 0.5, 0.0);
    assert_int_equal(p.n, EGO_PATH_MOTIONS);
    assert_int_equal(ego_path_between(&p, 100 * 20 * MS, (n - 1) * 20 * MS, &s), 0);
    assert_step(&s, 0.5 * 0.02 * (EGO_PATH_MOTIONS - 1), 0.0, 0.0, 1e-12);
    assert_int_equal(ego_path_between(&p, 100 * 20 * MS - 1, 3000 * MS, &s), -ENODATA);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(
            a_quarter_turn_to_the_left_ends_a_radius_ahead_and_a_radius_left),
        cmocka_unit_test(without_turning_the_way_is_speed_times_time),
        cmocka_unit_test(turning_on_the_spot_moves_points_to_the_right),
        cmocka_unit_test(driving_on_brings_what_stands_ahead_nearer),
        cmocka_unit_test(two_steps_joined_are_the_whole),
        cmocka_unit_test(points_keep_their_distances_and_directions_turn_with_them),
        cmocka_unit_test(along_a_path_of_one_motion_it_is_one_step),
        cmocka_unit_test(speed_that_rises_between_stamps_is_integrated),
        cmocka_unit_test(a_yaw_rate_that_rises_bends_the_path_more_and_more),
        cmocka_unit_test(back_in_time_is_the_way_back),
        cmocka_unit_test(the_newest_motion_holds_for_a_tenth_of_a_second),
        cmocka_unit_test(before_the_oldest_and_in_a_long_gap_nothing_is_known),
        cmocka_unit_test(what_comes_late_or_is_no_number_is_refused),
        cmocka_unit_test(what_is_faster_than_a_vehicle_is_not_believed),
        cmocka_unit_test(the_oldest_motions_make_room_for_the_newest),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
