/* SPDX-License-Identifier: MIT */
/* The bus is one of the test's own: it takes as many frames as there is room for, and
 * confirms them when told to.  A receiver on it does what README.md asks of one. */
#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/can/outbox.h"
#include "nodes/can/sender.h"

#define MS 1000000LL

struct canbus {
    size_t room;    /* frames that are taken before it is full */
    bool confirms;  /* at once */
    size_t pending; /* taken, not confirmed */
    int send_result, flush_result;
    enum canbus_state state;
    uint64_t outages;
    struct can_frame_data wire[1000];
    size_t n_wire, flushes;
};

int canbus_send(struct canbus *b, const struct can_frame_data *frame, int64_t stamp_ns)
{
    (void)stamp_ns;
    if (b->send_result)
        return b->send_result;
    if (b->state >= CANBUS_DOWN)
        return -ENETDOWN;
    if (!b->room)
        return -ENOBUFS;
    b->room--;
    b->pending++;
    b->wire[b->n_wire++] = *frame;
    return 0;
}

const char *canbus_uri(const struct canbus *b)
{
    (void)b;
    return "log:out/x.candump";
}

int canbus_flush(struct canbus *b)
{
    b->flushes++;
    return b->flush_result;
}

void canbus_poll(struct canbus *b, int64_t now_ns, struct canbus_status *out)
{
    (void)now_ns;
    if (b->confirms)
        b->pending = 0;
    *out = (struct canbus_status){
        .state = b->state, .pending = b->pending, .outages = b->outages};
    if (b->state)
        strcpy(out->text, "can0 is not well");
}

/* What was pending is thrown away, the queue is free again. */
static void break_off(struct canbus *b, enum canbus_state state)
{
    b->outages += b->pending > 0;
    b->pending = 0;
    b->state = state;
}

struct rig {
    struct canbus bus;
    struct clock_source clock;
    int64_t now_ns;
    struct sender sender;
    struct outbox outbox;
};

static int64_t rig_now(void *state)
{
    return ((const struct rig *)state)->now_ns;
}

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);
    struct sender_config cfg;

    if (!r)
        return -1;
    r->bus.room = SIZE_MAX;
    r->bus.confirms = true;
    r->now_ns = 5000 * MS;
    r->clock = (struct clock_source){.now_ns = rig_now, .state = r};
    sender_config_set(&cfg, NULL);
    sender_init(&r->sender, &cfg);
    outbox_init(&r->outbox, &r->bus, &r->clock, &r->sender);
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    free(*state);
    return 0;
}

static void step(struct rig *r, int64_t ms)
{
    r->now_ns += ms * MS;
    outbox_step(&r->outbox);
}

/* A list of n objects. */
static void put(struct rig *r, unsigned counter, size_t n)
{
    Anlos__DetectionList message = ANLOS__DETECTION_LIST__INIT;
    Anlos__Detection detections[CAN_MAX_OBJECTS], *pointers[CAN_MAX_OBJECTS];
    struct sender_list list;

    for (size_t i = 0; i < n; i++) {
        anlos__detection__init(&detections[i]);
        detections[i].id = (uint32_t)i;
        pointers[i] = &detections[i];
    }
    message.counter = counter;
    message.detections = pointers;
    message.n_detections = n;
    sender_list(&r->sender, &message, 4000 * MS, &list);
    outbox_put_list(&r->outbox, &list);
}

static void put_status(struct rig *r, uint16_t faults)
{
    struct can_frame_data frame;

    r->sender.status.faults = faults;
    sender_status(&r->sender, &frame);
    outbox_put_cyclic(&r->outbox, OUTBOX_STATUS, &frame);
}

/* The counters of the lists that came whole, as "1 2 3 ".  Signals as in anlos.dbc. */
static const char *received(const struct canbus *b)
{
    static char text[200];
    size_t missing = 0;
    unsigned counter = 0;

    text[0] = '\0';
    for (size_t i = 0; i < b->n_wire; i++) {
        const struct can_frame_data *f = &b->wire[i];
        if (f->id == 0x400)
            continue;
        if (f->id == 0x402) {
            missing = 1 + 3 * (size_t)(f->data[2] & 0x3f);
            counter = f->data[3] | (f->data[4] & 0xfu) << 8;
        } else if (missing && (f->id == 0x403 || (f->data[3] & 0xf) == (counter & 0xf))) {
            if (--missing == 0)
                sprintf(text + strlen(text), "%u ", counter);
        }
    }
    return text;
}

