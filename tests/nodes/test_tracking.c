/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "msgs/convert.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/track/tracking.h"
#include "recon/tracking/sidelobes.h"
#include "recon/tracking/sight.h"
#include "recon/tracking/timing.h"
#include "tests/nodes/near.h"
#include "tests/nodes/scene.h"

enum { NX = 101, NZ = 61 };

#define FRAME_NS 250000000
#define BEGIN_NS INT64_C(1000000000)
#define FRONT_M  0.09 /* from what is heard to the middle of it */

/* The scene's wall is z = 0.8 and its mount puts the array's x to the vehicle's y and its
 * z to x: an image at (x, z) is really at (1.6 - z, x) for the vehicle. */
struct rig {
    struct scene scene;
    struct tracking *tracking;
    float intensity[NZ][1][NX];
    Anlos__Volume volume;
    Anlos__Vec3 origin, step;
    struct tensor_view view;
    Anlos__DetectionList *list;
    int64_t stamp_ns;
};

static void clear(struct rig *r)
{
    uint32_t seed = 1;

    for (size_t i = 0; i < sizeof r->intensity / sizeof(float); i++) {
        seed = seed * 1664525u + 1013904223u;
        (&r->intensity[0][0][0])[i] = 1e-4f * (float)(seed >> 8) / 16777216.0f;
    }
}

static void add(struct rig *r, double x_m, double z_m, double power)
{
    for (int z = 0; z < NZ; z++)
        for (int x = 0; x < NX; x++) {
            double dx = (-2.0 + 0.04 * x - x_m) / 0.05,
                   dz = (0.9 + 0.04 * z - z_m) / 0.05;
            r->intensity[z][0][x] += (float)(power * exp(-0.5 * (dx * dx + dz * dz)));
        }
}

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);
    struct pipeline_config cfg;

    if (!r || scene_open(&r->scene, SOURCE_DIR "/tests/nodes/point.yaml"))
        return -1;
    launchfile_pipeline(&cfg, NULL);
    if (tracking_create(&r->tracking, NULL, &cfg.tracker) ||
        tracking_survey(r->tracking, r->scene.survey, NULL))
        return -1;
    anlos__volume__init(&r->volume);
    anlos__vec3__init(&r->origin);
    anlos__vec3__init(&r->step);
    r->origin.x = -2.0;
    r->origin.z = 0.9;
    r->step.x = r->step.y = r->step.z = 0.04;
    r->volume.survey_id = r->scene.survey->id;
    r->volume.scan = 1;
    r->volume.pings_used = 4;
    r->volume.origin_m = &r->origin;
    r->volume.step_m = &r->step;
    r->volume.intensity = tensor_borrow_f32(&r->view, &r->intensity[0][0][0], 3,
                                            (size_t)NZ, (size_t)1, (size_t)NX);
    r->stamp_ns = BEGIN_NS;
    clear(r);
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    detections_free(r->list);
    tracking_destroy(r->tracking);
    scene_close(&r->scene);
    free(r);
    return 0;
}

/* Where the middle of what is heard there is, whose sound comes from an array, or its
 * mirror image, ahead of the vehicle. */
static void behind(double x_m, double y_m, double array_m, double middle_m[2])
{
    double far_m = hypot(x_m - array_m, y_m);

    middle_m[0] = x_m + FRONT_M * (x_m - array_m) / far_m;
    middle_m[1] = y_m + FRONT_M * y_m / far_m;
}

/* The next image of a fixed array. */
static void image(struct rig *r)
{
    detections_free(r->list);
    r->list = NULL;
    r->volume.frame++;
    assert_int_equal(
        tracking_volume(r->tracking, &r->volume, r->stamp_ns, &r->list, NULL), 0);
    r->stamp_ns += FRAME_NS;
    clear(r);
}

static void tell_motion(struct rig *r, int64_t stamp_ns, double speed_m_s)
{
    Anlos__EgoMotion m = ANLOS__EGO_MOTION__INIT;

    m.speed_m_s = speed_m_s;
    m.valid = true;
    tracking_ego(r->tracking, &m, stamp_ns);
}

