#include "nodes/can/watch_rows.h"

#include <math.h>

#define MS         1000000LL
#define LATE_NS    (100 * MS)
#define AMBIENT_NS (3000 * MS)
#define WALL_NS    (500 * MS)
#define SILENT_NS  (2500 * MS)
#define FIRST_NS   (1000 * MS) /* while fewer than two intervals are known */

/* An outage is no interval: of two or more the shortest tells how long one may be. */
static int64_t longest_interval(const struct watch *w)
{
    size_t n = w->n_lists <= WATCH_INTERVALS ? w->n_lists - 1 : WATCH_INTERVALS;
    int64_t longest = 0, shortest = INT64_MAX, most = FIRST_NS;

    for (size_t i = 0; i < n; i++) {
        int64_t interval = w->intervals_ns[i];
        longest = interval > longest ? interval : longest;
        shortest = interval < shortest ? interval : shortest;
    }
    if (n > 1 && shortest > FIRST_NS / 2)
        most = 2 * shortest;
    return n && longest < most ? longest : most;
}

/* Modulo 2^64 ns: a stamp is whatever its sender wrote. */
static int64_t age_ns(int64_t now_ns, int64_t then_ns)
{
    return (int64_t)((uint64_t)now_ns - (uint64_t)then_ns);
}

/* What came while this node itself was kept from running is taken after this. */
static int64_t silence_ns(const struct watch *w, int64_t now_ns, int64_t since_ns,
                          int64_t unwatched_ns)
{
    int64_t excused = w->unwatched_ns - unwatched_ns;

    return now_ns - since_ns - (excused < WATCH_STALE_NS ? excused : WATCH_STALE_NS);
}

static bool image_is_stale(const struct watch *w, int64_t now_ns)
{
    return !w->n_lists ||
           silence_ns(w, now_ns, w->list_ns, w->list_unwatched_ns) >
               longest_interval(w) + LATE_NS ||
           age_ns(w->list_ns, w->capture_ns) > WATCH_STALE_NS ||
           age_ns(w->list_ns, w->capture_ns) < -LATE_NS;
}

static bool ego_is_missing(const struct watch *w, int64_t now_ns)
{
    return w->cfg.ego && (!w->ego_ns || now_ns - w->ego_ns > LATE_NS);
}

bool watch_has_ambient(const struct watch *w, int64_t now_ns)
{
    return w->ambient_ns && now_ns - w->ambient_ns <= AMBIENT_NS;
}

static bool temperature_is_unknown(const struct watch *w, int64_t now_ns)
{
    return (w->ambient_ns || isnan(w->survey_c)) && !watch_has_ambient(w, now_ns);
}

/* Of who says most: array and dsp judge the same microphones. */
static struct watch_channels channels(const struct watch *w, int kind)
{
    struct watch_channels most = {0, 0};

    for (size_t i = 0; i < w->n_nodes; i++)
        if (w->nodes[i].channels[kind].count > most.count)
            most = w->nodes[i].channels[kind];
    return most;
}

static bool channels_are_dead(const struct watch *w, int64_t now_ns)
{
    (void)now_ns;
    return channels(w, WATCH_SILENT).count + channels(w, WATCH_MUTE).count > 0;
}

static bool elements_err(const struct watch *w, int64_t now_ns)
{
    (void)now_ns;
    return channels(w, WATCH_DAMAGED).count > 0;
}

static bool is_clipped(const struct watch *w, int64_t now_ns)
{
    (void)now_ns;
    return channels(w, WATCH_CLIPPED).count > 0;
}

bool watch_is_blind(const struct watch *w)
{
    struct watch_channels mute = channels(w, WATCH_MUTE);
    uint32_t bad = 0, of = 0;

    for (int kind = 0; kind < WATCH_EARS; kind++) {
        struct watch_channels c = channels(w, kind);
        bad += c.count;
        of = c.of > of ? c.of : of;
    }
    return (bad && 2 * bad >= of) || (mute.count && 2 * mute.count >= mute.of);
}

