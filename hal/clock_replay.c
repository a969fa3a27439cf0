/* SPDX-License-Identifier: MIT */
#include "hal/clock_replay.h"

static int64_t now(void *state)
{
    const struct clock_replay *c = state;

    return c->on ? c->now_ns : clock_now_ns(c->machine);
}

/* Nothing would end a sleep in a time that stands still: it lasts as long as it would. */
static int sleep_until(void *state, int64_t t_ns)
{
    const struct clock_replay *c = state;
    int64_t left_ns = t_ns - now(state);

    if (!c->on)
        return c->machine->sleep_until_ns(c->machine->state, t_ns);
    return left_ns > 0 ? c->machine->sleep_until_ns(c->machine->state,
                                                    clock_now_ns(c->machine) + left_ns)
                       : 0;
}

void clock_replay_init(struct clock_replay *c, const struct clock_source *machine)
{
    *c = (struct clock_replay){.source = {now, sleep_until, c}, .machine = machine};
}

void clock_replay_set(struct clock_replay *c, int64_t now_ns)
{
    c->on = true;
    c->now_ns = now_ns;
}

void clock_replay_end(struct clock_replay *c)
{
    c->on = false;
}
