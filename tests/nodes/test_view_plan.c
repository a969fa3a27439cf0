/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"
#include "nodes/view/plan.h"
#include "tests/nodes/near.h"

static double elements[1][3] = {{0.0, 0.0, 0.0}};
static double positions[2] = {0.0, 1.0};

/* As launch/scenes/corner.yaml: x to the left, y up, z ahead, on the nose of a vehicle;
 * the wall is x + z = 1.6. */
static struct survey corner(void)
{
    struct survey s = {.sound_speed_m_s = 343.0,
                       .temperature_c = NAN,
                       .n_speakers = 1,
                       .n_microphones = 1,
                       .n_positions = 2,
                       .speakers_m = elements,
                       .microphones_m = elements,
                       .stage_axis = {1.0, 0.0, 0.0},
                       .stage_positions_m = positions,
                       .has_wall = true,
                       .wall_normal = {M_SQRT1_2, 0.0, M_SQRT1_2},
                       .wall_distance_m = 1.6 * M_SQRT1_2,
                       .has_mount = true,
                       .mount_origin_m = {3.6, -0.54, 0.3},
                       .mount_x_axis = {0.0, 1.0, 0.0},
                       .mount_y_axis = {0.0, 0.0, 1.0}};
    return s;
}

static void ahead_is_up_and_left_is_left(void **state)
{
    double at[2];

    (void)state;
    plan_point(true, (const double[3]){4.4, -1.14, 0.6}, at); /* ahead, to the right */
    assert_near(at[0], 1.14, 1e-12);
    assert_near(at[1], 4.4, 1e-12);
    plan_point(false, (const double[3]){0.5, 9.0, 2.0}, at);
    assert_near(at[0], 0.5, 1e-12);
    assert_near(at[1], 2.0, 1e-12);
}

static bool find_wall(const struct survey *s, double point[2], double direction[2])
{
    struct wall wall = {.distance_m = s->wall_distance_m};

    memcpy(wall.normal, s->wall_normal, sizeof wall.normal);
    return plan_wall(s, &wall, point, direction);
}

/* In the vehicle the wall is x + y = 4.66: on the plan, up - right = 4.66. */
static void the_wall_is_the_line_that_it_is(void **state)
{
    struct survey s = corner();
    double p[2], d[2];

    (void)state;
    assert_true(find_wall(&s, p, d));
    assert_near(p[1] - p[0], 4.66, 1e-9);
    assert_near(fabs(d[0]), M_SQRT1_2, 1e-9);
    assert_near(d[0], d[1], 1e-9);
    s.has_mount = false; /* x + z = 1.6 */
    assert_true(find_wall(&s, p, d));
    assert_near(p[0] + p[1], 1.6, 1e-9);
    assert_near(d[0], -d[1], 1e-9);
}

static void a_leaning_wall_is_shown_where_it_is_at_the_array_s_height(void **state)
{
    struct survey s = corner();
    double p[2], d[2];

    (void)state;
    s.has_mount = false; /* 0.6 y + 0.8 z = 1.6: at y = 0, z = 2 */
    memcpy(s.wall_normal, (double[3]){0.0, 0.6, 0.8}, sizeof s.wall_normal);
    s.wall_distance_m = 1.6;
    assert_true(find_wall(&s, p, d));
    assert_near(p[1], 2.0, 1e-9);
    assert_near(d[1], 0.0, 1e-9);
}

static void a_ceiling_has_no_line(void **state)
{
    struct survey s = corner();
    double p[2], d[2];

    (void)state;
    memcpy(s.wall_normal, (double[3]){0.0, 1.0, 0.0}, sizeof s.wall_normal);
    assert_false(find_wall(&s, p, d));
}