static bool wall_is_lost(const struct watch *w, int64_t now_ns)
{
    return (w->n_lists && !w->placed) ||
           (w->cfg.wall &&
            (!w->walls_ns || !w->wall_likely ||
             silence_ns(w, now_ns, w->walls_ns, w->walls_unwatched_ns) > WALL_NS));
}

static bool array_is_away(const struct watch *w, int64_t now_ns)
{
    (void)now_ns;
    for (size_t i = 0; i < w->n_nodes; i++)
        if (w->nodes[i].away)
            return true;
    return false;
}

static bool node_is_lost(const struct watch *w, int64_t now_ns)
{
    for (size_t i = 0; i < w->n_nodes; i++)
        if (w->nodes[i].lost || w->nodes[i].faulty ||
            (w->cfg.fixed && now_ns - w->nodes[i].heard_ns > SILENT_NS))
            return true;
    return false;
}

static bool clock_jumped(const struct watch *w, int64_t now_ns)
{
    (void)now_ns;
    return w->events & 1u << CAN_FAULT_CLOCK_JUMP;
}

static bool input_is_wrong(const struct watch *w, int64_t now_ns)
{
    (void)now_ns;
    return w->events & 1u << CAN_FAULT_INPUT_E2E;
}

static bool lists_are_dropped(const struct watch *w, int64_t now_ns)
{
    (void)now_ns;
    return w->events & 1u << CAN_FAULT_LISTS_DROPPED;
}

static bool range_is_reduced(const struct watch *w, int64_t now_ns)
{
    (void)now_ns;
    for (size_t i = 0; i < w->n_nodes; i++)
        if (w->nodes[i].reduced)
            return true;
    return false;
}

static bool elements_are_covered(const struct watch *w, int64_t now_ns)
{
    (void)now_ns;
    for (size_t i = 0; i < w->n_nodes; i++)
        if (w->nodes[i].covered)
            return true;
    return false;
}

const struct watch_row watch_rows[CAN_FAULTS] = {
    [CAN_FAULT_IMAGE_STALE] = {true, CAN_FAULT, 1000 * MS, image_is_stale},
    [CAN_FAULT_EGO_MISSING] = {true, CAN_DEGRADED, 1000 * MS, ego_is_missing},
    [CAN_FAULT_TEMPERATURE_UNKNOWN] = {true, CAN_DEGRADED, 1000 * MS,
                                       temperature_is_unknown},
    [CAN_FAULT_CHANNELS_DEAD] = {false, CAN_DEGRADED, 1000 * MS, channels_are_dead},
    [CAN_FAULT_ELEMENT_ERRORS] = {false, CAN_DEGRADED, 1000 * MS, elements_err},
    [CAN_FAULT_WALL_LOST] = {true, CAN_DEGRADED, 1000 * MS, wall_is_lost},
    [CAN_FAULT_CLOCK_JUMP] = {false, CAN_DEGRADED, 5000 * MS, clock_jumped},
    [CAN_FAULT_INPUT_E2E] = {false, CAN_DEGRADED, 1000 * MS, input_is_wrong},
    [CAN_FAULT_ARRAY_AWAY] = {false, CAN_FAULT, 1000 * MS, array_is_away},
    [CAN_FAULT_NODE_LOST] = {false, CAN_DEGRADED, 1000 * MS, node_is_lost},
    [CAN_FAULT_CLIPPED] = {false, CAN_DEGRADED, 1000 * MS, is_clipped},
    [CAN_FAULT_LISTS_DROPPED] = {false, CAN_DEGRADED, 5000 * MS, lists_are_dropped},
    [CAN_FAULT_RANGE_REDUCED] = {true, CAN_DEGRADED, 1000 * MS, range_is_reduced},
    [CAN_FAULT_ELEMENTS_COVERED] = {false, CAN_BLOCKED, 1000 * MS, elements_are_covered},
};
