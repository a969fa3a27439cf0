#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "msgs/convert.h"
#include "nodes/wall/wall_map.h"
#include "tests/nodes/near.h"

#define SECOND 1000000000LL

static struct wall_map *make(enum wall_from from, const struct survey *s)
{
    struct launchfile l = {.wall = {.from = from, .lost_s = 3.0, .vertical_deg = 0.573}};
    struct wall_map *k = malloc(sizeof *k);
    assert_non_null(k);
    l.wall.n_corners = 3;
    l.wall.free_view_m[1][0] = 1.0;
    l.wall.free_view_m[2][1] = 2.0;
    wall_map_init(k, &l);
    wall_map_survey(k, s);
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

static void drive(struct wall_map *k, double speed_m_s, double from_s, double to_s)
{
    for (int n = (int)(50 * from_s); n <= (int)(50 * to_s); n++) {
        Anlos__EgoMotion m = ANLOS__EGO_MOTION__INIT;
        m.speed_m_s = speed_m_s;
        m.valid = true;
        wall_map_ego(k, &m, n * SECOND / 50);
    }
}

static void the_survey_s_walls_are_told_as_configured(void **state)
{
    (void)state;
    const struct survey s = {
        .has_wall = true, .wall_normal = {0, 0, 1}, .wall_distance_m = 1.25};
    struct wall_map *k = make(WALL_FROM_SURVEY, &s);
    const Anlos__WallList *list = wall_map_list(k);
    struct walls back;
    assert_int_equal(list->n_walls, 1);
    assert_int_equal(list->walls[0]->origin, ANLOS__WALL__ORIGIN__CONFIGURED);
    assert_near(list->walls[0]->distance_m, 1.25, 0.0);
    assert_string_equal(list->text, "");
    assert_int_equal(walls_from_message(&back, list, NULL), 0);
    assert_int_equal(back.n_corners, 3);
    assert_near(back.free_view_m[2][1], 2.0, 0.0);
    wall_map_survey(k, &nothing);
    assert_int_equal(wall_map_list(k)->n_walls, 0);
    assert_true(wall_map_list(k)->text[0]);
    free(k);
}

static void a_wall_is_told_from_its_second_look_on(void **state)
{
    (void)state;
    struct wall_map *k = make(WALL_FROM_ECHOES, &nothing);
    const struct wall_estimates e = ahead(2.0);
    wall_map_advance(k, SECOND);
    wall_map_estimates(k, &e);
    assert_int_equal(wall_map_list(k)->n_walls, 0);
    wall_map_advance(k, 2 * SECOND);
    wall_map_estimates(k, &e);
    const Anlos__WallList *list = wall_map_list(k);
    assert_int_equal(list->n_walls, 1);
    assert_int_equal(list->walls[0]->origin, ANLOS__WALL__ORIGIN__ESTIMATED);
    assert_int_equal(list->walls[0]->id, 1);
    assert_int_equal(list->walls[0]->n_covariance, 6);
    assert_true(list->walls[0]->existence > 0.9);
    assert_string_equal(list->text, "");
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
    const Anlos__WallList *list = wall_map_list(k);
    assert_int_equal(list->n_walls, 1);
    assert_near(list->walls[0]->distance_m, 3.0 - 0.98, 1e-6); /* half of 20 ms to 2 */
    assert_near(list->walls[0]->unseen_s, 0.5, 1e-9);
    assert_true(list->walls[0]->covariance[5] > 5e-4);
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
    assert_int_equal(wall_map_list(k)->n_walls, 0);
    assert_string_equal(wall_map_list(k)->text, "wall 1 is lost");
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
    assert_int_equal(wall_map_list(k)->n_walls, 0);
    assert_non_null(strstr(wall_map_list(k)->text, "nobody tells how the vehicle moves"));
    free(k);
}

static void what_cannot_be_told_is_said(void **state)
{
    (void)state;
    struct wall_map *k = make(WALL_FROM_ECHOES, &nothing);
    const struct wall_estimates e = {.n_undetermined = 1};
    wall_map_advance(k, SECOND);
    wall_map_estimates(k, &e);
    assert_non_null(strstr(wall_map_list(k)->text, "cannot tell how it stands"));
    free(k);
}

/* Given in the vehicle frame 4 m ahead, half a second ago at 2 m/s. */
static void given_walls_are_carried_to_the_present_and_keep_their_ids(void **state)
{
    (void)state;
    struct wall_map *k = make(WALL_FROM_TOPIC, &nothing);
    Anlos__WallList list = ANLOS__WALL_LIST__INIT;
    Anlos__Wall wall = ANLOS__WALL__INIT, *each[1] = {&wall};
    Anlos__Vec3 normal = ANLOS__VEC3__INIT;
    normal.x = 1.0;
    wall.id = 12;
    wall.normal = &normal;
    wall.distance_m = 4.0;
    list.n_walls = 1;
    list.walls = each;
    drive(k, 2.0, 0.0, 2.0);
    wall_map_advance(k, 3 * SECOND / 2);
    assert_int_equal(wall_map_given(k, &list, SECOND, NULL), 0);
    const Anlos__WallList *out = wall_map_list(k);
    assert_int_equal(out->n_walls, 1);
    assert_int_equal(out->walls[0]->id, 12);
    assert_int_equal(out->walls[0]->origin, ANLOS__WALL__ORIGIN__GIVEN);
    assert_near(out->walls[0]->normal->z, 1.0, 1e-9);
    assert_near(out->walls[0]->distance_m, 3.0, 1e-6);
    wall.unseen_s = 0.2; /* said before: nothing new */
    wall.distance_m = 9.0;
    assert_int_equal(wall_map_given(k, &list, 3 * SECOND / 2, NULL), 0);
    assert_near(wall_map_list(k)->walls[0]->distance_m, 3.0, 1e-6);
    assert_near(wall_map_list(k)->walls[0]->covariance[3], 1e-4, 1e-5); /* the prior's */
    wall.unseen_s = 0.0;
    wall.distance_m = NAN;
    assert_int_equal(wall_map_given(k, &list, SECOND, NULL), -EINVAL);
    drive(k, 0.0, 2.02, 6.0);
    for (int n = 2; n <= 6; n++)
        wall_map_advance(k, n * SECOND);
    assert_int_equal(wall_map_list(k)->n_walls, 0);
    assert_string_equal(wall_map_list(k)->text, "wall 12 is lost");
    free(k);
}

static void a_wall_that_the_vehicle_takes_back_is_lost(void **state)
{
    (void)state;
    struct wall_map *k = make(WALL_FROM_TOPIC, &nothing);
    Anlos__WallList list = ANLOS__WALL_LIST__INIT;
    Anlos__Wall walls[2], *each[2] = {&walls[0], &walls[1]};
    Anlos__Vec3 normal = ANLOS__VEC3__INIT;
    normal.x = 1.0;
    for (uint32_t i = 0; i < 2; i++) {
        anlos__wall__init(&walls[i]);
        walls[i].id = i + 1;
        walls[i].normal = &normal;
        walls[i].distance_m = 3.0 + i;
    }
    list.n_walls = 2;
    list.walls = each;
    assert_int_equal(wall_map_given(k, &list, SECOND, NULL), 0);
    assert_int_equal(wall_map_list(k)->n_walls, 2);
    list.n_walls = 1;
    assert_int_equal(wall_map_given(k, &list, SECOND + 1, NULL), 0);
    assert_int_equal(wall_map_list(k)->n_walls, 1);
    assert_int_equal(wall_map_list(k)->walls[0]->id, 1);
    list.n_walls = 0;
    assert_int_equal(wall_map_given(k, &list, SECOND + 2, NULL), 0);
    assert_int_equal(wall_map_list(k)->n_walls, 0);
    assert_string_equal(wall_map_list(k)->text, "wall 1 is lost");
    free(k);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_survey_s_walls_are_told_as_configured),
        cmocka_unit_test(a_wall_is_told_from_its_second_look_on),
        cmocka_unit_test(walls_come_nearer_between_looks),
        cmocka_unit_test(a_wall_that_is_not_seen_any_more_is_said_to_be_lost),
        cmocka_unit_test(without_ego_motion_walls_are_lost_and_it_says_why),
        cmocka_unit_test(what_cannot_be_told_is_said),
        cmocka_unit_test(given_walls_are_carried_to_the_present_and_keep_their_ids),
        cmocka_unit_test(a_wall_that_the_vehicle_takes_back_is_lost),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