/* Of a header; as in anlos.dbc. */
static unsigned latency_ms(const struct can_frame_data *f)
{
    return f->data[4] >> 4 | f->data[5] << 4;
}

static unsigned cycle_ms(const struct can_frame_data *f)
{
    return 10 * (f->data[6] | (f->data[7] & 0xfu) << 8);
}

static size_t count_frames(const struct canbus *b, uint32_t id)
{
    size_t n = 0;

    for (size_t i = 0; i < b->n_wire; i++)
        n += b->wire[i].id == id;
    return n;
}

static uint64_t count_of(const struct rig *r, const char *name)
{
    struct device_count counts[OUTBOX_COUNTS];

    outbox_counts(&r->outbox, counts);
    for (size_t i = 0; i < OUTBOX_COUNTS; i++)
        if (!strcmp(counts[i].name, name))
            return counts[i].value;
    fail_msg("nothing counts %s", name);
    return 0;
}

/* However long it waits for the bus. */
static void a_list_of_a_replay_is_dated_by_its_stamp(void **state)
{
    struct rig *r = *state;
    Anlos__DetectionList message = ANLOS__DETECTION_LIST__INIT;
    struct sender_list list;

    for (int i = 0; i < 2; i++) {
        sender_list(&r->sender, &message, 1000 * MS, &list);
        list.dated_ns = (1250 + 100 * i) * MS;
        outbox_put_list(&r->outbox, &list);
    }
    step(r, 70000);
    assert_int_equal(count_frames(&r->bus, 0x402), 2);
    assert_int_equal(latency_ms(&r->bus.wire[0]), 250);
    assert_int_equal(latency_ms(&r->bus.wire[2]), 350);
    assert_int_equal(cycle_ms(&r->bus.wire[2]), 100);
}

static void lists_and_status_go_at_once_when_the_bus_takes_them(void **state)
{
    struct rig *r = *state;
    char text[256];

    put_status(r, 0);
    put(r, 1, 2);
    put(r, 2, 32);
    step(r, 0);
    assert_string_equal(received(&r->bus), "1 2 ");
    assert_int_equal(r->bus.n_wire, 1 + 8 + 98);
    assert_int_equal(r->bus.flushes, 3);
    assert_int_equal(count_of(r, "lists_sent"), 2);
    assert_true(outbox_well(&r->outbox, text, sizeof text));
    assert_false(outbox_busy(&r->outbox));
}

static void a_full_bus_gets_the_frames_in_order_as_it_takes_them(void **state)
{
    struct rig *r = *state;

    r->bus.room = 0;
    put(r, 1, 32);
    put(r, 2, 1);
    for (int i = 0; i < 60 && outbox_wait_ms(&r->outbox) < 20; i++) {
        step(r, 1);
        r->bus.room = 3;
    }
    assert_string_equal(received(&r->bus), "1 2 ");
    assert_int_equal(r->bus.n_wire, 98 + 5); /* nothing twice */
}

static void tries_become_rare_and_frequent_again_when_frames_go(void **state)
{
    struct rig *r = *state;

    r->bus.room = 1;
    put(r, 1, 1);
    step(r, 1);
    assert_int_equal(outbox_wait_ms(&r->outbox), 1);
    for (unsigned ms = 2; ms <= 16; ms *= 2) {
        step(r, 1);
        assert_int_equal(outbox_wait_ms(&r->outbox), ms);
    }
    step(r, 1);
    assert_int_equal(outbox_wait_ms(&r->outbox), 16);
    r->bus.room = 1;
    step(r, 1);
    assert_int_equal(outbox_wait_ms(&r->outbox), 1);
}

static void the_oldest_list_that_is_not_on_its_way_is_dropped_whole(void **state)
{
    struct rig *r = *state;
    char text[256];

    r->bus.room = 5;
    for (unsigned i = 1; i <= 7; i++) {
        put(r, i, 2);
        step(r, 1);
    }
    r->bus.room = SIZE_MAX;
    step(r, 1);
    assert_string_equal(received(&r->bus), "1 5 6 7 ");
    assert_int_equal(r->bus.n_wire, 4 * 8);
    assert_int_equal(count_of(r, "lists_dropped"), 3);
    assert_int_equal(count_of(r, "lists_cut"), 0);
    assert_false(outbox_well(&r->outbox, text, sizeof text));
    assert_string_equal(text, "lists come faster than the bus takes them: 3 dropped");
    step(r, 6000);
    assert_true(outbox_well(&r->outbox, text, sizeof text));
}

