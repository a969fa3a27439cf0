/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "nodes/play/account.h"

static void play(struct account *a, Anlos__Pass pass, uint32_t speaker, bool valid)
{
    const struct account_ping ping = {
        .scan = 1, .position = 2, .speaker = speaker, .pass = pass, .valid = valid};

    account_play(a, &ping);
}

static bool answer(struct account *a, Anlos__Pass pass, uint32_t speaker, bool usable)
{
    Anlos__Receipt r = ANLOS__RECEIPT__INIT;

    r.scan = 1;
    r.position = 2;
    r.pass = pass;
    r.speaker = speaker;
    r.usable = usable;
    return account_receipt(a, &r);
}

static void each_receipt_answers_its_ping(void **state)
{
    struct account a = {.n = 0};

    (void)state;
    play(&a, ANLOS__PASS__BACKGROUND, 0, true);
    play(&a, ANLOS__PASS__SCENE, 0, true);
    assert_int_equal(a.n, 2);
    assert_true(answer(&a, ANLOS__PASS__SCENE, 0, true));
    assert_true(answer(&a, ANLOS__PASS__BACKGROUND, 0, true));
    assert_false(answer(&a, ANLOS__PASS__BACKGROUND, 0, true));
    assert_int_equal(a.n, 0);
    assert_int_equal(a.used, 2);
    assert_int_equal(a.missing + a.unused, 0);
}

static void a_receipt_tells_what_was_lost_before_it(void **state)
{
    struct account a = {.n = 0};

    (void)state;
    for (uint32_t i = 0; i < 4; i++)
        play(&a, ANLOS__PASS__SCENE, i, true);
    play(&a, ANLOS__PASS__BACKGROUND, 9, true); /* goes another way */
    assert_true(answer(&a, ANLOS__PASS__SCENE, 2, true));
    assert_int_equal(a.missing, 2);
    assert_int_equal(a.n, 2);
    assert_int_equal(a.under_way[0].speaker, 3);
    assert_int_equal(a.under_way[1].speaker, 9);
}

static void a_refusal_overtakes_and_tells_nothing_of_others(void **state)
{
    struct account a = {.n = 0};

    (void)state;
    play(&a, ANLOS__PASS__SCENE, 0, true);
    play(&a, ANLOS__PASS__SCENE, 1, true);
    /* dsp has no background for it, and asks for that */
    assert_true(answer(&a, ANLOS__PASS__BACKGROUND, 1, false));
    assert_int_equal(a.unused, 1);
    assert_int_equal(a.missing, 0);
    assert_int_equal(a.n, 1);
}

static void what_was_recorded_as_not_valid_is_no_loss(void **state)
{
    struct account a = {.n = 0};

    (void)state;
    play(&a, ANLOS__PASS__SCENE, 0, false);
    play(&a, ANLOS__PASS__SCENE, 0, true); /* taken again */
    assert_true(answer(&a, ANLOS__PASS__SCENE, 0, false));
    assert_int_equal(a.unused, 0);
    assert_true(answer(&a, ANLOS__PASS__SCENE, 0, true));
    assert_int_equal(a.used, 1);
    assert_int_equal(a.n, 0);
}

static void what_is_given_up_is_missing_and_what_is_forgotten_is_not(void **state)
{
    struct account a = {.n = 0};

    (void)state;
    play(&a, ANLOS__PASS__SCENE, 0, true);
    play(&a, ANLOS__PASS__SCENE, 1, true);
    assert_int_equal(account_give_up(&a), 2);
    assert_int_equal(a.missing, 2);
    play(&a, ANLOS__PASS__SCENE, 2, true);
    account_forget(&a);
    assert_int_equal(a.n, 0);
    assert_int_equal(a.missing, 2);
    assert_int_equal(a.played, 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_receipt_answers_its_ping),
        cmocka_unit_test(a_receipt_tells_what_was_lost_before_it),
        cmocka_unit_test(a_refusal_overtakes_and_tells_nothing_of_others),
        cmocka_unit_test(what_was_recorded_as_not_valid_is_no_loss),
        cmocka_unit_test(what_is_given_up_is_missing_and_what_is_forgotten_is_not),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