/* Variances 0.04 and 0.01 along axes that are turned by 30 degrees. */
static void an_ellipse_holds_95_percent(void **state)
{
    const double turn = M_PI / 6.0, c = cos(turn), s = sin(turn);
    double rr = 0.04 * c * c + 0.01 * s * s, ff = 0.04 * s * s + 0.01 * c * c;
    double rf = (0.04 - 0.01) * c * s;
    struct plan_ellipse e;

    (void)state;
    /* Array frame: right is x, ahead is z. */
    plan_ellipse(false, (const double[6]){rr, 9.0, rf, 9.0, 9.0, ff}, &e);
    assert_near(e.major_m, 2.4477 * 0.2, 1e-4);
    assert_near(e.minor_m, 2.4477 * 0.1, 1e-4);
    assert_near(e.angle_rad, turn, 1e-9);
    /* Vehicle frame: right is -y, ahead is x. */
    plan_ellipse(true, (const double[6]){ff, -rf, 9.0, rr, 9.0, 9.0}, &e);
    assert_near(e.major_m, 2.4477 * 0.2, 1e-4);
    assert_near(e.angle_rad, turn, 1e-9);
}

static double number(const json_t *list, size_t i)
{
    return json_number_value(json_array_get(list, i));
}

/* x 0.1..1.1 and z 2..3 of the mirror image are really x = 1.6 - z, z = 1.6 - x, and in
 * the vehicle (3.6 + z, -0.54 + x). */
static void the_footprint_is_mirrored_back(void **state)
{
    const struct grid grid = {
        .origin_m = {0.15, 0.0, 2.05}, .step_m = {0.1, 0.1, 0.1}, .n = {10, 1, 10}};
    struct survey s = corner();
    const struct wall wall = {.normal = {M_SQRT1_2, 0.0, M_SQRT1_2},
                              .distance_m = 1.6 * M_SQRT1_2};
    json_t *all = plan_footprint_json(&s, &wall, &grid);
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};

    (void)state;
    assert_int_equal(json_array_size(all), 4);
    for (size_t i = 0; i < 4; i++) {
        for (size_t a = 0; a < 2; a++) {
            low[a] = fmin(low[a], number(json_array_get(all, i), a));
            high[a] = fmax(high[a], number(json_array_get(all, i), a));
        }
    }
    assert_near(low[0], 0.54 - (1.6 - 2.0), 1e-9);
    assert_near(high[0], 0.54 - (1.6 - 3.0), 1e-9);
    assert_near(low[1], 3.6 + 1.6 - 1.1, 1e-9);
    assert_near(high[1], 3.6 + 1.6 - 0.1, 1e-9);
    json_decref(all);
    /* Where no wall is known, as imaged: from x 0.1, z 2, along x first. */
    all = plan_footprint_json(&s, NULL, &grid);
    assert_near(number(json_array_get(all, 0), 0), 0.54 - 0.1, 1e-9);
    assert_near(number(json_array_get(all, 0), 1), 3.6 + 2.0, 1e-9);
    assert_near(number(json_array_get(all, 1), 0), 0.54 - 1.1, 1e-9);
    assert_near(number(json_array_get(all, 3), 1), 3.6 + 3.0, 1e-9);
    json_decref(all);
}

static void the_scene_says_what_is_known_and_what_is_not(void **state)
{
    struct survey s = corner();
    json_t *o = plan_scene_json(&s);

    (void)state;
    assert_string_equal(json_string_value(json_object_get(o, "frame")), "vehicle");
    assert_int_equal(json_array_size(json_object_get(o, "walls")), 1);
    assert_true(json_is_null(json_object_get(o, "temperature_c")));
    const json_t *array = json_object_get(o, "array"); /* both ends of the stage */
    assert_int_equal(json_array_size(array), 4);
    assert_near(number(json_array_get(array, 0), 0), 0.54, 1e-9);
    assert_near(number(json_array_get(array, 2), 0), -0.46, 1e-9);
    json_decref(o);
    s.has_wall = s.has_mount = false;
    s.source = SURVEY_REPLAY;
    o = plan_scene_json(&s);
    assert_string_equal(json_string_value(json_object_get(o, "frame")), "array");
    assert_string_equal(json_string_value(json_object_get(o, "source")), "replay");
    assert_int_equal(json_array_size(json_object_get(o, "walls")), 0);
    json_decref(o);
}