static void a_list_without_the_objects_that_did_not_fit_is_counted(void **state)
{
    struct rig *r = *state;

    r->bus.room = SIZE_MAX;
    put(r, 1, 2);
    step(r, 1);
    assert_int_equal(count_of(r, "lists_truncated"), 0);
    r->sender.cfg.bus.load = 0.001; /* not even that of the status */
    put(r, 2, 2);
    step(r, 1);
    assert_int_equal(count_of(r, "lists_sent"), 2);
    assert_int_equal(count_of(r, "lists_truncated"), 1);
}

static void of_status_frames_only_the_newest_waits(void **state)
{
    struct rig *r = *state;

    r->bus.room = 0;
    for (uint16_t i = 1; i <= 3; i++) {
        put_status(r, i);
        step(r, 100);
    }
    r->bus.room = SIZE_MAX;
    step(r, 1);
    assert_int_equal(r->bus.n_wire, 1);
    assert_int_equal(r->bus.wire[0].data[3], 3); /* Faults */
}

static void a_status_frame_does_not_wait_for_a_long_list(void **state)
{
    struct rig *r = *state;

    r->bus.room = 10;
    put(r, 1, 32);
    step(r, 1);
    put_status(r, 0);
    r->bus.room = 10;
    step(r, 1);
    assert_int_equal(r->bus.wire[10].id, 0x400);
    r->bus.room = SIZE_MAX;
    step(r, 1);
    assert_string_equal(received(&r->bus), "1 ");
}

static void a_list_begins_when_the_one_before_is_confirmed(void **state)
{
    struct rig *r = *state;

    r->bus.confirms = false;
    put(r, 1, 1);
    put(r, 2, 1);
    step(r, 1);
    put_status(r, 0);
    step(r, 1);
    assert_int_equal(r->bus.n_wire, 5);
    assert_int_equal(count_of(r, "lists_sent"), 0);
    r->bus.pending = 0;
    step(r, 1);
    assert_int_equal(count_of(r, "lists_sent"), 1);
    r->bus.pending = 0;
    step(r, 1);
    assert_string_equal(received(&r->bus), "1 2 ");
}

static void a_list_that_was_broken_off_is_sent_again_from_its_header(void **state)
{
    struct rig *r = *state;

    r->bus.confirms = false;
    r->bus.room = 6;
    put(r, 1, 2);
    step(r, 1);
    break_off(&r->bus, CANBUS_OFF);
    put(r, 2, 0);
    step(r, 100);
    assert_int_equal(r->bus.n_wire, 6);
    r->bus.state = CANBUS_READY;
    r->bus.confirms = true;
    r->bus.room = SIZE_MAX;
    step(r, 100);
    assert_int_equal(r->bus.n_wire, 6 + 8 + 2);
    assert_string_equal(received(&r->bus), "1 2 ");
    assert_int_equal(latency_ms(&r->bus.wire[0]), 5001 - 4000);
    assert_int_equal(latency_ms(&r->bus.wire[6]), 5201 - 4000);
    assert_int_equal(count_of(r, "lists_sent"), 2);
}

/* Only a whole list tells. */
static void objects_are_known_to_the_vehicle_when_their_list_is_confirmed(void **state)
{
    struct rig *r = *state;

    r->bus.confirms = false;
    put(r, 1, 2);
    step(r, 1);
    assert_int_equal(r->bus.n_wire, 8);
    assert_false(r->sender.told[0] || r->sender.told[1]);
    break_off(&r->bus, CANBUS_OFF);
    step(r, 100);
    assert_false(r->sender.told[0] || r->sender.told[1]);
    r->bus.state = CANBUS_READY;
    r->bus.confirms = true;
    step(r, 100);
    assert_int_equal(r->bus.n_wire, 8 + 8);
    assert_true(r->sender.told[0] && r->sender.told[1] && !r->sender.told[2]);
}

