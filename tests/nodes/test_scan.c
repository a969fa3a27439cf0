/* SPDX-License-Identifier: MIT */
/* The course of a scan: whom it waits for, what it fires, what it takes again. */
#include "tests/nodes/scan_world.h"

static void it_waits_for_every_node_and_says_for_whom(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 1, 8);
    tell_survey(&w);
    tell_stage(&w);
    step(&w);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__WAITING);
    hear(&w, "stage", 1, ANLOS__HEALTH__STATE__READY);
    hear(&w, "array", 1, ANLOS__HEALTH__STATE__READY);
    hear(&w, "recon", 1, ANLOS__HEALTH__STATE__STARTING);
    step(&w);
    assert_string_equal(status(&w).text, "waits for dsp, recon");
    assert_int_equal(w.moves + w.commands, 0);
    hear(&w, "dsp", 1, ANLOS__HEALTH__STATE__DEGRADED);
    hear(&w, "recon", 1, ANLOS__HEALTH__STATE__READY);
    step(&w);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__RUNNING);
    assert_int_equal(w.moves, 1);
    scan_destroy(w.scan);
}

static void without_a_survey_it_waits(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 1, 8);
    all_healthy(&w);
    step(&w);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__WAITING);
    assert_string_equal(status(&w).text, "waits for the survey");
    scan_destroy(w.scan);
}

static void every_ping_is_fired_once_background_first(void **state)
{
    struct world w;

    (void)state;
    setup(&w, true, 3, 8);
    start(&w);
    run(&w, 10000);
    Anlos__ScanStatus s = status(&w);
    assert_int_equal(s.state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(s.pings_expected, 2 * N_POSITIONS * N_SPEAKERS);
    assert_int_equal(s.pings_done, s.pings_expected);
    assert_int_equal(s.pings_retaken, 0);
    assert_int_equal(fired_total(&w, ANLOS__PASS__BACKGROUND), 12);
    assert_int_equal(fired_total(&w, ANLOS__PASS__SCENE), 12);
    assert_all_imaged(&w);
    /* There and back again: the scene begins where the background ended. */
    assert_int_equal(w.moves, 5);
    scan_destroy(w.scan);
}

static void never_more_pings_are_under_way_than_the_window_allows(void **state)
{
    struct world w;

    (void)state;
    for (unsigned window = 1; window <= 9; window++) {
        setup(&w, false, 0, window);
        start(&w);
        run(&w, 20000);
        assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
        assert_true(w.most_under_way <= window);
        assert_int_equal(fired_total(&w, ANLOS__PASS__SCENE), 12);
        scan_destroy(w.scan);
    }
}

static void a_command_is_sent_again_until_a_ping_answers_it(void **state)
{
    (void)state;
    for (int answered = 0; answered < 2; answered++) {
        struct world w;
        setup(&w, false, 0, 8);
        start(&w);
        step(&w); /* moves */
        step(&w); /* fires */
        assert_int_equal(w.commands, 1);
        if (answered)
            tell_ping(&w, &w.queue[0]);
        w.now_ns += 700 * MS;
        step(&w);
        assert_int_equal(w.commands, answered ? 1 : 2);
        scan_destroy(w.scan);
    }
}

static void it_goes_on_while_receipts_are_on_their_way(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 8);
    start(&w);
    step(&w); /* move */
    step(&w); /* fire */
    assert_int_equal(w.n_queue, 4);
    step(&w);
    assert_int_equal(w.moves, 1); /* it records: the stage stands still */
    for (int i = 0; i < 4; i++)
        tell_ping(&w, &w.queue[i]);
    step(&w);
    step(&w);
    assert_int_equal(w.moves, 2);
    assert_int_equal(w.n_queue, 8);
    for (int i = 4; i < 8; i++)
        tell_ping(&w, &w.queue[i]);
    step(&w); /* moves, but the window is full */
    step(&w);
    assert_int_equal(w.n_queue, 8);
    scan_destroy(w.scan);
}

