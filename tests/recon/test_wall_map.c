/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "recon/walls/wall_map.h"
#include "tests/nodes/near.h"

#define SECOND 1000000000LL

static struct wall_map *make(enum wall_from from, const struct survey *s)
{
    const struct wall_map_config cfg = {.from = from,
                                        .lost_s = 3.0,
                                        .vertical_rad = 0.01,
                                        .n_corners = 3,
                                        .free_view_m = {{0, 0}, {1, 0}, {0, 2}}};
    struct wall_map *k = malloc(sizeof *k);
    assert_non_null(k);
    wall_map_init(k, &cfg);
    wall_map_survey(k, s, false);
    return k;
}

static const struct survey nothing = {.n_walls = 0};

static struct wall_estimates ahead(double distance_m)
{
    return (struct wall_estimates){
        .n = 1,
        .list = {{.wall = {.normal = {0, 0, 1},
                           .distance_m = distance_m,
                           .covariance = {1e-5, 0, 0, 1e-3, 0, 1e-5}},
                  .share = 1.0}}};
}

/* A knocked microphone moves no wall. */
static void walls_stay_when_the_same_array_has_another_survey(void **state)
{
    const struct survey moved = nothing;
    const struct wall_estimates e = ahead(2.0);

    (void)state;
    for (int keep = 0; keep < 2; keep++) {
        struct wall_map *k = make(WALL_FROM_ECHOES, &nothing);
        for (int i = 1; i <= 10; i++) {
            wall_map_advance(k, i * SECOND / 10);
            wall_map_estimates(k, &e);
        }
        assert_int_equal(wall_map_list(k)->n, 1);
        wall_map_survey(k, &moved, keep);
        assert_int_equal(wall_map_list(k)->n, keep);
        if (keep)
            assert_near(wall_map_list(k)->list[0].plane.distance_m, 2.0, 1e-9);
        free(k);
    }
}

static void drive(struct wall_map *k, double speed_m_s, double from_s, double to_s)
{
    for (int n = (int)(50 * from_s); n <= (int)(50 * to_s); n++) {
        const struct ego_motion m = {speed_m_s, 0.0};
        wall_map_ego(k, &m, n * SECOND / 50);
    }
}

static void the_survey_s_walls_are_told_as_configured(void **state)
{
    (void)state;
    const struct survey s = {
        .has_wall = true, .wall_normal = {0, 0, 1}, .wall_distance_m = 1.25};
    struct wall_map *k = make(WALL_FROM_SURVEY, &s);
    const struct walls *list = wall_map_list(k);
    assert_int_equal(list->n, 1);
    assert_int_equal(list->origin[0], WALL_CONFIGURED);
    assert_near(list->list[0].plane.distance_m, 1.25, 0.0);
    assert_string_equal(k->text, "");
    assert_int_equal(list->n_corners, 3);
    assert_near(list->free_view_m[2][1], 2.0, 0.0);
    wall_map_survey(k, &nothing, false);
    assert_int_equal(wall_map_list(k)->n, 0);
    assert_true(k->text[0]);
    free(k);
}

static void a_wall_is_told_from_its_second_look_on(void **state)
{
    (void)state;
    struct wall_map *k = make(WALL_FROM_ECHOES, &nothing);
    const struct wall_estimates e = ahead(2.0);
    wall_map_advance(k, SECOND);
    wall_map_estimates(k, &e);
    assert_int_equal(wall_map_list(k)->n, 0);
    wall_map_advance(k, 2 * SECOND);
    wall_map_estimates(k, &e);
    const struct walls *list = wall_map_list(k);
    assert_int_equal(list->n, 1);
    assert_int_equal(list->origin[0], WALL_ESTIMATED);
    assert_int_equal(list->list[0].id, 1);
    assert_true(list->list[0].plane.covariance[5] > 0.0);
    assert_true(list->existence[0] > 0.9);
    assert_string_equal(k->text, "");
    free(k);
}

