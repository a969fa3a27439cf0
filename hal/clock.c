#include "hal/clock.h"

#include <errno.h>
#include <pthread.h>
#include <sys/timex.h>
#include <time.h>

#define NS_PER_S INT64_C(1000000000)

/* Set once; what is constant after the first call is no state. */
static int64_t wall_offset_ns;
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

static void start(void)
{
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

const struct clock_source *clock_system(void)
{
    static const struct clock_source system = {system_now_ns, system_sleep_until_ns,
                                               NULL};
    pthread_once(&once, start);
    return &system;
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
