/* SPDX-License-Identifier: MIT */
#include "nodes/can/cyclic.h"

#include <string.h>

#define STATUS_PERIOD_NS    100000000LL
#define DIAGNOSIS_PERIOD_NS 1000000000LL
#define EMPTY_PERIOD_NS     250000000LL /* of lists of our own, while none comes */
#define CHANGES_NS          1000000000LL

/* In step with the ones before, unless that one came late or out of turn. */
static int64_t next_due(int64_t due_ns, int64_t period_ns, int64_t now_ns)
{
    return due_ns <= now_ns && now_ns - due_ns < period_ns ? due_ns + period_ns
                                                           : now_ns + period_ns;
}

static bool may_change(struct cyclic *c, int64_t now_ns)
{
    int64_t *oldest = &c->changed_ns[c->n_changes % CAN_STATUS_CHANGES];

    if (*oldest && now_ns - *oldest < CHANGES_NS)
        return false;
    *oldest = now_ns;
    c->n_changes++;
    return true;
}

static void put_status(struct cyclic *c, int64_t now_ns)
{
    struct can_frame_data frame;

    sender_status(c->sender, &frame);
    if (now_ns < c->status_due_ns &&
        (!memcmp(&frame, &c->status, sizeof frame) || !may_change(c, now_ns)))
        return;
    c->status_due_ns = next_due(c->status_due_ns, STATUS_PERIOD_NS, now_ns);
    c->status = frame;
    outbox_put_cyclic(c->outbox, OUTBOX_STATUS, &frame);
}

static void put_diagnosis(struct cyclic *c, int64_t now_ns)
{
    struct can_frame_data frame;

    if (now_ns < c->diagnosis_due_ns)
        return;
    c->diagnosis_due_ns = next_due(c->diagnosis_due_ns, DIAGNOSIS_PERIOD_NS, now_ns);
    if (!c->watch->cfg.replayed)
        c->sender->time_sync = clock_is_synchronised() ? CAN_SYNCHRONISED
                                                       : CAN_NOT_SYNCHRONISED;
    diagnosis_next(c->diagnosis, c->watch, now_ns, &c->sender->diagnosis);
    sender_diagnosis(c->sender, &frame);
    outbox_put_cyclic(c->outbox, OUTBOX_DIAGNOSIS, &frame);
}

static void put_empty_list(struct cyclic *c, int64_t now_ns)
{
    struct sender_list list;

    bool stale = watch_faults(c->watch) & 1u << CAN_FAULT_IMAGE_STALE;
    bool comes = c->watch->n_lists && now_ns - c->watch->list_ns < EMPTY_PERIOD_NS;

    if (!stale || comes || now_ns < c->empty_due_ns)
        return;
    c->empty_due_ns = next_due(c->empty_due_ns, EMPTY_PERIOD_NS, now_ns);
    sender_empty_list(c->sender, c->watch->capture_ns, &list);
    outbox_put_list(c->outbox, &list);
}

void cyclic_step(struct cyclic *c, int64_t now_ns)
{
    put_status(c, now_ns);
    put_diagnosis(c, now_ns);
    put_empty_list(c, now_ns);
}

int64_t cyclic_due_ns(const struct cyclic *c)
{
    return c->status_due_ns;
}
