/* SPDX-License-Identifier: MIT */
#include "nodes/rt/processors.h"

#include <sched.h>

size_t processors_usable(void)
{
    cpu_set_t set;
    if (sched_getaffinity(0, sizeof set, &set))
        return 1;
    int n = CPU_COUNT(&set);
    return n > 0 ? (size_t)n : 1;
}
