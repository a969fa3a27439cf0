/* SPDX-License-Identifier: MIT */
#include "nodes/can/watch.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "dsp/error.h"
#include "nodes/rt/node.h"

/* The rows of the table in watch.h: when each fault is there, and what it does to the
 * state. */

struct watch_row {
    bool fixed_only;
    enum can_state state;
    int64_t hold_ns; /* it has to be well for so long: WATCH_HEALTH_NS or more */
    bool (*is_bad)(const struct watch *w, int64_t now_ns);
};

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

/* Does the vehicle tell a temperature? */
static bool watch_has_ambient(const struct watch *w, int64_t now_ns)
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

/* So few microphones are left that an image shows more of them than of the world. */
static bool watch_is_blind(const struct watch *w)
{
    struct watch_channels mute = channels(w, WATCH_MUTE);
    uint32_t bad = 0, of = 0;

    for (int kind = 0; kind < WATCH_SUBSCRIPTIONS; kind++) {
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

static bool elements_have_moved(const struct watch *w, int64_t now_ns)
{
    (void)now_ns;
    for (size_t i = 0; i < w->n_nodes; i++)
        if (w->nodes[i].moved)
            return true;
    return false;
}

static bool another_is_heard(const struct watch *w, int64_t now_ns)
{
    (void)now_ns;
    for (size_t i = 0; i < w->n_nodes; i++)
        if (w->nodes[i].interfered)
            return true;
    return false;
}

static const struct watch_row watch_rows[CAN_FAULTS] = {
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
    [CAN_FAULT_ELEMENTS_MOVED] = {false, CAN_DEGRADED, 1000 * MS, elements_have_moved},
    [CAN_FAULT_INTERFERENCE] = {true, CAN_DEGRADED, 1000 * MS, another_is_heard},
};

#define JUMP_NS  20000000LL
#define INIT_NS  10000000000LL
#define UNSEEN_S 2.0

#define RANGE_STEP_M 0.2 /* of the signal */
#define RANGE_NS     2500000000LL

void watch_init(struct watch *w, const struct watch_config *cfg)
{
    *w = (struct watch){.cfg = *cfg,
                        .scan = CAN_INIT,
                        .state = CAN_INIT,
                        .survey_c = NAN,
                        .range_m = NAN,
                        .ambient_c = NAN};
}

void watch_scan(struct watch *w, const Anlos__ScanStatus *status)
{
    switch (status->state) {
    case ANLOS__SCAN_STATUS__STATE__WAITING:
        w->scan = CAN_INIT;
        break;
    case ANLOS__SCAN_STATUS__STATE__RUNNING:
        w->scan = status->pass == ANLOS__PASS__BACKGROUND ? CAN_CALIBRATING : CAN_ACTIVE;
        break;
    case ANLOS__SCAN_STATUS__STATE__DONE:
        w->scan = status->pings_lost ? CAN_DEGRADED : CAN_ACTIVE;
        break;
    case ANLOS__SCAN_STATUS__STATE__PAUSED: /* until a person comes, or goes on */
        w->scan = status->held ? CAN_STANDBY : CAN_FAULT;
        break;
    default:
        w->scan = CAN_FAULT;
    }
    if (w->cfg.replayed)
        w->state = w->scan;
}

void watch_survey(struct watch *w, double temperature_c)
{
    w->survey_c = temperature_c;
}

/* Two steps that should have been and were not: this node did not run. */
static void count_unwatched(struct watch *w, int64_t now_ns)
{
    int64_t gap = now_ns - w->stepped_ns;

    if (w->stepped_ns && gap > 2 * WATCH_STEP_NS)
        w->unwatched_ns += gap - WATCH_STEP_NS;
    w->stepped_ns = now_ns;
}

void watch_list(struct watch *w, const Anlos__DetectionList *list, int64_t capture_ns,
                int64_t now_ns)
{
    count_unwatched(w,
                    now_ns); /* it may have waited for this node, before the next step */
    int64_t unwatched_ns = w->unwatched_ns - w->list_unwatched_ns;

    if (w->n_lists)
        w->intervals_ns[(w->n_lists - 1) % WATCH_INTERVALS] = now_ns - w->list_ns -
                                                              unwatched_ns;
    w->n_lists++;
    w->list_ns = now_ns;
    w->list_unwatched_ns = w->unwatched_ns;
    w->capture_ns = capture_ns;
    w->placed = list->mirrored && list->in_vehicle_frame;
}

void watch_ego(struct watch *w, int64_t now_ns)
{
    w->ego_ns = now_ns;
}

void watch_ambient(struct watch *w, double temperature_c, int64_t now_ns)
{
    if (!isfinite(temperature_c))
        return;
    w->ambient_c = temperature_c;
    w->ambient_ns = now_ns;
}

void watch_walls(struct watch *w, const Anlos__WallList *walls, int64_t now_ns)
{
    count_unwatched(w, now_ns);
    w->walls_ns = now_ns;
    w->walls_unwatched_ns = w->unwatched_ns;
    w->wall_likely = false;
    for (size_t i = 0; i < walls->n_walls; i++)
        w->wall_likely |= walls->walls[i]->existence >= 0.5 &&
                          walls->walls[i]->unseen_s <= UNSEEN_S;
}

static struct watch_node *find_node(struct watch *w, const char *name)
{
    size_t i = 0;

    while (i < w->n_nodes && strcmp(w->nodes[i].name, name))
        i++;
    if (i == WATCH_MAX_NODES)
        return NULL;
    if (i == w->n_nodes)
        snprintf(w->nodes[w->n_nodes++].name, sizeof w->nodes->name, "%s", name);
    return &w->nodes[i];
}

static void take_fault(struct watch_node *n, const Anlos__Fault *f)
{
    static const char *const kinds[WATCH_CHANNEL_KINDS] = {
        [WATCH_SILENT] = NODE_FAULT_CHANNELS_SILENT,
        [WATCH_DAMAGED] = NODE_FAULT_ELEMENTS_DAMAGED,
        [WATCH_CLIPPED] = NODE_FAULT_CHANNELS_CLIPPED,
        [WATCH_MUTE] = NODE_FAULT_SPEAKERS_MUTE,
    };

    for (size_t k = 0; k < WATCH_CHANNEL_KINDS; k++)
        if (!strcmp(f->name, kinds[k]))
            n->channels[k] = (struct watch_channels){f->count, f->of};
    if (!strcmp(f->name, NODE_FAULT_ARRAY_AWAY))
        n->away = f->count;
    if (!strcmp(f->name, NODE_FAULT_NODES_LOST))
        n->lost = f->count;
    if (!strcmp(f->name, NODE_FAULT_RANGE_REDUCED))
        n->reduced = f->count;
    if (!strcmp(f->name, NODE_FAULT_MICROPHONES_COVERED) ||
        !strcmp(f->name, NODE_FAULT_SPEAKERS_COVERED))
        n->covered += f->count;
    if (!strcmp(f->name, NODE_FAULT_MICROPHONES_MOVED) ||
        !strcmp(f->name, NODE_FAULT_SPEAKERS_MOVED))
        n->moved += f->count;
    if (!strcmp(f->name, NODE_FAULT_INTERFERENCE) || !strcmp(f->name, NODE_FAULT_TONE))
        n->interfered += f->count;
}

void watch_health(struct watch *w, const Anlos__Health *health, int64_t now_ns)
{
    struct watch_node *n = node_is_optional(health->node) ? NULL
                                                          : find_node(w, health->node);

    if (!n)
        return;
    n->heard_ns = now_ns;
    n->faulty = health->state == ANLOS__HEALTH__STATE__FAULT;
    n->away = n->lost = n->reduced = n->covered = n->moved = 0;
    n->interfered = 0;
    memset(n->channels, 0, sizeof n->channels);
    for (size_t i = 0; i < health->n_faults; i++)
        take_fault(n, health->faults[i]);
    if (health->sensing) {
        w->range_m = health->sensing->range_m;
        w->range_ns = now_ns;
    }
}

void watch_wrong_input(struct watch *w)
{
    w->events |= 1u << CAN_FAULT_INPUT_E2E;
}

void watch_clock(struct watch *w, int64_t ahead_ns)
{
    int64_t moved = ahead_ns - w->ahead_ns;

    if (w->clock_seen && (moved > JUMP_NS || moved < -JUMP_NS))
        w->events |= 1u << CAN_FAULT_CLOCK_JUMP;
    w->clock_seen = true;
    w->ahead_ns = ahead_ns;
}

void watch_dropped(struct watch *w, uint64_t lists)
{
    if (lists > w->lists_dropped)
        w->events |= 1u << CAN_FAULT_LISTS_DROPPED;
    w->lists_dropped = lists;
}

static void judge(struct watch *w, int f, int64_t now_ns)
{
    uint16_t bit = (uint16_t)(1u << f);

    if (watch_rows[f].fixed_only && !w->cfg.fixed)
        return;
    if (watch_rows[f].is_bad(w, now_ns)) {
        w->last_bad_ns[f] = now_ns;
        w->faults |= bit;
    } else if (now_ns - w->last_bad_ns[f] >= watch_rows[f].hold_ns) {
        w->faults = (uint16_t)(w->faults & ~bit);
    }
}

static void judge_blindness(struct watch *w, int64_t now_ns)
{
    if (watch_is_blind(w)) {
        w->blind = true;
        w->last_blind_ns = now_ns;
    } else if (now_ns - w->last_blind_ns >= WATCH_HEALTH_NS) {
        w->blind = false;
    }
}

/* How often each was raised in a sensor that had begun. */
static void count_raised(struct watch *w)
{
    for (int f = 0; f < CAN_FAULTS; f++)
        if ((w->faults & ~w->counted) & 1 << f && w->raised[f] < 255)
            w->raised[f]++;
    w->counted = w->faults;
}

static bool is_worse(enum can_state a, enum can_state b)
{
    static const int rank[] = {
        [CAN_ACTIVE] = 0, [CAN_DEGRADED] = 1, [CAN_BLOCKED] = 2, [CAN_FAULT] = 3};

    return rank[a] > rank[b];
}

static enum can_state worst(const struct watch *w)
{
    const uint16_t subscriptions = 1u << CAN_FAULT_CHANNELS_DEAD |
                                   1u << CAN_FAULT_ELEMENT_ERRORS |
                                   1u << CAN_FAULT_CLIPPED;
    enum can_state state = w->scan;

    for (int f = 0; f < CAN_FAULTS; f++)
        if (w->faults & 1u << f && is_worse(watch_rows[f].state, state))
            state = watch_rows[f].state;
    return w->faults & subscriptions && w->blind && is_worse(CAN_BLOCKED, state)
               ? CAN_BLOCKED
               : state;
}

/* Of a fixed array nothing was wrong for a while, or it took too long. */
static bool may_begin(const struct watch *w, int64_t now_ns)
{
    int64_t for_ns = now_ns - w->began_ns;

    return !w->cfg.fixed || (!w->faults && for_ns >= WATCH_HEALTH_NS) || for_ns > INIT_NS;
}

/* Worse is at once; better at most once in a while, then by as much as it is. */
static void change_state(struct watch *w, enum can_state state, int64_t now_ns)
{
    bool better = w->judged && is_worse(w->state, state);

    if (state == w->state || (better && now_ns - w->changed_ns < WATCH_HEALTH_NS))
        return;
    w->state = state;
    w->changed_ns = now_ns;
}

/* While the scan neither works nor has worked, its state is that of the sensor. */
static void follow_scan(struct watch *w)
{
    w->begun = w->judged = false;
    w->began_ns = 0;
    w->state = w->scan;
}

void watch_step(struct watch *w, int64_t now_ns)
{
    if (w->cfg.replayed) {
        w->faults = w->events = 0;
        w->state = w->scan;
        return;
    }
    count_unwatched(w, now_ns);
    if (!watch_has_ambient(w, now_ns))
        w->ambient_c = NAN;
    for (int f = 0; f < CAN_FAULTS; f++)
        judge(w, f, now_ns);
    judge_blindness(w, now_ns);
    w->events = 0;
    if (w->scan != CAN_ACTIVE && w->scan != CAN_DEGRADED) {
        follow_scan(w);
        return;
    }
    if (!w->began_ns)
        w->began_ns = now_ns;
    w->begun |= may_begin(w, now_ns);
    if (!w->begun) {
        w->state = CAN_INIT;
        return;
    }
    change_state(w, worst(w), now_ns);
    w->judged = true;
    count_raised(w);
}

enum can_state watch_state(const struct watch *w)
{
    return w->state;
}

uint16_t watch_faults(const struct watch *w)
{
    return w->faults;
}

uint16_t watch_tested(const struct watch *w)
{
    uint16_t tested = 0;

    for (int f = 0; f < CAN_FAULTS && !w->cfg.replayed; f++)
        if (w->cfg.fixed || !watch_rows[f].fixed_only)
            tested = (uint16_t)(tested | 1u << f);
    return tested;
}

void watch_text(const struct watch *w, char *text, size_t size)
{
    static const char *const names[CAN_FAULTS] = {
        [CAN_FAULT_IMAGE_STALE] = "no new image",
        [CAN_FAULT_EGO_MISSING] = "no motion of the vehicle",
        [CAN_FAULT_TEMPERATURE_UNKNOWN] = "no temperature",
        [CAN_FAULT_CHANNELS_DEAD] = "silent microphones or speakers",
        [CAN_FAULT_ELEMENT_ERRORS] = "damaged microphones",
        [CAN_FAULT_WALL_LOST] = "no wall or mount",
        [CAN_FAULT_CLOCK_JUMP] = "the wall clock was set",
        [CAN_FAULT_INPUT_E2E] = "wrong frames from the vehicle",
        [CAN_FAULT_ARRAY_AWAY] = "the array is away",
        [CAN_FAULT_NODE_LOST] = "a node is lost",
        [CAN_FAULT_CLIPPED] = "clipped microphones",
        [CAN_FAULT_LISTS_DROPPED] = "dropped lists",
        [CAN_FAULT_RANGE_REDUCED] = "noise hides who is far away",
        [CAN_FAULT_ELEMENTS_COVERED] = "covered microphones or speakers",
        [CAN_FAULT_ELEMENTS_MOVED] = "microphones or speakers that have moved",
        [CAN_FAULT_INTERFERENCE] = "another array or a steady tone is heard",
    };

    text[0] = '\0';
    for (int f = 0; f < CAN_FAULTS; f++)
        if (w->faults & 1u << f)
            text_add(text, size, ", ", "%s", names[f]);
}

double watch_temperature_c(const struct watch *w)
{
    return w->ambient_ns ? w->ambient_c : w->survey_c;
}

double watch_range_m(const struct watch *w)
{
    bool known = w->range_m >= 0.0 && !(w->faults & 1u << CAN_FAULT_WALL_LOST) &&
                 w->stepped_ns - w->range_ns < RANGE_NS;

    return known ? RANGE_STEP_M * floor(w->range_m / RANGE_STEP_M + 1e-9) : NAN;
}

bool watch_lets_objects(const struct watch *w)
{
    if (w->cfg.fixed && !w->cfg.replayed)
        return w->state == CAN_ACTIVE || w->state == CAN_DEGRADED;
    return w->state != CAN_FAULT && w->state != CAN_BLOCKED && w->state != CAN_STANDBY;
}
