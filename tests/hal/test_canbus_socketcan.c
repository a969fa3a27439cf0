/* SPDX-License-Identifier: MIT */
/* The kernel is one of the test's own: one interface, and what it does to a socket. */
#include <errno.h>
#include <fcntl.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "hal/can/socket.h"
#include "hal/canbus.h"
#include "tests/hal/canbus_count.h"

#define MS 1000000LL

enum { NO_ACKNOWLEDGE = 0x20000020, BUS_OFF = 0x20000040, RESTARTED = 0x20000100 };

static struct {
    bool there, up, carrier, can_fd;
    int socket_error; /* told by the next call, once */
    int send_result;
    int opens, free_descriptor;
    uint32_t ids[CAN_SOCKET_MAX_IDS];
    size_t n_ids, n_sent, first, n_events;
    struct can_event events[200];
} kernel;

int can_socket_open(int *fd, const char *interface, uint32_t error_mask,
                    struct error *why)
{
    kernel.opens++;
    assert_string_equal(interface, "can0");
    assert_true(error_mask & 0x40);
    if (!kernel.there)
        return error_say(why, -ENODEV, "no can0");
    kernel.n_ids = 0;
    kernel.first = kernel.n_events = 0;
    *fd = open("/dev/null", O_RDONLY | O_CLOEXEC);
    return 0;
}

int can_socket_filter(int fd, const uint32_t *ids, size_t n)
{
    assert_true(fcntl(fd, F_GETFD) >= 0);
    memcpy(kernel.ids, ids, n * sizeof *ids);
    kernel.n_ids = n;
    return 0;
}

int can_socket_link(int fd, const char *interface, struct can_link *out)
{
    assert_true(fcntl(fd, F_GETFD) >= 0);
    (void)interface;
    *out = (struct can_link){
        .up = kernel.up, .carrier = kernel.carrier, .can_fd = kernel.can_fd};
    return kernel.there ? 0 : -ENODEV;
}

static int pop_error(void)
{
    int err = kernel.socket_error;

    kernel.socket_error = 0;
    return err;
}

int can_socket_send(int fd, const struct can_frame_data *f)
{
    int err = pop_error();

    (void)f;
    assert_true(fcntl(fd, F_GETFD) >= 0);
    if (!err)
        err = !kernel.there ? -ENXIO : !kernel.up ? -ENETDOWN : kernel.send_result;
    kernel.n_sent += !err;
    return err;
}

int can_socket_receive(int fd, struct can_event *out)
{
    int err = pop_error();

    assert_true(fcntl(fd, F_GETFD) >= 0);
    if (err)
        return err;
    if (kernel.first == kernel.n_events)
        return -EAGAIN;
    *out = kernel.events[kernel.first++];
    return 0;
}

static void happens(enum can_event_kind kind, uint32_t id)
{
    kernel.events[kernel.n_events++] = (struct can_event){.kind = kind, .id = id};
}

static void goes_down(void)
{
    kernel.up = false;
    kernel.socket_error = -ENETDOWN;
}

static void goes_away(void)
{
    kernel.up = kernel.there = false;
    kernel.socket_error = -ENODEV;
}

/* The lowest that is free: the same before and after when nothing is left open. */
static int free_descriptor(void)
{
    int fd = open("/dev/null", O_RDONLY | O_CLOEXEC);

    close(fd);
    return fd;
}

static int setup(void **state)
{
    struct canbus *b;

    memset(&kernel, 0, sizeof kernel);
    kernel.there = kernel.up = kernel.carrier = true;
    kernel.free_descriptor = free_descriptor();
    if (canbus_open(&b, "socketcan:can0", NULL))
        return -1;
    *state = b;
    return 0;
}

static int teardown(void **state)
{
    canbus_close(*state);
    return free_descriptor() - kernel.free_descriptor;
}

static int send(struct canbus *b, uint32_t id, int64_t ms)
{
    return canbus_send(b, &(struct can_frame_data){.id = id, .size = 2}, ms * MS);
}

static struct canbus_status look(struct canbus *b, int64_t ms)
{
    struct canbus_status status;

    canbus_poll(b, ms * MS, &status);
    return status;
}

