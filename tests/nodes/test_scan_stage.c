/* SPDX-License-Identifier: MIT */
/* A scan whose stage does not do as it is told. */
#include "tests/nodes/scan_world.h"

static void a_stage_command_that_got_lost_is_sent_again(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 8);
    start(&w);
    w.stage_deaf = true;
    step(&w);
    w.now_ns += 400 * MS;
    step(&w);
    assert_int_equal(w.moves, 1);
    w.now_ns += 200 * MS;
    w.stage_deaf = false;
    step(&w);
    assert_int_equal(w.moves, 2);
    run(&w, 10000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    scan_destroy(w.scan);
}

static void a_target_out_of_the_stages_reach_fails_the_scan(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 2, 8);
    start(&w);
    w.stage_short = true;
    run(&w, 60000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__FAILED);
    assert_string_equal(status(&w).text, "stage: a limit switch is open");
    assert_int_equal(w.moves, 1);
    assert_int_equal(w.commands, 0);
    scan_destroy(w.scan);
}

/* Hours if need be: nothing times out, nothing is fired, nothing counts as failed. */
static void a_stage_in_fault_pauses_the_scan_until_it_is_homed(void **state)
{
    struct world w;

    (void)state;
    setup(&w, true, 1, 8);
    start(&w);
    run(&w, 100);
    unsigned moves = w.moves, commands = w.commands;
    double left_s = status(&w).time_left_s;
    w.stage_fault = true;
    w.position_m = 0.05; /* somewhere */
    tell_stage(&w);
    run(&w, 3600000);
    Anlos__ScanStatus s = status(&w);
    assert_int_equal(s.state, ANLOS__SCAN_STATUS__STATE__PAUSED);
    assert_false(s.held);
    assert_string_equal(s.text,
                        "stage: a limit switch is open; 'anlos stage home' goes on");
    assert_int_equal(w.moves, moves);
    assert_int_equal(w.commands, commands);
    w.stage_fault = false;
    w.command_id = 0; /* it was homed by hand, and knows no command */
    w.position_m = w.target_m = 0;
    tell_stage(&w);
    step(&w);
    assert_int_equal(w.moves, moves + 1);
    assert_true(status(&w).time_left_s <= left_s + 60);
    run(&w, 60000);
    s = status(&w);
    assert_int_equal(s.state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(s.pings_lost, 0);
    assert_all_imaged(&w);
    scan_destroy(w.scan);
}

/* The array had not got the command, or was still emitting: the stage may have been
 * pushed. */
static void what_was_being_recorded_when_it_paused_is_taken_again(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 8);
    start(&w);
    step(&w); /* moves */
    step(&w); /* fires */
    assert_int_equal(w.n_queue, 4);
    tell_ping(&w, &w.queue[0]);
    w.stage_held = true;
    tell_stage(&w);
    w.n_queue = 0; /* and the array lost them */
    run(&w, 20000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__PAUSED);
    assert_true(status(&w).held);
    assert_non_null(strstr(status(&w).text, "'anlos stage home' or 'release' goes on"));
    assert_int_equal(w.commands, 1);
    w.stage_held = false;
    tell_stage(&w);
    run(&w, 20000);
    Anlos__ScanStatus s = status(&w);
    assert_int_equal(s.state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(s.pings_lost, 0);
    assert_int_equal(s.pings_retaken, 4);
    scan_destroy(w.scan);
}

/* Receipts come in while it pauses: what was heard before is not taken again. */
static void receipts_count_while_it_pauses(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 8);
    start(&w);
    step(&w);
    step(&w);
    w.stage_held = true;
    tell_stage(&w);
    step(&w);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__PAUSED);
    while (w.n_queue)
        process_one(&w);
    assert_int_equal(status(&w).pings_done, 4);
    w.stage_held = false;
    tell_stage(&w);
    run(&w, 20000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(status(&w).pings_retaken, 0);
    scan_destroy(w.scan);
}

static void a_restarted_stage_is_not_in_the_fault_of_the_one_before(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 8);
    start(&w);
    w.stage_fault = true;
    tell_stage(&w);
    step(&w);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__PAUSED);
    w.stage_fault = false;
    w.epoch.stage++;
    all_healthy(&w);
    run(&w, 20000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    scan_destroy(w.scan);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_stage_command_that_got_lost_is_sent_again),
        cmocka_unit_test(a_target_out_of_the_stages_reach_fails_the_scan),
        cmocka_unit_test(a_stage_in_fault_pauses_the_scan_until_it_is_homed),
        cmocka_unit_test(what_was_being_recorded_when_it_paused_is_taken_again),
        cmocka_unit_test(receipts_count_while_it_pauses),
        cmocka_unit_test(a_restarted_stage_is_not_in_the_fault_of_the_one_before),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
