/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "tests/recon/near.h"

#include "recon/tracking/sight.h"

/* Without a mount the vehicle frame is the array's.  The image: x -4 to 4, z 0.5 to 6. */
static const struct grid grid = {
    .origin_m = {-4, 0, 0.5}, .step_m = {0.5, 1, 0.5}, .n = {17, 1, 12}};
static const struct walls none = {.n = 0};

static bool shows(const struct walls *walls, double x_m, double z_m)
{
    const struct survey survey = {.has_mount = false};
    const double p[3] = {x_m, 0, z_m};
    struct sight s;
    sight_init(&s, &survey, walls, &none, &grid);
    return sight_shows(&s, p);
}

/* A wall at 2 m from x = -1 to 1: what stands at (x, z) is imaged at (x, 4 - z), and the
 * way there crosses the wall at 2 x / (4 - z). */
static void what_leaves_the_end_of_a_wall_is_out_of_view(void **state)
{
    (void)state;
    struct walls w = {
        .n = 1,
        .list = {{.id = 1,
                  .plane = {.normal = {0, 0, 1}, .distance_m = 2, .ends_m = {-1, 1}},
                  .gate_m = {0, 10}}}};
    assert_true(shows(&w, 1.4, 1));
    assert_false(shows(&w, 1.6, 1)); /* at 1.07 */
    assert_true(shows(&w, -1.4, 1));
    assert_false(shows(&w, -1.6, 1));
    assert_false(shows(&w, 1.5, 2.5)); /* seen past the end, directly: no track of it */
    memset(w.list[0].plane.ends_m, 0, sizeof w.list[0].plane.ends_m);
    assert_true(shows(&w, 1.6, 1));
}

/* Through the opening between two pieces of a wall nothing is seen by way of them. */
static void an_opening_shows_nothing(void **state)
{
    (void)state;
    const struct walls w = {
        .n = 2,
        .list = {
            {1, {.normal = {0, 0, 1}, .distance_m = 2, .ends_m = {0.5, 3}}, {0, 10}},
            {2, {.normal = {0, 0, 1}, .distance_m = 2, .ends_m = {-3, -0.5}}, {0, 10}}}};
    assert_true(shows(&w, 0.8, 1));
    assert_false(shows(&w, 0.7, 1)); /* at 0.47 */
    assert_false(shows(&w, -0.7, 1));
    assert_true(shows(&w, -0.8, 1));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_leaves_the_end_of_a_wall_is_out_of_view),
        cmocka_unit_test(an_opening_shows_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
