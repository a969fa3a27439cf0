/* SPDX-License-Identifier: MIT */
#include "nodes/can/outbox.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "nodes/rt/uri.h"

#define PROBE_NS  1000000000LL
#define RECENT_NS 5000000000LL

enum { FIRST_WAIT_MS = 1, LAST_WAIT_MS = 16, IDLE_MS = 20 };

void outbox_init(struct outbox *o, struct canbus *bus, const struct clock_source *clock,
                 struct sender *sender)
{
    *o = (struct outbox){
        .bus = bus, .clock = clock, .sender = sender, .wait_ms = FIRST_WAIT_MS};
}

/* Takes the list out of the queue. */
static void take_out(struct outbox *o, size_t i)
{
    o->n_lists--;
    memmove(&o->lists[i], &o->lists[i + 1], (o->n_lists - i) * sizeof *o->lists);
    if (i == 0) {
        o->next = 0;
        o->cut = false;
    }
}

/* err: what it is dropped for; 0: there are too many. */
static void drop(struct outbox *o, size_t i, int err)
{
    o->dropped++;
    o->cut_off += i == 0 && (o->cut || o->next);
    o->dropped_ns = clock_now_ns(o->clock);
    o->dropped_for = err;
    sender_dropped(o->sender, &o->lists[i]);
    take_out(o, i);
}

void outbox_put_list(struct outbox *o, const struct sender_list *list)
{
    if (o->n_lists == OUTBOX_LISTS)
        drop(o, o->next ? 1 : 0, 0);
    o->lists[o->n_lists++] = *list;
}

void outbox_put_cyclic(struct outbox *o, enum outbox_cyclic kind,
                       const struct can_frame_data *frame)
{
    o->cyclic[kind] = *frame;
    o->waits[kind] = true;
}

static bool is_all_out(const struct outbox *o)
{
    return o->n_lists && o->next && o->next == o->lists[0].n_frames;
}

static bool holds_back(const struct outbox *o)
{
    return o->health.state >= CANBUS_SILENT;
}

/* Is a list on its way of which the rest must not follow what its header said? */
static bool is_outdated(const struct outbox *o)
{
    const struct sender_list *list = &o->lists[0];

    return o->next &&
           !sender_holds(o->sender, list,
                         list->dated_ns ? list->dated_ns : clock_now_ns(o->clock));
}

/* How the bus is, what became of the list on its way. */
static void look(struct outbox *o)
{
    uint64_t outages = o->health.outages;

    canbus_poll(o->bus, clock_now_ns(o->clock), &o->health);
    bool broken = o->health.outages != outages ||
                  ((holds_back(o) || is_outdated(o)) && !is_all_out(o));
    if (broken && o->next) {
        o->next = 0;
        o->cut = true;
    }
    if (is_all_out(o) && !o->health.pending) {
        o->sent++;
        sender_sent(o->sender, &o->lists[0]);
        o->truncated += o->lists[0].truncated;
        o->last_ns = o->begun_ns;
        take_out(o, 0);
    }
}

/* 0, -EAGAIN (the bus does not take it now), or an error that will not go by. */
static int send_frame(struct outbox *o, const struct can_frame_data *frame)
{
    int err = sender_send(o->sender, o->bus, frame, clock_now_ns(o->clock));

    if (err == -ENOBUFS || err == -ENETDOWN)
        return -EAGAIN;
    o->error = err;
    return err;
}

/* err: 0, or one that will not go by. */
static void count_lost(struct outbox *o, int err)
{
    if (!err || err == -EAGAIN)
        return;
    o->lost++;
    o->lost_for = err;
}

static bool send_cyclic(struct outbox *o, enum outbox_cyclic kind)
{
    int err = send_frame(o, &o->cyclic[kind]);

    if (err == -EAGAIN)
        return false;
    if (!err)
        err = o->error = canbus_flush(o->bus);
    count_lost(o, err);
    o->waits[kind] = false;
    return true;
}

