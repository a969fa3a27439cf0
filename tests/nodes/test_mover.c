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
    int moves, result;
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

void stage_status(struct stage *s, struct stage_status *out)
{
    *out = s->status;
}

static void command(struct mover *m, uint32_t id, double target_m)
{
    Anlos__StageCommand c = ANLOS__STAGE_COMMAND__INIT;

    c.id = id;
    c.target_m = target_m;
    mover_command(m, &c);
}

static void a_command_moves_the_stage_and_is_named_in_the_state(void **state)
{
    struct stage stage = {.status = {.position_m = 0.1}};
    struct mover m;
    Anlos__StageState s;

    (void)state;
    mover_init(&m, &stage);
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
    mover_init(&m, &stage);
    command(&m, 1, 0.5);
    command(&m, 1, 0.5);
    assert_int_equal(stage.moves, 1);
    command(&m, 2, 0.5);
    assert_int_equal(stage.moves, 2);
    command(&m, 2, 0.6); /* of a scan that counts anew */
    assert_int_equal(stage.moves, 3);
}

static void states_repeat_faster_in_motion_than_at_rest(void **state)
{
    struct stage stage = {.moves = 0};
    struct mover m;
    Anlos__StageState s;
    int n = 0;

    (void)state;
    mover_init(&m, &stage);
    for (int64_t t = 0; t < 2000 * MS; t += 5 * MS)
        n += mover_state(&m, t, &s);
    assert_int_equal(n, 4);
    stage.status.motion = STAGE_MOVING;
    n = 0;
    for (int64_t t = 2000 * MS; t < 3000 * MS; t += 5 * MS)
        n += mover_state(&m, t, &s);
    assert_int_equal(n, 20);
}

static void a_target_out_of_reach_shows_as_a_fault_until_the_next_command(void **state)
{
    struct stage stage = {.result = -ERANGE};
    struct mover m;
    Anlos__StageState s;

    (void)state;
    mover_init(&m, &stage);
    command(&m, 3, 9.0);
    assert_true(mover_state(&m, 0, &s));
    assert_int_equal(s.state, ANLOS__STAGE_STATE__STATE__FAULT);
    assert_int_equal(s.command_id, 3);
    assert_true(s.target_m == 9.0);
    assert_non_null(strstr(s.text, "cannot move to 9.0000 m: it does not reach"));
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
    mover_init(&m, &stage);
    assert_true(mover_state(&m, 0, &s));
    assert_int_equal(s.state, ANLOS__STAGE_STATE__STATE__FAULT);
    assert_string_equal(s.text, "motor stalled");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_command_moves_the_stage_and_is_named_in_the_state),
        cmocka_unit_test(a_command_seen_before_is_ignored),
        cmocka_unit_test(states_repeat_faster_in_motion_than_at_rest),
        cmocka_unit_test(a_target_out_of_reach_shows_as_a_fault_until_the_next_command),
        cmocka_unit_test(a_fault_of_the_hardware_is_passed_on_with_its_text),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