static void frames_are_pending_until_their_echo(void **state)
{
    struct canbus *b = *state;

    for (int i = 0; i < 3; i++)
        assert_int_equal(send(b, 0x400, 0), 0);
    happens(CAN_EVENT_ECHO, 0x400);
    happens(CAN_EVENT_FOREIGN, 0x400);
    happens(CAN_EVENT_ECHO, 0x400);
    assert_int_equal(look(b, 1).pending, 1);
    assert_int_equal(canbus_count(b, "frames_sent"), 3);
    assert_int_equal(canbus_count(b, "frames_confirmed"), 2);
    assert_int_equal(canbus_count(b, "foreign_frames"), 1);
}

static void only_what_is_sent_is_let_in(void **state)
{
    struct canbus *b = *state;

    send(b, 0x402, 0);
    send(b, 0x18fee900, 0);
    send(b, 0x402, 0);
    assert_int_equal(kernel.n_ids, 2);
    assert_int_equal(kernel.ids[0], 0x402);
    assert_int_equal(kernel.ids[1], 0x18fee900);
    for (uint32_t id = 1; id <= 14; id++)
        assert_int_equal(send(b, id, 0), 0);
    assert_int_equal(send(b, 15, 0), -EINVAL);
    assert_int_equal(kernel.n_sent, 17);
}

static void comes(uint32_t id, uint8_t byte)
{
    kernel.events[kernel.n_events++] = (struct can_event){
        .kind = CAN_EVENT_FOREIGN,
        .id = id,
        .frame = {.id = id, .size = 8, .data = {byte}},
    };
}

static void what_is_listened_to_is_let_in_beside_what_is_sent(void **state)
{
    const uint32_t inputs[] = {0x40c, 0x40d};
    struct canbus *b = *state;

    assert_int_equal(canbus_listen(b, inputs, 2), 0);
    send(b, 0x402, 0);
    assert_int_equal(kernel.n_ids, 3);
    assert_int_equal(kernel.ids[0], 0x40c);
    assert_int_equal(kernel.ids[1], 0x40d);
    assert_int_equal(kernel.ids[2], 0x402);
    for (uint32_t id = 1; id <= 15; id++)
        assert_int_equal(send(b, id, 0), 0);
    assert_int_equal(kernel.n_ids, 18);
}

/* Neither echoes nor what somebody else sends under our identifiers. */
static void only_frames_that_are_listened_to_are_received(void **state)
{
    const uint32_t inputs[] = {0x40c, 0x40d};
    struct canbus *b = *state;
    struct can_frame_data f;

    canbus_listen(b, inputs, 2);
    send(b, 0x402, 0);
    comes(0x40c, 1);
    happens(CAN_EVENT_ECHO, 0x402);
    comes(0x402, 2);
    comes(0x40d, 3);
    assert_int_equal(canbus_receive(b, &f, 0, NULL), 0);
    assert_int_equal(f.id, 0x40c);
    assert_int_equal(f.size, 8);
    assert_int_equal(f.data[0], 1);
    assert_int_equal(canbus_receive(b, &f, 0, NULL), 0);
    assert_int_equal(f.data[0], 3);
    assert_int_equal(canbus_receive(b, &f, 0, NULL), -EAGAIN);
    assert_int_equal(canbus_count(b, "inputs"), 2);
    assert_int_equal(canbus_count(b, "foreign_frames"), 1);
    assert_int_equal(canbus_count(b, "frames_confirmed"), 1);
}

static void a_frame_that_waited_came_before(void **state)
{
    const uint32_t inputs[] = {0x40c};
    struct canbus *b = *state;
    struct can_frame_data f;
    int64_t came_ns;

    canbus_listen(b, inputs, 1);
    comes(0x40c, 1);
    kernel.events[kernel.n_events - 1].held_ns = 120 * MS;
    comes(0x40c, 2);
    look(b, 500); /* takes them in */
    assert_int_equal(canbus_receive(b, &f, 510 * MS, &came_ns), 0);
    assert_int_equal(came_ns, 380 * MS);
    assert_int_equal(canbus_receive(b, &f, 510 * MS, &came_ns), 0);
    assert_int_equal(came_ns, 500 * MS);
}

/* The node was stopped, or the wall clock was set forward; one from the future, after it
 * was set back, has come now. */
