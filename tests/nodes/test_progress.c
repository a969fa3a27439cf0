/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/launcher/screen.h"

static bool tell(struct progress *p, Anlos__ScanStatus__State state, uint32_t done)
{
    Anlos__ScanStatus s = ANLOS__SCAN_STATUS__INIT;

    s.state = state;
    s.pings_done = done;
    s.pings_expected = 200;
    s.time_left_s = 12.4;
    s.pings_lost = 1;
    s.text = (char *)(state == ANLOS__SCAN_STATUS__STATE__WAITING ? "waits for dsp" : "");
    return progress_status(p, &s);
}

static void a_pipe_gets_a_line_for_each_tenth(void **state)
{
    struct progress p;
    int lines = 0;

    (void)state;
    progress_init(&p, false);
    for (uint32_t done = 0; done <= 200; done++)
        lines += tell(&p, ANLOS__SCAN_STATUS__STATE__RUNNING, done);
    assert_int_equal(lines, 11);
}

static void a_terminal_gets_every_change(void **state)
{
    struct progress p;

    (void)state;
    progress_init(&p, true);
    for (uint32_t done = 0; done <= 10; done++)
        assert_true(tell(&p, ANLOS__SCAN_STATUS__STATE__RUNNING, done));
}

static void the_line_says_pings_time_and_losses(void **state)
{
    struct progress p;
    Anlos__Health h = ANLOS__HEALTH__INIT;
    Anlos__TopicCount c = ANLOS__TOPIC_COUNT__INIT, *list = &c;

    (void)state;
    progress_init(&p, true);
    c.gaps = 2;
    c.dropped = 3;
    h.topics = &list;
    h.n_topics = 1;
    h.node = (char *)"dsp";
    progress_health(&p, &h);
    h.node = (char *)"recon";
    progress_health(&p, &h);
    progress_health(&p, &h); /* repeated, not added */
    tell(&p, ANLOS__SCAN_STATUS__STATE__RUNNING, 50);
    assert_string_equal(p.text, "scene 50/200 pings, 12 s left, 0 retaken, 1 given up, "
                                "10 messages lost");
}

/* The longest line of a scan such as the demo's, with some losses. */
static void the_line_fits_a_terminal_of_80_columns(void **state)
{
    struct progress p;
    Anlos__ScanStatus s = ANLOS__SCAN_STATUS__INIT;

    (void)state;
    progress_init(&p, true);
    s.state = ANLOS__SCAN_STATUS__STATE__RUNNING;
    s.pass = ANLOS__PASS__BACKGROUND;
    s.pings_done = 1000;
    s.pings_expected = 1024;
    s.time_left_s = 97.0;
    s.pings_retaken = 304;
    progress_status(&p, &s);
    assert_in_range(strlen(p.text), 1, 79);
}

static void while_it_waits_it_says_for_whom(void **state)
{
    struct progress p;

    (void)state;
    progress_init(&p, false);
    assert_true(tell(&p, ANLOS__SCAN_STATUS__STATE__WAITING, 0));
    assert_string_equal(p.text, "waits for dsp");
    assert_false(tell(&p, ANLOS__SCAN_STATUS__STATE__WAITING, 0));
}

static void a_failure_is_shown_at_once(void **state)
{
    struct progress p;

    (void)state;
    progress_init(&p, false);
    tell(&p, ANLOS__SCAN_STATUS__STATE__RUNNING, 21);
    assert_true(tell(&p, ANLOS__SCAN_STATUS__STATE__FAILED, 22));
    assert_int_equal(p.state, ANLOS__SCAN_STATUS__STATE__FAILED);
}

static void of_an_array_that_stands_nothing_is_expected(void **state)
{
    struct progress p;
    Anlos__ScanStatus s = ANLOS__SCAN_STATUS__INIT;

    (void)state;
    progress_init(&p, false);
    s.state = ANLOS__SCAN_STATUS__STATE__DONE;
    s.pings_done = 16;
    s.pings_lost = 1;
    s.text = (char *)"the recording has ended";
    progress_status(&p, &s);
    assert_string_equal(p.text, "done: the recording has ended; 16 pings, 1 lost, "
                                "0 messages lost");
    s.state = ANLOS__SCAN_STATUS__STATE__FAILED;
    s.pings_done = 0;
    s.text = (char *)"no such speaker";
    assert_true(progress_status(&p, &s));
    assert_string_equal(p.text, "failed: no such speaker");
}