static void the_lists_of_a_scan_stand_for_themselves(void **state)
{
    struct rig *r = *state;

    add(r, 0.5, 2.0, 1.0);
    assert_int_equal(
        tracking_volume(r->tracking, &r->volume, r->stamp_ns, &r->list, NULL), 0);
    assert_false(r->list->tracked);
    assert_int_equal(r->list->n_detections, 1);
    assert_int_equal(r->list->detections[0]->n_velocity_m_s, 0);
}

static void a_fixed_array_tells_of_what_stays(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 6; k++) {
        add(r, 0.5, 2.0, 1.0);
        image(r);
        assert_true(r->list->tracked);
        assert_int_equal(r->list->frame, k + 1);
        assert_int_equal(r->list->counter, k);
        assert_int_equal(r->list->n_detections, k >= 2);
    }
    const Anlos__Detection *d = r->list->detections[0];
    assert_int_equal(d->id, 2); /* of a first image with a stamp of 1 s */
    assert_int_equal(d->measurement, ANLOS__MEASUREMENT__MEASURED);
    assert_int_equal(d->wall, 1);
    double middle_m[2];
    behind(-0.4, 0.5, 1.6, middle_m);
    assert_near(d->position_m->x, middle_m[0], 0.01);
    assert_near(d->position_m->y, middle_m[1], 0.01);
    assert_near(d->virtual_m->x, 0.5, 0.01);
    assert_near(d->virtual_m->z, 2.0, 0.01);
    assert_int_equal(d->n_covariance_m2, 6);
    assert_true(d->covariance_m2[0] > 0.0 && d->covariance_m2[3] > 0.0);
    assert_int_equal(d->n_velocity_m_s, 2);
    assert_near(d->velocity_m_s[0], 0.0, 0.05);
    assert_int_equal(d->n_velocity_covariance_m2_s2, 3);
    assert_near(d->age_s, 1.25, 1e-9);
    assert_true(d->level_db > 12.0);
    assert_int_equal(d->motion, ANLOS__MOTION__STANDING);
}

/* Faint ones, that were taken for things at rest before. */
static void what_a_background_may_have_left_is_not_told_at_rest(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 12; k++) {
        r->volume.standing_taken = k < 6;
        add(r, 0.5, 2.0, 1.9e-3);
        image(r);
        assert_int_equal(r->list->n_detections, k >= 6);
    }
    assert_near(r->list->detections[0]->level_db, 13.0, 1.0);
}

/* At 1 m/s along the array's x.  What 4 pings show is 12 ms later (34.7 after the chirp's
 * start, 46.9 for the mean of the pings), and 6 to 7 ms on the way. */
static void something_that_walks_is_where_it_is_at_the_stamp(void **state)
{
    struct rig *r = *state;
    const double lag_s = -0.046875 + 0.0347222 + 2.2 / 343.0;

    for (int k = 0; k < 13; k++) {
        add(r, -1.2 + 0.25 * k + lag_s, 2.0, 1.0);
        image(r);
    }
    const Anlos__Detection *d = r->list->detections[0];
    double middle_m[2];
    behind(-0.4, -1.2 + 0.25 * 12, 1.6, middle_m);
    assert_near(d->position_m->y, middle_m[1], 0.02);
    assert_near(d->velocity_m_s[1], 1.0, 0.1);
    assert_int_equal(d->motion, ANLOS__MOTION__MOVING);
}

static void it_is_predicted_and_then_deleted(void **state)
{
    struct rig *r = *state;
    int predicted = 0;

    for (int k = 0; k < 6; k++) {
        add(r, 0.5, 2.0, 1.0);
        image(r);
    }
    double level_db = r->list->detections[0]->level_db;
    for (image(r); r->list->detections[0]->measurement != ANLOS__MEASUREMENT__DELETED;
         image(r)) {
        assert_int_equal(r->list->detections[0]->measurement,
                         ANLOS__MEASUREMENT__PREDICTED);
        assert_near(r->list->detections[0]->level_db, level_db, 1e-12);
        predicted++;
    }
    assert_in_range(predicted, 3, 6);
    image(r);
    assert_int_equal(r->list->n_detections, 0);
}

/* A quarter of an image's pings may be blanked; with more it shows nothing: what is told
 * is predicted, as sure as before but for the time that passes, and nothing begins. */