static void an_object_is_where_it_is(void **state)
{
    double covariance[6] = {1e-4, 0.0, 0.0, 4e-4, 0.0, 9e-4};
    Anlos__Vec3 p = ANLOS__VEC3__INIT, extent = ANLOS__VEC3__INIT;
    Anlos__Detection d = ANLOS__DETECTION__INIT, bare = ANLOS__DETECTION__INIT;
    Anlos__Detection *both[2] = {&d, &bare};
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;

    (void)state;
    p.x = 4.4, p.y = -1.14, p.z = 0.6;
    extent.x = 0.5, extent.y = 0.25, extent.z = 2.0;
    d.id = 7;
    d.position_m = &p;
    d.extent_m = &extent;
    d.covariance_m2 = covariance;
    d.n_covariance_m2 = 6;
    d.existence = 0.93;
    list.in_vehicle_frame = list.mirrored = true;
    list.detections = both;
    list.n_detections = 2;
    json_t *o = plan_objects_json(&list, NULL);
    const json_t *item = json_array_get(json_object_get(o, "items"), 0);
    assert_int_equal(json_integer_value(json_object_get(item, "id")), 7);
    assert_near(number(json_object_get(item, "at"), 0), 1.14, 1e-9);
    assert_near(number(json_object_get(item, "sd_m"), 2), 0.03, 1e-9);
    assert_near(number(json_object_get(item, "size"), 0), 0.25, 1e-9);
    assert_near(number(json_object_get(item, "size"), 1), 0.5, 1e-9);
    /* What a message leaves out is not known, and nothing worse. */
    item = json_array_get(json_object_get(o, "items"), 1);
    assert_true(json_is_null(json_array_get(json_object_get(item, "at"), 0)));
    assert_int_equal(json_array_size(json_object_get(o, "views")), 0);
    json_decref(o);
}

/* In the vehicle frame what is left is at -y to the right; in the array's x is right. */
static void what_is_seen_is_outlined(void **state)
{
    double corners[6] = {4.4, -1.14, 6, 2, 4.4, 2};
    Anlos__ViewArea a = ANLOS__VIEW_AREA__INIT, *views[1] = {&a};
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;

    (void)state;
    a.wall = 3;
    a.corners_m = corners;
    a.n_corners_m = 6;
    list.views = views;
    list.n_views = 1;
    for (int vehicle = 0; vehicle < 2; vehicle++) {
        list.in_vehicle_frame = vehicle;
        json_t *o = plan_objects_json(&list, NULL);
        const json_t *view = json_array_get(json_object_get(o, "views"), 0),
                     *at = json_object_get(view, "corners");
        assert_int_equal(json_integer_value(json_object_get(view, "wall")), 3);
        assert_int_equal(json_array_size(at), 3);
        assert_near(number(json_array_get(at, 0), 0), vehicle ? 1.14 : 4.4, 1e-9);
        assert_near(number(json_array_get(at, 0), 1), vehicle ? 4.4 : -1.14, 1e-9);
        json_decref(o);
    }
}

/* 1.2 m/s ahead and 0.5 to the left; it was 0.3 m behind 0.25 s before. */
static void a_track_has_velocity_and_trail(void **state)
{
    double velocity[2] = {1.2, 0.5};
    Anlos__Vec3 p = ANLOS__VEC3__INIT;
    Anlos__Detection d = ANLOS__DETECTION__INIT, gone = ANLOS__DETECTION__INIT;
    Anlos__Detection *both[2] = {&d, &gone};
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;
    struct trails *trails = malloc(sizeof *trails);

    (void)state;
    assert_non_null(trails);
    trails_init(trails, 1000000000, 100000000);
    p.x = 4.1, p.y = -1.0;
    d.id = 7;
    d.position_m = &p;
    d.velocity_m_s = velocity;
    d.n_velocity_m_s = 2;
    d.measurement = ANLOS__MEASUREMENT__PREDICTED;
    d.shape = ANLOS__SHAPE__PLATE;
    d.unseen_s = 0.25;
    gone.id = 6;
    gone.measurement = ANLOS__MEASUREMENT__DELETED;
    list.in_vehicle_frame = list.tracked = true;
    list.detections = both;
    list.n_detections = 2;
    trails_take(trails, &list, 1000000000);
    p.x = 4.4;
    trails_take(trails, &list, 1250000000);
    json_t *o = plan_objects_json(&list, trails), *items = json_object_get(o, "items");
    const json_t *item = json_array_get(items, 0),
                 *trail = json_object_get(item, "trail");
    assert_int_equal(json_array_size(items), 1);
    assert_near(number(json_object_get(item, "velocity"), 0), -0.5, 1e-9);
    assert_near(number(json_object_get(item, "velocity"), 1), 1.2, 1e-9);
    assert_near(json_number_value(json_object_get(item, "speed_m_s")), 1.3, 1e-9);
    assert_string_equal(json_string_value(json_object_get(item, "measurement")),
                        "predicted");
    assert_string_equal(json_string_value(json_object_get(item, "shape")), "plate");
    assert_int_equal(json_array_size(trail), 2);
    assert_near(number(json_array_get(trail, 0), 0), 1.0, 1e-9);
    assert_near(number(json_array_get(trail, 0), 1), 4.1, 1e-9);
    assert_near(number(json_array_get(trail, 1), 1), 4.4, 1e-9);
    json_decref(o);
    free(trails);
}

