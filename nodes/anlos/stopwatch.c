/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/stopwatch.h"

#include <time.h>

static double clock_s(clockid_t id)
{
    struct timespec t;
    clock_gettime(id, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

struct stopwatch stopwatch_now(bool own_thread)
{
    return (struct stopwatch){
        clock_s(CLOCK_MONOTONIC),
        clock_s(own_thread ? CLOCK_THREAD_CPUTIME_ID : CLOCK_PROCESS_CPUTIME_ID)};
}

void stopwatch_lap(struct stopwatch *total, struct stopwatch *since, bool own_thread)
{
    struct stopwatch now = stopwatch_now(own_thread);
    total->wall_s += now.wall_s - since->wall_s;
    total->cpu_s += now.cpu_s - since->cpu_s;
    *since = now;
}