static void while_a_sound_drowns_the_images_tracks_go_on(void **state)
{
    struct rig *r = *state;

    r->volume.pings_expected = 4;
    for (int k = 0; k < 6; k++) {
        r->volume.pings_blanked = k == 5;
        add(r, 0.5, 2.0, 1.0);
        image(r);
    }
    const Anlos__Detection *d = r->list->detections[0];
    assert_int_equal(d->measurement, ANLOS__MEASUREMENT__MEASURED);
    double existence = d->existence;
    r->volume.pings_blanked = 2;
    for (int k = 0; k < 4; k++) { /* 1 s of the 30 s that an object stays */
        add(r, -0.5, 2.5, 1.0);
        image(r);
        assert_int_equal(r->list->n_detections, 1);
        d = r->list->detections[0];
        assert_int_equal(d->measurement, ANLOS__MEASUREMENT__PREDICTED);
        double near = 1.0 - exp(-1.0 / (d->covariance_m2[0] + d->covariance_m2[3]));
        assert_near(d->existence, existence * exp(-0.25 / 30.0 * (k + 1)) * near, 1e-4);
    }
    r->volume.pings_blanked = 0;
    add(r, 0.5, 2.0, 1.0);
    image(r);
    assert_int_equal(r->list->detections[0]->measurement, ANLOS__MEASUREMENT__MEASURED);
}

/* A strong thing that stands, in air that warms: what the background leaves of it grows
 * by 4 dB a second and then flickers.  Then something comes that is 20 dB over it. */
static void what_a_background_leaves_is_not_told_and_what_comes_is(void **state)
{
    struct rig *r = *state;
    struct pipeline_config cfg;

    launchfile_pipeline(&cfg, NULL);
    cfg.tracker.detector.cfar = CFAR_ORDERED;
    cfg.tracker.detector.false_alarm_rate = 1e-4;
    tracking_destroy(r->tracking);
    assert_int_equal(tracking_create(&r->tracking, NULL, &cfg.tracker), 0);
    assert_int_equal(tracking_survey(r->tracking, r->scene.survey, NULL), 0);
    r->volume.standing_left = true; /* the background begins */
    for (int k = 0; k < 60; k++) {
        add(r, 0.5, 2.0, 1e-2 * (1.0 + 0.3 * sin(k)) * fmin(pow(10.0, 0.1 * k - 2.0), 1));
        image(r);
        r->volume.standing_left = false;
        assert_int_equal(r->list->n_detections, 0);
    }
    for (int k = 0; k < 60; k++) {
        add(r, 0.5, 2.0, 1e-2 * (1.0 + 0.3 * sin(k)));
        add(r, -0.8 + 0.05 * k, 2.5, 1.0);
        image(r);
        assert_int_equal(r->list->n_detections, k >= 2);
    }
}

/* One wall across the array's view, number 7, or none. */
static void tell_wall(struct rig *r, size_t n, double distance_m, int64_t stamp_ns)
{
    Anlos__WallList walls = ANLOS__WALL_LIST__INIT;
    Anlos__Wall wall = ANLOS__WALL__INIT, *list[1] = {&wall};
    Anlos__Vec3 normal = ANLOS__VEC3__INIT;

    normal.z = 1.0;
    wall.normal = &normal;
    wall.id = 7;
    wall.distance_m = distance_m;
    wall.gate_far_m = 10.0;
    walls.walls = list;
    walls.n_walls = n;
    assert_int_equal(tracking_walls(r->tracking, &walls, stamp_ns, NULL), 0);
}

/* The vehicle drives 0.8 m/s towards what stands over ground. */
static void what_stands_is_seen_to_stand_from_a_vehicle_that_moves(void **state)
{
    struct rig *r = *state;

    /* Told once, at the beginning: it comes nearer by itself. */
    tell_wall(r, 1, 1.6, BEGIN_NS);
    for (int k = 0; k < 8; k++) {
        for (int i = 0; i < 13; i++)
            tell_motion(r, r->stamp_ns - FRAME_NS + 20000000 * i, 0.8);
        double wall_m = 1.6 - 0.2 * k, object_m = 0.5 - 0.2 * k; /* ahead */
        add(r, 0.5, 2.0 * wall_m - object_m, 1.0);
        image(r);
    }
    assert_int_equal(r->list->n_detections, 1);
    const Anlos__Detection *d = r->list->detections[0];
    assert_int_equal(d->wall, 7);
    double middle_m[2];
    behind(0.5 - 0.2 * 7, 0.5, 2.0 * (1.6 - 0.2 * 7), middle_m);
    assert_near(d->position_m->x, middle_m[0], 0.02);
    assert_near(d->velocity_m_s[0], 0.0, 0.05);
    assert_int_equal(d->motion, ANLOS__MOTION__STANDING);
    assert_false(r->list->ego_unknown);
}

