/* SPDX-License-Identifier: MIT */
/* The array is one of the test's own: two microphones that hear the number of the
 * speaker, and fail when told to. */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "hal/room/room.h"
#include "msgs/tensor.h"
#include "nodes/array/acquisition.h"

#define N_SAMPLES 3
#define SLOT_NS   INT64_C(31250000) /* of the scene */
#define SPEED_M_S (0.04 / 0.125)    /* four of them from position to position */

struct array {
    struct room *room;
    struct array_shot shot;
    size_t next;
    int fires, halts, fire_result, next_result;
    int64_t late_ns; /* of what is to begin at a time */
    float samples[16][N_SAMPLES];
    uint32_t clipped[16], not_finite[16];
};

const struct survey *array_survey(const struct array *a)
{
    return room_survey(a->room);
}

int array_fire(struct array *a, const struct array_shot *shot)
{
    a->fires++;
    a->shot = *shot;
    a->next = 0;
    return a->fire_result;
}

int array_next(struct array *a, struct array_ping *out, struct error *why)
{
    if (a->next_result)
        return error_say(why, a->next_result, "the cable is out");
    size_t n_rounds = a->shot.n_rounds ? a->shot.n_rounds : 1;
    if (!a->shot.endless && a->next == n_rounds * a->shot.n_speakers)
        return -ENODATA;
    size_t index = a->next % a->shot.n_speakers;
    bool rounds = a->shot.endless || a->shot.n_rounds;
    for (size_t m = 0; m < 16; m++)
        for (size_t i = 0; i < N_SAMPLES; i++)
            a->samples[m][i] = (float)a->shot.speakers[index];
    a->clipped[1] = 5;
    *out = (struct array_ping){
        .shot_index = index,
        .frame = rounds ? (uint32_t)(a->next / a->shot.n_speakers + 1) : 0,
        .down = index == 1,
        .samples = a->samples[0],
        .n_samples = N_SAMPLES,
        .clipped = a->clipped,
        .not_finite = a->not_finite,
        .valid = true,
        .temperature_c = 21.5,
        .t0_ns = 1001 + (int64_t)a->next};
    if (a->shot.n_rounds)
        out->t0_ns = a->shot.start_ns + a->late_ns + SLOT_NS * (int64_t)a->next;
    a->next++;
    return 0;
}

void array_halt(struct array *a)
{
    a->halts++;
}

size_t array_counts(struct array *a, struct device_count out[DEVICE_MAX_COUNTS])
{
    (void)a, (void)out;
    return 0;
}

int array_condition(struct array *a, struct error *why)
{
    (void)a, (void)why;
    return 0;
}

bool array_notice(struct array *a, struct error *out)
{
    (void)a, (void)out;
    return false;
}

void array_close(struct array *a)
{
    (void)a;
}

struct rig {
    struct array array;
    struct acquisition *acquisition;
};

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);

    if (!r || room_load(&r->array.room, SOURCE_DIR "/tests/nodes/point.yaml", NULL) ||
        acquisition_create(&r->acquisition, NULL, &r->array))
        return -1;
    *state = r;
    return 0;
}

static int setup_continuous(void **state)
{
    const struct firing firing = {.stage = FIRING_STAGE_GOES_ON};
    struct rig *r = calloc(1, sizeof *r);

    if (!r ||
        room_load_drawn(&r->array.room, SOURCE_DIR "/tests/nodes/point.yaml", &firing, 0,
                        NULL) ||
        acquisition_create(&r->acquisition, NULL, &r->array))
        return -1;
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    acquisition_destroy(r->acquisition);
    room_destroy(r->array.room);
    free(r);
    return 0;
}

static int fire(struct rig *r, uint32_t id, uint32_t position, uint32_t *speakers,
                size_t n, struct error *why)
{
    Anlos__FireCommand c = ANLOS__FIRE_COMMAND__INIT;

    c.id = id;
    c.scan = 9;
    c.pass = ANLOS__PASS__BACKGROUND;
    c.position = position;
    c.stage_m = 0.12;
    c.speakers = speakers;
    c.n_speakers = n;
    return acquisition_fire(r->acquisition, &c, 77, why);
}

