/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "nodes/anlos/score/drive_score.h"
#include "tests/nodes/near.h"

/* A person walks 1.2 m/s behind a corner, into sight and on. */
#define SCENE SOURCE_DIR "/tests/nodes/walker.yaml"

struct rig {
    struct room *room;
    struct drive_score score;
    struct drive_moment moment;
};

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);

    if (!r || room_load(&r->room, SCENE, NULL))
        return -1;
    const struct drive_truth truth = drive_truth_room(r->room);
    drive_score_init(&r->score, &truth, room_survey(r->room), 0.0);
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    room_destroy(r->room);
    free(r);
    return 0;
}

struct told { /* a list of one object */
    Anlos__DetectionList list;
    Anlos__Detection detection, *detections[1];
    Anlos__Vec3 position;
    double velocity_m_s[2];
};

/* The person, off by so much; beside: nothing. */
static void tell(struct told *t, const struct rig *r, double t_s, double off_m,
                 Anlos__Measurement measurement, unsigned id)
{
    struct room_truth truth;

    assert_int_equal(room_truth(r->room, t_s, &truth, 1), 1);
    anlos__detection_list__init(&t->list);
    anlos__detection__init(&t->detection);
    anlos__vec3__init(&t->position);
    t->position.x = truth.position_m[0] + off_m;
    t->position.y = truth.position_m[1];
    t->velocity_m_s[0] = truth.velocity_m_s[0];
    t->velocity_m_s[1] = truth.velocity_m_s[1] + 0.1;
    t->detection.id = id;
    t->detection.position_m = &t->position;
    t->detection.velocity_m_s = t->velocity_m_s;
    t->detection.n_velocity_m_s = 2;
    t->detection.measurement = measurement;
    t->detections[0] = &t->detection;
    t->list.detections = t->detections;
    t->list.n_detections = 1;
}

static const Anlos__DetectionList none = ANLOS__DETECTION_LIST__INIT;

static void what_is_right_has_no_distance_but_its_own(void **state)
{
    struct rig *r = *state;
    struct told told;

    tell(&told, r, 4.0, 0.03, ANLOS__MEASUREMENT__MEASURED, 1);
    drive_score_list(&r->score, 4.0, 4.03, &told.list, &told.list, &r->moment);
    assert_int_equal(r->moment.n_objects, 1);
    assert_int_equal(r->moment.n_tracks, 1);
    assert_near(r->moment.gospa_m, 0.03, 1e-9);
    assert_near(r->moment.ospa_m, 0.03, 1e-9);
    assert_near(drive_rms(&r->score.result.position2), 0.03, 1e-9);
    assert_near(drive_rms(&r->score.result.velocity2), 0.1, 1e-9);
    assert_near(drive_mean(&r->score.result.seen), 1.0, 1e-9);
}

/* c = 1 m, p = 2: sqrt(1 / 2). */
static void who_is_missed_costs_half_the_cutoff(void **state)
{
    struct rig *r = *state;

    drive_score_list(&r->score, 4.0, 4.03, &none, &none, &r->moment);
    assert_near(r->moment.gospa_m, sqrt(0.5), 1e-9);
    assert_near(r->moment.missed_m, sqrt(0.5), 1e-9);
    assert_near(r->moment.ospa_m, 1.0, 1e-9);
    assert_near(drive_mean(&r->score.result.seen), 0.0, 1e-9);
    assert_int_equal(r->score.result.n_entries, 1);
    drive_score_list(&r->score, 7.9, 7.93, &none, &none, &r->moment); /* gone by */
    drive_score_end(&r->score);
    assert_int_equal(r->score.result.n_entries, 1);
    assert_int_equal(r->score.result.n_late, 1);
}

/* At the start the person is 4.7 m away, by way of the wall: out of the gate. */
static void who_is_out_of_the_gate_may_be_tracked_or_not(void **state)
{
    struct rig *r = *state;
    struct told told;

    drive_score_list(&r->score, 2.1, 2.13, &none, &none, &r->moment);
    assert_true(r->moment.gospa_m == 0.0);
    tell(&told, r, 2.3, 0.1, ANLOS__MEASUREMENT__MEASURED, 1);
    drive_score_list(&r->score, 2.3, 2.33, &told.list, &none, &r->moment);
    assert_true(r->moment.gospa_m == 0.0);
    assert_int_equal(r->moment.n_objects, 0);
    assert_int_equal(r->moment.n_tracks, 0);
    drive_score_end(&r->score);
    assert_int_equal(r->score.result.n_false_tracks, 0);
}

static void a_track_that_was_never_near_anyone_is_false(void **state)
{
    struct rig *r = *state;
    struct told told;

    tell(&told, r, 4.0, 2.0, ANLOS__MEASUREMENT__NEW, 5);
    drive_score_list(&r->score, 4.0, 4.03, &told.list, &none, &r->moment);
    assert_near(r->moment.gospa_m, 1.0, 1e-9); /* one false, one missed */
    tell(&told, r, 4.5, 2.0, ANLOS__MEASUREMENT__DELETED, 5);
    drive_score_list(&r->score, 4.5, 4.53, &told.list, &none, &r->moment);
    assert_int_equal(r->moment.n_tracks, 0);
    assert_int_equal(r->score.result.n_false_tracks, 1);
    /* The same id again, and this time it is somebody. */
    tell(&told, r, 5.0, 0.2, ANLOS__MEASUREMENT__NEW, 5);
    drive_score_list(&r->score, 5.0, 5.03, &told.list, &none, &r->moment);
    drive_score_end(&r->score);
    assert_int_equal(r->score.result.n_false_tracks, 1);
}

