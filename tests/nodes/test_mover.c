/* SPDX-License-Identifier: MIT */
/* The stage is one of the test's own. */
#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/stage/mover.h"

#define MS 1000000LL

struct stage {
    struct stage_status status;
    int moves, homes, stops, result;
    double speed_m_s;
};

int stage_move(struct stage *s, double target_m)
{
    s->moves++;
    if (!s->result) {
        s->status.motion = STAGE_MOVING;
        s->status.target_m = target_m;
    }
    return s->result;
}

int stage_move_at(struct stage *s, double target_m, double speed_m_s)
{
    s->speed_m_s = speed_m_s;
    return stage_move(s, target_m);
}

int stage_home(struct stage *s)
{
    s->homes++;
    s->status.motion = STAGE_MOVING;
    s->status.homed = false;
    s->status.text[0] = '\0';
    return 0;
}

int stage_stop(struct stage *s)
{
    s->stops++;
    if (s->status.motion == STAGE_MOVING)
        s->status.motion = STAGE_IDLE;
    return 0;
}

void stage_status(struct stage *s, struct stage_status *out)
{
    *out = s->status;
}

size_t stage_counts(struct stage *s, struct device_count out[DEVICE_MAX_COUNTS])
{
    (void)s, (void)out;
    return 0;
}

void stage_close(struct stage *s)
{
    (void)s;
}

static void command(struct mover *m, uint32_t id, double target_m)
{
    Anlos__StageCommand c = ANLOS__STAGE_COMMAND__INIT;

    c.id = id;
    c.target_m = target_m;
    mover_command(m, &c);
}

static void by_hand(struct mover *m, uint64_t id, Anlos__StageManual__Verb verb,
                    double target_m)
{
    Anlos__StageManual c = ANLOS__STAGE_MANUAL__INIT;

    c.id = id;
    c.verb = verb;
    c.target_m = target_m;
    mover_manual(m, &c);
}

static void a_command_moves_the_stage_and_is_named_in_the_state(void **state)
{
    struct stage stage = {.status = {.position_m = 0.1}};
    struct mover m;
    Anlos__StageState s;

    (void)state;
    mover_init(&m, NULL, &stage);
    assert_true(mover_state(&m, 0, &s));
    assert_int_equal(s.state, ANLOS__STAGE_STATE__STATE__IDLE);
    command(&m, 7, 0.5);
    assert_int_equal(stage.moves, 1);
    assert_true(mover_state(&m, 1, &s)); /* at once */
    assert_int_equal(s.state, ANLOS__STAGE_STATE__STATE__MOVING);
    assert_int_equal(s.command_id, 7);
    assert_true(s.target_m == 0.5 && s.position_m == 0.1);
    stage.status.motion = STAGE_IDLE;
    stage.status.position_m = 0.4999;
    assert_true(mover_state(&m, 2, &s));
    assert_int_equal(s.state, ANLOS__STAGE_STATE__STATE__IDLE);
    assert_true(s.position_m == 0.4999);
}

static void a_command_seen_before_is_ignored(void **state)
{
    struct stage stage = {.moves = 0};
    struct mover m;

    (void)state;
    mover_init(&m, NULL, &stage);
    command(&m, 1, 0.5);
    command(&m, 1, 0.5);
    assert_int_equal(stage.moves, 1);
    command(&m, 2, 0.5);
    assert_int_equal(stage.moves, 2);
    command(&m, 2, 0.6); /* of a scan that counts anew */
    assert_int_equal(stage.moves, 3);
}

static void a_move_goes_at_the_speed_that_it_is_told(void **state)
{
    struct stage stage = {.status = {.position_m = 0.1, .at_ns = 77}};
    struct mover m;
    Anlos__StageState s;
    Anlos__StageCommand c = ANLOS__STAGE_COMMAND__INIT;

    (void)state;
    mover_init(&m, NULL, &stage);
    c.id = 1;
    c.target_m = 1.1;
    c.speed_m_s = 0.0593;
    mover_command(&m, &c);
    assert_true(stage.moves == 1 && stage.speed_m_s == 0.0593);
    assert_true(mover_state(&m, 100, &s));
    assert_true(m.at_ns == 77);
    stage.result = -EDOM;
    c.id = 2;
    mover_command(&m, &c);
    assert_true(mover_state(&m, 200, &s));
    assert_int_equal(s.state, ANLOS__STAGE_STATE__STATE__REFUSED);
    assert_string_equal(s.text, "cannot move at 0.0593 m/s to 1.1000 m: it does not go "
                                "at that speed");
}