static void a_shot_becomes_a_ping_for_each_speaker(void **state)
{
    struct rig *r = *state;
    uint32_t speakers[] = {3, 1};
    Anlos__Ping ping;
    int64_t t0;

    assert_int_equal(fire(r, 1, 2, speakers, 2, NULL), 0);
    speakers[0] = speakers[1] = 0; /* the command's own memory is gone by then */
    for (uint32_t i = 0; i < 2; i++) {
        size_t extents[2];
        assert_true(acquisition_busy(r->acquisition));
        assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
        assert_int_equal(t0, 1001 + i);
        assert_int_equal(ping.survey_id, acquisition_survey(r->acquisition)->id);
        assert_int_equal(ping.scan, 9);
        assert_int_equal(ping.pass, ANLOS__PASS__BACKGROUND);
        assert_int_equal(ping.position, 2);
        assert_true(ping.stage_m == 0.12);
        assert_int_equal(ping.speaker, i ? 1 : 3);
        assert_true(ping.valid);
        assert_true(ping.temperature_c == 21.5);
        const float *x = tensor_f32(ping.samples, 2, extents);
        assert_non_null(x);
        assert_int_equal(extents[0], 4);
        assert_int_equal(extents[1], N_SAMPLES);
        assert_true(x[5] == (i ? 1.0f : 3.0f));
        assert_int_equal(ping.n_clipped, 4);
        assert_int_equal(ping.clipped[1], 5);
    }
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), -ENODATA);
    assert_false(acquisition_busy(r->acquisition));
}

/* A scan that was restarted counts from 1 again. */
static void the_same_id_of_a_new_process_is_a_new_command(void **state)
{
    struct rig *r = *state;
    uint32_t speaker = 2;
    Anlos__FireCommand c = ANLOS__FIRE_COMMAND__INIT;
    Anlos__Ping ping;
    int64_t t0;

    c.id = 1;
    c.pass = ANLOS__PASS__BACKGROUND;
    c.speakers = &speaker;
    c.n_speakers = 1;
    for (int64_t epoch = 77; epoch <= 78; epoch++)
        for (int sent = 0; sent < 2; sent++)
            assert_int_equal(acquisition_fire(r->acquisition, &c, epoch, NULL), 0);
    for (int i = 0; i < 2; i++)
        assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), -ENODATA);
}

static void shots_wait_for_their_turn(void **state)
{
    struct rig *r = *state;
    uint32_t first[] = {0}, second[] = {2};
    Anlos__Ping ping;
    int64_t t0;

    assert_int_equal(fire(r, 1, 0, first, 1, NULL), 0);
    assert_int_equal(fire(r, 2, 1, second, 1, NULL), 0);
    assert_int_equal(r->array.fires, 0);
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    assert_int_equal(ping.position, 0);
    assert_int_equal(r->array.fires, 1);
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    assert_int_equal(ping.position, 1);
    assert_int_equal(ping.speaker, 2);
}

static void what_was_queued_while_the_stage_is_displaced_is_not_valid(void **state)
{
    struct rig *r = *state;
    uint32_t speakers[] = {0, 1}, later[] = {2};
    Anlos__Ping ping;
    int64_t t0;

    assert_int_equal(fire(r, 1, 0, speakers, 2, NULL), 0);
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    assert_true(ping.valid);
    acquisition_displaced(r->acquisition, true);
    acquisition_displaced(r->acquisition,
                          false); /* back again: the shot stays doubtful */
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    assert_false(ping.valid);
    assert_int_equal(fire(r, 2, 1, later, 1, NULL), 0);
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    assert_true(ping.valid);
    acquisition_displaced(r->acquisition, true);
    assert_int_equal(fire(r, 3, 1, later, 1, NULL), 0);
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    assert_false(ping.valid);
}

#define START_NS INT64_C(1795393947000000000)

static void fire_rounds(struct rig *r, uint32_t id, uint32_t position, uint32_t n_rounds,
                        int64_t start_ns)
{
    uint32_t speakers[] = {0, 1, 2, 3};
    Anlos__FireCommand c = ANLOS__FIRE_COMMAND__INIT;

    c.id = id;
    c.pass = ANLOS__PASS__SCENE;
    c.position = position;
    c.n_rounds = n_rounds;
    c.start_ns = start_ns;
    c.stage_m = 0.04 * position;
    c.speed_m_s = SPEED_M_S;
    c.speakers = speakers;
    c.n_speakers = 4;
    assert_int_equal(acquisition_fire(r->acquisition, &c, 77, NULL), 0);
}

