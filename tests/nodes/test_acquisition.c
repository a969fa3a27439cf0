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

struct array {
    struct room *room;
    struct array_shot shot;
    size_t next;
    int fires, halts, fire_result, next_result;
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
    if (!a->shot.endless && a->next == a->shot.n_speakers)
        return -ENODATA;
    size_t index = a->next % a->shot.n_speakers;
    for (size_t m = 0; m < 16; m++)
        for (size_t i = 0; i < N_SAMPLES; i++)
            a->samples[m][i] = (float)a->shot.speakers[index];
    a->clipped[1] = 5;
    *out = (struct array_ping){
        .shot_index = index,
        .frame = a->shot.endless ? (uint32_t)(a->next / a->shot.n_speakers + 1) : 0,
        .down = index == 1,
        .samples = a->samples[0],
        .n_samples = N_SAMPLES,
        .clipped = a->clipped,
        .not_finite = a->not_finite,
        .valid = true,
        .temperature_c = 21.5,
        .t0_ns = 1001 + (int64_t)a->next};
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
        FIXED(a_shot_without_end_goes_on_in_frames_until_another_is_queued),
        FIXED(a_recording_that_ends_by_itself_is_told),
        FIXED(a_shot_without_end_is_stopped_by_one_without_speakers),
        TEST(an_array_on_a_stage_does_not_go_on_without_end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