static void motion_that_is_not_told_any_more_is_said(void **state)
{
    struct rig *r = *state;

    image(r);
    assert_false(r->list->ego_unknown); /* never told: it stands */
    tell_motion(r, r->stamp_ns - FRAME_NS, 0.0);
    tell_motion(r, r->stamp_ns - 50000000, 0.0);
    image(r);
    assert_true(r->list->ego_unknown); /* 200 ms in between without */
    for (int i = 0; i <= 12; i++)
        tell_motion(r, r->stamp_ns - FRAME_NS + 1000 + 20000000 * i, 0.0);
    image(r);
    assert_false(r->list->ego_unknown);
    image(r);
    assert_true(r->list->ego_unknown);
}

/* The wall may be 10 cm off: the place of the object as well, twice, however long it is
 * looked at.  Its distance moves what is behind it by 2 along the normal.  So does how
 * far behind its front a middle is, 6 cm, along the line of sight, 14 degrees off that.
 */
static void the_walls_error_is_not_averaged_away(void **state)
{
    struct rig *r = *state;
    Anlos__WallList walls = ANLOS__WALL_LIST__INIT;
    Anlos__Wall wall = ANLOS__WALL__INIT, *list[1] = {&wall};
    Anlos__Vec3 normal = ANLOS__VEC3__INIT;
    double covariance[6] = {0, 0, 0, 0, 0, 0.01};

    normal.z = 1.0;
    wall.normal = &normal;
    wall.id = 1;
    wall.distance_m = 0.8;
    wall.gate_far_m = 10.0;
    wall.covariance = covariance;
    wall.n_covariance = 6;
    walls.walls = list;
    walls.n_walls = 1;
    assert_int_equal(tracking_walls(r->tracking, &walls, BEGIN_NS, NULL), 0);
    for (int k = 0; k < 12; k++) {
        add(r, 0.5, 2.0, 1.0);
        image(r);
    }
    assert_near(r->list->detections[0]->covariance_m2[0],
                0.04 + 0.06 * 0.06 * 2.0 * 2.0 / (2.0 * 2.0 + 0.5 * 0.5), 0.004);
    assert_true(r->list->detections[0]->covariance_m2[3] < 0.01);
}

static void an_image_of_the_past_is_refused(void **state)
{
    struct rig *r = *state;
    struct error why = {""};
    Anlos__DetectionList *list = NULL;

    image(r);
    assert_int_equal(tracking_volume(r->tracking, &r->volume, BEGIN_NS, &list, &why),
                     -ESTALE);
    assert_null(list);
    assert_string_equal(why.text, "an image that is not newer than the one before");
    assert_int_equal(tracking_counts(r->tracking).late, 1);
}

/* As far from the array, which is at the origin, and 10 dB fainter. */
static void a_sidelobe_begins_no_track(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 8; k++) {
        add(r, 0.5, 2.0, 1.0);
        add(r, -1.2, sqrt(0.25 + 4.0 - 1.44), 0.1);
        image(r);
    }
    assert_int_equal(r->list->n_detections, 1);
    for (int k = 0; k < 8; k++) { /* nearer by half a metre: something else */
        add(r, 0.5, 2.0, 1.0);
        add(r, -0.6, 1.4, 0.1);
        image(r);
    }
    assert_int_equal(r->list->n_detections, 2);
}

/* At z = 0.8. */
static void the_wall_itself_is_not_tracked(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 8; k++) {
        add(r, 0.5, 0.98, 1.0);
        add(r, -0.6, 1.6, 0.9);
        image(r);
    }
    assert_int_equal(r->list->n_detections, 1);
    double middle_m[2];
    behind(0.0, -0.6, 1.6, middle_m);
    assert_near(r->list->detections[0]->position_m->y, middle_m[1], 0.02);
}