/* Reports every 50 ms of a stage that is so much beside the plan. */
static void report(struct rig *r, int64_t from_ns, int64_t to_ns, double position_m,
                   double off_m)
{
    for (int64_t t = from_ns; t <= to_ns; t += 50000000)
        acquisition_stage(r->acquisition,
                          position_m + off_m + SPEED_M_S * 1e-9 * (double)(t - START_NS),
                          t);
}

static void pings_on_the_way_are_placed_by_the_stages_reports(void **state)
{
    struct rig *r = *state;
    Anlos__Ping ping;
    int64_t t0;

    report(r, START_NS - 100000000, START_NS + 600000000, 0.08, 2e-4);
    fire_rounds(r, 1, 2, 3, START_NS);
    for (uint32_t k = 0; k < 12; k++) {
        assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
        double planned_m = 0.08 + SPEED_M_S * 0.03125 * k;
        assert_int_equal(t0, START_NS + SLOT_NS * k);
        assert_int_equal(ping.position, 2 + k / 4);
        assert_int_equal(ping.speaker, k % 4);
        assert_int_equal(ping.frame, 0);
        assert_true(fabs(ping.stage_m - planned_m - 2e-4) < 1e-7);
        assert_true(ping.valid);
    }
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), -ENODATA);
}

/* 5 ms late are 1.6 mm. */
static void a_ping_beside_its_place_is_not_valid(void **state)
{
    struct rig *r = *state;
    Anlos__Ping ping;
    int64_t t0;

    report(r, START_NS - 100000000, START_NS + 600000000, 0, 0);
    r->array.late_ns = 5000000;
    fire_rounds(r, 1, 0, 1, START_NS);
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    assert_true(fabs(ping.stage_m - 0.0016) < 1e-7);
    assert_false(ping.valid);
    r->array.late_ns = 2000000;
    fire_rounds(r, 2, 0, 1, START_NS); /* in its place */
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    assert_true(ping.valid && ping.position == 0);
    assert_int_equal(r->array.halts, 1);
}

/* The scan knew where it would begin; 0.3 s later nobody does. */
static void without_reports_only_the_first_pings_have_a_place(void **state)
{
    struct rig *r = *state;
    Anlos__Ping ping;
    int64_t t0;

    fire_rounds(r, 1, 0, 3, START_NS);
    for (uint32_t k = 0; k < 12; k++) {
        assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
        assert_int_equal(ping.valid, SLOT_NS * k < 300000000);
    }
}

/* Reports of the way there, and of braking, do not count. */
static void other_ways_of_the_stage_do_not_count(void **state)
{
    struct rig *r = *state;
    Anlos__Ping ping;
    int64_t t0;

    acquisition_stage(r->acquisition, 0.3, START_NS - 600000000);
    acquisition_stage(r->acquisition, 0.2, START_NS - 500000000);
    acquisition_stage(r->acquisition, 0.1, START_NS - 400000000);
    report(r, START_NS - 100000000, START_NS + 120000000, 0, 0);
    acquisition_stage(r->acquisition, 0.05, START_NS + 200000000);
    acquisition_stage(r->acquisition, 0.05, START_NS + 300000000);
    fire_rounds(r, 1, 0, 1, START_NS);
    for (uint32_t k = 0; k < 4; k++) {
        assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
        assert_true(ping.valid);
        assert_true(fabs(ping.stage_m - SPEED_M_S * 0.03125 * k) < 1e-7);
    }
}

/* A recording that is played was moved when it was made. */
static void without_a_time_pings_are_where_the_survey_has_them(void **state)
{
    struct rig *r = *state;
    Anlos__Ping ping;
    int64_t t0;

    fire_rounds(r, 1, 1, 2, 0);
    for (uint32_t k = 0; k < 8; k++) {
        assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
        assert_true(ping.valid);
        assert_true(fabs(ping.stage_m - 0.04 - 0.01 * k) < 1e-9);
    }
}

static void rounds_that_the_survey_does_not_have_are_refused(void **state)
{
    struct rig *r = *state;
    uint32_t speakers[] = {0, 1, 2, 3};
    Anlos__FireCommand c = ANLOS__FIRE_COMMAND__INIT;
    struct error why = {""};

    c.id = 1;
    c.pass = ANLOS__PASS__SCENE;
    c.position = 4;
    c.n_rounds = 3;
    c.speakers = speakers;
    c.n_speakers = 4;
    assert_int_equal(acquisition_fire(r->acquisition, &c, 77, &why), -EINVAL);
    assert_string_equal(why.text, "fire 1: 3 rounds from position 4 on of 6; expected a "
                                  "survey that is continuous, and has them");
}

