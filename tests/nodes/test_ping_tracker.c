/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "nodes/scan/ping_tracker.h"

#define SCENE      ANLOS__PASS__SCENE
#define BACKGROUND ANLOS__PASS__BACKGROUND

static struct ping_tracker *make(bool background, unsigned retries)
{
    const struct ping_tracker_size size = {
        .background = background, .n_positions = 2, .n_speakers = 3, .retries = retries};
    struct ping_tracker *l = NULL;

    assert_int_equal(ping_tracker_create(&l, &size), 0);
    return l;
}

static void fire(struct ping_tracker *l, Anlos__Pass pass, size_t position,
                 size_t speaker)
{
    ping_tracker_fire(l, &(struct ping_tracker_ping){pass, position, speaker});
}

static void receipt(struct ping_tracker *l, Anlos__Pass pass, size_t position,
                    size_t speaker, bool usable)
{
    ping_tracker_receipt(l, &(struct ping_tracker_ping){pass, position, speaker}, usable);
}

static struct ping_tracker_count count(const struct ping_tracker *l)
{
    struct ping_tracker_count c;

    ping_tracker_count(l, &c);
    return c;
}

static size_t missing(const struct ping_tracker *l, Anlos__Pass pass, size_t position)
{
    uint32_t speakers[3];

    return ping_tracker_missing(l, pass, position, speakers);
}

static void an_empty_scan_is_refused(void **state)
{
    const struct ping_tracker_size size = {.n_positions = 0, .n_speakers = 3};
    struct ping_tracker *l = NULL;

    (void)state;
    assert_true(ping_tracker_create(&l, &size) < 0);
    assert_null(l);
}

static void both_passes_are_expected_and_the_background_comes_first(void **state)
{
    struct ping_tracker *l = make(true, 1);

    (void)state;
    assert_int_equal(count(l).expected, 12);
    assert_int_equal(ping_tracker_pass(l), BACKGROUND);
    for (size_t p = 0; p < 2; p++) {
        for (size_t s = 0; s < 3; s++) {
            assert_int_equal(ping_tracker_pass(l), BACKGROUND);
            fire(l, BACKGROUND, p, s);
            receipt(l, BACKGROUND, p, s, true);
        }
    }
    assert_int_equal(ping_tracker_pass(l), SCENE);
    assert_int_equal(count(l).done, 6);
    ping_tracker_destroy(l);
}

static void a_receipt_for_a_later_ping_shows_that_an_earlier_one_was_lost(void **state)
{
    struct ping_tracker *l = make(false, 1);

    (void)state;
    for (size_t s = 0; s < 3; s++)
        fire(l, SCENE, 0, s);
    receipt(l, SCENE, 0, 0, true);
    assert_int_equal(missing(l, SCENE, 0), 0);
    receipt(l, SCENE, 0, 2, true); /* and none for 1 */
    assert_int_equal(missing(l, SCENE, 0), 1);
    assert_int_equal(count(l).under_way, 0);
    assert_int_equal(count(l).retaken, 0);
    fire(l, SCENE, 0, 1);
    assert_int_equal(count(l).retaken, 1);
    receipt(l, SCENE, 0, 1, true);
    assert_int_equal(count(l).done, 3);
    ping_tracker_destroy(l);
}

static void a_ping_is_given_up_after_its_retries(void **state)
{
    struct ping_tracker *l = make(false, 2);

    (void)state;
    for (int i = 0; i < 3; i++) {
        assert_int_equal(count(l).lost, 0);
        assert_int_equal(missing(l, SCENE, 1), 3);
        fire(l, SCENE, 1, 1);
        ping_tracker_time_out(l);
    }
    assert_int_equal(count(l).lost, 1);
    assert_int_equal(missing(l, SCENE, 1), 2);
    ping_tracker_destroy(l);
}

static void a_scene_ping_without_background_is_given_up_with_it(void **state)
{
    struct ping_tracker *l = make(true, 0);

    (void)state;
    fire(l, BACKGROUND, 0, 0);
    receipt(l, BACKGROUND, 0, 0, false);
    assert_int_equal(count(l).lost, 2);
    assert_int_equal(missing(l, SCENE, 0), 2);
    ping_tracker_destroy(l);
}

static void a_late_receipt_counts(void **state)
{
    struct ping_tracker *l = make(false, 3);

    (void)state;
    fire(l, SCENE, 0, 0);
    ping_tracker_time_out(l);
    assert_int_equal(missing(l, SCENE, 0), 3);
    receipt(l, SCENE, 0, 0, true);
    assert_int_equal(missing(l, SCENE, 0), 2);
    assert_int_equal(count(l).done, 1);
    ping_tracker_destroy(l);
}

