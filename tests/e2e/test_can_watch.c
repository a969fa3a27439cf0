/* SPDX-License-Identifier: MIT */
/* The node can by itself.  What it depends on stops or goes wrong, one after the other;
 * what the vehicle is told, and when, is read from the log of the bus.  The rules are
 * those of the table in nodes/can/watch.h. */
#include "tests/e2e/can_world.h"

#include <signal.h>

#include "nodes/rt/node.h"

#define LATEST_NS (2000 * MS) /* after its time, on a busy machine */

/* What happens; returns when its limit begins to run, or shortly before. */
static int64_t lose_ego(struct world *w)
{
    w->held->no_ego = true;
    return w->held->ego_ns;
}

static int64_t set_clock(struct world *w)
{
    int64_t now_ns = alone_now_ns();

    w->held->wall_ahead_ns = 3600000 * MS;
    return now_ns;
}

static int64_t damage_walls(struct world *w)
{
    int64_t now_ns = alone_now_ns();

    w->held->bad_walls = true;
    return now_ns;
}

static int64_t refuse_list(struct world *w)
{
    int64_t now_ns = alone_now_ns();

    w->held->refuse_list = true;
    return now_ns;
}

static int64_t break_microphones(struct world *w)
{
    w->faults[0] = NODE_FAULT_CHANNELS_SILENT;
    w->faults[1] = NODE_FAULT_ELEMENTS_DAMAGED;
    w->faults[2] = NODE_FAULT_CHANNELS_CLIPPED;
    tell_now(w, HEALTH);
    return alone_now_ns();
}

static int64_t stop_walls(struct world *w)
{
    return stop(w, WALLS);
}

static int64_t stop_lists(struct world *w)
{
    return stop(w, LISTS);
}

static int64_t stick_lists(struct world *w)
{
    w->stuck = true;
    return w->sources[LISTS].sent_ns;
}

static int64_t stop_dsp(struct world *w)
{
    return stop(w, DSP_HEALTH);
}

static int64_t lose_ambient(struct world *w)
{
    w->held->no_ambient = true;
    return w->held->ambient_ns;
}

static int64_t lose_array(struct world *w)
{
    w->faults[0] = NODE_FAULT_ARRAY_AWAY;
    tell_now(w, HEALTH);
    return alone_now_ns();
}

struct row {
    const char *name;
    uint16_t faults;
    enum can_state state;
    int64_t limit_ns;
    int64_t (*happens)(struct world *w);
};

#define BIT(f) (uint16_t)(1u << CAN_FAULT_##f)

static const struct row dsp_hangs = {"a node that says nothing", BIT(NODE_LOST),
                                     CAN_DEGRADED, 2500 * MS, stop_dsp};
static const struct row no_air = {"no temperature", BIT(TEMPERATURE_UNKNOWN),
                                  CAN_DEGRADED, 3000 * MS, lose_ambient};
static const struct row no_lists = {"no lists", BIT(IMAGE_STALE), CAN_FAULT, 100 * MS,
                                    stop_lists}; /* and when the next was due */
static const struct row same_lists = {"the same list again and again", BIT(IMAGE_STALE),
                                      CAN_FAULT, 100 * MS, stick_lists};
static const struct row array_away = {"the array is away", BIT(ARRAY_AWAY), CAN_FAULT, 0,
                                      lose_array};
static const struct row quick[] = {
    {"no motion", BIT(EGO_MISSING), CAN_DEGRADED, 100 * MS, lose_ego},
    {"the clock is set", BIT(CLOCK_JUMP), CAN_DEGRADED, 0, set_clock},
    {"a damaged frame", BIT(INPUT_E2E), CAN_DEGRADED, 0, damage_walls},
    {"a list that the bus does not take", BIT(LISTS_DROPPED), CAN_DEGRADED, 0,
     refuse_list},
    {"bad microphones", BIT(CHANNELS_DEAD) | BIT(ELEMENT_ERRORS) | BIT(CLIPPED),
     CAN_DEGRADED, 0, break_microphones},
    {"no word of walls", BIT(WALL_LOST), CAN_DEGRADED, 500 * MS, stop_walls},
};

/* Until the newest status has none of these faults, or all. */
static void wait_until(struct world *w, uint16_t faults, bool raised)
{
    const struct can_log_status *s;

    while (!(s = can_log_now(&w->log)) || s->state == CAN_INIT ||
           (s->faults & faults) != (raised ? faults : 0))
        go_on(w);
}

struct begun { /* a row under way */
    const struct row *row;
    int64_t since_ns;
    size_t first; /* status that may tell of it */
};