static void so_is_one_of_which_all_that_went_out_was_confirmed(void **state)
{
    struct rig *r = *state;

    r->bus.room = 6;
    put(r, 1, 2);
    step(r, 1);
    r->bus.state = CANBUS_DOWN; /* nothing was pending: nothing was thrown away */
    step(r, 100);
    r->bus.state = CANBUS_READY;
    r->bus.room = SIZE_MAX;
    step(r, 100);
    assert_int_equal(r->bus.n_wire, 6 + 8);
    assert_string_equal(received(&r->bus), "1 ");
}

static void the_cycle_is_from_the_list_that_was_finished_before(void **state)
{
    struct rig *r = *state;

    put(r, 1, 0);
    step(r, 0);
    put(r, 2, 0);
    step(r, 250);
    r->bus.confirms = false;
    put(r, 3, 0);
    step(r, 100);
    break_off(&r->bus, CANBUS_READY);
    step(r, 300);
    assert_int_equal(r->bus.n_wire, 8);
    assert_int_equal(cycle_ms(&r->bus.wire[0]), 40950); /* NotAvailable */
    assert_int_equal(cycle_ms(&r->bus.wire[2]), 250);
    assert_int_equal(cycle_ms(&r->bus.wire[4]), 100);
    assert_int_equal(cycle_ms(&r->bus.wire[6]), 400);
}

/* All frames were taken, but not all came to the bus. */
static void a_list_that_was_thrown_away_unconfirmed_is_sent_again(void **state)
{
    struct rig *r = *state;

    r->bus.confirms = false;
    put(r, 1, 1);
    step(r, 1);
    r->bus.pending = 2;
    break_off(&r->bus, CANBUS_READY); /* down and up between two looks */
    r->bus.confirms = true;
    step(r, 1);
    assert_int_equal(r->bus.n_wire, 10);
    assert_int_equal(count_of(r, "lists_sent"), 1);
}

static void a_list_that_is_confirmed_is_not_sent_again(void **state)
{
    struct rig *r = *state;

    r->bus.confirms = false;
    put(r, 1, 1);
    step(r, 1);
    r->bus.pending = 0;
    break_off(&r->bus, CANBUS_OFF);
    step(r, 1);
    r->bus.state = CANBUS_READY;
    step(r, 1);
    assert_int_equal(r->bus.n_wire, 5);
}

static void a_list_that_was_cut_and_then_dropped_is_counted_as_such(void **state)
{
    struct rig *r = *state;

    r->bus.confirms = false;
    r->bus.room = 4;
    put(r, 1, 2);
    step(r, 1);
    break_off(&r->bus, CANBUS_GONE);
    for (unsigned i = 2; i <= 6; i++) {
        put(r, i, 1);
        step(r, 1);
    }
    r->bus.state = CANBUS_READY;
    r->bus.confirms = true;
    r->bus.room = SIZE_MAX;
    step(r, 1);
    assert_string_equal(received(&r->bus), "3 4 5 6 ");
    assert_int_equal(count_of(r, "lists_dropped"), 2);
    assert_int_equal(count_of(r, "lists_cut"), 1);
}

/* Its id may come again before the next list gets through. */
static void what_ended_in_lists_that_were_dropped_is_not_known_any_more(void **state)
{
    struct rig *r = *state;

    r->sender.told[0] = r->sender.told[3] = true;
    break_off(&r->bus, CANBUS_GONE);
    for (unsigned i = 1; i <= OUTBOX_LISTS; i++)
        put(r, i, 1);
    assert_true(r->sender.told[0] && r->sender.told[3]);
    put(r, OUTBOX_LISTS + 1, 1);
    assert_true(r->sender.told[0] && !r->sender.told[3]);
}

/* Of a header and of an ObjectState frame; as in anlos.dbc. */
static unsigned number(const struct can_frame_data *f)
{
    return f->data[2] & 0x3f;
}

static unsigned measurement(const struct can_frame_data *f)
{
    return f->data[3] >> 4 & 3;
}

/* The bus trickles, and the sensor becomes faulty. */
static void objects_that_must_not_be_sent_any_more_end_a_list_on_its_way(void **state)
{
    struct rig *r = *state;

    r->bus.room = 6;
    put(r, 1, 2);
    step(r, 1);
    sender_let_objects(&r->sender, false);
    put_status(r, 1);
    r->bus.room = SIZE_MAX;
    step(r, 1);
    assert_int_equal(r->bus.n_wire, 6 + 1 + 2);
    assert_int_equal(r->bus.wire[6].id, 0x400);
    assert_int_equal(r->bus.wire[7].id, 0x402);
    assert_int_equal(number(&r->bus.wire[7]), 0);
    assert_string_equal(received(&r->bus), "1 ");
    assert_int_equal(count_of(r, "lists_sent"), 1);
}