/* At 1.6 m/s; an image for each ping, of the four newest, of which the first one, two
 * and three images have it in as many. */
static void something_that_comes_out_is_no_slower_at_first(void **state)
{
    const double ping_s = 0.03125, shown_s = 0.0347222 + 2.2 / 343.0;
    struct rig *r = *state;

    image(r);
    r->stamp_ns += (int64_t)(1e9 * ping_s) - FRAME_NS;
    for (int k = 0; k < 8; k++) {
        double ago_s = 0.5 * ping_s * fmin(k, 3);
        add(r, -0.2 + 1.6 * (ping_s * k - ago_s + shown_s), 2.0, 1.0);
        image(r);
        r->stamp_ns += (int64_t)(1e9 * ping_s) - FRAME_NS;
    }
    assert_int_equal(r->list->n_detections, 1);
    assert_near(r->list->detections[0]->velocity_m_s[1], 1.6, 0.3);
}

/* At 1.2 m/s, in images that have what stands in them. */
static void until_a_wall_is_found_nothing_hides(void **state)
{
    struct rig *r = *state;

    r->volume.standing_left = true;
    for (int found = 0; found < 2; found++) {
        tell_wall(r, (size_t)found, 0.8, r->stamp_ns);
        for (int k = 0; k < 8; k++) {
            add(r, -1.2 + 0.3 * k, 2.0, 1.0);
            image(r);
            assert_true(found || r->list->n_detections == 0);
        }
    }
    assert_int_equal(r->list->n_detections, 1);
    double middle_m[2];
    behind(1.6 - 2.0, -1.2 + 0.3 * 7, 1.6, middle_m);
    assert_near(r->list->detections[0]->position_m->x, middle_m[0], 0.05);
}

/* At 3.2 m/s: what is heard is its rear, which is where it is imaged; its middle is ahead
 * of that. */
static void something_fast_that_goes_is_imaged_where_its_rear_is(void **state)
{
    struct rig *r = *state;
    double x_m = 0.0;

    for (int k = 0; k < 5; k++) {
        x_m = -1.6 + 0.8 * k;
        add(r, x_m, 2.0, 1.0);
        image(r);
    }
    assert_int_equal(r->list->n_detections, 1);
    const Anlos__Detection *d = r->list->detections[0];
    assert_near(d->virtual_m->x, x_m, 0.1);
    assert_near(d->virtual_m->z, 2.0, 0.05);
    assert_true(d->position_m->y > x_m + 0.2);
    assert_true(d->extent_m->y > 0.7);
}

/* A background begins with somebody in it; of the four speakers a round takes an eighth
 * of a second, and seven rounds three images and a half.  After a gap it begins again. */
static void a_young_background_leaves_holes_that_are_not_told(void **state)
{
    struct rig *r = *state;

    for (int begun = 0; begun < 2; begun++) {
        for (int k = 0; k < 8; k++) {
            r->volume.standing_left = k < 1;
            add(r, 0.5, 2.0, 1.0);
            image(r);
            if (begun && !k) /* of before */
                assert_int_equal(r->list->detections[0]->measurement,
                                 ANLOS__MEASUREMENT__DELETED);
            else
                assert_int_equal(r->list->n_detections, k >= 4);
        }
        r->stamp_ns += 8 * (int64_t)FRAME_NS;
    }
}

static void a_background_that_was_there_leaves_none(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 8; k++) {
        add(r, 0.5, 2.0, 1.0);
        image(r);
        assert_int_equal(r->list->n_detections, k >= 2);
    }
}

static void who_walks_before_a_young_background_is_told(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 6; k++) {
        r->volume.standing_left = k < 1;
        add(r, -1.2 + 0.3 * k, 2.0, 1.0);
        image(r);
    }
    assert_int_equal(r->list->n_detections, 1);
}

/* In the plane, at an angle from straight ahead. */
static struct sidelobe_source ghost_at(double angle, double range_m, double level_db)
{
    const double at_m[3] = {range_m * sin(angle), 0.0, range_m * cos(angle)};

    return sidelobe_source_at(at_m, level_db);
}

