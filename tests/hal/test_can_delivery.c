/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "hal/can/errors.h"

#define MS 1000000LL

static void assert_counts(const struct can_delivery *d, uint64_t confirmed,
                          uint64_t unconfirmed, size_t pending)
{
    assert_int_equal(d->confirmed, confirmed);
    assert_int_equal(d->unconfirmed, unconfirmed);
    assert_int_equal(d->pending, pending);
    assert_int_equal(d->sent, confirmed + unconfirmed + pending);
}

static void every_frame_is_confirmed_pending_or_given_up(void **state)
{
    struct can_delivery d = {0};

    (void)state;
    for (int i = 0; i < 5; i++)
        can_delivery_sent(&d, i * MS);
    can_delivery_echo(&d, 5 * MS);
    can_delivery_echo(&d, 6 * MS);
    assert_counts(&d, 2, 0, 3);
    can_delivery_lost(&d);
    assert_counts(&d, 2, 3, 0);
    can_delivery_echo(&d, 7 * MS); /* one was on the bus after all */
    assert_counts(&d, 3, 2, 0);
    assert_int_equal(d.outages, 1);
}

static void a_loss_of_nothing_is_none(void **state)
{
    struct can_delivery d = {0};

    (void)state;
    can_delivery_lost(&d);
    can_delivery_sent(&d, 0);
    can_delivery_echo(&d, 0);
    can_delivery_lost(&d);
    assert_int_equal(d.outages, 0);
}

static void silence_is_a_second_without_echo_while_frames_wait(void **state)
{
    struct can_delivery d = {0};

    (void)state;
    can_delivery_check(&d, 5000 * MS); /* nothing was sent */
    assert_false(d.silent);
    can_delivery_sent(&d, 5000 * MS);
    can_delivery_sent(&d, 5900 * MS);
    can_delivery_check(&d, 5999 * MS);
    assert_false(d.silent);
    can_delivery_check(&d, 6000 * MS);
    assert_true(d.silent);
    assert_counts(&d, 0, 2, 0);
    can_delivery_echo(&d, 6500 * MS);
    assert_false(d.silent);
}

static void a_lost_echo_costs_one_second_not_all(void **state)
{
    struct can_delivery d = {0};

    (void)state;
    can_delivery_sent(&d, 0);
    can_delivery_check(&d, 1000 * MS);
    for (int i = 1; i < 100; i++) {
        can_delivery_sent(&d, i * 1000 * MS);
        can_delivery_echo(&d, i * 1000 * MS + 500 * MS);
        can_delivery_check(&d, i * 1000 * MS + 999 * MS);
        assert_false(d.silent);
    }
    assert_counts(&d, 99, 1, 0);
    assert_int_equal(d.outages, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_frame_is_confirmed_pending_or_given_up),
        cmocka_unit_test(a_loss_of_nothing_is_none),
        cmocka_unit_test(silence_is_a_second_without_echo_while_frames_wait),
        cmocka_unit_test(a_lost_echo_costs_one_second_not_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