static void a_frame_that_waited_for_long_does_not_look_new(void **state)
{
    static const int64_t held_ms[] = {1000, 1001, 3600000, -1, -3600000};
    const uint32_t inputs[] = {0x40c};
    struct canbus *b = *state;
    struct can_frame_data f;
    int64_t came_ns;

    canbus_listen(b, inputs, 1);
    for (size_t i = 0; i < 5; i++) {
        comes(0x40c, 1);
        kernel.events[kernel.n_events - 1].held_ns = held_ms[i] * MS;
        look(b, 5000);
        assert_int_equal(canbus_receive(b, &f, 5000 * MS, &came_ns), 0);
        assert_int_equal(came_ns, (held_ms[i] > 0 ? 4000 : 5000) * MS);
    }
}

/* canbus_poll takes them in, too, and nobody may ask for long. */
static void inputs_that_nobody_takes_are_dropped_from_the_oldest_on(void **state)
{
    const uint32_t inputs[] = {0x40c};
    struct canbus *b = *state;
    struct can_frame_data f;

    canbus_listen(b, inputs, 1);
    for (uint8_t i = 0; i < 70; i++)
        comes(0x40c, i);
    look(b, 1);
    assert_int_equal(canbus_receive(b, &f, 2 * MS, NULL), 0);
    assert_int_equal(f.data[0], 6);
    assert_int_equal(canbus_count(b, "inputs_dropped"), 6);
}

static void an_interface_that_comes_back_is_listened_to_again(void **state)
{
    const uint32_t inputs[] = {0x40c};
    struct canbus *b = *state;
    struct can_frame_data f;

    canbus_listen(b, inputs, 1);
    assert_true(canbus_fd(b) >= 0);
    goes_away();
    look(b, 1);
    assert_int_equal(canbus_fd(b), -1);
    assert_int_equal(canbus_receive(b, &f, 2 * MS, NULL), -EAGAIN);
    kernel.there = kernel.up = true;
    for (int64_t ms = 2; ms < 1000; ms++)
        look(b, ms);
    assert_true(canbus_fd(b) >= 0);
    assert_int_equal(kernel.n_ids, 1);
    comes(0x40c, 9);
    assert_int_equal(canbus_receive(b, &f, 1000 * MS, NULL), 0);
    assert_int_equal(f.data[0], 9);
}

static void a_full_queue_is_counted_and_nothing_is_pending(void **state)
{
    struct canbus *b = *state;

    kernel.send_result = -ENOBUFS;
    assert_int_equal(send(b, 1, 0), -ENOBUFS);
    assert_int_equal(send(b, 1, 0), -ENOBUFS);
    assert_int_equal(look(b, 0).pending, 0);
    assert_int_equal(look(b, 0).state, CANBUS_READY);
    assert_int_equal(canbus_count(b, "no_buffer"), 2);
    assert_int_equal(canbus_count(b, "frames_sent"), 0);
}

static void an_fd_frame_needs_an_interface_for_it(void **state)
{
    const struct can_frame_data frame = {.id = 1, .size = 12, .fd = true};
    struct canbus *b = *state;

    assert_int_equal(canbus_send(b, &frame, 0), -EOPNOTSUPP);
    goes_away();
    look(b, 0);
    kernel.there = kernel.up = kernel.can_fd = true;
    look(b, 1000);
    assert_int_equal(canbus_send(b, &frame, 0), 0);
}

static void bus_off_throws_away_what_is_pending(void **state)
{
    struct canbus *b = *state;

    send(b, 1, 0);
    send(b, 1, 0);
    happens(CAN_EVENT_ECHO, 1);
    happens(CAN_EVENT_ERROR, BUS_OFF);
    struct canbus_status s = look(b, 1);
    assert_int_equal(s.state, CANBUS_OFF);
    assert_int_equal(s.pending, 0);
    assert_int_equal(s.outages, 1);
    assert_non_null(strstr(s.text, "can0 is bus-off"));
    assert_non_null(strstr(s.text, "restart-ms"));
    assert_int_equal(canbus_count(b, "frames_unconfirmed"), 1);
    happens(CAN_EVENT_ERROR, RESTARTED);
    s = look(b, 2);
    assert_int_equal(s.state, CANBUS_READY);
    assert_int_equal(s.outages, 1);
    assert_string_equal(s.text, "");
    assert_int_equal(canbus_count(b, "bus_off"), 1);
    assert_int_equal(canbus_count(b, "restarts"), 1);
}