static bool is_ghost(const struct sidelobe_array *array, struct sidelobe_source what,
                     struct sidelobe_source loud)
{
    return sidelobes_may_be(array, &what, &loud, 1);
}

static void only_what_is_fainter_and_as_far_may_be_a_sidelobe(void **state)
{
    static const struct sidelobe_array point = {.margin_db = 6.0};
    const struct sidelobe_source loud = ghost_at(0.0, 3.0, 30.0);

    (void)state;
    assert_true(is_ghost(&point, ghost_at(0.5, 3.2, 23.0), loud));
    assert_false(is_ghost(&point, ghost_at(0.5, 3.2, 25.0), loud));
    assert_false(is_ghost(&point, ghost_at(0.5, 3.4, 10.0), loud));
    assert_false(is_ghost(&point, loud, loud));
}

/* The end of an array of 1 m hears what is 4 m away at 45 degrees 0.35 m nearer than the
 * middle does, and so as far away as what is straight ahead at 3.65 m; smears add 0.3 m.
 * Nothing of that is seen along a line of sight, nor across the array's own line, nor
 * where the gate ends so far away (4.35 m) that the other end hears it too. */
static void the_ends_of_an_array_hear_other_ranges(void **state)
{
    static const struct sidelobe_array
        line = {.half_m = {0.5}, .gate_m = 4.3, .margin_db = 6.0},
        upright = {.half_m = {0.0, 0.5}, .gate_m = 3.9, .margin_db = 6.0},
        deep = {.half_m = {0.5}, .gate_m = 4.4, .margin_db = 6.0};
    const struct sidelobe_source loud = ghost_at(M_PI_4, 4.0, 30.0);

    (void)state;
    assert_true(is_ghost(&line, ghost_at(0.0, 3.37, 20.0), loud));
    assert_false(is_ghost(&line, ghost_at(0.0, 3.33, 20.0), loud));
    assert_true(is_ghost(&line, ghost_at(-M_PI_4, 3.02, 20.0), loud));
    assert_false(is_ghost(&line, ghost_at(-M_PI_4, 2.97, 20.0), loud));
    assert_false(is_ghost(&line, ghost_at(M_PI_4, 3.67, 20.0), loud));
    assert_false(is_ghost(&upright, ghost_at(0.0, 3.67, 20.0), loud));
    assert_false(is_ghost(&deep, ghost_at(0.0, 3.67, 20.0), loud));
    assert_false(is_ghost(&line, ghost_at(0.0, 3.37, 25.0), loud));
}

/* 4 cm by 24 cm, in its scene's file. */
static void an_array_reaches_from_element_to_element(void **state)
{
    struct rig *r = *state;
    struct sidelobe_array array = {.margin_db = 6.0};
    struct survey survey;

    assert_int_equal(survey_from_message(&survey, r->scene.survey, NULL), 0);
    sidelobe_array_measure(&array, &survey);
    assert_near(array.half_m[0], 0.02, 1e-6);
    assert_near(array.half_m[1], 0.12, 1e-6);
    assert_near(array.half_m[2], 0.0, 1e-6);
    assert_near(array.gate_m, 1.8, 1e-6);
    survey_clear(&survey);
}

/* 16 pings of 24 ms began 180 ms before the stamp on average, or more when some of those
 * between them were lost; a chirp of 20 ms up to 20 kHz shows 22.2 ms after its start, up
 * and down together its middle. */
