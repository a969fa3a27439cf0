/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "msgs/convert.h"
#include "recon/detection/objects.h"
#include "recon/detection/peak.h"
#include "tests/nodes/near.h"

static struct detection point(double x, double y, double z)
{
    struct detection d = {.position_m = {x, y, z},
                          .covariance_m2 = {1e-4, 2e-5, 3e-5, 4e-4, 5e-5, 9e-4},
                          .level_db = 20.0,
                          .existence = 0.9,
                          .extent_m = {0.1, 0.2, 0.3}};
    return d;
}

/* A fixed array of two speakers, and microphones where they are. */
static struct survey line_of_two(double elements_m[2][3])
{
    static double stage[1] = {0};

    return (struct survey){.n_speakers = 2,
                           .n_microphones = 2,
                           .n_positions = 1,
                           .speakers_m = elements_m,
                           .microphones_m = elements_m,
                           .stage_axis = {1, 0, 0},
                           .stage_positions_m = stage};
}

static int listed(Anlos__DetectionList **out, const struct survey *s,
                  const struct walls *walls, const struct detection *objects, size_t n)
{
    struct object_list list;

    objects_list(&list, s, walls, objects, n);
    return detections_from_objects(out, &list);
}

/* Behind the survey's own walls. */
static int list_of(Anlos__DetectionList **out, const struct survey *s,
                   const struct detection *objects, size_t n)
{
    struct walls walls;
    walls_from_survey(&walls, s);
    return listed(out, s, &walls, objects, n);
}

static void without_wall_and_mount_positions_stay_as_imaged(void **state)
{
    (void)state;
    struct survey s = {.temperature_c = NAN};
    struct detection d = point(0.1, 0.2, 3.0);
    Anlos__DetectionList *list;
    assert_int_equal(list_of(&list, &s, &d, 1), 0);
    assert_false(list->mirrored);
    assert_false(list->in_vehicle_frame);
    assert_int_equal(list->n_detections, 1);
    assert_near(list->detections[0]->position_m->z, 3.0, 0.0);
    for (int i = 0; i < 6; i++)
        assert_near(list->detections[0]->covariance_m2[i], d.covariance_m2[i], 1e-18);
    detections_free(list);
}

static void a_frontal_wall_folds_depth_back(void **state)
{
    (void)state;
    struct survey s = {
        .has_wall = true, .wall_normal = {0, 0, 1}, .wall_distance_m = 1.25};
    struct detection d = point(0.1, 0.2, 2.0);
    Anlos__DetectionList *list;
    assert_int_equal(list_of(&list, &s, &d, 1), 0);
    const Anlos__Detection *m = list->detections[0];
    assert_true(list->mirrored);
    assert_near(m->position_m->x, 0.1, 1e-12);
    assert_near(m->position_m->z, 0.5, 1e-12);
    assert_near(m->virtual_m->z, 2.0, 0.0);
    /* diag(1, 1, -1) on both sides: only xz and yz change sign */
    const double expected[6] = {1e-4, 2e-5, -3e-5, 4e-4, -5e-5, 9e-4};
    for (int i = 0; i < 6; i++)
        assert_near(m->covariance_m2[i], expected[i], 1e-16);
    detections_free(list);
}

/* The array looks to the vehicle's left: its x (along the stage) points forward, its y
 * up. */
static void a_mount_turns_position_and_covariance(void **state)
{
    (void)state;
    struct survey s = {.has_mount = true,
                       .mount_origin_m = {2.0, 0.0, 0.5},
                       .mount_x_axis = {1, 0, 0},
                       .mount_y_axis = {0, 0, 1}};
    struct detection d = point(0.1, 0.2, 3.0);
    Anlos__DetectionList *list;
    double z_axis[3], zero[3] = {0, 0, 0}, unit[3] = {0, 0, 1};
    survey_to_vehicle(&s, zero, zero);
    survey_to_vehicle(&s, unit, z_axis);
    double side = z_axis[1] - zero[1]; /* left or right, as the frame's handedness says */
    assert_near(fabs(side), 1.0, 1e-12);

    assert_int_equal(list_of(&list, &s, &d, 1), 0);
    const Anlos__Detection *m = list->detections[0];
    assert_true(list->in_vehicle_frame);
    assert_near(m->position_m->x, 2.1, 1e-12);
    assert_near(m->position_m->y, 3.0 * side, 1e-12);
    assert_near(m->position_m->z, 0.7, 1e-12);
    /* vehicle (x, y, z) = array (x, side z, y) */
    const double expected[6] = {1e-4, side * 3e-5, 2e-5, 9e-4, side * 5e-5, 4e-4};
    for (int i = 0; i < 6; i++)
        assert_near(m->covariance_m2[i], expected[i], 1e-16);
    detections_free(list);
}