static struct begun begin(struct world *w, const struct row *row)
{
    wait_until(w, row->faults, false);
    struct begun b = {.row = row, .first = w->log.n_statuses};
    b.since_ns = row->happens(w);
    return b;
}

/* The first status that tells of it comes in its time.  How bad it is alone: a status may
 * be worse by others. */
static void assert_told(struct world *w, const struct begun *b)
{
    const struct row *row = b->row;
    const struct can_log_status *s = &w->log.statuses[b->first];

    wait_until(w, row->faults, true);
    while ((s->faults & row->faults) != row->faults)
        s++;
    int64_t delay_ns = s->stamp_ns - b->since_ns;
    if (delay_ns < row->limit_ns - MS || delay_ns > row->limit_ns + LATEST_NS)
        fail_msg("%s: told after %.3f s", row->name, 1e-9 * (double)delay_ns);
    bool stale = s->faults & BIT(IMAGE_STALE);
    if (s->state != row->state && !(stale && s->state == CAN_FAULT))
        fail_msg("%s: the state is %d", row->name, s->state);
}

static void assert_raises(struct world *w, const struct row *row)
{
    struct begun b = begin(w, row);

    assert_told(w, &b);
}

/* So many lists in the state that is, and whether they have objects. */
static void assert_lists(struct world *w, enum can_state state, bool objects)
{
    while (can_log_now(&w->log)->state != state || w->log.lists < 3)
        go_on(w);
    if ((w->log.objects > 0) != objects)
        fail_msg("%u objects in %u lists of state %d", w->log.objects, w->log.lists,
                 state);
}

/* Each of them, where the same text comes again within seconds. */
static void assert_changes_are_written(const struct alone *can)
{
    char *log = alone_log(can);

    for (const char *at = log; (at = strstr(at, "the sensor is ")); at++)
        if (at[strcspn(at, "(\n")] == '(')
            fail_msg("a change was counted: %.*s", (int)strcspn(at, "\n"), at);
    free(log);
}

/* The slow ones run beside the others, which need not wait for them. */
static void what_stops_or_goes_wrong_is_told_to_the_vehicle_in_time(void **state)
{
    struct world w;

    open_world(&w, *state);
    wait_until(&w, 0xffff, false);
    assert_lists(&w, CAN_ACTIVE, true);
    struct begun silence = begin(&w, &dsp_hangs), air = begin(&w, &no_air);
    for (size_t i = 0; i < sizeof quick / sizeof *quick; i++)
        assert_raises(&w, &quick[i]);
    assert_raises(&w, &no_lists);
    assert_lists(&w, CAN_FAULT, false);
    w.sources[LISTS].stopped = false;
    assert_lists(&w, CAN_DEGRADED, true);
    assert_raises(&w, &same_lists);
    w.stuck = false;
    assert_told(&w, &silence);
    assert_told(&w, &air);
    w.held->no_ambient = false;
    assert_raises(&w, &array_away);
    assert_lists(&w, CAN_FAULT, false);
    wait_until(&w, BIT(TEMPERATURE_UNKNOWN), false);
    close_world(&w, 1); /* one list is missing in the log */
    assert_int_equal(tally_wrong(&w.log.tally), 0);
    assert_changes_are_written(&w.can);
}

/* On a busy machine the node may be the last of the stopped ones to notice. */
static void that_the_others_were_stopped_too_is_no_fault(void **state)
{
    struct world w;

    open_world(&w, *state);
    wait_until(&w, 0xffff, false);
    assert_lists(&w, CAN_ACTIVE, true);
    kill(w.can.pid, SIGSTOP);
    int64_t since_ns = stop_lists(&w);
    while (alone_now_ns() < since_ns + 1500 * MS)
        go_on(&w);
    kill(w.can.pid, SIGTERM);
    kill(w.can.pid, SIGCONT);
    close_world(&w, 0);
    /* that it was stopped is its last word, three times; nothing was wrong before */
    const struct can_log_status *last = can_log_now(&w.log);
    assert_true(w.log.n_statuses > 3);
    for (int i = 0; i < 3; i++)
        assert_true(last[-i].shutdown && last[-i].faults == 0);
    assert_false(last[-3].shutdown);
    assert_int_equal(last[-3].state, CAN_ACTIVE);
    assert_int_equal(last[-3].faults, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(
            what_stops_or_goes_wrong_is_told_to_the_vehicle_in_time, scratch_open,
            scratch_close),
        cmocka_unit_test_setup_teardown(that_the_others_were_stopped_too_is_no_fault,
                                        scratch_open, scratch_close),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