static void images_tell_of_instants_of_their_own(void **state)
{
    struct survey s = {.sample_rate_hz = 48000,
                       .slot_samples = 1152,
                       .chirp_start_hz = 2000,
                       .chirp_stop_hz = 20000,
                       .chirp_duration_s = 0.02,
                       .sound_speed_m_s = 340};
    struct volume v = {.pings_used = 16};

    (void)state;
    assert_near(timing_lag_s(&s, &v, 3.4), 0.02 * 20.0 / 18.0 + 0.01 - 0.18, 1e-9);
    assert_near(timing_fresh(&s, &v, 0.024, 0.0), 1.0 / 16.0, 1e-9);
    assert_near(timing_fresh(&s, &v, 0.5, 0.2), 1.0, 1e-9);
    v.age_s = 0.372;
    assert_near(timing_lag_s(&s, &v, 3.4), 0.02 * 20.0 / 18.0 + 0.01 - 0.372, 1e-9);
    assert_near(timing_fresh(&s, &v, 0.048, 0.0), 1.0 / 16.0, 1e-9);
    v.age_s = NAN;
    assert_near(timing_age_s(&s, &v), 0.18, 1e-9);
    v.age_s = 1e9;
    assert_true(timing_age_s(&s, &v) < 10.0);
    v = (struct volume){.pings_used = 1};
    s.chirp_alternates = true;
    assert_near(timing_lag_s(&s, &v, 3.4), 0.01 + 0.01, 1e-9);
    assert_near(timing_fresh(&s, &v, 0.024, 0.2), 0.12, 1e-9);
    s.n_speakers = 16;
    assert_near(timing_round_s(&s), 16 * 0.024, 1e-9);
    v.pings_used = 16;
    s.together = 2;
    assert_near(timing_fresh(&s, &v, 0.024, 0.0), 1.0 / 8.0, 1e-9);
}

/* The array's mirror image stands at z = 1.6, for the vehicle at (1.6, 0). */
static void what_hides_is_heard_from_where_the_mirrored_array_stands(void **state)
{
    struct rig *r = *state;
    const double at_m[3] = {0.4, 0.9, 0.0};
    struct grid grid = {.n = {NX, 1, NZ}};
    struct survey survey;
    struct walls walls, none = {.n = 0};
    struct sight sight;
    double way[2];

    assert_int_equal(survey_from_message(&survey, r->scene.survey, NULL), 0);
    walls_from_survey(&walls, &survey);
    sight_init(&sight, &survey, &walls, &none, &grid);
    sight_direction(&sight, walls.list[0].id, at_m, way);
    assert_near(way[0], -0.8, 1e-9);
    assert_near(way[1], 0.6, 1e-9);
    sight_direction(&sight, walls.list[0].id + 1, at_m, way); /* no such wall: directly */
    assert_near(way[0], 0.4 / hypot(0.4, 0.9), 1e-9);
    assert_near(way[1], 0.9 / hypot(0.4, 0.9), 1e-9);
    const double step_m[3] = {0.3, 0.0,
                              0.1}; /* away from the array is nearer, mirrored */
    sight_way(&sight, walls.list[0].id, step_m, way);
    assert_near(way[0], -0.1, 1e-9);
    assert_near(way[1], 0.3, 1e-9);
    sight_way(&sight, walls.list[0].id + 1, step_m, way);
    assert_near(way[0], 0.1, 1e-9);
    assert_near(way[1], 0.3, 1e-9);
    survey_clear(&survey);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(the_lists_of_a_scan_stand_for_themselves),
        TEST(a_fixed_array_tells_of_what_stays),
        TEST(what_a_background_may_have_left_is_not_told_at_rest),
        TEST(something_that_walks_is_where_it_is_at_the_stamp),
        TEST(something_that_comes_out_is_no_slower_at_first),
        TEST(it_is_predicted_and_then_deleted),
        TEST(while_a_sound_drowns_the_images_tracks_go_on),
        TEST(what_a_background_leaves_is_not_told_and_what_comes_is),
        TEST(what_stands_is_seen_to_stand_from_a_vehicle_that_moves),
        TEST(motion_that_is_not_told_any_more_is_said),
        TEST(the_walls_error_is_not_averaged_away),
        TEST(an_image_of_the_past_is_refused),
        TEST(a_sidelobe_begins_no_track),
        TEST(the_wall_itself_is_not_tracked),
        TEST(something_fast_that_goes_is_imaged_where_its_rear_is),
        TEST(a_young_background_leaves_holes_that_are_not_told),
        TEST(a_background_that_was_there_leaves_none),
        TEST(who_walks_before_a_young_background_is_told),
        TEST(until_a_wall_is_found_nothing_hides),
        TEST(what_hides_is_heard_from_where_the_mirrored_array_stands),
        cmocka_unit_test(only_what_is_fainter_and_as_far_may_be_a_sidelobe),
        cmocka_unit_test(the_ends_of_an_array_hear_other_ranges),
        TEST(an_array_reaches_from_element_to_element),
        cmocka_unit_test(images_tell_of_instants_of_their_own),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