static void rounds_of_no_place_speed_or_time_are_refused(void **state)
{
    static const struct {
        double stage_m, speed_m_s;
        int64_t start_ns;
    } cases[] = {
        {NAN, SPEED_M_S, START_NS}, {1e9, SPEED_M_S, START_NS}, {0, NAN, START_NS},
        {0, -INFINITY, START_NS},   {0, SPEED_M_S, INT64_MIN},  {0, SPEED_M_S, INT64_MAX},
    };
    struct rig *r = *state;
    uint32_t speakers[] = {0, 1, 2, 3};

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        Anlos__FireCommand c = ANLOS__FIRE_COMMAND__INIT;
        struct error why = {""};
        c.id = 1;
        c.pass = ANLOS__PASS__SCENE;
        c.n_rounds = 2;
        c.stage_m = cases[i].stage_m;
        c.speed_m_s = cases[i].speed_m_s;
        c.start_ns = cases[i].start_ns;
        c.speakers = speakers;
        c.n_speakers = 4;
        assert_int_equal(acquisition_fire(r->acquisition, &c, 77, &why), -EINVAL);
        assert_non_null(strstr(why.text, "fire 1: rounds from "));
    }
}

static void a_command_sent_again_is_not_fired_again(void **state)
{
    struct rig *r = *state;
    uint32_t speakers[] = {0};
    Anlos__Ping ping;
    int64_t t0;

    assert_int_equal(fire(r, 1, 0, speakers, 1, NULL), 0);
    assert_int_equal(fire(r, 1, 0, speakers, 1, NULL), 0);
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    assert_int_equal(fire(r, 1, 0, speakers, 1, NULL), 0);
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), -ENODATA);
    assert_int_equal(r->array.fires, 1);
}

static void commands_that_do_not_fit_the_survey_are_refused(void **state)
{
    struct rig *r = *state;
    uint32_t good[] = {0}, bad[] = {4}, many[] = {0, 1, 2, 3, 0};
    struct error why = {""};

    assert_int_equal(fire(r, 1, 6, good, 1, &why), -EINVAL);
    assert_string_equal(why.text, "fire 1: position 6 of 6");
    assert_int_equal(fire(r, 2, 0, bad, 1, &why), -EINVAL);
    assert_string_equal(why.text, "fire 2: speaker 4 of 4");
    assert_int_equal(fire(r, 3, 0, many, 5, &why), -EINVAL);
    assert_int_equal(fire(r, 4, 0, good, 0, &why), -EINVAL);
    assert_false(acquisition_busy(r->acquisition));
}

static void pings_name_the_survey_that_was_taken_last(void **state)
{
    struct rig *r = *state;
    uint32_t speakers[] = {0, 1};
    uint64_t was = acquisition_survey(r->acquisition)->id;
    struct survey warm = *room_survey(r->array.room), wrong = warm; /* borrow */
    Anlos__Ping ping;
    int64_t t0;

    warm.sound_speed_m_s *= 1.01;
    wrong.sound_speed_m_s = 0.0;
    assert_int_equal(fire(r, 1, 0, speakers, 2, NULL), 0);
    assert_false(acquisition_is_endless(r->acquisition));
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    assert_true(ping.survey_id == was);
    assert_int_equal(acquisition_take_survey(r->acquisition, &warm), 0);
    assert_true(acquisition_survey(r->acquisition)->id == survey_id(&warm));
    assert_int_equal(acquisition_take_survey(r->acquisition, &wrong), -EINVAL);
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    assert_true(ping.survey_id == survey_id(&warm) && ping.survey_id != was);
}

static void too_many_shots_are_refused_not_forgotten(void **state)
{
    struct rig *r = *state;
    uint32_t speakers[] = {0};
    struct error why = {""};
    int err = 0;
    uint32_t id = 0;

    while (!err && id < 100)
        err = fire(r, ++id, 0, speakers, 1, &why);
    assert_int_equal(err, -ENOBUFS);
    assert_non_null(strstr(why.text, "shots are waiting already"));
}

