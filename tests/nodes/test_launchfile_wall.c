/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/rt/launchfile.h"
#include "tests/nodes/near.h"

static int parse(const char *wall, struct launchfile **out, struct error *why)
{
    char text[512];
    int n = snprintf(text, sizeof text, "nodes: [wall]\n%s", wall);
    why->text[0] = 0;
    return launchfile_parse(out, "drive.yaml", text, (size_t)n, why);
}

static void walls_come_from_the_survey_unless_it_says_otherwise(void **state)
{
    (void)state;
    struct launchfile *l;
    struct error why;
    if (parse("", &l, &why))
        fail_msg("%s", why.text);
    assert_true(launchfile_has_node(l, "wall"));
    assert_int_equal(l->wall.from, WALL_FROM_SURVEY);
    assert_true(l->wall.vertical);
    assert_near(l->wall.vertical_deg, 2.0, 0.0);
    assert_near(l->wall.reach_m, 5.0, 0.0);
    assert_near(l->wall.every_s, 0.5, 0.0);
    assert_near(l->wall.lost_s, 3.0, 0.0);
    assert_int_equal(l->wall.n_corners, 0);
    launchfile_destroy(l);
}

static void each_key_is_taken(void **state)
{
    (void)state;
    struct launchfile *l;
    struct error why;
    if (parse(
            "wall: {from: echoes, prior: none, vertical_deg: 3, reach_m: 7, every_s: 1, "
            "lost_s: 9, free_view_m: [[-1, 0], [1, 0], [0, 2.5]]}\n",
            &l, &why))
        fail_msg("%s", why.text);
    assert_int_equal(l->wall.from, WALL_FROM_ECHOES);
    assert_false(l->wall.vertical);
    assert_near(l->wall.vertical_deg, 3.0, 0.0);
    assert_near(l->wall.reach_m, 7.0, 0.0);
    assert_near(l->wall.every_s, 1.0, 0.0);
    assert_near(l->wall.lost_s, 9.0, 0.0);
    assert_int_equal(l->wall.n_corners, 3);
    assert_near(l->wall.free_view_m[0][0], -1.0, 0.0);
    assert_near(l->wall.free_view_m[2][1], 2.5, 0.0);
    launchfile_destroy(l);
    assert_int_equal(parse("wall: {from: topic}\n", &l, &why), 0);
    assert_int_equal(l->wall.from, WALL_FROM_TOPIC);
    launchfile_destroy(l);
}

static void what_does_not_fit_is_named(void **state)
{
    (void)state;
    const struct {
        const char *text, *says;
    } cases[] = {
        {"wall: {from: radar}\n", "wall.from: expected survey, topic or echoes"},
        {"wall: {prior: flat}\n", "wall.prior: expected vertical or none"},
        {"wall: {reach_m: 0.1}\n", "wall.reach_m: expected 0.3 to 20, not 0.1"},
        {"wall: {vertical_deg: 0}\n", "wall.vertical_deg: expected"},
        {"wall: {every_s: -1}\n", "wall.every_s: expected"},
        {"wall: {lost_s: 1000}\n", "wall.lost_s: expected"},
        {"wall: {free_view_m: [[0, 1], [1, 1]]}\n", "expected at least 3 corners"},
        {"wall: {free_view_m: [[0, 1], [1, 1], [2, 1e9]]}\n", "wall.free_view_m[2]"},
        {"wall: {free_view_m: [[0, 1, 2], [1, 1, 2], [2, 1, 2]]}\n", "drive.yaml:2"},
        {"wall: {distance_m: 1}\n", "distance_m"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct launchfile *l;
        struct error why;
        assert_int_equal(parse(cases[i].text, &l, &why), -EINVAL);
        if (!strstr(why.text, cases[i].says))
            fail_msg("\"%s\" does not say \"%s\"", why.text, cases[i].says);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(walls_come_from_the_survey_unless_it_says_otherwise),
        cmocka_unit_test(each_key_is_taken),
        cmocka_unit_test(what_does_not_fit_is_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