/* Their sound is 1001 ms old at first. */
static void objects_that_grow_old_on_their_way_are_not_sent_as_measured(void **state)
{
    struct rig *r = *state;

    r->sender.cfg.stale_ns = 1010 * MS;
    r->bus.room = 6;
    put(r, 1, 2);
    step(r, 1);
    assert_int_equal(measurement(&r->bus.wire[2]), CAN_NEW);
    r->bus.room = 1;
    step(r, 9);
    assert_int_equal(r->bus.n_wire, 7); /* it is just young enough */
    for (int i = 0; i < 8; i++) {
        r->bus.room = 1;
        step(r, 100);
    }
    assert_int_equal(r->bus.n_wire, 7 + 8); /* again from its header, once */
    assert_int_equal(r->bus.wire[7].id, 0x402);
    assert_int_equal(number(&r->bus.wire[7]), 2);
    assert_int_equal(latency_ms(&r->bus.wire[7]), 1110);
    assert_int_equal(measurement(&r->bus.wire[9]), CAN_PREDICTED);
    assert_int_equal(measurement(&r->bus.wire[12]), CAN_PREDICTED);
    assert_string_equal(received(&r->bus), "1 ");
}

static void a_bus_that_is_down_is_left_alone(void **state)
{
    struct rig *r = *state;
    char text[256];

    r->bus.state = CANBUS_DOWN;
    for (uint16_t i = 0; i < 50; i++) {
        put_status(r, i);
        step(r, 100);
    }
    assert_int_equal(r->bus.n_wire, 0);
    assert_int_equal(outbox_wait_ms(&r->outbox), 20);
    assert_false(outbox_well(&r->outbox, text, sizeof text));
    assert_string_equal(text, "can0 is not well");
}

/* The E2E counters are the low halves of the second bytes, 0 to 14 in turn for each
 * identifier: a frame that was sent again has a new one, one that the bus did not take
 * has none. */
static void every_frame_that_goes_out_counts_once(void **state)
{
    struct rig *r = *state;
    uint8_t next[0x10] = {0};

    r->bus.confirms = false;
    r->bus.room = 5;
    put_status(r, 0);
    put(r, 1, 2);
    step(r, 1);
    break_off(&r->bus, CANBUS_OFF);
    step(r, 100);
    r->bus.state = CANBUS_READY;
    r->bus.confirms = true;
    for (int i = 0; i < 40; i++) {
        r->bus.room = 3;
        put_status(r, 0);
        step(r, 1);
    }
    put(r, 2, 32);
    r->bus.room = SIZE_MAX;
    step(r, 1);
    assert_string_equal(received(&r->bus), "1 2 ");
    assert_true(count_frames(&r->bus, 0x404) > 32);
    for (size_t i = 0; i < r->bus.n_wire; i++) {
        const struct can_frame_data *f = &r->bus.wire[i];
        uint8_t *counter = &next[f->id - 0x400];
        assert_int_equal(f->data[1] & 0xf, *counter);
        *counter = (uint8_t)((*counter + 1) % 15);
    }
}

static void a_diagnosis_goes_beside_the_status(void **state)
{
    struct rig *r = *state;
    struct can_frame_data frame;

    r->bus.room = 4;
    put(r, 1, 2);
    step(r, 1);
    put_status(r, 0);
    sender_diagnosis(&r->sender, &frame);
    outbox_put_cyclic(&r->outbox, OUTBOX_DIAGNOSIS, &frame);
    r->bus.room = SIZE_MAX;
    step(r, 1);
    assert_int_equal(r->bus.wire[4].id, 0x400);
    assert_int_equal(r->bus.wire[5].id, 0x401);
    assert_string_equal(received(&r->bus), "1 ");
}

/* Not every controller says that it was restarted. */
static void a_bus_that_is_off_is_tried_with_a_status_frame_a_second(void **state)
{
    struct rig *r = *state;

    put_status(r, 0);
    step(r, 0);
    r->bus.state = CANBUS_OFF;
    put(r, 1, 0);
    for (uint16_t i = 0; i < 39; i++) {
        put_status(r, i);
        step(r, 100);
    }
    assert_int_equal(r->bus.n_wire, 1 + 3);
    assert_int_equal(count_frames(&r->bus, 0x400), 4);
}