static void an_array_that_fails_loses_the_rest_of_the_shot_only(void **state)
{
    struct rig *r = *state;
    uint32_t speakers[] = {0, 1};
    struct error why = {""};
    Anlos__Ping ping;
    int64_t t0;

    fire(r, 1, 0, speakers, 2, NULL);
    fire(r, 2, 1, speakers, 2, NULL);
    r->array.next_result = -EIO;
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, &why), -EIO);
    assert_string_equal(why.text, "the cable is out");
    r->array.next_result = 0;
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    assert_int_equal(ping.position, 1);
}

static void a_signal_costs_nothing(void **state)
{
    struct rig *r = *state;
    uint32_t speakers[] = {0};
    Anlos__Ping ping;
    int64_t t0;

    fire(r, 1, 0, speakers, 1, NULL);
    r->array.next_result = -EINTR;
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), -EINTR);
    r->array.next_result = 0;
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    assert_int_equal(r->array.fires, 1);
}

static void a_position_that_cannot_be_fired_is_named(void **state)
{
    struct rig *r = *state;
    uint32_t speakers[] = {0};
    struct error why = {""};
    Anlos__Ping ping;
    int64_t t0;

    fire(r, 1, 4, speakers, 1, NULL);
    r->array.fire_result = -EINVAL;
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, &why), -EINVAL);
    assert_string_equal(why.text, "position 4 cannot be fired: Invalid argument");
    assert_false(acquisition_busy(r->acquisition));
}

static int setup_fixed(void **state)
{
    struct rig *r = calloc(1, sizeof *r);

    if (!r ||
        room_load(&r->array.room, SOURCE_DIR "/launch/scenes/full-array.yaml", NULL) ||
        acquisition_create(&r->acquisition, NULL, &r->array))
        return -1;
    *state = r;
    return 0;
}

static void fire_endless(struct rig *r, uint32_t id, uint32_t *speakers, size_t n)
{
    Anlos__FireCommand c = ANLOS__FIRE_COMMAND__INIT;
    struct error why;

    c.id = id;
    c.scan = 9;
    c.speakers = speakers;
    c.n_speakers = n;
    c.endless = true;
    assert_int_equal(acquisition_fire(r->acquisition, &c, 77, &why), 0);
}

static void a_shot_without_end_goes_on_in_frames_until_another_is_queued(void **state)
{
    struct rig *r = *state;
    uint32_t speakers[] = {3, 1, 7}, others[] = {2};
    Anlos__Ping ping;
    int64_t t0;

    fire_endless(r, 1, speakers, 3);
    for (unsigned i = 0; i < 100; i++) {
        fire_endless(r, 1, speakers, 3); /* sent again: nothing new */
        assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
        assert_int_equal(ping.speaker, speakers[i % 3]);
        assert_int_equal(ping.frame, i / 3 + 1);
        assert_int_equal(ping.down, i % 3 == 1);
    }
    assert_int_equal(r->array.fires, 1);
    assert_int_equal(r->array.halts, 0);
    fire_endless(r, 2, others, 1);
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    assert_int_equal(r->array.halts, 1);
    assert_int_equal(ping.speaker, 2);
    assert_int_equal(ping.frame, 1);
    assert_true(acquisition_busy(r->acquisition));
}

static void a_shot_without_end_is_stopped_by_one_without_speakers(void **state)
{
    struct rig *r = *state;
    uint32_t speakers[] = {3, 1};
    Anlos__Ping ping;
    int64_t t0;

    fire_endless(r, 1, speakers, 2);
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    fire_endless(r, 2, NULL, 0);
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), -ENODATA);
    assert_int_equal(r->array.halts, 1);
    assert_false(acquisition_busy(r->acquisition));
}

static void a_recording_that_ends_by_itself_is_told(void **state)
{
    struct rig *r = *state;
    uint32_t speakers[] = {3, 1};
    Anlos__Ping ping;
    int64_t t0;

    fire_endless(r, 1, speakers, 2);
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    assert_false(acquisition_has_ended(r->acquisition));
    r->array.next_result = -ENODATA;
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), -ENODATA);
    assert_true(acquisition_has_ended(r->acquisition));
    r->array.next_result = 0;
    fire_endless(r, 2, speakers, 2);
    assert_false(acquisition_has_ended(r->acquisition));
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    fire_endless(r, 3, NULL, 0); /* stopped: nothing has ended */
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), -ENODATA);
    assert_false(acquisition_has_ended(r->acquisition));
}

