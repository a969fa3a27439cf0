/* SPDX-License-Identifier: MIT */
/* msgs/monotonic.h -- CLOCK_MONOTONIC, for the deadlines of the bus itself: no time of a
 * message's. */
#ifndef ANLOS_MSGS_MONOTONIC_H
#define ANLOS_MSGS_MONOTONIC_H

#include <stdint.h>
#include <time.h>

static inline int64_t monotonic_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static inline int64_t monotonic_ms(void)
{
    return monotonic_ns() / 1000000;
}

#endif