static void a_pause_is_said_at_once_and_so_is_its_end(void **state)
{
    struct progress p;
    Anlos__ScanStatus s = ANLOS__SCAN_STATUS__INIT;

    (void)state;
    progress_init(&p, false);
    tell(&p, ANLOS__SCAN_STATUS__STATE__RUNNING, 21);
    s.state = ANLOS__SCAN_STATUS__STATE__PAUSED;
    s.pings_done = 21;
    s.pings_expected = 200;
    s.text = (char *)"stage: emergency stop";
    assert_true(progress_status(&p, &s));
    assert_string_equal(p.text, "paused at 21/200 pings; stage: emergency stop");
    assert_false(progress_status(&p, &s));
    assert_true(tell(&p, ANLOS__SCAN_STATUS__STATE__RUNNING, 21));
}

static bool tell_endless(struct progress *p, Anlos__ScanStatus__State state,
                         Anlos__Pass pass)
{
    Anlos__ScanStatus s = ANLOS__SCAN_STATUS__INIT;

    s.state = state;
    s.pass = pass;
    s.pings_done = 480;
    s.pings_lost = 2;
    s.text = (char *)"2.6 frames/s, 41.7 pings/s";
    return progress_status(p, &s);
}

static void a_scan_without_end_tells_its_pace_and_what_was_lost(void **state)
{
    struct progress p;

    (void)state;
    progress_init(&p, false);
    assert_true(
        tell_endless(&p, ANLOS__SCAN_STATUS__STATE__RUNNING, ANLOS__PASS__BACKGROUND));
    assert_non_null(strstr(p.text, "background: 2.6 frames/s"));
    assert_false(
        tell_endless(&p, ANLOS__SCAN_STATUS__STATE__RUNNING, ANLOS__PASS__SCENE));
    assert_string_equal(p.text, "runs: 2.6 frames/s, 41.7 pings/s; 480 pings, 2 lost, "
                                "0 messages lost");
    tell_endless(&p, ANLOS__SCAN_STATUS__STATE__WAITING, ANLOS__PASS__SCENE);
    assert_true(tell_endless(&p, ANLOS__SCAN_STATUS__STATE__RUNNING, ANLOS__PASS__SCENE));
}

static void a_pipe_gets_the_pace_of_a_scan_without_end_first_and_last(void **state)
{
    Anlos__ScanStatus s = ANLOS__SCAN_STATUS__INIT;
    struct progress p;

    (void)state;
    progress_init(&p, false);
    s.state = ANLOS__SCAN_STATUS__STATE__RUNNING;
    s.text = (char *)"waits for the first ping";
    assert_false(progress_status(&p, &s));
    assert_false(progress_end(&p));
    assert_true(tell_endless(&p, ANLOS__SCAN_STATUS__STATE__RUNNING, ANLOS__PASS__SCENE));
    assert_false(
        tell_endless(&p, ANLOS__SCAN_STATUS__STATE__RUNNING, ANLOS__PASS__SCENE));
    assert_true(progress_end(&p));
    /* A terminal has it already, and a scan that ends by itself its tenths. */
    progress_init(&p, true);
    tell_endless(&p, ANLOS__SCAN_STATUS__STATE__RUNNING, ANLOS__PASS__SCENE);
    assert_false(progress_end(&p));
    progress_init(&p, false);
    tell(&p, ANLOS__SCAN_STATUS__STATE__RUNNING, 21);
    assert_false(progress_end(&p));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_pause_is_said_at_once_and_so_is_its_end),
        cmocka_unit_test(a_pipe_gets_a_line_for_each_tenth),
        cmocka_unit_test(a_terminal_gets_every_change),
        cmocka_unit_test(the_line_says_pings_time_and_losses),
        cmocka_unit_test(the_line_fits_a_terminal_of_80_columns),
        cmocka_unit_test(while_it_waits_it_says_for_whom),
        cmocka_unit_test(a_failure_is_shown_at_once),
        cmocka_unit_test(of_an_array_that_stands_nothing_is_expected),
        cmocka_unit_test(a_pipe_gets_the_pace_of_a_scan_without_end_first_and_last),
        cmocka_unit_test(a_scan_without_end_tells_its_pace_and_what_was_lost),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
