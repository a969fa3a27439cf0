/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include "recon/mount.h"

/* At the right of the nose, 0.5 m high: looks forward and to the right by 30 degrees. */
static struct mount corner(void)
{
    static const double origin_m[3] = {3.5, -0.8, 0.5};
    const double left[3] = {0.5, sqrt(0.75), 0.0}, up[3] = {0.0, 0.0, 1.0};
    struct mount m;
    mount_create(&m, origin_m, left, up);
    return m;
}

static void what_is_ahead_of_the_array_is_where_it_looks(void **state)
{
    (void)state;
    const struct mount m = corner();
    const double ahead[3] = {0.0, 0.2, 2.0};
    double p[3];
    mount_to_vehicle(&m, ahead, p);
    assert_near(p[0], 3.5 + 2.0 * sqrt(0.75), 1e-12);
    assert_near(p[1], -0.8 - 1.0, 1e-12);
    assert_near(p[2], 0.7, 1e-12);
    mount_to_array(&m, p, p);
    for (int a = 0; a < 3; a++)
        assert_near(p[a], ahead[a], 1e-12);
}

/* 0.5 m forward and 90 degrees to the left. */
static void all_points_step_as_each_of_them(void **state)
{
    (void)state;
    static const double points[2][3] = {{0.3, -0.1, 2.5}, {-2.0, 1.0, 0.5}};
    const struct mount m = corner();
    const struct ego_step step = {0.5, 0.0, 0.5 * M_PI};
    double r[3][3], t[3], p[3], q[3];
    mount_step(&m, &step, r, t);
    for (int k = 0; k < 2; k++) {
        mount_to_vehicle(&m, points[k], p);
        /* What was ahead is to the right, what was to the left ahead. */
        const double there[3] = {p[1], 0.5 - p[0], p[2]};
        mount_to_array(&m, there, q);
        mount_step_point(&m, &step, points[k], p);
        for (int a = 0; a < 3; a++) {
            assert_near(p[a], q[a], 1e-12);
            assert_near(r[a][0] * points[k][0] + r[a][1] * points[k][1] +
                            r[a][2] * points[k][2] + t[a],
                        q[a], 1e-12);
        }
    }
}

/* Its velocity is that with which what stands at it comes towards it. */
static void the_array_moves_against_the_world(void **state)
{
    (void)state;
    static const double here[3] = {0.0, 0.0, 0.0}, dt_s = 1e-6;
    const struct mount m = corner();
    const struct ego_motion motion = {2.0, 0.5};
    const struct ego_step step = {2.0 * dt_s, 0.0, 0.5 * dt_s};
    double v[3], p[3];
    mount_velocity(&m, &motion, v);
    mount_step_point(&m, &step, here, p);
    for (int a = 0; a < 3; a++)
        assert_near(v[a], -p[a] / dt_s, 1e-5);
    assert_near(v[1], 0.0, 1e-12);
    /* 2 + 0.5 x 0.8 m/s forward, 0.5 x 3.5 m/s to the left. */
    assert_near(hypot(v[0], v[2]), hypot(2.4, 1.75), 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_ahead_of_the_array_is_where_it_looks),
        cmocka_unit_test(all_points_step_as_each_of_them),
        cmocka_unit_test(the_array_moves_against_the_world),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
