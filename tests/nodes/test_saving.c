/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

#include "nodes/can/saving.h"

#define MS 1000000LL

static const struct can_save_request collision = {
    .number = 513, .reason = CAN_COLLISION, .request = CAN_SAVE};

static Anlos__SaveStatus status_of(uint64_t id, const char *error)
{
    Anlos__SaveStatus s = ANLOS__SAVE_STATUS__INIT;

    s.request_id = id;
    s.error = (char *)error;
    return s;
}

static void nothing_is_asked_for_by_itself(void **state)
{
    const Anlos__SaveStatus of_another = status_of(7, ""), of_none = status_of(0, "");
    struct saving s = {0};
    Anlos__SaveRequest r;

    (void)state;
    assert_false(saving_due(&s, 5000 * MS, &r));
    assert_false(saving_ends(&s, 9000 * MS));
    assert_false(saving_status(&s, &of_another));
    assert_false(saving_status(&s, &of_none));
}

/* Each time by the same id, by which a recorder knows that it is one request. */
static void it_is_asked_again_until_a_recorder_names_it(void **state)
{
    struct saving s = {0};
    Anlos__SaveRequest r, again;

    (void)state;
    saving_begin(&s, &collision, 1000 * MS);
    assert_true(saving_due(&s, 1000 * MS, &r));
    assert_string_equal(r.reason, "vehicle, collision, 513");
    assert_true(r.id != 0);
    assert_false(saving_due(&s, 1249 * MS, &again));
    assert_true(saving_due(&s, 1250 * MS, &again));
    assert_true(again.id == r.id);
    Anlos__SaveStatus status = status_of(r.id + 1, "");
    assert_false(saving_status(&s, &status));
    status = status_of(r.id, "");
    assert_true(saving_status(&s, &status));
    assert_false(saving_status(&s, &status));
    assert_false(saving_due(&s, 1500 * MS, &again));
    assert_false(saving_ends(&s, 9000 * MS));
    assert_string_equal(s.failed, "");
}

static void who_keeps_nothing_is_no_answer_while_another_one_may_save(void **state)
{
    struct saving s = {0};
    Anlos__SaveRequest r;

    (void)state;
    saving_begin(&s, &collision, 1000 * MS);
    assert_true(saving_due(&s, 1000 * MS, &r));
    Anlos__SaveStatus status = status_of(r.id, "keeps none");
    assert_false(saving_status(&s, &status));
    status = status_of(r.id, "");
    assert_true(saving_status(&s, &status));
    assert_int_equal(s.unsaved, 0);
}

static void assert_unsaved(struct saving *s, const char *text)
{
    struct device_count counts[SAVING_COUNTS];

    assert_false(saving_ends(s, 3999 * MS));
    assert_true(saving_ends(s, 4000 * MS));
    assert_false(saving_ends(s, 4001 * MS));
    assert_string_equal(s->failed, text);
    saving_counts(s, counts);
    assert_string_equal(counts[0].name, "saves_asked");
    assert_string_equal(counts[1].name, "saves_failed");
    assert_int_equal(counts[0].value, 1);
    assert_int_equal(counts[1].value, 1);
}

static void without_an_answer_it_says_that_nobody_keeps_anything(void **state)
{
    struct saving s = {0};

    (void)state;
    saving_begin(&s, &collision, 1000 * MS);
    assert_unsaved(&s, "the vehicle's request to save (vehicle, collision, 513): nobody "
                       "keeps the last seconds (anlos launch --snapshot)");
}

static void a_recorder_that_cannot_is_quoted(void **state)
{
    struct saving s = {0};
    Anlos__SaveRequest r;

    (void)state;
    saving_begin(&s, &collision, 1000 * MS);
    assert_true(saving_due(&s, 1000 * MS, &r));
    const Anlos__SaveStatus status = status_of(r.id, "the disk is full");
    assert_false(saving_status(&s, &status));
    assert_unsaved(&s,
                   "the vehicle's request to save (vehicle, collision, 513): the disk "
                   "is full");
}

/* It covers the same seconds; the other one is counted. */
static void a_new_request_replaces_one_that_is_under_way(void **state)
{
    struct can_save_request later = {
        .number = 2, .reason = CAN_REASON_UNKNOWN, .request = CAN_SAVE};
    struct saving s = {0};
    Anlos__SaveRequest first, second;

    (void)state;
    saving_begin(&s, &collision, 1000 * MS);
    assert_true(saving_due(&s, 1000 * MS, &first));
    saving_begin(&s, &later, 1100 * MS);
    assert_true(saving_due(&s, 1100 * MS, &second));
    assert_true(first.id != second.id);
    assert_string_equal(second.reason, "vehicle, no reason given, 2");
    assert_int_equal(s.asked, 2);
    assert_int_equal(s.unsaved, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_is_asked_for_by_itself),
        cmocka_unit_test(it_is_asked_again_until_a_recorder_names_it),
        cmocka_unit_test(who_keeps_nothing_is_no_answer_while_another_one_may_save),
        cmocka_unit_test(without_an_answer_it_says_that_nobody_keeps_anything),
        cmocka_unit_test(a_recorder_that_cannot_is_quoted),
        cmocka_unit_test(a_new_request_replaces_one_that_is_under_way),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