/* The image is at (x, 3.1) in the array frame, x = -3.6 + 1.2 (t - 2): its range is 4.1 m
 * at x = -2.683, t = 2.764.  The corner at (-0.6, 0.9) hides it, standing at z = 1.3, up
 * to x = -0.867, t = 4.278. */
static void time_runs_from_the_gate_to_the_track_and_on_to_the_sight(void **state)
{
    struct rig *r = *state;
    struct told told;

    tell(&told, r, 3.0, 0.0, ANLOS__MEASUREMENT__NEW, 1);
    drive_score_list(&r->score, 3.0, 3.1, &told.list, &told.list, &r->moment);
    assert_near(drive_mean(&r->score.result.delay), 3.1 - 2.764, 0.011);
    assert_near(drive_mean(&r->score.result.lead), 4.278 - 3.1, 0.02);
    assert_int_equal(r->score.result.n_entries, 1);
    /* Later lists change nothing. */
    tell(&told, r, 3.5, 0.0, ANLOS__MEASUREMENT__MEASURED, 1);
    drive_score_list(&r->score, 3.5, 3.6, &told.list, &told.list, &r->moment);
    assert_int_equal(r->score.result.delay.n, 1);
}

/* Through the frames of the bus, a signal's step of which is 2 cm; sigma 10 cm. */
static void tell_vehicle(struct rig *r, struct drive_told *bus, double t_s, double off_m,
                         Anlos__Measurement measurement, double existence)
{
    double covariance_m2[6] = {0.0098, 0.0, 0.0, 0.0098, 0.0, 1.0};
    struct told told;

    tell(&told, r, t_s, off_m, measurement, 1);
    told.detection.covariance_m2 = covariance_m2;
    told.detection.n_covariance_m2 = 6;
    told.detection.existence = existence;
    told.list.tracked = told.list.mirrored = told.list.in_vehicle_frame = true;
    drive_score_told(&r->score, bus, t_s, &told.list, llround(1e9 * t_s),
                     llround(1e9 * (t_s + 0.03)));
}

/* Off by 30 cm: 9 = 0.3^2 / 0.1^2 squared sigmas, by 5 cm a quarter. */
static void what_the_vehicle_is_told_is_held_against_what_is_true(void **state)
{
    struct rig *r = *state;
    const struct drive_result *result = &r->score.result;
    struct drive_told bus;

    drive_told_init(&bus, NULL);
    tell_vehicle(r, &bus, 4.0, 0.3, ANLOS__MEASUREMENT__NEW, 0.96);
    assert_int_equal(bus.n, 1);
    assert_near(drive_mean(&result->nees[0].sum), 9.0, 1.3); /* 1 cm of rounding */
    assert_int_equal(result->nees[0].n_within, 0);
    tell_vehicle(r, &bus, 4.05, 0.05, ANLOS__MEASUREMENT__MEASURED, 0.96);
    assert_int_equal(result->nees[0].n_within, 1);
    assert_near(drive_mean(&result->told), 1.0, 1e-9);
    tell_vehicle(r, &bus, 4.1, 2.5, ANLOS__MEASUREMENT__MEASURED, 0.98); /* a ghost */
    assert_near(drive_mean(&result->told), 2.0 / 3.0, 1e-9);
    assert_int_equal(result->existence[6].n, 3); /* 95 to 99 % */
    assert_int_equal(result->existence[6].n_true, 2);
    assert_near(result->existence[6].stated, 0.96 + 0.96 + 0.98, 1e-9);
    tell_vehicle(r, &bus, 4.15, 0.05, ANLOS__MEASUREMENT__DELETED, 0.3);
    assert_near(drive_mean(&result->told), 0.5, 1e-9);
    assert_int_equal(result->existence[0].n, 0);
}

static void bins_take_what_is_between_their_ends(void **state)
{
    static const double stated[] = {0.0, 0.49, 0.5, 0.59, 0.9, 0.95, 0.989, 0.99, 1.0};
    static const size_t n[DRIVE_BINS] = {2, 2, 0, 0, 0, 1, 2, 2};
    struct drive_bin bins[DRIVE_BINS] = {{.n = 0}};

    (void)state;
    for (size_t i = 0; i < sizeof stated / sizeof *stated; i++)
        drive_bins_add(bins, stated[i], i % 2);
    for (size_t b = 0; b < DRIVE_BINS; b++)
        assert_int_equal(bins[b].n, n[b]);
    assert_true(drive_bin_from(0) == 0.0 && drive_bin_from(DRIVE_BINS) == 1.0);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_is_right_has_no_distance_but_its_own),
        TEST(who_is_missed_costs_half_the_cutoff),
        TEST(who_is_out_of_the_gate_may_be_tracked_or_not),
        TEST(a_track_that_was_never_near_anyone_is_false),
        TEST(time_runs_from_the_gate_to_the_track_and_on_to_the_sight),
        TEST(what_the_vehicle_is_told_is_held_against_what_is_true),
        TEST(bins_take_what_is_between_their_ends),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