static void states_repeat_faster_in_motion_than_at_rest(void **state)
{
    struct stage stage = {.moves = 0};
    struct mover m;
    Anlos__StageState s;
    int n = 0;

    (void)state;
    mover_init(&m, NULL, &stage);
    for (int64_t t = 0; t < 2000 * MS; t += 5 * MS)
        n += mover_state(&m, t, &s);
    assert_int_equal(n, 4);
    stage.status.motion = STAGE_MOVING;
    n = 0;
    for (int64_t t = 2000 * MS; t < 3000 * MS; t += 5 * MS)
        n += mover_state(&m, t, &s);
    assert_int_equal(n, 20);
}

static void a_target_out_of_reach_is_refused_until_the_next_command(void **state)
{
    struct stage stage = {.result = -ERANGE, .status.reach_m = {-0.05, 2.0}};
    struct mover m;
    Anlos__StageState s;

    (void)state;
    mover_init(&m, NULL, &stage);
    command(&m, 3, 9.0);
    assert_true(mover_state(&m, 0, &s));
    assert_int_equal(s.state, ANLOS__STAGE_STATE__STATE__REFUSED);
    assert_int_equal(s.command_id, 3);
    assert_true(s.target_m == 9.0);
    assert_non_null(strstr(s.text, "cannot move to 9.0000 m: it does not reach that "
                                   "far: it goes from -0.05 to 2 m"));
    stage.result = 0;
    command(&m, 4, 0.2);
    assert_true(mover_state(&m, 1, &s));
    assert_int_equal(s.state, ANLOS__STAGE_STATE__STATE__MOVING);
    assert_string_equal(s.text, "");
}

static void a_fault_of_the_hardware_is_passed_on_with_its_text(void **state)
{
    struct stage stage = {.status = {.motion = STAGE_FAULT, .text = "motor stalled"}};
    struct mover m;
    Anlos__StageState s;

    (void)state;
    mover_init(&m, NULL, &stage);
    assert_true(mover_state(&m, 0, &s));
    assert_int_equal(s.state, ANLOS__STAGE_STATE__STATE__FAULT);
    assert_string_equal(s.text, "motor stalled");
}

/* A lost place is the stage's fault, not the target's. */
static void a_move_without_a_place_shows_the_stages_own_fault(void **state)
{
    struct stage stage = {
        .result = -ESTALE,
        .status = {.motion = STAGE_FAULT, .text = "the far limit switch was hit"}};
    struct mover m;
    Anlos__StageState s;

    (void)state;
    mover_init(&m, NULL, &stage);
    command(&m, 3, 0.1);
    assert_true(mover_state(&m, 0, &s));
    assert_int_equal(s.state, ANLOS__STAGE_STATE__STATE__FAULT);
    assert_string_equal(s.text, "the far limit switch was hit");
}

static void stopped_by_hand_it_is_held_until_it_is_released(void **state)
{
    struct stage stage = {.status = {.homed = true}};
    struct mover m;
    Anlos__StageState s;

    (void)state;
    mover_init(&m, NULL, &stage);
    command(&m, 1, 0.5);
    assert_true(mover_state(&m, 0, &s));
    by_hand(&m, 77, ANLOS__STAGE_MANUAL__VERB__STOP, 0);
    assert_int_equal(stage.stops, 1);
    assert_true(mover_state(&m, 1, &s));
    assert_true(s.held);
    assert_true(s.manual_id == 77);
    assert_string_equal(s.text, "held by hand");
    /* Its command of before is forgotten, or the scan would take it for done. */
    assert_int_equal(s.command_id, 0);
    command(&m, 2, 0.6);
    assert_int_equal(stage.moves, 1);
    by_hand(&m, 78, ANLOS__STAGE_MANUAL__VERB__RELEASE, 0);
    assert_true(mover_state(&m, 2, &s));
    assert_false(s.held);
    command(&m, 2, 0.6);
    assert_int_equal(stage.moves, 2);
}

static void a_move_by_hand_holds_it_and_the_same_one_is_made_once(void **state)
{
    struct stage stage = {.status = {.homed = true}};
    struct mover m;
    Anlos__StageState s;

    (void)state;
    mover_init(&m, NULL, &stage);
    by_hand(&m, 5, ANLOS__STAGE_MANUAL__VERB__MOVE, 0.3);
    by_hand(&m, 5, ANLOS__STAGE_MANUAL__VERB__MOVE, 0.3);
    assert_int_equal(stage.moves, 1);
    assert_true(mover_state(&m, 0, &s));
    assert_true(s.held);
    assert_true(s.target_m == 0.3);
}