/* Half a second at 2 m/s toward it. */
static void walls_come_nearer_between_looks(void **state)
{
    (void)state;
    struct wall_map *k = make(WALL_FROM_ECHOES, &nothing);
    const struct wall_estimates e = ahead(3.0);
    drive(k, 0.0, 0.0, 2.0);
    wall_map_advance(k, SECOND);
    wall_map_estimates(k, &e);
    wall_map_advance(k, 2 * SECOND);
    wall_map_estimates(k, &e);
    drive(k, 2.0, 2.02, 2.5);
    wall_map_advance(k, 5 * SECOND / 2);
    const struct walls *list = wall_map_list(k);
    assert_int_equal(list->n, 1);
    assert_near(list->list[0].plane.distance_m, 3.0 - 0.98,
                1e-6); /* half of 20 ms to 2 */
    assert_near(list->unseen_s[0], 0.5, 1e-9);
    assert_true(list->list[0].plane.covariance[5] > 5e-4);
    free(k);
}

static void a_wall_that_is_not_seen_any_more_is_said_to_be_lost(void **state)
{
    (void)state;
    struct wall_map *k = make(WALL_FROM_ECHOES, &nothing);
    const struct wall_estimates e = ahead(3.0), none = {.n = 0};
    wall_map_advance(k, SECOND);
    wall_map_estimates(k, &e);
    wall_map_estimates(k, &e);
    for (int n = 3; n < 8; n++) {
        wall_map_advance(k, n * SECOND);
        wall_map_estimates(k, &none);
    }
    assert_int_equal(wall_map_list(k)->n, 0);
    assert_string_equal(k->text, "wall 1 is lost");
    free(k);
}

static void without_ego_motion_walls_are_lost_and_it_says_why(void **state)
{
    (void)state;
    struct wall_map *k = make(WALL_FROM_ECHOES, &nothing);
    const struct wall_estimates e = ahead(3.0);
    drive(k, 2.0, 0.0, 1.0);
    wall_map_advance(k, SECOND);
    wall_map_estimates(k, &e);
    wall_map_estimates(k, &e);
    wall_map_advance(k, 2 * SECOND);
    assert_int_equal(wall_map_list(k)->n, 0);
    assert_non_null(strstr(k->text, "nobody tells how the vehicle moves"));
    free(k);
}

static void what_cannot_be_told_is_said(void **state)
{
    (void)state;
    struct wall_map *k = make(WALL_FROM_ECHOES, &nothing);
    const struct wall_estimates e = {.n_undetermined = 1};
    wall_map_advance(k, SECOND);
    wall_map_estimates(k, &e);
    assert_int_equal(wall_map_list(k)->n, 0);
    assert_non_null(strstr(k->text, "cannot tell how it stands"));
    free(k);
}

static void a_pillar_is_said_while_it_is_heard(void **state)
{
    (void)state;
    struct wall_map *k = make(WALL_FROM_ECHOES, &nothing);
    const struct wall_estimates outwards = {.n_bent = 1, .curvature_1_m = 0.625},
                                inwards = {.n_bent = 1, .curvature_1_m = -0.4},
                                silence = {.n = 0};
    wall_map_advance(k, SECOND);
    wall_map_estimates(k, &outwards);
    assert_int_equal(wall_map_list(k)->n, 0);
    assert_non_null(strstr(k->text, "round, outwards by a radius of 1.6 m"));
    wall_map_estimates(k, &inwards);
    assert_int_equal(wall_map_list(k)->n, 0);
    assert_non_null(strstr(k->text, "round, inwards by a radius of 2.5 m"));
    wall_map_estimates(k, &silence);
    assert_int_equal(wall_map_list(k)->n, 0);
    assert_string_equal(k->text, "no wall is known yet");
    free(k);
}

