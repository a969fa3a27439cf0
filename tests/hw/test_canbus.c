/* SPDX-License-Identifier: MIT */
/* hal/canbus on interfaces of a real kernel. */
#include "candump.h"

#include <errno.h>

#include "hal/canbus.h"
#include "hal/clock.h"
#include "tests/hal/canbus_count.h"

static struct canbus *open_bus(const char *uri)
{
    struct error why = {""};
    struct canbus *b;

    if (canbus_open(&b, uri, &why))
        fail_msg("%s", why.text);
    return b;
}

static int64_t now(void)
{
    return clock_now_ns(clock_system());
}

static struct canbus_status look(struct canbus *b)
{
    struct canbus_status status;

    canbus_poll(b, now(), &status);
    return status;
}

/* Looks until the bus is in the state. */
static struct canbus_status wait_for(struct canbus *b, enum canbus_state state)
{
    const struct clock_source *clock = clock_system();
    int64_t end = now() + DEADLINE_MS * 1000000LL;
    struct canbus_status s = look(b);

    while (s.state != state) {
        if (now() > end)
            fail_msg("state %d after %d ms: %s", s.state, DEADLINE_MS, s.text);
        clock->sleep_until_ns(clock->state, now() + 1000000);
        s = look(b);
    }
    return s;
}

static int send(struct canbus *b, uint32_t id)
{
    return canbus_send(b, &(struct can_frame_data){.id = id, .size = 1, .data = {0x5a}},
                       now());
}

/* Classic and FD, with short and long identifiers, at the other end of a cable.  The 5
 * after ## is the second bit rate (1), and the kernel's own mark of an FD frame (4). */
static void frames_arrive_as_they_were_sent(void **state)
{
    static const struct {
        struct can_frame_data frame;
        const char *line;
    } cases[] = {
        {{.id = 0x404, .size = 8, .data = {0, 0x11, 0x22, 0x33, 0xaa, 0xbb, 0xcc, 0xff}},
         "404#00112233AABBCCFF"},
        {{.id = 7}, "007#"},
        {{.id = 0x18fee900, .size = 1, .data = {0x5a}}, "18FEE900#5A"},
        {{.id = 0x123, .size = 9, .fd = true, .data = {1, 2, 3, 4, 5, 6, 7, 8, 9}},
         "123##5010203040506070809000000"},
        {{.id = 0x1ffffffe, .fd = true}, "1FFFFFFE##5"},
    };
    struct canbus *b = open_bus("socketcan:vxcan0");
    struct candump dump;

    (void)state;
    candump_start(&dump, "vxcan1");
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        assert_int_equal(canbus_send(b, &cases[i].frame, now()), 0);
        assert_string_equal(candump_read(&dump), cases[i].line);
    }
    assert_int_equal(look(b).pending, 0);
    assert_int_equal(canbus_count(b, "frames_sent"), 5);
    assert_int_equal(canbus_count(b, "frames_confirmed"), 5);
    candump_stop(&dump);
    canbus_close(b);
}

static void a_classic_interface_takes_no_fd_frame(void **state)
{
    const struct can_frame_data frame = {.id = 1, .size = 12, .fd = true};

    (void)state;
    run("ip link add vcan1 type vcan && ip link set vcan1 mtu 16 up");
    struct canbus *b = open_bus("socketcan:vcan1");
    assert_int_equal(canbus_send(b, &frame, now()), -EOPNOTSUPP);
    assert_int_equal(send(b, 1), 0);
    canbus_close(b);
    run("ip link del vcan1");
}

static void of_others_only_frames_with_our_identifiers_come_in(void **state)
{
    struct canbus *b = open_bus("socketcan:vcan0");

    (void)state;
    send(b, 0x402);
    run("cansend vcan0 403#00 && cansend vcan0 402#00 && cansend vcan0 00000402#00");
    assert_int_equal(look(b).pending, 0);
    assert_int_equal(canbus_count(b, "frames_confirmed"), 1);
    assert_int_equal(canbus_count(b, "foreign_frames"), 1);
    canbus_close(b);
}

