/* SPDX-License-Identifier: MIT */
#include "msgs/pace.h"

#include <math.h>

static double level_at(const struct pace *p, int64_t now_ns)
{
    double elapsed_s = now_ns > p->stamp_ns ? (double)(now_ns - p->stamp_ns) * 1e-9 : 0;
    return fmax(0, p->level_bytes - elapsed_s * p->rate_bytes_s);
}

int64_t pace_delay_ns(const struct pace *p, int64_t now_ns)
{
    double over = level_at(p, now_ns) - p->burst_bytes;
    return over > 0 ? (int64_t)ceil(over / p->rate_bytes_s * 1e9) : 0;
}

void pace_spend(struct pace *p, int64_t now_ns, double bytes)
{
    p->level_bytes = level_at(p, now_ns) + bytes;
    p->stamp_ns = now_ns;
}