/* As many frames of the oldest list as go. */
static bool send_list(struct outbox *o)
{
    struct sender_list *list = &o->lists[0];
    size_t before = o->next;
    int err = 0;

    if (!o->next) {
        o->begun_ns = list->dated_ns ? list->dated_ns : clock_now_ns(o->clock);
        sender_finalize(o->sender, list, o->begun_ns, o->last_ns);
    }
    while (!err && o->next < list->n_frames) {
        err = send_frame(o, &list->frames[o->next]);
        o->next += !err;
    }
    if (!err)
        err = o->error = canbus_flush(o->bus);
    if (err && err != -EAGAIN) {
        count_lost(o, err);
        drop(o, 0, err);
        return true;
    }
    return o->next > before;
}

/* A bus that holds back is tried with a status frame now and then: not every controller
 * says that it was restarted. */
static void probe(struct outbox *o, int64_t now_ns)
{
    bool open = o->health.state == CANBUS_SILENT || o->health.state == CANBUS_OFF;

    if (!open || !o->waits[OUTBOX_STATUS] || now_ns < o->probe_ns)
        return;
    send_cyclic(o, OUTBOX_STATUS);
    o->probe_ns = now_ns + PROBE_NS;
}

/* Returns whether it got on. */
static bool advance(struct outbox *o)
{
    int64_t now = clock_now_ns(o->clock);

    look(o);
    if (holds_back(o)) {
        probe(o, now);
        return false;
    }
    o->probe_ns = now + PROBE_NS;
    bool under_way = o->next && !is_all_out(o);
    for (enum outbox_cyclic k = 0; k < OUTBOX_CYCLIC; k++)
        if (o->waits[k] && (under_way || !o->health.pending))
            return send_cyclic(o, k);
    return o->n_lists && (under_way || (!o->next && !o->health.pending)) && send_list(o);
}

void outbox_step(struct outbox *o)
{
    bool got_on = false;

    while (advance(o))
        got_on = true;
    o->wait_ms = got_on                          ? FIRST_WAIT_MS
                 : o->wait_ms * 2 < LAST_WAIT_MS ? o->wait_ms * 2
                                                 : LAST_WAIT_MS;
}

bool outbox_busy(const struct outbox *o)
{
    return o->n_lists && !holds_back(o);
}

unsigned outbox_wait_ms(const struct outbox *o)
{
    bool waits = o->n_lists || o->waits[OUTBOX_STATUS] || o->waits[OUTBOX_DIAGNOSIS] ||
                 o->health.pending;

    return waits && !holds_back(o) ? o->wait_ms : IDLE_MS;
}

static const char *reason(int err)
{
    return err == -EOPNOTSUPP
               ? "the interface takes no CAN FD frames, which can.fd asks for"
           : err == -ENOSPC
               ? "the log cannot be written, its disk is full: make room there, or name "
                 "another log in can.uri"
               : strerror(-err);
}

bool outbox_well(const struct outbox *o, char *text, size_t size)
{
    if (o->health.state != CANBUS_READY)
        snprintf(text, size, "%s", o->health.text);
    else if (o->error)
        snprintf(text, size, "frames did not go out: %s (%s)", reason(o->error),
                 canbus_uri(o->bus));
    else if (!o->dropped_ns || clock_now_ns(o->clock) - o->dropped_ns >= RECENT_NS)
        return true;
    else if (o->dropped_for)
        snprintf(text, size, "lists did not go out: %s: %llu dropped (%s)",
                 reason(o->dropped_for), (unsigned long long)o->dropped,
                 canbus_uri(o->bus));
    else
        snprintf(text, size, "lists come faster than the bus takes them: %llu dropped",
                 (unsigned long long)o->dropped);
    return false;
}

bool outbox_log_lacks(const struct outbox *o, char *text, size_t size)
{
    if (!o->lost || uri_has_scheme(canbus_uri(o->bus), "socketcan"))
        return false;
    snprintf(text, size,
             "the log is not whole, %llu lists and frames are missing: %s (%s)",
             (unsigned long long)o->lost, reason(o->lost_for), canbus_uri(o->bus));
    return true;
}

void outbox_counts(const struct outbox *o, struct device_count out[OUTBOX_COUNTS])
{
    out[0] = (struct device_count){"lists_sent", o->sent};
    out[1] = (struct device_count){"lists_dropped", o->dropped};
    out[2] = (struct device_count){"lists_cut", o->cut_off};
    out[3] = (struct device_count){"lists_truncated", o->truncated};
}