/* Between two looks; and when nothing was pending nothing is lost. */
static void a_short_bus_off_is_seen_by_what_it_cost(void **state)
{
    struct canbus *b = *state;

    happens(CAN_EVENT_ERROR, BUS_OFF);
    happens(CAN_EVENT_ERROR, RESTARTED);
    assert_int_equal(look(b, 1).outages, 0);
    send(b, 1, 2);
    happens(CAN_EVENT_ERROR, BUS_OFF);
    happens(CAN_EVENT_ERROR, RESTARTED);
    struct canbus_status s = look(b, 3);
    assert_int_equal(s.state, CANBUS_READY);
    assert_int_equal(s.outages, 1);
}

static void an_echo_ends_a_bus_off_that_nobody_ended(void **state)
{
    struct canbus *b = *state;

    happens(CAN_EVENT_ERROR, BUS_OFF);
    look(b, 0);
    assert_int_equal(send(b, 1, 1000), 0);
    happens(CAN_EVENT_ECHO, 1);
    assert_int_equal(look(b, 1001).state, CANBUS_READY);
}

static void a_bus_that_confirms_nothing_for_a_second_is_silent(void **state)
{
    struct canbus *b = *state;

    look(b, 0);
    send(b, 1, 5000);
    send(b, 1, 5500);
    happens(CAN_EVENT_ERROR, NO_ACKNOWLEDGE);
    assert_int_equal(look(b, 5999).state, CANBUS_READY);
    struct canbus_status s = look(b, 6000);
    assert_int_equal(s.state, CANBUS_SILENT);
    assert_int_equal(s.pending, 0);
    assert_int_equal(s.outages, 1);
    assert_non_null(strstr(s.text, "acknowledges"));
    assert_int_equal(canbus_count(b, "unacknowledged"), 1);
    happens(CAN_EVENT_ECHO, 1); /* it was only late */
    assert_int_equal(look(b, 7000).state, CANBUS_READY);
    assert_int_equal(canbus_count(b, "frames_unconfirmed"), 1);
    assert_int_equal(canbus_count(b, "frames_confirmed"), 1);
}

/* A slow bus is not a silent one. */
static void each_echo_gives_the_next_one_a_second(void **state)
{
    struct canbus *b = *state;

    send(b, 1, 0);
    send(b, 1, 0);
    happens(CAN_EVENT_ECHO, 1);
    assert_int_equal(look(b, 900).state, CANBUS_READY);
    assert_int_equal(look(b, 1800).state, CANBUS_READY);
    assert_int_equal(look(b, 1900).state, CANBUS_SILENT);
}

static void an_interface_that_goes_down_is_waited_for(void **state)
{
    struct canbus *b = *state;

    send(b, 1, 0);
    goes_down();
    struct canbus_status s = look(b, 1000);
    assert_int_equal(s.state, CANBUS_DOWN);
    assert_int_equal(s.outages, 1);
    assert_non_null(strstr(s.text, "ip link set can0 up"));
    assert_int_equal(send(b, 1, 1000), -ENETDOWN);
    kernel.up = true;
    assert_int_equal(look(b, 1049).state, CANBUS_DOWN);
    assert_int_equal(look(b, 1050).state, CANBUS_READY);
    assert_int_equal(send(b, 1, 1051), 0);
    assert_int_equal(canbus_count(b, "link_down"), 1);
    assert_int_equal(canbus_count(b, "reopened"), 0);
    assert_int_equal(kernel.opens, 1);
}

static void an_interface_that_is_gone_is_opened_by_its_name_again(void **state)
{
    struct canbus *b = *state;

    send(b, 0x400, 0);
    goes_away();
    assert_int_equal(look(b, 0).state, CANBUS_GONE);
    assert_int_equal(send(b, 1, 0), -ENETDOWN);
    kernel.there = true; /* made anew, still down */
    assert_int_equal(look(b, 50).state, CANBUS_DOWN);
    kernel.up = true;
    assert_int_equal(look(b, 1000).state, CANBUS_READY);
    assert_int_equal(kernel.n_ids, 1);
    assert_int_equal(kernel.ids[0], 0x400);
    assert_int_equal(canbus_count(b, "link_down"), 1);
    assert_int_equal(canbus_count(b, "reopened"), 1);
}