static void a_lost_ping_is_taken_again(void **state)
{
    struct world w;

    (void)state;
    setup(&w, true, 3, 8);
    start(&w);
    w.lose = 1;
    run(&w, 10000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(status(&w).pings_retaken, 1);
    assert_int_equal(status(&w).pings_lost, 0);
    assert_int_equal(fired_total(&w, ANLOS__PASS__BACKGROUND), 13);
    assert_all_imaged(&w);
    scan_destroy(w.scan);
}

static void the_last_ping_of_all_is_missed_by_the_clock(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 1, 4);
    start(&w);
    while (fired_total(&w, ANLOS__PASS__SCENE) < 12) {
        step(&w);
        while (w.n_queue > (fired_total(&w, ANLOS__PASS__SCENE) == 12 ? 1 : 0))
            process_one(&w);
        w.now_ns += 10 * MS;
    }
    w.lose = 1;
    process_one(&w);
    int64_t lost_ns = w.now_ns;
    run(&w, 10000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(status(&w).pings_retaken, 1);
    assert_true(w.now_ns - lost_ns >= 1000 * MS);
    assert_true(w.now_ns - lost_ns < 1500 * MS);
    scan_destroy(w.scan);
}

static void what_nobody_can_use_is_given_up_and_said(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 2, 4);
    start(&w);
    w.refuse = 3;
    w.lose = 0;
    step(&w);
    step(&w);
    /* The first shot's first ping is refused three times. */
    for (int i = 0; i < 3; i++) {
        while (w.n_queue > 0) {
            struct ping p = w.queue[0];
            w.refuse = p.position == 0 && p.speaker == 0;
            process_one(&w);
        }
        step(&w);
    }
    w.refuse = 0;
    run(&w, 10000);
    Anlos__ScanStatus s = status(&w);
    assert_int_equal(s.state, ANLOS__SCAN_STATUS__STATE__DONE);
    assert_int_equal(s.pings_lost, 1);
    assert_int_equal(s.pings_done, 11);
    assert_int_equal(s.pings_retaken, 2);
    assert_string_equal(s.text, "done; 1 of 12 pings were given up");
    scan_destroy(w.scan);
}

static void a_scan_without_a_single_ping_has_failed(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 8);
    start(&w);
    w.refuse = 1000;
    run(&w, 20000);
    assert_int_equal(status(&w).state, ANLOS__SCAN_STATUS__STATE__FAILED);
    assert_int_equal(status(&w).pings_lost, 12);
    scan_destroy(w.scan);
}

static void a_fire_command_that_got_lost_is_sent_again_before_the_time_out(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 8);
    start(&w);
    w.array_deaf = true;
    step(&w);
    step(&w);
    assert_int_equal(w.commands, 1);
    w.now_ns += 600 * MS;
    w.array_deaf = false;
    step(&w);
    assert_int_equal(w.commands, 2);
    run(&w, 10000);
    assert_int_equal(status(&w).pings_lost, 0);
    assert_int_equal(status(&w).pings_retaken, 0);
    assert_all_imaged(&w);
    scan_destroy(w.scan);
}

static void time_left_follows_the_pace(void **state)
{
    struct world w;

    (void)state;
    setup(&w, false, 0, 4);
    start(&w);
    step(&w);
    step(&w);
    w.now_ns += 400 * MS; /* four of twelve in 0.4 s */
    while (w.n_queue)
        process_one(&w);
    assert_true(status(&w).time_left_s > 0.799 && status(&w).time_left_s < 0.801);
    scan_destroy(w.scan);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_waits_for_every_node_and_says_for_whom),
        cmocka_unit_test(without_a_survey_it_waits),
        cmocka_unit_test(every_ping_is_fired_once_background_first),
        cmocka_unit_test(never_more_pings_are_under_way_than_the_window_allows),
        cmocka_unit_test(a_command_is_sent_again_until_a_ping_answers_it),
        cmocka_unit_test(it_goes_on_while_receipts_are_on_their_way),
        cmocka_unit_test(a_lost_ping_is_taken_again),
        cmocka_unit_test(the_last_ping_of_all_is_missed_by_the_clock),
        cmocka_unit_test(what_nobody_can_use_is_given_up_and_said),
        cmocka_unit_test(a_scan_without_a_single_ping_has_failed),
        cmocka_unit_test(a_fire_command_that_got_lost_is_sent_again_before_the_time_out),
        cmocka_unit_test(time_left_follows_the_pace),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
