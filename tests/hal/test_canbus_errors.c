/* SPDX-License-Identifier: MIT */
/* Frames as drivers/net/can/dev.c and the controllers' drivers of the kernel make them;
 * bits as in linux/can/error.h, written out. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "hal/can/errors.h"

enum {
    FLAG = 0x20000000,
    LOST_ARBITRATION = 0x02,
    CONTROLLER = 0x04,
    NO_ACKNOWLEDGE = 0x20,
    BUS_OFF = 0x40,
    RESTARTED = 0x100
};

static void take(struct canbus_errors *e, uint32_t what, uint8_t controller)
{
    const uint8_t data[8] = {[1] = controller};

    canbus_errors_take(e, FLAG | what, data);
}

static void a_controller_goes_through_warning_and_passive_and_recovers(void **state)
{
    struct canbus_errors e = {0};

    (void)state;
    take(&e, CONTROLLER, 0x08);
    assert_int_equal(e.state, CANBUS_WARNING);
    take(&e, CONTROLLER, 0x20);
    assert_int_equal(e.state, CANBUS_PASSIVE);
    take(&e, CONTROLLER, 0x08);
    assert_int_equal(e.state, CANBUS_WARNING);
    take(&e, CONTROLLER, 0x40);
    assert_int_equal(e.state, CANBUS_READY);
    assert_int_equal(e.warning, 2);
    assert_int_equal(e.passive, 1);
}

static void the_worse_of_sending_and_receiving_counts(void **state)
{
    struct canbus_errors e = {0};

    (void)state;
    take(&e, CONTROLLER, 0x04 | 0x20);
    assert_int_equal(e.state, CANBUS_PASSIVE);
    take(&e, CONTROLLER, 0x40 | 0x04);
    assert_int_equal(e.state, CANBUS_WARNING);
}

static void a_full_buffer_of_the_controller_is_no_state(void **state)
{
    struct canbus_errors e = {0};

    (void)state;
    take(&e, CONTROLLER, 0x10);
    take(&e, CONTROLLER, 0x01);
    take(&e, CONTROLLER, 0x02);
    take(&e, CONTROLLER, 0);
    assert_int_equal(e.state, CANBUS_PASSIVE);
    assert_int_equal(e.passive, 1);
}

static void bus_off_lasts_until_the_restart(void **state)
{
    struct canbus_errors e = {0};

    (void)state;
    take(&e, BUS_OFF, 0);
    take(&e, BUS_OFF, 0); /* some drivers say it more than once */
    take(&e, LOST_ARBITRATION, 0);
    assert_int_equal(e.state, CANBUS_OFF);
    assert_int_equal(e.off, 1);
    take(&e, RESTARTED, 0);
    assert_int_equal(e.state, CANBUS_READY);
    take(&e, BUS_OFF | CONTROLLER, 0x20);
    assert_int_equal(e.state, CANBUS_OFF);
    assert_int_equal(e.off, 2);
    assert_int_equal(e.restarted, 1);
}

/* Hardware that restarts by itself says only that it counts errors again, or nothing. */
static void a_controller_that_works_again_is_not_off(void **state)
{
    struct canbus_errors e = {0};

    (void)state;
    take(&e, BUS_OFF, 0);
    take(&e, CONTROLLER, 0x40);
    assert_int_equal(e.state, CANBUS_READY);
    take(&e, BUS_OFF, 0);
    canbus_errors_alive(&e);
    assert_int_equal(e.state, CANBUS_READY);
    take(&e, CONTROLLER, 0x20);
    canbus_errors_alive(&e);
    assert_int_equal(e.state, CANBUS_PASSIVE);
}

static void what_is_counted_is_what_the_socket_lets_in(void **state)
{
    struct canbus_errors e = {0};

    (void)state;
    take(&e, LOST_ARBITRATION | NO_ACKNOWLEDGE, 0);
    take(&e, NO_ACKNOWLEDGE, 0);
    assert_int_equal(e.arbitration_lost, 1);
    assert_int_equal(e.unacknowledged, 2);
    assert_int_equal(e.state, CANBUS_READY);
    assert_int_equal(canbus_errors_mask(), LOST_ARBITRATION | CONTROLLER |
                                               NO_ACKNOWLEDGE | BUS_OFF | RESTARTED);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_controller_goes_through_warning_and_passive_and_recovers),
        cmocka_unit_test(the_worse_of_sending_and_receiving_counts),
        cmocka_unit_test(a_full_buffer_of_the_controller_is_no_state),
        cmocka_unit_test(bus_off_lasts_until_the_restart),
        cmocka_unit_test(a_controller_that_works_again_is_not_off),
        cmocka_unit_test(what_is_counted_is_what_the_socket_lets_in),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