static void one_that_stays_away_is_looked_for_ever_less_often(void **state)
{
    struct canbus *b = *state;

    goes_away();
    for (int ms = 0; ms < 10000; ms++)
        assert_int_equal(look(b, ms).state, CANBUS_GONE);
    /* At 50, 150, 350, 750, 1550 ms, and every 800 ms from then on: 5 + 10. */
    assert_int_equal(kernel.opens, 1 + 15);
    kernel.there = kernel.up = true;
    assert_int_equal(look(b, 10800).state, CANBUS_READY);
}

/* Sending sees it before anybody has looked. */
static void what_is_sent_into_nowhere_finds_out(void **state)
{
    struct canbus *b = *state;

    goes_down();
    kernel.socket_error = 0;
    assert_int_equal(send(b, 1, 0), -ENETDOWN);
    assert_int_equal(look(b, 1).state, CANBUS_DOWN);
    kernel.up = true;
    assert_int_equal(look(b, 1000).state, CANBUS_READY);
    goes_away();
    kernel.socket_error = 0;
    assert_int_equal(send(b, 1, 1001), -ENETDOWN);
    assert_int_equal(look(b, 1002).state, CANBUS_GONE);
}

static void an_interface_without_carrier_is_off_from_the_start(void **state)
{
    struct canbus *b = *state;

    goes_down();
    look(b, 0);
    kernel.up = true;
    kernel.carrier = false;
    assert_int_equal(look(b, 50).state, CANBUS_OFF);
    assert_int_equal(canbus_count(b, "bus_off"), 0);
}

static void an_interface_that_is_down_at_the_start_is_waited_for(void **state)
{
    struct canbus *b;

    (void)state;
    kernel.up = false;
    assert_int_equal(canbus_open(&b, "socketcan:can0", NULL), 0);
    assert_int_equal(look(b, 1000).state, CANBUS_DOWN);
    kernel.up = true;
    assert_int_equal(look(b, 1099).state, CANBUS_DOWN);
    assert_int_equal(look(b, 1100).state, CANBUS_READY);
    assert_int_equal(canbus_count(b, "link_down"), 0);
    canbus_close(b);
}

/* The kernel tells of the end before of what was before it. */
static void an_echo_from_before_the_end_still_counts(void **state)
{
    struct canbus *b = *state;

    send(b, 1, 0);
    send(b, 1, 0);
    happens(CAN_EVENT_ECHO, 1);
    goes_away();
    assert_int_equal(look(b, 1).state, CANBUS_GONE);
    assert_int_equal(canbus_count(b, "frames_confirmed"), 1);
    assert_int_equal(canbus_count(b, "frames_unconfirmed"), 1);
}

static void names_that_are_too_long_are_no_interfaces(void **state)
{
    struct error why = {""};
    struct canbus *b;

    (void)state;
    assert_int_equal(canbus_open(&b, "socketcan:can0123456789012", &why), -ENODEV);
    assert_non_null(strstr(why.text, "a name has 15 letters at most"));
    assert_null(b);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(frames_are_pending_until_their_echo),
        TEST(only_what_is_sent_is_let_in),
        TEST(what_is_listened_to_is_let_in_beside_what_is_sent),
        TEST(only_frames_that_are_listened_to_are_received),
        TEST(a_frame_that_waited_came_before),
        TEST(a_frame_that_waited_for_long_does_not_look_new),
        TEST(inputs_that_nobody_takes_are_dropped_from_the_oldest_on),
        TEST(an_interface_that_comes_back_is_listened_to_again),
        TEST(a_full_queue_is_counted_and_nothing_is_pending),
        TEST(an_fd_frame_needs_an_interface_for_it),
        TEST(bus_off_throws_away_what_is_pending),
        TEST(a_short_bus_off_is_seen_by_what_it_cost),
        TEST(an_echo_ends_a_bus_off_that_nobody_ended),
        TEST(a_bus_that_confirms_nothing_for_a_second_is_silent),
        TEST(each_echo_gives_the_next_one_a_second),
        TEST(an_interface_that_goes_down_is_waited_for),
        TEST(an_interface_that_is_gone_is_opened_by_its_name_again),
        TEST(one_that_stays_away_is_looked_for_ever_less_often),
        TEST(what_is_sent_into_nowhere_finds_out),
        TEST(an_interface_without_carrier_is_off_from_the_start),
        TEST(an_interface_that_is_down_at_the_start_is_waited_for),
        TEST(an_echo_from_before_the_end_still_counts),
        TEST(names_that_are_too_long_are_no_interfaces),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
