#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/can/sender.h"

#define MS 1000000LL

struct list {
    Anlos__DetectionList message;
    Anlos__Detection detections[40], *pointers[40];
    Anlos__Vec3 position, extent;
    double covariance[6];
};

static void fill(struct list *l, size_t n)
{
    anlos__detection_list__init(&l->message);
    anlos__vec3__init(&l->position);
    anlos__vec3__init(&l->extent);
    l->position.x = 4.0;
    l->position.y = -1.5;
    l->position.z = 0.5;
    l->extent.x = 0.2;
    l->extent.y = 0.3;
    l->extent.z = 1.1;
    memcpy(l->covariance, (const double[]){4e-4, 1e-4, 0, 1e-4, 0, 1e-4},
           sizeof l->covariance);
    for (size_t i = 0; i < n; i++) {
        Anlos__Detection *d = l->pointers[i] = &l->detections[i];
        anlos__detection__init(d);
        d->id = (uint32_t)i + 1;
        d->position_m = &l->position;
        d->extent_m = &l->extent;
        d->covariance_m2 = l->covariance;
        d->n_covariance_m2 = 6;
        d->existence = 0.75;
    }
    l->message.detections = l->pointers;
    l->message.n_detections = n;
    l->message.counter = 5;
    l->message.mirrored = true;
    l->message.in_vehicle_frame = true;
}

static void assert_frame(const struct can_frame_data *is,
                         const struct can_frame_data *expected)
{
    assert_int_equal(is->id, expected->id);
    assert_int_equal(is->size, expected->size);
    assert_memory_equal(is->data, expected->data, expected->size);
}

static void a_list_is_header_time_and_three_frames_an_object(void **state)
{
    struct sender s;
    struct list l;
    struct can_frame_data expected;
    struct sender_list sent;
    const struct can_frame_data *f = sent.frames;
    static const uint32_t ids[] = {0x502, 0x503, 0x504, 0x505,
                                   0x506, 0x504, 0x505, 0x506};

    (void)state;
    sender_init(&s, 0x500);
    fill(&l, 2);
    sender_list(&s, &l.message, 1000 * MS, &sent);
    sender_date(&s, &sent, 1030 * MS, 0);
    assert_int_equal(sent.n_frames, 8);
    for (size_t i = 0; i < 8; i++)
        assert_int_equal(f[i].id, ids[i]);
    can_pack_list_header(
        &expected, 0x500,
        &(struct can_list_header){
            .number = 2, .counter = 5, .latency_ms = 30.0, .cycle_ms = NAN});
    assert_frame(&f[0], &expected);
    can_pack_time(&expected, 0x500, 1000 * MS);
    assert_frame(&f[1], &expected);
}

static void an_object_carries_what_the_detection_says(void **state)
{
    struct sender s;
    struct list l;
    struct can_frame_data expected;
    struct sender_list sent;
    const struct can_frame_data *f = sent.frames;
    const struct can_object object = {.id = 1,
                                      .counter = 5,
                                      .position_m = {4.0, -1.5, 0.5},
                                      .measurement = CAN_NEW,
                                      .existence = 0.75,
                                      .velocity_m_s = {NAN, NAN},
                                      .sigma_m = {0.02, 0.01},
                                      .correlation = 0.5,
                                      .length_m = 0.2,
                                      .width_m = 0.3};

    (void)state;
    sender_init(&s, 0x400);
    fill(&l, 1);
    sender_list(&s, &l.message, 1, &sent);
    assert_int_equal(sent.n_frames, 5);
    can_pack_object_state(&expected, 0x400, &object);
    assert_frame(&f[2], &expected);
    can_pack_object_dynamics(&expected, 0x400, &object);
    assert_frame(&f[3], &expected);
    can_pack_object_quality(&expected, 0x400, &object);
    assert_frame(&f[4], &expected);
}

/* Not when it was made: it may have waited for the bus. */
static void age_and_cycle_are_those_of_when_it_goes_out(void **state)
{
    struct sender s;
    struct list l;
    struct can_frame_data expected;
    struct sender_list sent;
    const struct can_frame_data *f = sent.frames;

    (void)state;
    sender_init(&s, 0x400);
    fill(&l, 0);
    sender_list(&s, &l.message, 1100 * MS, &sent);
    sender_date(&s, &sent, 1105 * MS, 1010 * MS);
    sender_date(&s, &sent, 1120 * MS, 1010 * MS);
    can_pack_list_header(
        &expected, 0x400,
        &(struct can_list_header){.counter = 5, .latency_ms = 20.0, .cycle_ms = 110.0});
    assert_frame(&f[0], &expected);
}

static void more_objects_than_fit_are_cut_off_and_said(void **state)
{
    struct sender s;
    struct list l;
    struct can_frame_data expected;
    struct sender_list sent;
    const struct can_frame_data *f = sent.frames;

    (void)state;
    sender_init(&s, 0x400);
    fill(&l, 40);
    sender_list(&s, &l.message, 0, &sent);
    sender_date(&s, &sent, 7 * MS, 0);
    assert_int_equal(sent.n_frames, SENDER_MAX_FRAMES);
    can_pack_list_header(&expected, 0x400,
                         &(struct can_list_header){.number = CAN_MAX_OBJECTS,
                                                   .counter = 5,
                                                   .latency_ms = NAN,
                                                   .cycle_ms = NAN,
                                                   .truncated = true});
    assert_frame(&f[0], &expected);
}