/* Of a knocked microphone; what is said of the survey before comes too late, and a place
 * that cannot be leaves the survey as it is. */
static void places_are_those_of_the_next_survey(void **state)
{
    struct rig *r = *state;
    uint32_t speakers[] = {3, 1};
    Anlos__MovedElement moved = ANLOS__MOVED_ELEMENT__INIT, *list[] = {&moved};
    Anlos__ElementPlaces said = ANLOS__ELEMENT_PLACES__INIT;
    uint64_t id = acquisition_survey(r->acquisition)->id;
    double was_m = acquisition_survey(r->acquisition)->microphones_m[2]->x;
    struct error why = {""};
    Anlos__Ping ping;
    int64_t t0;

    said.survey_id = id;
    said.moved = list;
    said.n_moved = 1;
    moved.element = 3;
    moved.x_m = 0.02;
    assert_int_equal(acquisition_places(r->acquisition, &said, &why), -ESTALE);
    fire_endless(r, 1, speakers, 2);
    assert_int_equal(acquisition_places(r->acquisition, &said, &why), 0);
    const Anlos__Survey *now = acquisition_survey(r->acquisition);
    assert_true(fabs(now->microphones_m[2]->x - was_m - 0.02) < 1e-12);
    assert_int_not_equal(now->id, id);
    assert_int_equal(acquisition_next(r->acquisition, &ping, &t0, NULL), 0);
    assert_int_equal(ping.survey_id, now->id);
    assert_int_equal(acquisition_places(r->acquisition, &said, &why), -ESTALE);
    said.survey_id = id = now->id;
    moved.x_m = 0.2;
    assert_int_equal(acquisition_places(r->acquisition, &said, &why), -EINVAL);
    assert_non_null(strstr(why.text, "microphone 3"));
    assert_int_equal(acquisition_survey(r->acquisition)->id, id);
}

static void an_array_on_a_stage_does_not_go_on_without_end(void **state)
{
    struct rig *r = *state;
    Anlos__FireCommand c = ANLOS__FIRE_COMMAND__INIT;
    uint32_t speaker = 0;
    struct error why;

    c.id = 1;
    c.endless = true;
    c.speakers = &speaker;
    c.n_speakers = 1;
    assert_int_equal(acquisition_fire(r->acquisition, &c, 77, &why), -EINVAL);
    assert_non_null(strstr(why.text, "stage positions"));
}

#define TEST(f)  cmocka_unit_test_setup_teardown(f, setup, teardown)
#define FIXED(f) cmocka_unit_test_setup_teardown(f, setup_fixed, teardown)

#define MOVING(name) cmocka_unit_test_setup_teardown(name, setup_continuous, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_shot_becomes_a_ping_for_each_speaker),
        TEST(the_same_id_of_a_new_process_is_a_new_command),
        TEST(shots_wait_for_their_turn),
        TEST(what_was_queued_while_the_stage_is_displaced_is_not_valid),
        TEST(a_command_sent_again_is_not_fired_again),
        TEST(commands_that_do_not_fit_the_survey_are_refused),
        TEST(pings_name_the_survey_that_was_taken_last),
        TEST(too_many_shots_are_refused_not_forgotten),
        TEST(an_array_that_fails_loses_the_rest_of_the_shot_only),
        TEST(a_signal_costs_nothing),
        TEST(a_position_that_cannot_be_fired_is_named),
        MOVING(pings_on_the_way_are_placed_by_the_stages_reports),
        MOVING(a_ping_beside_its_place_is_not_valid),
        MOVING(without_reports_only_the_first_pings_have_a_place),
        MOVING(other_ways_of_the_stage_do_not_count),
        MOVING(without_a_time_pings_are_where_the_survey_has_them),
        MOVING(rounds_that_the_survey_does_not_have_are_refused),
        MOVING(rounds_of_no_place_speed_or_time_are_refused),
        FIXED(a_shot_without_end_goes_on_in_frames_until_another_is_queued),
        FIXED(a_recording_that_ends_by_itself_is_told),
        FIXED(a_shot_without_end_is_stopped_by_one_without_speakers),
        FIXED(places_are_those_of_the_next_survey),
        TEST(an_array_on_a_stage_does_not_go_on_without_end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
