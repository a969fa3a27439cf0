/* SPDX-License-Identifier: MIT */
#include "hal/clock.h"

#include <errno.h>
#include <inttypes.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/timex.h>
#include <time.h>
#include <unistd.h>

#define NS_PER_S INT64_C(1000000000)
#define SHARED   "ANLOS_CLOCK"

/* Set once; what is constant after the first call is no state. */
static int64_t wall_offset_ns;
static bool shared_is_damaged;
static pthread_once_t once = PTHREAD_ONCE_INIT;

static int64_t read_ns(clockid_t id)
{
    struct timespec t;
    clock_gettime(id, &t);
    return (int64_t)t.tv_sec * NS_PER_S + t.tv_nsec;
}

/* The two clocks cannot be read in one instant: the closest of some tries counts. */
static int64_t measure_offset(void)
{
    int64_t best = INT64_MAX, offset = 0;
    for (int i = 0; i < 8; i++) {
        int64_t before = read_ns(CLOCK_MONOTONIC);
        int64_t wall = read_ns(CLOCK_REALTIME);
        int64_t after = read_ns(CLOCK_MONOTONIC);
        if (after - before < best) {
            best = after - before;
            offset = wall - (before + after) / 2;
        }
    }
    return offset;
}

/* Does it make a time between 1970 and 2116, where nothing overflows? */
static bool is_offset(int64_t ns)
{
    return ns >= -read_ns(CLOCK_MONOTONIC) && ns <= INT64_MAX / 2;
}

/* 0, -ENOENT (nothing, or for the children of another), -EINVAL. */
static int read_shared(int64_t *offset_ns)
{
    const char *text = getenv(SHARED), *number;
    char *end;

    if (!text)
        return -ENOENT;
    errno = 0;
    long parent = strtol(text, &end, 10);
    if (end == text || *end != ':' || errno)
        return -EINVAL;
    if (parent != getppid())
        return -ENOENT;
    number = end + 1;
    *offset_ns = strtoll(number, &end, 10);
    return end == number || *end || errno || !is_offset(*offset_ns) ? -EINVAL : 0;
}

static void start(void)
{
    int err = read_shared(&wall_offset_ns);

    shared_is_damaged = err == -EINVAL;
    if (err)
        wall_offset_ns = measure_offset();
}

static int64_t system_now_ns(void *state)
{
    (void)state;
    return read_ns(CLOCK_MONOTONIC) + wall_offset_ns;
}

static int system_sleep_until_ns(void *state, int64_t t_ns)
{
    (void)state;
    int64_t t = t_ns - wall_offset_ns;
    if (t < 0)
        return 0;
    struct timespec at = {.tv_sec = (time_t)(t / NS_PER_S), .tv_nsec = t % NS_PER_S};
    return -clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL);
}

int64_t clock_monotonic_ns(void)
{
    return read_ns(CLOCK_MONOTONIC);
}

const struct clock_source *clock_system(void)
{
    static const struct clock_source system = {system_now_ns, system_sleep_until_ns,
                                               NULL};
    pthread_once(&once, start);
    return &system;
}

int clock_share(void)
{
    char text[48];

    pthread_once(&once, start);
    snprintf(text, sizeof text, "%ld:%" PRId64, (long)getpid(), wall_offset_ns);
    return setenv(SHARED, text, 1) ? -errno : 0;
}

int clock_check_shared(struct error *why)
{
    pthread_once(&once, start);
    if (!shared_is_damaged)
        return 0;
    return error_say(
        why, -EINVAL,
        "%s \"%s\" is no clock of the launcher: this process counts from the "
        "wall clock as it is now, and its stamps may be apart from the other "
        "nodes'",
        SHARED, getenv(SHARED));
}

/* Slewing moves both clocks alike, setting only one. */
int64_t clock_wall_ahead_ns(void)
{
    pthread_once(&once, start);
    return measure_offset() - wall_offset_ns;
}

bool clock_is_synchronised(void)
{
    struct timex t = {0};

    return adjtimex(&t) >= 0 && !(t.status & STA_UNSYNC);
}

static int64_t replay_now(void *state)
{
    const struct clock_replay *c = state;

    return c->on ? c->now_ns : clock_now_ns(c->machine);
}

/* Nothing would end a sleep in a time that stands still: it lasts as long as it would. */
static int replay_sleep_until(void *state, int64_t t_ns)
{
    const struct clock_replay *c = state;
    int64_t left_ns = t_ns - replay_now(state);

    if (!c->on)
        return c->machine->sleep_until_ns(c->machine->state, t_ns);
    return left_ns > 0 ? c->machine->sleep_until_ns(c->machine->state,
                                                    clock_now_ns(c->machine) + left_ns)
                       : 0;
}

void clock_replay_init(struct clock_replay *c, const struct clock_source *machine)
{
    *c = (struct clock_replay){.source = {replay_now, replay_sleep_until, c},
                               .machine = machine};
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
