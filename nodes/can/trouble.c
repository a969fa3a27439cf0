/* SPDX-License-Identifier: MIT */
#include "nodes/can/trouble.h"

void trouble_init(struct trouble_memory *m, uint16_t supported)
{
    *m = (struct trouble_memory){.supported = supported};
    for (int f = 0; f < CAN_FAULTS; f++)
        trouble_clear(m, f);
}

bool trouble_supports(const struct trouble_memory *m, int fault)
{
    return m->supported >> fault & 1;
}

static void fail(struct trouble_code *c, const struct freeze_frame *now)
{
    c->status = TROUBLE_FAILED | TROUBLE_FAILED_THIS_CYCLE | TROUBLE_PENDING |
                TROUBLE_CONFIRMED | TROUBLE_FAILED_SINCE_CLEAR;
    if (!c->has_frame)
        c->first = *now;
    c->has_frame = true;
}

static void pass(struct trouble_code *c)
{
    c->status &= (uint8_t) ~(TROUBLE_FAILED | TROUBLE_UNTESTED_SINCE_CLEAR |
                             TROUBLE_UNTESTED_THIS_CYCLE);
}

void trouble_step(struct trouble_memory *m, const struct freeze_frame *now, bool begun,
                  int64_t now_ns)
{
    for (int f = 0; f < CAN_FAULTS; f++) {
        struct trouble_code *c = &m->codes[f];
        bool fails = now->faults >> f & 1;
        if (!trouble_supports(m, f))
            continue;
        if (fails && !c->fails)
            c->since_ns = now_ns;
        c->fails = fails;
        if (fails && (begun || now_ns - c->since_ns >= TROUBLE_SETTLE_NS))
            fail(c, now);
        else if (!fails && (begun || c->status & TROUBLE_FAILED))
            pass(c);
    }
}

void trouble_clear(struct trouble_memory *m, int fault)
{
    struct trouble_code *c = &m->codes[fault];

    c->status = TROUBLE_UNTESTED_SINCE_CLEAR | TROUBLE_UNTESTED_THIS_CYCLE;
    c->has_frame = false;
}
