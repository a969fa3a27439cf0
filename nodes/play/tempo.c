/* SPDX-License-Identifier: MIT */
#include "nodes/play/tempo.h"

void tempo_init(struct tempo *t, double rate)
{
    *t = (struct tempo){.rate = rate};
}

void tempo_set(struct tempo *t, int64_t bag_ns, int64_t machine_ns)
{
    t->started = true;
    t->bag_ns = bag_ns;
    t->machine_ns = machine_ns;
}

int64_t tempo_due_ns(struct tempo *t, int64_t bag_ns, int64_t machine_ns)
{
    if (!t->started)
        tempo_set(t, bag_ns, machine_ns);
    if (t->rate <= 0.0)
        return machine_ns;
    double after_ns = ((double)bag_ns - (double)t->bag_ns) / t->rate;

    return after_ns < 9e17 ? t->machine_ns + (int64_t)after_ns : INT64_MAX;
}
