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

#define OF_ELEMENTS                                                                      \
    (1u << CAN_FAULT_ARRAY_AWAY | 1u << CAN_FAULT_CHANNELS_DEAD |                        \
     1u << CAN_FAULT_ELEMENT_ERRORS | 1u << CAN_FAULT_CLIPPED |                          \
     1u << CAN_FAULT_ELEMENTS_COVERED | 1u << CAN_FAULT_ELEMENTS_MOVED)

bool trouble_start_self_test(struct trouble_memory *m)
{
    if (!(m->supported & OF_ELEMENTS))
        return false;
    m->self_test = (struct self_test){.state = SELF_TEST_RUNS};
    return true;
}

static void step_self_test(struct self_test *t, uint16_t faults, int64_t now_ns)
{
    if (t->state != SELF_TEST_RUNS)
        return;
    if (!t->began_ns)
        t->began_ns = now_ns;
    t->faults |= faults;
    if (now_ns - t->began_ns >= SELF_TEST_NS)
        t->state = SELF_TEST_DONE;
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
    if (begun)
        step_self_test(&m->self_test, now->faults & m->supported & OF_ELEMENTS, now_ns);
}

void trouble_clear(struct trouble_memory *m, int fault)
{
    struct trouble_code *c = &m->codes[fault];

    c->status = TROUBLE_UNTESTED_SINCE_CLEAR | TROUBLE_UNTESTED_THIS_CYCLE;
    c->has_frame = false;
}