static void assert_extent(const struct survey *s, double x, double y, double z)
{
    struct detection d = point(0.1, 0.2, 3.0); /* 0.1 x 0.2 x 0.3 as imaged */
    Anlos__DetectionList *list;
    assert_int_equal(list_of(&list, s, &d, 1), 0);
    const Anlos__Vec3 *extent = list->detections[0]->extent_m;
    assert_near(extent->x, x, 1e-12);
    assert_near(extent->y, y, 1e-12);
    assert_near(extent->z, z, 1e-12);
    detections_free(list);
}

/* The array looks forward, its x to the vehicle's left: length is its depth.  A wall at
 * 45 degrees turns depth to the side, and what was beside into depth. */
static void extents_are_mirrored_and_turned_like_the_position(void **state)
{
    (void)state;
    const double half = sqrt(0.5);
    struct survey s = {0};
    assert_extent(&s, 0.1, 0.2, 0.3);
    s.has_mount = true;
    s.mount_x_axis[1] = 1.0;
    s.mount_y_axis[2] = 1.0;
    assert_extent(&s, 0.3, 0.1, 0.2);
    s.has_wall = true;
    s.wall_normal[0] = s.wall_normal[2] = half;
    s.wall_distance_m = 1.0;
    assert_extent(&s, 0.1, 0.3, 0.2);
}

/* Turned by 45 degrees about the upright, a box of a by b needs (a + b) / sqrt 2. */
static void a_turned_extent_is_the_box_around_it(void **state)
{
    (void)state;
    const double half = sqrt(0.5);
    struct survey s = {
        .has_mount = true, .mount_x_axis = {half, half, 0}, .mount_y_axis = {0, 0, 1}};
    assert_extent(&s, (0.1 + 0.3) * half, (0.1 + 0.3) * half, 0.2);
}

/* n turned by a about y is (a, 0, 1): the image of (0.1, 0.2, 2) in the wall z = 1.25
 * moves by -1.5 a along x and by -0.2 a along z, and by 2 for each metre of distance. */
static void the_error_of_the_wall_is_in_the_covariance(void **state)
{
    (void)state;
    const struct survey s = {.temperature_c = NAN};
    const double turn = 1e-3, distance = 4e-4, both = 2e-4;
    const struct walls walls = {
        .n = 1,
        .list = {{.id = 7,
                  .plane = {.normal = {0, 0, 1},
                            .distance_m = 1.25,
                            .covariance = {turn, 0, both, 0, 0, distance}},
                  .gate_m = {0, 10}}}};
    const struct detection d = point(0.1, 0.2, 2.0);
    struct placement p;
    objects_place(&p, &s, &walls, &d);
    assert_int_equal(p.wall, 7);
    assert_false(p.behind_no_wall || p.in_free_view);
    assert_near(p.position_m[2], 0.5, 1e-12);
    const double expected[6] = {1e-4 + 2.25 * turn,
                                2e-5,
                                -3e-5 + 0.3 * turn - 3.0 * both,
                                4e-4,
                                -5e-5,
                                9e-4 + 0.04 * turn + 4.0 * distance - 0.8 * both};
    for (int i = 0; i < 6; i++)
        assert_near(p.covariance_m2[i], expected[i], 1e-15);
}

/* Behind both; the one ahead is first on the way there. */
static void an_object_is_placed_by_the_wall_that_is_chosen(void **state)
{
    (void)state;
    const struct survey s = {.temperature_c = NAN};
    struct walls walls = {
        .n = 2,
        .list = {{1, {.normal = {0, 0, 1}, .distance_m = 1.0}, {0, 5}},
                 {4, {.normal = {1, 0, 0}, .distance_m = 2.0}, {0, 5}}}};
    struct detection d = point(2.5, 0, 1.8);
    struct object_list list;
    struct placement by_the_other;

    d.extent_m[2] = 0.3;
    objects_list(&list, &s, &walls, &d, 1);
    assert_int_equal(list.objects[0].place.wall, 1);
    objects_place_by(&list.objects[0], &s, &walls, 1);
    const struct placement *p = &list.objects[0].place;
    assert_int_equal(p->wall, 4);
    assert_near(p->position_m[0], 1.5, 1e-12);
    assert_near(p->position_m[2], 1.8, 1e-12);
    walls.list[0] = walls.list[1]; /* as if that were the only one, in its way */
    walls.n = 1;
    objects_place(&by_the_other, &s, &walls, &d);
    for (int i = 0; i < 6; i++)
        assert_near(p->covariance_m2[i], by_the_other.covariance_m2[i], 1e-15);
    assert_near(p->extent_m[2], 0.3, 1e-12);
    objects_place_by(&list.objects[0], &s, &walls, walls.n);
    assert_int_equal(p->wall, 0);
    assert_near(p->position_m[0], 2.5, 1e-12);
}

