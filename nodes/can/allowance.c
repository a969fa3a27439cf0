#include "nodes/can/allowance.h"

#include <math.h>

#include "msgs/can/frames.h"

#define WINDOW_NS    1000000000ULL
#define SPARE        2.0 /* lists: one more than a second has counts; all come unevenly */
#define LEAST_SPAN_S 0.25 /* some lists at once are no pace */

/* Modulo 2^64 ns: a stamp is whatever its sender wrote. */
static uint64_t age_ns(const struct allowance *a, size_t number, int64_t now_ns)
{
    return (uint64_t)now_ns - (uint64_t)a->lists[number % ALLOWANCE_LISTS].begun_ns;
}

/* The first list that began within the last second; a->n: none did. */
static size_t first_within(const struct allowance *a, int64_t now_ns)
{
    size_t first = a->n;

    while (first && a->n - first < ALLOWANCE_LISTS &&
           age_ns(a, first - 1, now_ns) < WINDOW_NS)
        first--;
    return first;
}

static double taken_s(const struct allowance *a, size_t first)
{
    double sum = 0.0;

    for (size_t i = first ? first - 1 : 0; i < a->n; i++)
        if (a->n - i <= ALLOWANCE_LISTS)
            sum += a->lists[i % ALLOWANCE_LISTS].bus_s;
    return sum;
}

/* What the next list may take of the bus.  What is left is for those, too, that are still
 * to come in the second that the first of them began. */
static double share_s(const struct allowance *a, int64_t now_ns, double lists_s)
{
    size_t first = first_within(a, now_ns);
    double span_s = first < a->n ? 1e-9 * (double)age_ns(a, first, now_ns) : 0.0;
    double pace_hz = fmax(1.0, (double)(a->n - first) / fmax(span_s, LEAST_SPAN_S));
    double left_s = lists_s - taken_s(a, first);

    if (a->n - first == ALLOWANCE_LISTS)
        return 0.0;
    return fmin(lists_s / (pace_hz + SPARE),
                left_s / fmax(1.0, pace_hz * (1.0 - span_s)));
}

size_t allowance_objects(struct allowance *a, const struct allowance_config *cfg,
                         int64_t now_ns)
{
    double lists_s = cfg->load - can_cycles_s(&cfg->rate);
    double empty_s = can_list_s(&cfg->rate, 0, cfg->fd);
    double object_s = can_list_s(&cfg->rate, 1, cfg->fd) - empty_s;

    if (a->n && now_ns < a->lists[(a->n - 1) % ALLOWANCE_LISTS].begun_ns)
        a->n = 0;
    double n = floor((share_s(a, now_ns, lists_s) - empty_s) / object_s);
    return n > 0.0 ? (size_t)fmin(n, CAN_MAX_OBJECTS) : 0;
}

void allowance_begin(struct allowance *a, const struct allowance_config *cfg,
                     int64_t now_ns, size_t n_objects)
{
    a->lists[a->n % ALLOWANCE_LISTS].begun_ns = now_ns;
    a->lists[a->n % ALLOWANCE_LISTS].bus_s = can_list_s(&cfg->rate, n_objects, cfg->fd);
    a->n++;
}