static void a_move_by_hand_that_comes_again_after_a_stop_stays_stopped(void **state)
{
    struct stage stage = {.status = {.homed = true}};
    struct mover m;

    (void)state;
    mover_init(&m, NULL, &stage);
    by_hand(&m, 5, ANLOS__STAGE_MANUAL__VERB__MOVE, 0.3);
    by_hand(&m, 6, ANLOS__STAGE_MANUAL__VERB__STOP, 0);
    by_hand(&m, 5, ANLOS__STAGE_MANUAL__VERB__MOVE, 0.3);
    assert_int_equal(stage.moves, 1);
    assert_int_equal(stage.stops, 1);
}

static void a_move_by_hand_that_is_refused_says_why_and_holds_nothing(void **state)
{
    static const struct {
        int err;
        const char *part;
    } cases[] = {{-ERANGE, "does not reach that far"}, {-ESTALE, "home it first"}};

    (void)state;
    for (size_t i = 0; i < 2; i++) {
        struct stage stage = {.result = cases[i].err};
        struct mover m;
        Anlos__StageState s;
        mover_init(&m, NULL, &stage);
        by_hand(&m, 5, ANLOS__STAGE_MANUAL__VERB__MOVE, 9);
        assert_true(mover_state(&m, 0, &s));
        assert_false(s.held);
        assert_non_null(strstr(s.manual_refusal, cases[i].part));
    }
}

/* It takes no command while it looks for its place: the newest one would count. */
static void homing_by_hand_ends_a_fault_and_releases_it_when_done(void **state)
{
    struct stage stage = {.status = {.motion = STAGE_FAULT, .text = "emergency stop"}};
    struct mover m;
    Anlos__StageState s;

    (void)state;
    mover_init(&m, NULL, &stage);
    by_hand(&m, 4, ANLOS__STAGE_MANUAL__VERB__RELEASE, 0);
    assert_true(mover_state(&m, 0, &s));
    assert_non_null(strstr(s.manual_refusal, "home it"));
    by_hand(&m, 5, ANLOS__STAGE_MANUAL__VERB__HOME, 0);
    assert_int_equal(stage.homes, 1);
    assert_true(mover_state(&m, 1, &s));
    assert_int_equal(s.state, ANLOS__STAGE_STATE__STATE__MOVING);
    assert_true(s.held);
    assert_string_equal(s.manual_refusal, "");
    command(&m, 2, 0.6);
    assert_int_equal(stage.moves, 0);
    stage.status.motion = STAGE_IDLE;
    stage.status.homed = true;
    assert_true(mover_state(&m, 2, &s));
    assert_false(s.held);
    assert_true(s.homed);
    command(&m, 2, 0.6);
    assert_int_equal(stage.moves, 1);
}

static void a_note_is_told_once_and_again_when_it_changes(void **state)
{
    struct stage stage = {.status = {.note = "it is hot"}};
    struct mover m;
    Anlos__StageState s;

    (void)state;
    mover_init(&m, NULL, &stage);
    assert_null(mover_note(&m));
    mover_state(&m, 0, &s);
    assert_string_equal(mover_note(&m), "it is hot");
    mover_state(&m, 1, &s);
    assert_null(mover_note(&m));
    stage.status.note[0] = '\0';
    mover_state(&m, 2, &s);
    assert_null(mover_note(&m));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_command_moves_the_stage_and_is_named_in_the_state),
        cmocka_unit_test(a_command_seen_before_is_ignored),
        cmocka_unit_test(a_move_goes_at_the_speed_that_it_is_told),
        cmocka_unit_test(states_repeat_faster_in_motion_than_at_rest),
        cmocka_unit_test(a_target_out_of_reach_is_refused_until_the_next_command),
        cmocka_unit_test(a_fault_of_the_hardware_is_passed_on_with_its_text),
        cmocka_unit_test(a_move_without_a_place_shows_the_stages_own_fault),
        cmocka_unit_test(stopped_by_hand_it_is_held_until_it_is_released),
        cmocka_unit_test(a_move_by_hand_holds_it_and_the_same_one_is_made_once),
        cmocka_unit_test(a_move_by_hand_that_comes_again_after_a_stop_stays_stopped),
        cmocka_unit_test(a_move_by_hand_that_is_refused_says_why_and_holds_nothing),
        cmocka_unit_test(homing_by_hand_ends_a_fault_and_releases_it_when_done),
        cmocka_unit_test(a_note_is_told_once_and_again_when_it_changes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
