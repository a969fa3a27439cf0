/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "msgs/convert.h"
#include "recon/detection/detector.h"
#include "tests/nodes/near.h"
#include "tests/nodes/scene.h"

enum { NX = 31, NY = 26, NZ = 61 };

struct rig {
    struct scene scene;
    struct detector detector;
    float intensity[NZ][NY][NX];
    Anlos__Volume volume;
    Anlos__Vec3 origin, step;
    struct tensor_view view;
    Anlos__DetectionList *list;
};

static const struct detector_config config = {.threshold_db = 12.0, .min_existence = 0.5};
static const double origin_m[3] = {-0.1, -0.1, 0.9};

/* A volume of weak noise, the same each time. */
static void fill_noise(struct rig *r)
{
    uint32_t seed = 1;

    for (size_t i = 0; i < sizeof r->intensity / sizeof(float); i++) {
        seed = seed * 1664525u + 1013904223u;
        (&r->intensity[0][0][0])[i] = 1e-4f * (float)(seed >> 8) / 16777216.0f;
    }
}

/* Standard deviations of a point's image. */
static const double sharp_m[3] = {0.025, 0.025, 0.012};

static void add_blob(struct rig *r, const double at_m[3], const double sigma_m[3])
{
    for (int z = 0; z < NZ; z++) {
        for (int y = 0; y < NY; y++) {
            for (int x = 0; x < NX; x++) {
                double dx = (origin_m[0] + 0.02 * x - at_m[0]) / sigma_m[0];
                double dy = (origin_m[1] + 0.02 * y - at_m[1]) / sigma_m[1];
                double dz = (origin_m[2] + 0.01 * z - at_m[2]) / sigma_m[2];
                r->intensity[z][y][x] += (float)exp(-0.5 * (dx * dx + dy * dy + dz * dz));
            }
        }
    }
}

static int detect(struct rig *r, const struct walls *walls, struct error *why)
{
    struct object_list list;
    struct volume volume;

    volume_from_message(&volume, &r->volume, 0);
    int err = detector_volume(&r->detector, &volume, walls, &list, why);
    return err ? err : detections_from_objects(&r->list, &list);
}

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);

    if (!r || scene_open(&r->scene, SOURCE_DIR "/tests/nodes/point.yaml"))
        return -1;
    detector_init(&r->detector, &config);
    struct survey survey;
    if (survey_from_message(&survey, r->scene.survey, NULL) ||
        detector_survey(&r->detector, &survey))
        return -1;
    survey_clear(&survey);
    fill_noise(r);
    anlos__volume__init(&r->volume);
    anlos__vec3__init(&r->origin);
    anlos__vec3__init(&r->step);
    r->origin.x = origin_m[0];
    r->origin.y = origin_m[1];
    r->origin.z = origin_m[2];
    r->step.x = r->step.y = 0.02;
    r->step.z = 0.01;
    r->volume.survey_id = r->scene.survey->id;
    r->volume.scan = 3;
    r->volume.origin_m = &r->origin;
    r->volume.step_m = &r->step;
    r->volume.intensity = tensor_borrow_f32(&r->view, &r->intensity[0][0][0], 3,
                                            (size_t)NZ, (size_t)NY, (size_t)NX);
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    detections_free(r->list);
    detector_clear(&r->detector);
    scene_close(&r->scene);
    free(r);
    return 0;
}

/* Two voxels 6 cm apart are one blurred thing, or two points. */
static void what_a_method_isolates_is_not_joined(void **state)
{
    struct rig *r = *state;

    memset(r->intensity, 0, sizeof r->intensity);
    r->intensity[NZ / 2][NY / 2][3] = 1.0f;
    r->intensity[NZ / 2][NY / 2][6] = 0.9f;
    assert_int_equal(detect(r, NULL, NULL), 0);
    assert_int_equal(r->list->n_detections, 1);
    detections_free(r->list);
    r->list = NULL;
    r->volume.method = (char *)"sparse";
    assert_int_equal(detect(r, NULL, NULL), 0);
    assert_int_equal(r->list->n_detections, 2);
}

/* The scene's wall is z = 0.8 and its mount puts the array's x to the vehicle's y, its y
 * to z and so its z to x, 0.3 m up: an image at (x, y, z) is really at (x, y, 1.6 - z),
 * and for the vehicle at (1.6 - z, x, y + 0.3). */
static void an_object_is_reported_where_it_really_is(void **state)
{
    struct rig *r = *state;
    const double at_m[3] = {0.183, 0.142, 1.196};

    add_blob(r, at_m, sharp_m);
    assert_int_equal(detect(r, NULL, NULL), 0);
    assert_true(r->list->mirrored);
    assert_true(r->list->in_vehicle_frame);
    assert_int_equal(r->list->scan, 3);
    assert_int_equal(r->list->n_detections, 1);
    const Anlos__Detection *d = r->list->detections[0];
    assert_int_equal(d->id, 1);
    assert_near(d->position_m->x, 0.404, 0.003);
    assert_near(d->position_m->y, 0.183, 0.003);
    assert_near(d->position_m->z, 0.442, 0.003);
    assert_near(d->virtual_m->z, 1.196, 0.003);
    assert_true(d->existence >= 0.5);
}