/* Given in the vehicle frame 4 m ahead, half a second ago at 2 m/s. */
static void given_walls_are_carried_to_the_present_and_keep_their_ids(void **state)
{
    (void)state;
    struct wall_map *k = make(WALL_FROM_TOPIC, &nothing);
    struct walls given = {
        .n = 1, .list = {{.id = 12, .plane = {.normal = {1, 0, 0}, .distance_m = 4.0}}}};
    drive(k, 2.0, 0.0, 2.0);
    wall_map_advance(k, 3 * SECOND / 2);
    assert_int_equal(wall_map_given(k, &given, SECOND, NULL), 0);
    const struct walls *out = wall_map_list(k);
    assert_int_equal(out->n, 1);
    assert_int_equal(out->list[0].id, 12);
    assert_int_equal(out->origin[0], WALL_GIVEN);
    assert_near(out->list[0].plane.normal[2], 1.0, 1e-9);
    assert_near(out->list[0].plane.distance_m, 3.0, 1e-6);
    given.unseen_s[0] = 0.2; /* said before: nothing new */
    given.list[0].plane.distance_m = 9.0;
    assert_int_equal(wall_map_given(k, &given, 3 * SECOND / 2, NULL), 0);
    assert_near(wall_map_list(k)->list[0].plane.distance_m, 3.0, 1e-6);
    assert_near(wall_map_list(k)->list[0].plane.covariance[3], 1e-4,
                1e-5); /* the prior's */
    given.unseen_s[0] = 0.0;
    given.list[0].plane.distance_m = NAN;
    assert_int_equal(wall_map_given(k, &given, SECOND, NULL), -EINVAL);
    drive(k, 0.0, 2.02, 6.0);
    for (int n = 2; n <= 6; n++)
        wall_map_advance(k, n * SECOND);
    assert_int_equal(wall_map_list(k)->n, 0);
    assert_string_equal(k->text, "wall 12 is lost");
    free(k);
}

/* Driving along a wall on the right: its far end comes nearer by the way, and it keeps
 * what was given first until it is given anew. */
static void given_walls_keep_their_ends(void **state)
{
    (void)state;
    struct wall_map *k = make(WALL_FROM_TOPIC, &nothing);
    struct walls given = {
        .n = 1,
        .list = {
            {.id = 3,
             .plane = {.normal = {0, -1, 0}, .distance_m = 2.0, .ends_m = {-5.0, 1.0}}}}};
    /* To the right of who looks at it is behind: it reaches 5 m ahead. */
    drive(k, 2.0, 0.0, 2.0);
    wall_map_advance(k, SECOND / 2);
    assert_int_equal(wall_map_given(k, &given, SECOND / 2, NULL), 0);
    wall_map_advance(k, SECOND);
    const struct wall *w = &wall_map_list(k)->list[0].plane;
    assert_near(w->normal[0], -1.0, 1e-9); /* the array's x is to the left */
    assert_near(w->ends_m[0], -4.0, 1e-6);
    assert_near(w->ends_m[1], 2.0, 1e-6);
    given.unseen_s[0] = 0.2;
    given.list[0].plane.ends_m[0] = -9.0;
    assert_int_equal(wall_map_given(k, &given, SECOND, NULL), 0);
    assert_near(wall_map_list(k)->list[0].plane.ends_m[0], -4.0, 1e-6);
    given.unseen_s[0] = 0.0;
    assert_int_equal(wall_map_given(k, &given, SECOND, NULL), 0);
    assert_near(wall_map_list(k)->list[0].plane.ends_m[0], -9.0, 1e-6);
    memset(given.list[0].plane.ends_m, 0, sizeof given.list[0].plane.ends_m);
    assert_int_equal(wall_map_given(k, &given, SECOND, NULL), 0);
    assert_false(wall_ends(&wall_map_list(k)->list[0].plane));
    free(k);
}

/* Also when as many others were known, and no one more: what lies behind a full list is
 * none of it. */
static void as_many_walls_as_there_may_be_are_all_told(void **state)
{
    (void)state;
    struct wall_map *k = make(WALL_FROM_TOPIC, &nothing);
    struct walls given = {.n = WALLS_MAX};
    for (uint32_t first = 1; first <= 1 + WALLS_MAX; first += WALLS_MAX) {
        uint32_t seen = 0;
        for (uint32_t i = 0; i < WALLS_MAX; i++)
            given.list[i] = (struct wall_gate){
                .id = first + i,
                .plane = {.normal = {1, 0, 0}, .distance_m = 3.0 + 0.5 * i}};
        assert_int_equal(wall_map_given(k, &given, first * SECOND, NULL), 0);
        const struct walls *out = wall_map_list(k);
        assert_int_equal(out->n, WALLS_MAX);
        for (size_t i = 0; i < out->n; i++)
            seen |= UINT32_C(1) << (out->list[i].id - first);
        assert_int_equal(seen, (UINT32_C(1) << WALLS_MAX) - 1);
    }
    free(k);
}

/* 5 cm and 2 degrees, and as upright as walls are: what a vehicle means that gives a
 * plane and nothing else.  What it does say is taken at its word. */