static void an_error_that_is_not_of_the_bus_costs_the_list_and_is_said(void **state)
{
    struct rig *r = *state;
    char text[256];

    r->bus.flush_result = -ENOSPC;
    put(r, 1, 1);
    step(r, 1);
    assert_false(outbox_well(&r->outbox, text, sizeof text));
    assert_string_equal(
        text, "frames did not go out: the log cannot be written, its disk is full: make "
              "room there, or name another log in can.uri (log:out/x.candump)");
    assert_int_equal(count_of(r, "lists_dropped"), 1);
    r->bus.flush_result = 0;
    r->bus.send_result = -EOPNOTSUPP;
    put(r, 2, 1);
    step(r, 1);
    assert_int_equal(count_of(r, "lists_dropped"), 2);
    r->bus.send_result = 0;
    put_status(r, 1); /* which goes */
    step(r, 1);
    assert_false(outbox_well(&r->outbox, text, sizeof text));
    assert_string_equal(text,
                        "lists did not go out: the interface takes no CAN FD frames, "
                        "which can.fd asks for: 2 dropped (log:out/x.candump)");
    put(r, 3, 1);
    step(r, 6000);
    assert_true(outbox_well(&r->outbox, text, sizeof text));
    assert_int_equal(count_of(r, "lists_sent"), 1);
}

static void a_log_that_lacked_room_is_not_whole_though_there_is_room_again(void **state)
{
    struct rig *r = *state;
    char text[256];

    put(r, 1, 1);
    step(r, 1);
    assert_false(outbox_log_lacks(&r->outbox, text, sizeof text));
    r->bus.flush_result = -ENOSPC;
    put(r, 2, 1);
    step(r, 1);
    put_status(r, 1);
    step(r, 1);
    r->bus.flush_result = 0;
    put(r, 3, 1);
    step(r, 6000);
    assert_true(outbox_well(&r->outbox, text, sizeof text));
    assert_true(outbox_log_lacks(&r->outbox, text, sizeof text));
    assert_string_equal(
        text,
        "the log is not whole, 2 lists and frames are missing: the log cannot be "
        "written, its disk is full: make room there, or name another log in can.uri "
        "(log:out/x.candump)");
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_list_of_a_replay_is_dated_by_its_stamp),
        TEST(lists_and_status_go_at_once_when_the_bus_takes_them),
        TEST(a_full_bus_gets_the_frames_in_order_as_it_takes_them),
        TEST(tries_become_rare_and_frequent_again_when_frames_go),
        TEST(the_oldest_list_that_is_not_on_its_way_is_dropped_whole),
        TEST(a_list_without_the_objects_that_did_not_fit_is_counted),
        TEST(of_status_frames_only_the_newest_waits),
        TEST(a_status_frame_does_not_wait_for_a_long_list),
        TEST(a_list_begins_when_the_one_before_is_confirmed),
        TEST(a_list_that_was_broken_off_is_sent_again_from_its_header),
        TEST(objects_are_known_to_the_vehicle_when_their_list_is_confirmed),
        TEST(so_is_one_of_which_all_that_went_out_was_confirmed),
        TEST(the_cycle_is_from_the_list_that_was_finished_before),
        TEST(a_list_that_was_thrown_away_unconfirmed_is_sent_again),
        TEST(a_list_that_is_confirmed_is_not_sent_again),
        TEST(a_list_that_was_cut_and_then_dropped_is_counted_as_such),
        TEST(what_ended_in_lists_that_were_dropped_is_not_known_any_more),
        TEST(objects_that_must_not_be_sent_any_more_end_a_list_on_its_way),
        TEST(objects_that_grow_old_on_their_way_are_not_sent_as_measured),
        TEST(a_bus_that_is_down_is_left_alone),
        TEST(a_bus_that_is_off_is_tried_with_a_status_frame_a_second),
        TEST(every_frame_that_goes_out_counts_once),
        TEST(a_diagnosis_goes_beside_the_status),
        TEST(an_error_that_is_not_of_the_bus_costs_the_list_and_is_said),
        TEST(a_log_that_lacked_room_is_not_whole_though_there_is_room_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