/* Half of it is beyond the end of the image (z, the vehicle's x).  Of images that follow
 * each other a track tells that it may go on there. */
static void at_a_border_a_scan_tells_nothing_and_a_frame_what_is_seen(void **state)
{
    struct rig *r = *state;
    const double at_m[3] = {0.183, 0.142, origin_m[2]};

    add_blob(r, at_m, sharp_m);
    for (r->volume.frame = 0; r->volume.frame < 2; r->volume.frame++) {
        assert_int_equal(detect(r, NULL, NULL), 0);
        assert_int_equal(r->list->n_detections, 1);
        const Anlos__Detection *d = r->list->detections[0];
        assert_true(d->at_border);
        double sigma_m = sqrt(d->covariance_m2[0]);
        if (r->volume.frame)
            assert_true(sigma_m < 0.05);
        else
            assert_true(sigma_m > 1.0);
        detections_free(r->list);
        r->list = NULL;
    }
}

static const Anlos__Detection *find(const Anlos__DetectionList *list, double virtual_z_m)
{
    for (size_t i = 0; i < list->n_detections; i++)
        if (fabs(list->detections[i]->virtual_m->z - virtual_z_m) < 0.02)
            return list->detections[i];
    fail_msg("nothing at %g m", virtual_z_m);
    return NULL;
}

/* One 1.1 and one 1.4 m before the array, in the image. */
static void find_two(struct rig *r, const struct walls *walls)
{
    add_blob(r, (const double[3]){0.1, 0.1, 1.1}, sharp_m);
    add_blob(r, (const double[3]){0.2, 0.2, 1.4}, sharp_m);
    assert_int_equal(detect(r, walls, NULL), 0);
    assert_int_equal(r->list->n_detections, 2);
}

/* The second wall is 5 cm farther away. */
static void each_wall_mirrors_what_its_gate_holds(void **state)
{
    struct rig *r = *state;
    const struct walls walls = {
        .n = 2,
        .list = {{4, {.normal = {0, 0, 1}, .distance_m = 0.8}, {0.0, 1.25}},
                 {7, {.normal = {0, 0, 1}, .distance_m = 0.85}, {1.25, 3.0}}}};

    find_two(r, &walls);
    const Anlos__Detection *near = find(r->list, 1.1), *far = find(r->list, 1.4);
    assert_int_equal(near->wall, 4);
    assert_near(near->position_m->x, 1.6 - 1.1, 0.003);
    assert_int_equal(far->wall, 7);
    assert_near(far->position_m->x, 1.7 - 1.4, 0.003);
    assert_false(near->behind_no_wall || far->behind_no_wall);
    assert_false(near->in_free_view || far->in_free_view);
}

static void what_no_wall_stands_before_is_marked(void **state)
{
    struct rig *r = *state;
    const struct walls walls = {
        .n = 1, .list = {{4, {.normal = {0, 0, 1}, .distance_m = 1.25}, {0.0, 3.0}}}};

    find_two(r, &walls);
    const Anlos__Detection *before = find(r->list, 1.1), *behind = find(r->list, 1.4);
    assert_true(before->behind_no_wall);
    assert_int_equal(before->wall, 0);
    assert_near(before->position_m->x, 1.1, 0.003);
    assert_false(behind->behind_no_wall);
    assert_int_equal(behind->wall, 4);
    assert_near(behind->position_m->x, 2.5 - 1.4, 0.003);
}

/* The array sees a strip 0.4 to 0.6 m before it: one stands in it, the other at 0.2. */
static void what_would_stand_in_free_view_is_marked(void **state)
{
    struct rig *r = *state;
    const struct walls walls = {
        .n = 1,
        .list = {{4, {.normal = {0, 0, 1}, .distance_m = 0.8}, {0.0, 3.0}}},
        .n_corners = 4,
        .free_view_m = {{-1.0, 0.4}, {1.0, 0.4}, {1.0, 0.6}, {-1.0, 0.6}}};

    find_two(r, &walls);
    assert_true(find(r->list, 1.1)->in_free_view);
    assert_false(find(r->list, 1.4)->in_free_view);
}

/* Seen through an aperture of 0.2 m a point is 1.207 lambda R / 2 D = 0.11 m wide at
 * 1.2 m: a blob 9 voxels wide (3.33 sigma) is no more than a point. */
static void the_aperture_tells_how_wide_a_point_is(void **state)
{
    struct rig *r = *state;
    const double at_m[3] = {0.2, 0.14, 1.2}, blurred_m[3] = {0.056, 0.025, 0.009};

    add_blob(r, at_m, blurred_m);
    assert_int_equal(detect(r, NULL, NULL), 0);
    assert_int_equal(r->list->n_detections, 1);
    assert_true(r->list->detections[0]->extent_m->y == 0.0); /* the array's x */
}