static void what_the_vehicle_does_not_say_of_a_wall_s_errors_is_assumed(void **state)
{
    (void)state;
    struct wall_map *k = make(WALL_FROM_TOPIC, &nothing);
    const struct walls given = {
        .n = 2,
        .list = {{.id = 1, .plane = {.normal = {1, 0, 0}, .distance_m = 3.0}},
                 {.id = 2,
                  .plane = {.normal = {0, 1, 0},
                            .distance_m = 4.0,
                            .covariance = {4e-4, 0, 0, 5e-4, 0, 6e-4}}}}};
    assert_int_equal(wall_map_given(k, &given, SECOND, NULL), 0);
    const struct walls *list = wall_map_list(k);
    assert_int_equal(list->n, 2);
    for (size_t i = 0; i < 2; i++) {
        const double *c = list->list[i].plane.covariance;
        bool said = list->list[i].id == 2;
        assert_near(c[0], said ? 4e-4 : 0.035 * 0.035, 1e-9);
        assert_near(c[3], said ? 5e-4 : 1e-4, 1e-9);
        assert_near(c[5], said ? 6e-4 : 0.05 * 0.05, 1e-9);
    }
    free(k);
}

static void all_walls_of_a_look_are_told(void **state)
{
    (void)state;
    struct wall_map *k = make(WALL_FROM_ECHOES, &nothing);
    struct wall_estimates e = ahead(2.0);
    e.list[1] = e.list[0];
    e.list[1].wall.normal[0] = e.list[0].wall.normal[2];
    e.list[1].wall.normal[2] = 0.0;
    e.list[1].wall.distance_m = 3.0;
    e.n = 2;
    for (int n = 1; n <= 2; n++) {
        wall_map_advance(k, n * SECOND);
        wall_map_estimates(k, &e);
    }
    const struct walls *list = wall_map_list(k);
    assert_int_equal(list->n, 2);
    assert_near(list->list[0].plane.distance_m + list->list[1].plane.distance_m, 5.0,
                1e-6);
    free(k);
}

static void a_wall_that_the_vehicle_takes_back_is_lost(void **state)
{
    (void)state;
    struct wall_map *k = make(WALL_FROM_TOPIC, &nothing);
    struct walls given = {
        .n = 2,
        .list = {{.id = 1, .plane = {.normal = {1, 0, 0}, .distance_m = 3.0}},
                 {.id = 2, .plane = {.normal = {1, 0, 0}, .distance_m = 4.0}}}};
    assert_int_equal(wall_map_given(k, &given, SECOND, NULL), 0);
    assert_int_equal(wall_map_list(k)->n, 2);
    given.n = 1;
    assert_int_equal(wall_map_given(k, &given, SECOND + 1, NULL), 0);
    assert_int_equal(wall_map_list(k)->n, 1);
    assert_int_equal(wall_map_list(k)->list[0].id, 1);
    given.n = 0;
    assert_int_equal(wall_map_given(k, &given, SECOND + 2, NULL), 0);
    assert_int_equal(wall_map_list(k)->n, 0);
    assert_string_equal(k->text, "wall 1 is lost");
    free(k);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_survey_s_walls_are_told_as_configured),
        cmocka_unit_test(walls_stay_when_the_same_array_has_another_survey),
        cmocka_unit_test(a_wall_is_told_from_its_second_look_on),
        cmocka_unit_test(walls_come_nearer_between_looks),
        cmocka_unit_test(a_wall_that_is_not_seen_any_more_is_said_to_be_lost),
        cmocka_unit_test(without_ego_motion_walls_are_lost_and_it_says_why),
        cmocka_unit_test(what_cannot_be_told_is_said),
        cmocka_unit_test(a_pillar_is_said_while_it_is_heard),
        cmocka_unit_test(given_walls_are_carried_to_the_present_and_keep_their_ids),
        cmocka_unit_test(given_walls_keep_their_ends),
        cmocka_unit_test(as_many_walls_as_there_may_be_are_all_told),
        cmocka_unit_test(what_the_vehicle_does_not_say_of_a_wall_s_errors_is_assumed),
        cmocka_unit_test(all_walls_of_a_look_are_told),
        cmocka_unit_test(a_wall_that_the_vehicle_takes_back_is_lost),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