static void each_object_is_mirrored_by_its_wall_or_by_none(void **state)
{
    (void)state;
    const struct survey s = {.temperature_c = NAN};
    const struct walls walls = {
        .n = 2,
        .list = {{1, {.normal = {0, 0, 1}, .distance_m = 1.0}, {0, 3}},
                 {4, {.normal = {1, 0, 0}, .distance_m = 2.0}, {2, 5}}},
        .n_corners = 4,
        .free_view_m = {{-1, 0}, {1, 0}, {1, 0.9}, {-1, 0.9}}};
    const struct detection d[4] = {point(0.2, 0, 1.8), point(3, 0, 0.5), point(0, 0, 3.5),
                                   point(0, 0, 0.5)};
    Anlos__DetectionList *list;
    assert_int_equal(listed(&list, &s, &walls, d, 4), 0);
    const Anlos__Detection *m = list->detections[0];
    assert_int_equal(m->wall, 1);
    assert_near(m->position_m->z, 0.2, 1e-12);
    assert_true(m->in_free_view); /* at (0.2, 0.2) */
    m = list->detections[1];
    assert_int_equal(m->wall, 4);
    assert_near(m->position_m->x, 1.0, 1e-12);
    assert_false(m->behind_no_wall);
    m = list->detections[2]; /* beyond the gate of the wall before it */
    assert_int_equal(m->wall, 0);
    assert_true(m->behind_no_wall);
    assert_false(m->in_free_view);
    assert_near(m->position_m->z, 3.5, 0.0);
    m = list->detections[3]; /* before all walls, in sight */
    assert_true(m->behind_no_wall && m->in_free_view);
    detections_free(list);
}

static void a_line_array_does_not_tell_heights(void **state)
{
    (void)state;
    double speakers[2][3] = {{-0.5, 0.3, 0}, {0.5, 0.3, 0}};
    const struct survey s = line_of_two(speakers);
    const struct walls none = {.n = 0};
    const struct detection d = point(0.1, 0.2, 2.0);
    struct placement p;
    objects_place(&p, &s, &none, &d);
    assert_near(p.covariance_m2[3], 0.25, 1e-12);
    assert_near(p.covariance_m2[1], 0.0, 1e-15);
    assert_near(p.covariance_m2[0], 1e-4, 1e-15);
    speakers[1][1] = 0.5;
    objects_place(&p, &s, &none, &d);
    assert_near(p.covariance_m2[3], 4e-4, 1e-15);
}

/* A ridge from the place (0, 0, 2) along (0, 1, -1): with a height that is assumed to
 * half a metre, the distance is known to half a metre, and with it. */
static void what_the_image_tells_is_meant_for_the_assumed_height(void **state)
{
    (void)state;
    double elements[2][3] = {{-0.5, 0, 0}, {0.5, 0, 0}};
    const struct survey s = line_of_two(elements);
    const struct walls none = {.n = 0};
    struct detection d = point(0.0, 0.0, 2.0);
    struct placement p;
    memcpy(d.covariance_m2, (double[6]){1e-4, 0, 0, 5e3 + 1e-4, -5e3, 5e3 + 1e-4},
           sizeof d.covariance_m2);
    objects_place(&p, &s, &none, &d);
    assert_true(p.height_assumed);
    assert_near(p.covariance_m2[0], 1e-4, 1e-12);
    assert_near(p.covariance_m2[3], 0.25, 1e-4);
    assert_near(p.covariance_m2[4], -0.25, 1e-4);
    assert_near(p.covariance_m2[5], 0.25, 1e-3);
    /* An image that tells heights to 0.87 m: z goes by -0.7 / 0.75 of them. */
    memcpy(d.covariance_m2, (double[6]){1e-4, 0, 0, 0.75, -0.7, 0.7},
           sizeof d.covariance_m2);
    objects_place(&p, &s, &none, &d);
    assert_near(p.covariance_m2[3], 0.25, 1e-12);
    assert_near(p.covariance_m2[4], -0.7 / 3.0, 1e-12);
    assert_near(p.covariance_m2[5], 0.7 - 0.7 * 0.7 * (1.0 - 1.0 / 3.0) / 0.75, 1e-12);
}