static void walls_that_are_told_keep_their_state(void **state)
{
    double covariance[6] = {[0] = 4e-6, [5] = 9e-6};
    struct survey s = corner();
    struct walls walls;
    struct error why;
    Anlos__Vec3 n = ANLOS__VEC3__INIT, up = ANLOS__VEC3__INIT;
    double ends[2] = {-1.0, 2.5};
    Anlos__Wall ceiling = ANLOS__WALL__INIT, w = ANLOS__WALL__INIT;
    Anlos__Wall *both[2] = {&ceiling, &w};
    Anlos__WallList list = ANLOS__WALL_LIST__INIT;

    (void)state;
    up.y = n.z = 1.0;
    ceiling.id = 1;
    ceiling.normal = &up;
    ceiling.distance_m = w.distance_m = 2.0;
    w.id = 2;
    w.normal = &n;
    w.origin = ANLOS__WALL__ORIGIN__ESTIMATED;
    w.covariance = covariance;
    w.n_covariance = 6;
    w.existence = 0.8;
    w.unseen_s = 1.5;
    list.walls = both;
    list.n_walls = 2;
    list.text = (char *)"one is lost";
    w.ends_m = ends;
    w.n_ends_m = 2;
    assert_int_equal(walls_from_message(&walls, &list, &why), 0);
    json_t *o = plan_walls_json(&s, &list, &walls), *items = json_object_get(o, "items");
    const json_t *item = json_array_get(items, 0);
    assert_int_equal(json_array_size(items), 1); /* a ceiling is no line */
    assert_int_equal(json_integer_value(json_object_get(item, "id")), 2);
    assert_string_equal(json_string_value(json_object_get(item, "origin")), "estimated");
    assert_near(json_number_value(json_object_get(item, "sd_m")), 3e-3, 1e-9);
    assert_near(json_number_value(json_object_get(item, "unseen_s")), 1.5, 1e-9);
    assert_near(number(json_object_get(item, "point"), 1), 5.6, 1e-9); /* 3.6 + 2 */
    for (int k = 0; k < 2; k++) { /* 1 m to the left of the array, and 2.5 to the right */
        const json_t *end = json_array_get(json_object_get(item, "ends"), (size_t)k);
        assert_near(number(end, 0), ends[k] - s.mount_origin_m[1], 1e-9);
        assert_near(number(end, 1), 5.6, 1e-9);
    }
    assert_string_equal(json_string_value(json_object_get(o, "text")), "one is lost");
    json_decref(o);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ahead_is_up_and_left_is_left),
        cmocka_unit_test(the_wall_is_the_line_that_it_is),
        cmocka_unit_test(a_leaning_wall_is_shown_where_it_is_at_the_array_s_height),
        cmocka_unit_test(a_ceiling_has_no_line),
        cmocka_unit_test(an_ellipse_holds_95_percent),
        cmocka_unit_test(the_footprint_is_mirrored_back),
        cmocka_unit_test(the_scene_says_what_is_known_and_what_is_not),
        cmocka_unit_test(an_object_is_where_it_is),
        cmocka_unit_test(what_is_seen_is_outlined),
        cmocka_unit_test(a_track_has_velocity_and_trail),
        cmocka_unit_test(walls_that_are_told_keep_their_state),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