static void recording_ends_with_the_ping_that_is_recorded(void **state)
{
    struct ping_tracker *l = make(false, 1);

    (void)state;
    for (size_t s = 0; s < 3; s++)
        fire(l, SCENE, 0, s);
    assert_int_equal(count(l).recording, 3);
    /* The second one's message was lost on the bus; it was recorded all the same. */
    ping_tracker_recorded(l, &(struct ping_tracker_ping){SCENE, 0, 0});
    ping_tracker_recorded(l, &(struct ping_tracker_ping){SCENE, 0, 2});
    assert_int_equal(count(l).recording, 0);
    assert_int_equal(count(l).under_way, 3);
    ping_tracker_destroy(l);
}

static void fill(struct ping_tracker *l, Anlos__Pass pass)
{
    for (size_t p = 0; p < 2; p++) {
        for (size_t s = 0; s < 3; s++) {
            fire(l, pass, p, s);
            receipt(l, pass, p, s, true);
        }
    }
}

static void a_restarted_dsp_needs_only_the_backgrounds_still_to_be_used(void **state)
{
    struct ping_tracker *l = make(true, 1);

    (void)state;
    fill(l, BACKGROUND);
    fire(l, SCENE, 0, 0);
    receipt(l, SCENE, 0, 0, true);
    ping_tracker_forget_under_way(l);
    ping_tracker_forget_background(l);
    assert_int_equal(ping_tracker_pass(l), BACKGROUND);
    assert_int_equal(missing(l, BACKGROUND, 0), 2);
    assert_int_equal(missing(l, BACKGROUND, 1), 3);
    ping_tracker_destroy(l);
}

static void a_restarted_recon_needs_every_scene_ping_again(void **state)
{
    struct ping_tracker *l = make(true, 1);

    (void)state;
    fill(l, BACKGROUND);
    fill(l, SCENE);
    assert_int_equal(count(l).done, 12);
    ping_tracker_forget_scene(l);
    assert_int_equal(count(l).done, 6);
    assert_int_equal(ping_tracker_pass(l), SCENE);
    assert_int_equal(missing(l, SCENE, 0) + missing(l, SCENE, 1), 6);
    ping_tracker_destroy(l);
}

static void after_dsp_and_recon_the_background_is_missing_too(void **state)
{
    struct ping_tracker *l = make(true, 0);

    (void)state;
    fill(l, BACKGROUND);
    fill(l, SCENE);
    ping_tracker_forget_background(l); /* all used: nothing to do yet */
    assert_int_equal(count(l).done, 12);
    ping_tracker_forget_scene(l);
    assert_int_equal(count(l).done, 0);
    assert_int_equal(count(l).lost, 0);
    assert_int_equal(ping_tracker_pass(l), BACKGROUND);
    ping_tracker_destroy(l);
}

static void what_a_restart_voided_is_no_retry(void **state)
{
    struct ping_tracker *l = make(false, 0);

    (void)state;
    for (int i = 0; i < 5; i++) {
        fire(l, SCENE, 0, 0);
        ping_tracker_forget_under_way(l);
    }
    assert_int_equal(count(l).lost, 0);
    assert_int_equal(count(l).retaken, 4);
    ping_tracker_destroy(l);
}

static void a_missing_background_costs_the_scene_ping_no_retry(void **state)
{
    struct ping_tracker *l = make(true, 0);

    (void)state;
    fill(l, BACKGROUND);
    fire(l, SCENE, 1, 2);
    ping_tracker_forget_background(l);
    assert_int_equal(missing(l, BACKGROUND, 1), 3);
    receipt(l, BACKGROUND, 1, 2, false); /* dsp about that scene ping */
    assert_int_equal(missing(l, SCENE, 1), 3);
    assert_int_equal(missing(l, BACKGROUND, 1), 3);
    assert_int_equal(count(l).lost, 0);
    ping_tracker_destroy(l);
}

static void pings_of_another_scan_are_ignored(void **state)
{
    struct ping_tracker *l = make(false, 0);

    (void)state;
    receipt(l, SCENE, 2, 0, true);
    receipt(l, SCENE, 0, 3, true);
    receipt(l, BACKGROUND, 0, 0, true);
    receipt(l, (Anlos__Pass)7, 0, 0, true);
    assert_int_equal(count(l).done, 0);
    ping_tracker_destroy(l);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_empty_scan_is_refused),
        cmocka_unit_test(both_passes_are_expected_and_the_background_comes_first),
        cmocka_unit_test(a_receipt_for_a_later_ping_shows_that_an_earlier_one_was_lost),
        cmocka_unit_test(a_ping_is_given_up_after_its_retries),
        cmocka_unit_test(a_scene_ping_without_background_is_given_up_with_it),
        cmocka_unit_test(a_late_receipt_counts),
        cmocka_unit_test(recording_ends_with_the_ping_that_is_recorded),
        cmocka_unit_test(a_restarted_dsp_needs_only_the_backgrounds_still_to_be_used),
        cmocka_unit_test(a_restarted_recon_needs_every_scene_ping_again),
        cmocka_unit_test(after_dsp_and_recon_the_background_is_missing_too),
        cmocka_unit_test(what_a_restart_voided_is_no_retry),
        cmocka_unit_test(a_missing_background_costs_the_scene_ping_no_retry),
        cmocka_unit_test(pings_of_another_scan_are_ignored),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