static void borders_are_those_of_axes_that_are_heard(void **state)
{
    (void)state;
    double speakers[2][3] = {{-0.5, 0, 0}, {0.5, 0, 0}};
    struct survey s = line_of_two(speakers);
    struct detection d = point(0.1, 0.2, 2.0);
    Anlos__DetectionList *list;
    d.at_border = PEAK_BORDER(1, 0) | PEAK_BORDER(2, 1);
    assert_int_equal(list_of(&list, &s, &d, 1), 0);
    assert_int_equal(list->detections[0]->at_border, PEAK_BORDER(2, 1));
    assert_true(list->detections[0]->height_assumed);
    detections_free(list);
    speakers[1][1] = 0.5;
    assert_int_equal(list_of(&list, &s, &d, 1), 0);
    assert_int_equal(list->detections[0]->at_border, d.at_border);
    assert_false(list->detections[0]->height_assumed);
    detections_free(list);
}

/* A line array at the nose of a vehicle, 0.4 m over the ground. */
static struct survey bumper(void)
{
    static double elements[2][3] = {{-0.5, 0, 0}, {0.5, 0, 0}};
    static const struct survey mount = {.mount_origin_m = {3.6, 0, 0.4},
                                        .mount_x_axis = {0, 1, 0},
                                        .mount_y_axis = {0, 0, 1}};
    struct survey s = line_of_two(elements);

    s.has_mount = true;
    memcpy(s.mount_origin_m, mount.mount_origin_m, sizeof s.mount_origin_m);
    memcpy(s.mount_x_axis, mount.mount_x_axis, sizeof s.mount_x_axis);
    memcpy(s.mount_y_axis, mount.mount_y_axis, sizeof s.mount_y_axis);
    return s;
}

/* Of two that make it, and of one alone. */
static void an_echo_of_others_names_their_ids(void **state)
{
    (void)state;
    struct survey s = bumper();
    struct detection d[3] = {point(0.1, 0.2, 2.0), point(0.3, 0.2, 2.2), point(0, 0, 3)};
    Anlos__DetectionList *list;
    d[2].multipath = MULTIPATH_PAIR;
    d[2].of[1] = 1;
    d[1].multipath = MULTIPATH_SHADOW;
    assert_int_equal(list_of(&list, &s, d, 3), 0);
    const Anlos__Detection *of_one = list->detections[1], *of_two = list->detections[2];
    assert_int_equal(list->detections[0]->multipath, ANLOS__MULTIPATH__NO_MULTIPATH);
    assert_int_equal(list->detections[0]->n_multipath_of, 0);
    assert_int_equal(of_one->multipath, ANLOS__MULTIPATH__IN_A_SHADOW);
    assert_int_equal(of_one->n_multipath_of, 1);
    assert_int_equal(of_one->multipath_of[0], list->detections[0]->id);
    assert_int_equal(of_two->multipath, ANLOS__MULTIPATH__OF_A_PAIR);
    assert_int_equal(of_two->n_multipath_of, 2);
    assert_int_equal(of_two->multipath_of[0], list->detections[0]->id);
    assert_int_equal(of_two->multipath_of[1], of_one->id);
    detections_free(list);
}

/* The middle of things is 0.4 m above the array, give or take 0.5 m: 2 m away they are
 * imaged at sqrt(2^2 + 0.4^2 + 0.5^2). */
static void a_line_array_on_a_vehicle_sees_things_on_the_ground(void **state)
{
    (void)state;
    const struct survey s = bumper();
    const struct walls none = {.n = 0};
    const struct detection far = point(0.7, 0, sqrt(4.0 + 0.16 + 0.25));
    const struct detection near = point(0.7, 0, 0.5);
    struct placement p;

    objects_place(&p, &s, &none, &far);
    assert_near(p.position_m[0], 5.6, 1e-9);
    assert_near(p.position_m[1], 0.7, 1e-9);
    assert_true(p.covariance_m2[0] > 0.02);
    double depth_m = 0.5 * hypot(0.4, 0.5) / 2.0; /* one sigma of the height, in depth */
    assert_near(p.height_m2[0], depth_m * depth_m, 1e-9);
    assert_near(p.covariance_m2[0] - p.height_m2[0], far.covariance_m2[5], 1e-9);
    objects_place(&p, &s, &none, &near); /* nearer than they are high */
    assert_near(p.position_m[0], 4.1, 1e-9);
}