static void a_body_wider_than_a_point_has_an_extent(void **state)
{
    struct rig *r = *state;
    const double at_m[3] = {0.2, 0.14, 1.2}, wide_m[3] = {0.1, 0.025, 0.009};

    add_blob(r, at_m, wide_m);
    assert_int_equal(detect(r, NULL, NULL), 0);
    assert_int_equal(r->list->n_detections, 1);
    assert_near(r->list->detections[0]->extent_m->y, 0.333, 0.03); /* the array's x */
}

static void what_is_too_unlikely_is_left_out(void **state)
{
    struct rig *r = *state;
    const double at_m[3] = {0.1, 0.1, 1.1};

    add_blob(r, at_m, sharp_m);
    r->detector.cfg.min_existence = 1.01;
    assert_int_equal(detect(r, NULL, NULL), 0);
    assert_int_equal(r->list->n_detections, 0);
}

/* The same place in the coarse image, as bright as `here`; 8 cm behind the volume stands
 * something of brightness 1. */
static size_t found_before(struct rig *r, float here)
{
    const float behind[1][4] = {{0.183f, 0.142f, 1.58f, 1.0f}};
    const double at_m[3] = {0.183, 0.142, 1.196};
    float coarse[2][2][2] = {{{0.0f}}};
    struct object_list list;
    struct volume v;

    add_blob(r, at_m, sharp_m);
    volume_from_message(&v, &r->volume, 0);
    v.method = "lct"; /* an image of power */
    for (int i = 0; i < 8; i++)
        (&coarse[0][0][0])[i] = here;
    v.around = (struct surroundings_view){
        .grid = {{-0.1, -0.1, 0.9}, {0.6, 0.5, 0.6}, {2, 2, 2}},
        .intensity = &coarse[0][0][0],
        .n_spots = 1,
        .spots = behind};
    assert_int_equal(detector_volume(&r->detector, &v, NULL, &list, NULL), 0);
    return list.n;
}

static void a_sidelobe_of_what_stands_behind_the_volume_is_no_object(void **state)
{
    struct rig *r = *state;

    r->detector.cfg.min_existence = 0.0;
    assert_int_equal(found_before(r, 0.5f), 1);
    assert_int_equal(found_before(r, 1e-4f), 1); /* named, but hardly there */
    r->detector.cfg.min_existence = 0.5;
    assert_int_equal(found_before(r, 0.5f), 1);
    assert_int_equal(found_before(r, 1e-4f), 0);
}

static void the_threshold_is_above_the_noise(void **state)
{
    struct rig *r = *state;
    const double at_m[3] = {0.1, 0.1, 1.1};

    add_blob(r, at_m, sharp_m); /* 40 dB above the noise's mean */
    r->detector.cfg.threshold_db = 80.0;
    assert_int_equal(detect(r, NULL, NULL), 0);
    assert_int_equal(r->list->n_detections, 0);
}

static void the_counter_rises_and_previews_are_marked(void **state)
{
    struct rig *r = *state;

    r->volume.preview = true;
    assert_int_equal(detect(r, NULL, NULL), 0);
    assert_true(r->list->preview);
    uint32_t counter = r->list->counter;
    detections_free(r->list);
    r->list = NULL;
    r->volume.preview = false;
    assert_int_equal(detect(r, NULL, NULL), 0);
    assert_false(r->list->preview);
    assert_int_equal(r->list->counter, counter + 1);
}

static void a_volume_before_its_survey_waits(void **state)
{
    struct rig *r = *state;
    struct error why = {""};

    r->volume.survey_id++;
    assert_int_equal(detect(r, NULL, &why), -EAGAIN);
    assert_string_equal(why.text, "the survey of a volume is not known yet");
}

static void a_volume_with_nan_or_without_grid_is_refused(void **state)
{
    struct rig *r = *state;

    r->intensity[5][5][5] = NAN;
    assert_int_equal(detect(r, NULL, NULL), -EINVAL);
    r->intensity[5][5][5] = -1.0f;
    assert_int_equal(detect(r, NULL, NULL), -EINVAL);
    r->intensity[5][5][5] = 0.0f;
    r->step.x = 0.0;
    assert_int_equal(detect(r, NULL, NULL), -EINVAL);
    r->step.x = 0.02;
    r->volume.origin_m = NULL;
    assert_int_equal(detect(r, NULL, NULL), -EINVAL);
    assert_null(r->list);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(an_object_is_reported_where_it_really_is),
        TEST(at_a_border_a_scan_tells_nothing_and_a_frame_what_is_seen),
        TEST(what_a_method_isolates_is_not_joined),
        TEST(each_wall_mirrors_what_its_gate_holds),
        TEST(what_no_wall_stands_before_is_marked),
        TEST(what_would_stand_in_free_view_is_marked),
        TEST(the_aperture_tells_how_wide_a_point_is),
        TEST(a_body_wider_than_a_point_has_an_extent),
        TEST(what_is_too_unlikely_is_left_out),
        TEST(a_sidelobe_of_what_stands_behind_the_volume_is_no_object),
        TEST(the_threshold_is_above_the_noise),
        TEST(the_counter_rises_and_previews_are_marked),
        TEST(a_volume_before_its_survey_waits),
        TEST(a_volume_with_nan_or_without_grid_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