/* Of the one object of the list, only that it is there is known. */
static void assert_nowhere(const struct list *l)
{
    struct sender s;
    struct can_frame_data expected;
    struct sender_list sent;
    const struct can_frame_data *f = sent.frames;
    const struct can_object object = {.id = 1,
                                      .counter = 5,
                                      .position_m = {NAN, NAN, NAN},
                                      .existence = 0.75,
                                      .velocity_m_s = {NAN, NAN},
                                      .sigma_m = {NAN, NAN},
                                      .correlation = NAN,
                                      .length_m = NAN,
                                      .width_m = NAN};

    sender_init(&s, 0x400);
    sender_list(&s, &l->message, 1, &sent);
    assert_int_equal(sent.n_frames, 5);
    can_pack_object_state(&expected, 0x400, &object);
    assert_frame(&f[2], &expected);
    can_pack_object_dynamics(&expected, 0x400, &object);
    assert_frame(&f[3], &expected);
    can_pack_object_quality(&expected, 0x400, &object);
    assert_frame(&f[4], &expected);
}

static void what_a_detection_does_not_say_is_not_available(void **state)
{
    struct list l;

    (void)state;
    fill(&l, 1);
    l.detections[0].position_m = NULL;
    l.detections[0].extent_m = NULL;
    l.detections[0].n_covariance_m2 = 0;
    assert_nowhere(&l);
}

/* Where the wall or the array stands is not known: neither is where the object is. */
static void a_place_outside_of_the_vehicle_frame_is_not_sent(void **state)
{
    struct list l;

    (void)state;
    fill(&l, 1);
    l.message.mirrored = false;
    assert_nowhere(&l);
    fill(&l, 1);
    l.message.in_vehicle_frame = false;
    assert_nowhere(&l);
}

static void assert_status(const struct sender *s, enum can_state state,
                          enum can_source source)
{
    struct can_frame_data f, expected;
    const struct can_status status = {.state = state,
                                      .source = source,
                                      .temperature_c = 20.0,
                                      .sound_speed_m_s = 343.2};

    sender_status(s, &f);
    can_pack_status(&expected, 0x400, &status);
    assert_frame(&f, &expected);
}

static void the_status_follows_scan_and_survey(void **state)
{
    struct sender s;
    Anlos__Survey survey = ANLOS__SURVEY__INIT;
    Anlos__ScanStatus scan = ANLOS__SCAN_STATUS__INIT;

    (void)state;
    survey.source = ANLOS__SOURCE__LIVE;
    survey.temperature_c = 20.0;
    survey.sound_speed_m_s = 343.2;
    sender_init(&s, 0x400);
    sender_survey(&s, &survey);
    assert_status(&s, CAN_INIT, CAN_LIVE);
    scan.state = ANLOS__SCAN_STATUS__STATE__RUNNING;
    scan.pass = ANLOS__PASS__BACKGROUND;
    sender_scan(&s, &scan);
    assert_status(&s, CAN_CALIBRATING, CAN_LIVE);
    scan.pass = ANLOS__PASS__SCENE;
    sender_scan(&s, &scan);
    assert_status(&s, CAN_ACTIVE, CAN_LIVE);
    scan.state = ANLOS__SCAN_STATUS__STATE__DONE;
    scan.pings_lost = 1;
    sender_scan(&s, &scan);
    assert_status(&s, CAN_DEGRADED, CAN_LIVE);
    scan.state = ANLOS__SCAN_STATUS__STATE__FAILED;
    sender_scan(&s, &scan);
    assert_status(&s, CAN_FAULT, CAN_LIVE);
}

static void what_is_not_known_to_be_live_never_looks_live(void **state)
{
    struct sender s;
    Anlos__Survey survey = ANLOS__SURVEY__INIT;

    (void)state;
    sender_init(&s, 0x400);
    assert_int_equal(s.status.source, CAN_SOURCE_UNKNOWN); /* until a survey says it */
    survey.temperature_c = 20.0;
    survey.sound_speed_m_s = 343.2;
    survey.source = (Anlos__Source)9;
    sender_survey(&s, &survey);
    assert_status(&s, CAN_INIT, CAN_SIMULATION);
    survey.source = ANLOS__SOURCE__REPLAY;
    sender_survey(&s, &survey);
    assert_status(&s, CAN_INIT, CAN_REPLAY);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_list_is_header_time_and_three_frames_an_object),
        cmocka_unit_test(an_object_carries_what_the_detection_says),
        cmocka_unit_test(age_and_cycle_are_those_of_when_it_goes_out),
        cmocka_unit_test(more_objects_than_fit_are_cut_off_and_said),
        cmocka_unit_test(what_a_detection_does_not_say_is_not_available),
        cmocka_unit_test(a_place_outside_of_the_vehicle_frame_is_not_sent),
        cmocka_unit_test(the_status_follows_scan_and_survey),
        cmocka_unit_test(what_is_not_known_to_be_live_never_looks_live),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
