/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "nodes/can/list_check.h"

#define MANY 400

struct rig {
    struct list_check check;
    Anlos__DetectionList list;
    Anlos__Detection detections[MANY], *pointers[MANY];
};

/* A list of n tracks that follows on nothing. */
static void fill(struct rig *r, size_t n)
{
    r->check = (struct list_check){.n = 0};
    anlos__detection_list__init(&r->list);
    for (size_t i = 0; i < n; i++) {
        anlos__detection__init(&r->detections[i]);
        r->detections[i].id = (uint32_t)i + 1;
        r->pointers[i] = &r->detections[i];
    }
    r->list.detections = r->pointers;
    r->list.n_detections = n;
    r->list.tracked = true;
}

static enum list_verdict hear(struct rig *r, const char *from, int64_t epoch_ns,
                              uint64_t sequence, uint32_t counter)
{
    r->list.counter = counter;
    return list_check(&r->check, &r->list, from, epoch_ns, sequence, false);
}

static void
lists_that_follow_each_other_are_good_with_gaps_and_across_the_wrap(void **state)
{
    struct rig r;

    (void)state;
    fill(&r, 3);
    assert_int_equal(hear(&r, "track", 7, 0, UINT32_MAX - 1), LIST_GOOD);
    assert_int_equal(hear(&r, "track", 7, 1, UINT32_MAX), LIST_GOOD);
    assert_int_equal(hear(&r, "track", 7, 5, 4), LIST_GOOD);
    assert_int_equal(r.check.verdicts[LIST_GOOD], 3);
}

static void a_list_that_comes_twenty_times_is_told_once(void **state)
{
    struct rig r;

    (void)state;
    fill(&r, 3);
    assert_int_equal(hear(&r, "track", 7, 100, 50), LIST_GOOD);
    for (int i = 0; i < 19; i++)
        assert_int_equal(hear(&r, "track", 7, 100, 50), LIST_REPEATED);
    assert_int_equal(hear(&r, "track", 7, 101, 51), LIST_GOOD);
    assert_int_equal(r.check.verdicts[LIST_REPEATED], 19);
}

/* Each message is another one, but a tracker that is stuck makes the same list, or one
 * that is older; or somebody sends an old message, of the newest list. */
static void nor_may_the_counter_stand_or_go_back(void **state)
{
    struct rig r;

    (void)state;
    fill(&r, 0);
    assert_int_equal(hear(&r, "track", 7, 100, 50), LIST_GOOD);
    assert_int_equal(hear(&r, "track", 7, 101, 50), LIST_REPEATED);
    assert_int_equal(hear(&r, "track", 7, 102, 49), LIST_REPEATED);
    assert_int_equal(hear(&r, "track", 7, 99, 51), LIST_REPEATED);
    assert_int_equal(hear(&r, "track", 7, 101, 51), LIST_GOOD);
}

static void a_tracker_that_was_started_again_counts_anew(void **state)
{
    struct rig r;

    (void)state;
    fill(&r, 1);
    assert_int_equal(hear(&r, "track", 7, 100, 50), LIST_GOOD);
    assert_int_equal(hear(&r, "track", 9, 0, 0), LIST_GOOD);
    assert_int_equal(hear(&r, "track", 9, 0, 0), LIST_REPEATED);
    assert_int_equal(hear(&r, "track", 9, 1, 1), LIST_GOOD);
    assert_int_equal(hear(&r, "track", 7, 100, 50),
                     LIST_REPEATED);                         /* of the one before */
    assert_int_equal(hear(&r, "track", 5, 0, 0), LIST_GOOD); /* the clock was set back */
}

static void whoever_else_sends_lists_counts_for_itself(void **state)
{
    struct rig r;

    (void)state;
    fill(&r, 1);
    for (uint32_t i = 0; i < 5; i++) {
        assert_int_equal(hear(&r, "track", 7, i, i), LIST_GOOD);
        assert_int_equal(hear(&r, "other", 7, 50 - i, 50 + i),
                         i ? LIST_REPEATED : LIST_GOOD);
    }
}

static void more_sources_than_are_remembered_do_no_harm(void **state)
{
    struct rig r;

    (void)state;
    fill(&r, 1);
    for (int64_t epoch_ns = 1; epoch_ns < 50; epoch_ns++) {
        assert_int_equal(hear(&r, "track", epoch_ns, 1, 1), LIST_GOOD);
        assert_int_equal(hear(&r, "track", epoch_ns, 1, 1), LIST_REPEATED);
    }
}

static void two_objects_of_one_id_are_refused_with_their_list(void **state)
{
    struct rig r;

    (void)state;
    fill(&r, 3);
    r.detections[2].id = 1;
    assert_int_equal(hear(&r, "track", 7, 0, 0), LIST_MALFORMED);
    r.detections[2].id = 1 + 256; /* eight bits of it go out */
    assert_int_equal(hear(&r, "track", 7, 1, 1), LIST_MALFORMED);
    r.detections[2].id = 256;
    assert_int_equal(hear(&r, "track", 7, 2, 2), LIST_GOOD);
    r.list.tracked = false; /* as few as these keep their numbers */
    r.detections[2].id = 1 + 256;
    assert_int_equal(hear(&r, "track", 7, 3, 3), LIST_MALFORMED);
    assert_int_equal(r.check.verdicts[LIST_MALFORMED], 3);
}

/* That of a scan only numbers its objects. */
static void a_list_without_tracks_may_have_more_objects_than_ids(void **state)
{
    struct rig r;

    (void)state;
    fill(&r, MANY);
    r.list.tracked = false;
    assert_int_equal(hear(&r, "track", 7, 0, 0), LIST_GOOD);
    r.detections[399].id = 300;
    assert_int_equal(hear(&r, "track", 7, 1, 1), LIST_MALFORMED);
}

static void a_malformed_list_that_comes_again_is_repeated(void **state)
{
    struct rig r;

    (void)state;
    fill(&r, 2);
    r.detections[1].id = 1;
    assert_int_equal(hear(&r, "track", 7, 0, 0), LIST_MALFORMED);
    assert_int_equal(hear(&r, "track", 7, 0, 0), LIST_REPEATED);
}

/* Whoever plays a bag may go back in it. */
static void what_is_replayed_may_come_again(void **state)
{
    struct rig r;

    (void)state;
    fill(&r, 2);
    for (uint32_t i = 9; i > 0; i--) {
        r.list.counter = i;
        assert_int_equal(list_check(&r.check, &r.list, "track", 7, i, true), LIST_GOOD);
    }
    r.detections[1].id = 1;
    assert_int_equal(list_check(&r.check, &r.list, "track", 7, 1, true), LIST_MALFORMED);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(
            lists_that_follow_each_other_are_good_with_gaps_and_across_the_wrap),
        cmocka_unit_test(a_list_that_comes_twenty_times_is_told_once),
        cmocka_unit_test(nor_may_the_counter_stand_or_go_back),
        cmocka_unit_test(a_tracker_that_was_started_again_counts_anew),
        cmocka_unit_test(whoever_else_sends_lists_counts_for_itself),
        cmocka_unit_test(more_sources_than_are_remembered_do_no_harm),
        cmocka_unit_test(two_objects_of_one_id_are_refused_with_their_list),
        cmocka_unit_test(a_list_without_tracks_may_have_more_objects_than_ids),
        cmocka_unit_test(a_malformed_list_that_comes_again_is_repeated),
        cmocka_unit_test(what_is_replayed_may_come_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