/* Whatever the height of what echoes, from a wheel's hub or a child to a trunk: imaged at
 * its slant range, it is reported where it stands within one sigma, and sigma is not so
 * large that it says nothing. */
static void the_covariance_covers_what_is_not_known_of_heights(void **state)
{
    (void)state;
    const struct survey s = bumper();
    const struct walls none = {.n = 0};

    for (double depth_m = 2.0; depth_m <= 6.0; depth_m += 0.5) {
        double worst_m = 0.0, sigma_m = 0.0;
        for (double height_m = 0.4; height_m < 1.11; height_m += 0.1) {
            const struct detection d = point(0.7, 0, hypot(depth_m, height_m - 0.4));
            struct placement p;
            objects_place(&p, &s, &none, &d);
            double error_m = fabs(p.position_m[0] - 3.6 - depth_m);
            sigma_m = sqrt(p.covariance_m2[0]);
            assert_true(error_m < sigma_m);
            worst_m = fmax(worst_m, error_m);
        }
        assert_true(sigma_m < 2.0 * worst_m);
    }
}

/* 1 m away; of an image 3 cm behind it, 0.4 m higher things would be before it. */
static void what_is_imaged_behind_a_wall_is_told_before_it(void **state)
{
    (void)state;
    const struct survey s = bumper();
    const struct detection d = point(0.2, 0, 1.03);
    struct placement p;

    for (int turned = -1; turned <= 1; turned += 2) { /* its normal may point here */
        const struct walls walls = {
            .n = 1,
            .list = {{.id = 1,
                      .plane = {.normal = {0, 0, turned}, .distance_m = turned},
                      .gate_m = {0, 9}}}};
        objects_place(&p, &s, &walls, &d);
        assert_int_equal(p.wall, 1);
        assert_true(p.position_m[0] <= 4.6 + 1e-12);
        assert_near(p.position_m[0], 4.6, 0.01);
        assert_near(p.position_m[1], 0.2, 1e-9);
    }
}

static void ids_rise_in_the_order_given(void **state)
{
    (void)state;
    struct survey s = {.temperature_c = 20.0};
    struct detection d[3] = {point(0, 0, 1), point(0, 0, 2), point(0, 0, 3)};
    Anlos__DetectionList *list;
    assert_int_equal(list_of(&list, &s, d, 3), 0);
    for (uint32_t i = 0; i < 3; i++) {
        assert_int_equal(list->detections[i]->id, i + 1);
        assert_near(list->detections[i]->position_m->z, 1.0 + i, 0.0);
    }
    detections_free(list);
}

static void an_empty_volume_gives_an_empty_list(void **state)
{
    (void)state;
    struct survey s = {.temperature_c = 20.0};
    struct grid g = {.step_m = {0.1, 0.1, 0.1}, .n = {4, 4, 4}};
    float zero[64] = {0.0f};
    struct detect_config cfg;
    Anlos__DetectionList *list;
    detect_config_default(&cfg);
    struct object_list none;
    assert_int_equal(objects_find(&none, &s, NULL, &cfg, 0.0, &g, zero), 0);
    assert_int_equal(detections_from_objects(&list, &none), 0);
    assert_int_equal(list->n_detections, 0);
    detections_free(list);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(without_wall_and_mount_positions_stay_as_imaged),
        cmocka_unit_test(a_frontal_wall_folds_depth_back),
        cmocka_unit_test(a_mount_turns_position_and_covariance),
        cmocka_unit_test(extents_are_mirrored_and_turned_like_the_position),
        cmocka_unit_test(a_turned_extent_is_the_box_around_it),
        cmocka_unit_test(the_error_of_the_wall_is_in_the_covariance),
        cmocka_unit_test(an_object_is_placed_by_the_wall_that_is_chosen),
        cmocka_unit_test(each_object_is_mirrored_by_its_wall_or_by_none),
        cmocka_unit_test(a_line_array_does_not_tell_heights),
        cmocka_unit_test(what_the_image_tells_is_meant_for_the_assumed_height),
        cmocka_unit_test(borders_are_those_of_axes_that_are_heard),
        cmocka_unit_test(an_echo_of_others_names_their_ids),
        cmocka_unit_test(a_line_array_on_a_vehicle_sees_things_on_the_ground),
        cmocka_unit_test(the_covariance_covers_what_is_not_known_of_heights),
        cmocka_unit_test(what_is_imaged_behind_a_wall_is_told_before_it),
        cmocka_unit_test(ids_rise_in_the_order_given),
        cmocka_unit_test(an_empty_volume_gives_an_empty_list),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