static void error_frames_come_in(void **state)
{
    struct canbus *b = open_bus("socketcan:vcan0");

    (void)state;
    run("cansend vcan0 20000004#0008000000000000");
    assert_int_equal(look(b).state, CANBUS_WARNING);
    run("cansend vcan0 20000004#0020000000000000");
    assert_int_equal(look(b).state, CANBUS_PASSIVE);
    run("cansend vcan0 20000002#0000000000000000");
    run("cansend vcan0 20000040#0000000000000000");
    assert_int_equal(look(b).state, CANBUS_OFF);
    run("cansend vcan0 20000100#0000000000000000");
    assert_int_equal(look(b).state, CANBUS_READY);
    assert_int_equal(canbus_count(b, "error_warning"), 1);
    assert_int_equal(canbus_count(b, "error_passive"), 1);
    assert_int_equal(canbus_count(b, "arbitration_lost"), 1);
    assert_int_equal(canbus_count(b, "bus_off"), 1);
    assert_int_equal(canbus_count(b, "restarts"), 1);
    canbus_close(b);
}

static void an_interface_goes_down_and_up(void **state)
{
    struct canbus *b = open_bus("socketcan:vcan0");

    (void)state;
    run("ip link set vcan0 down");
    assert_int_equal(look(b).state, CANBUS_DOWN);
    assert_int_equal(send(b, 1), -ENETDOWN);
    run("ip link set vcan0 up");
    wait_for(b, CANBUS_READY);
    assert_int_equal(send(b, 1), 0);
    assert_int_equal(look(b).pending, 0);
    run("ip link set vcan0 down && ip link set vcan0 up"); /* between two looks */
    wait_for(b, CANBUS_READY);
    assert_int_equal(canbus_count(b, "link_down"), 2);
    assert_int_equal(canbus_count(b, "reopened"), 0);
    canbus_close(b);
}

static void an_interface_is_deleted_and_made_again(void **state)
{
    struct canbus *b = open_bus("socketcan:vcan0");

    (void)state;
    send(b, 1);
    run("ip link del vcan0");
    assert_int_equal(look(b).state, CANBUS_GONE);
    assert_int_equal(send(b, 1), -ENETDOWN);
    run("ip link add vcan0 type vcan");
    wait_for(b, CANBUS_DOWN);
    run("ip link set vcan0 mtu 72 up");
    wait_for(b, CANBUS_READY);
    assert_int_equal(send(b, 1), 0);
    assert_int_equal(look(b).pending, 0);
    assert_int_equal(canbus_count(b, "reopened"), 1);
    assert_int_equal(canbus_count(b, "frames_confirmed"), 2);
    canbus_close(b);
}

/* As a controller that was in bus-off before anybody listened. */
static void an_interface_without_carrier_is_off_until_a_frame_goes_through(void **state)
{
    (void)state;
    run("ip link set vxcan1 down");
    struct canbus *b = open_bus("socketcan:vxcan0");
    assert_int_equal(look(b).state, CANBUS_OFF);
    run("ip link set vxcan1 up");
    assert_int_equal(send(b, 1), 0);
    wait_for(b, CANBUS_READY);
    canbus_close(b);
}

static void loopback_is_no_can_interface(void **state)
{
    struct error why = {""};
    struct canbus *b;

    (void)state;
    assert_int_equal(canbus_open(&b, "socketcan:lo", &why), -ENODEV);
    assert_non_null(strstr(why.text, "lo is no CAN interface"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_arrive_as_they_were_sent),
        cmocka_unit_test(a_classic_interface_takes_no_fd_frame),
        cmocka_unit_test(of_others_only_frames_with_our_identifiers_come_in),
        cmocka_unit_test(error_frames_come_in),
        cmocka_unit_test(an_interface_goes_down_and_up),
        cmocka_unit_test(an_interface_is_deleted_and_made_again),
        cmocka_unit_test(an_interface_without_carrier_is_off_until_a_frame_goes_through),
        cmocka_unit_test(loopback_is_no_can_interface),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
