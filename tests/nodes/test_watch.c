/* SPDX-License-Identifier: MIT */
/* A sensor on a fixed array whose inputs come as they should, every 10 ms of a clock of
 * the test's own, until one does not.  Each row of the table in watch.h has its test. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/can/watch.h"
#include "nodes/rt/node.h"
#include "tests/nodes/near.h"

#define MS 1000000LL

struct world {
    struct watch watch;
    int64_t now_ns;
    /* What goes on; all true at first. */
    bool lists, ego, ambient, walls, health;
    bool mirrored, mounted; /* as the lists say; true at first */
    int64_t image_age_ns, cycle_ns, ahead_ns;
    double wall_existence, wall_unseen_s;
    double range_m;    /* as the array says */
    const char *fault; /* that the node dsp tells */
    uint32_t count, of;
    Anlos__Health__State state; /* of dsp */
};

static void tell_health(struct world *w, const char *name)
{
    Anlos__Health h = ANLOS__HEALTH__INIT;
    Anlos__Fault fault = ANLOS__FAULT__INIT, *faults[] = {&fault};
    Anlos__Sensing sensing = ANLOS__SENSING__INIT;
    bool is_dsp = !strcmp(name, "dsp");

    h.node = (char *)name;
    sensing.range_m = w->range_m;
    if (!strcmp(name, "array"))
        h.sensing = &sensing;
    h.state = is_dsp ? w->state : ANLOS__HEALTH__STATE__READY;
    if (is_dsp && w->fault) {
        fault.name = (char *)w->fault;
        fault.count = w->count;
        fault.of = w->of;
        h.faults = faults;
        h.n_faults = 1;
    }
    watch_health(&w->watch, &h, w->now_ns);
}

static void tell_list(struct world *w)
{
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;

    list.mirrored = w->mirrored;
    list.in_vehicle_frame = w->mounted;
    watch_list(&w->watch, &list, w->now_ns - w->image_age_ns, w->now_ns);
}

static void tell_walls(struct world *w)
{
    Anlos__WallList list = ANLOS__WALL_LIST__INIT;
    Anlos__Wall wall = ANLOS__WALL__INIT, *walls[] = {&wall};

    wall.existence = w->wall_existence;
    wall.unseen_s = w->wall_unseen_s;
    list.walls = walls;
    list.n_walls = 1;
    watch_walls(&w->watch, &list, w->now_ns);
}

static bool is_time(const struct world *w, int64_t period_ns)
{
    return w->now_ns % period_ns == 0;
}

/* Runs on for so long. */
static void run(struct world *w, int64_t ms)
{
    for (int64_t end = w->now_ns + ms * MS; w->now_ns < end;) {
        w->now_ns += 10 * MS;
        if (w->lists && is_time(w, w->cycle_ns))
            tell_list(w);
        if (w->ego && is_time(w, 20 * MS))
            watch_ego(&w->watch, w->now_ns);
        if (w->ambient && is_time(w, 1000 * MS))
            watch_ambient(&w->watch, 11.0, w->now_ns);
        if (w->walls && is_time(w, 100 * MS))
            tell_walls(w);
        if (w->health && is_time(w, 1000 * MS)) {
            tell_health(w, "array");
            tell_health(w, "dsp");
        }
        watch_clock(&w->watch, w->ahead_ns);
        watch_step(&w->watch, w->now_ns);
    }
}

static void tell_scan(struct world *w, Anlos__ScanStatus__State state)
{
    Anlos__ScanStatus scan = ANLOS__SCAN_STATUS__INIT;

    scan.state = state;
    watch_scan(&w->watch, &scan);
}

static void start(struct world *w, const struct watch_config *cfg)
{
    *w = (struct world){.now_ns = 1000000 * MS,
                        .lists = true,
                        .ego = true,
                        .ambient = true,
                        .walls = true,
                        .health = true,
                        .mirrored = true,
                        .mounted = true,
                        .image_age_ns = 80 * MS,
                        .cycle_ns = 250 * MS,
                        .wall_existence = 0.9,
                        .range_m = 3.99,
                        .state = ANLOS__HEALTH__STATE__READY};
    watch_init(&w->watch, cfg);
    tell_scan(w, ANLOS__SCAN_STATUS__STATE__RUNNING);
}

static const struct watch_config fixed = {.fixed = true, .ego = true, .wall = true};

/* One that works, at a full second. */
static void start_well(struct world *w)
{
    start(w, &fixed);
    run(w, 5000);
    assert_int_equal(watch_state(&w->watch), CAN_ACTIVE);
    assert_int_equal(watch_faults(&w->watch), 0);
}

static void assert_is(const struct world *w, enum can_state state, enum can_fault fault)
{
    assert_int_equal(watch_state(&w->watch), state);
    assert_int_equal(watch_faults(&w->watch), 1u << fault);
}

static void assert_well(const struct world *w)
{
    assert_int_equal(watch_state(&w->watch), CAN_ACTIVE);
    assert_int_equal(watch_faults(&w->watch), 0);
}

/* The last list came with the full second, the next is due after 250 ms. */
static void an_image_that_does_not_come_is_a_fault_100_ms_after_it_was_due(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    w.lists = false;
    run(&w, 350);
    assert_well(&w);
    run(&w, 10);
    assert_is(&w, CAN_FAULT, CAN_FAULT_IMAGE_STALE);
    assert_false(watch_lets_objects(&w.watch));
    w.lists = true;
    run(&w, 140); /* up to where one comes */
    assert_is(&w, CAN_FAULT, CAN_FAULT_IMAGE_STALE);
    run(&w, 980);
    assert_is(&w, CAN_FAULT, CAN_FAULT_IMAGE_STALE);
    run(&w, 20);
    assert_well(&w);
    assert_true(watch_lets_objects(&w.watch));
}

static void an_image_of_old_sound_is_a_fault_when_it_comes(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    w.image_age_ns = 510 * MS;
    run(&w, 240);
    assert_well(&w);
    run(&w, 10);
    assert_is(&w, CAN_FAULT, CAN_FAULT_IMAGE_STALE);
    start_well(&w);
    w.image_age_ns = -110 * MS;
    run(&w, 250);
    assert_is(&w, CAN_FAULT, CAN_FAULT_IMAGE_STALE);
}

/* The vehicle's own jitter is no fault: of 4 intervals the longest counts. */
static void an_image_may_come_as_late_as_the_ones_before(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    for (int i = 0; i < 8; i++) {
        w.cycle_ns = (i % 2 ? 300 : 200) * MS;
        w.now_ns = 2000000 * MS + i * 600 * MS;
        run(&w, w.cycle_ns / MS);
    }
    assert_int_equal(watch_faults(&w.watch) & 1u << CAN_FAULT_IMAGE_STALE, 0);
}

/* A list every 2 s: from the third on that is known, a second later it is well. */
static void a_slow_array_is_judged_by_its_own_pace(void **state)
{
    struct world w;

    (void)state;
    start(&w, &fixed);
    w.cycle_ns = 2000 * MS;
    run(&w, 7000);
    for (int i = 0; i < 499; i++) { /* up to a list, at 12 s */
        run(&w, 10);
        assert_well(&w);
    }
    run(&w, 10);
    w.lists = false;
    run(&w, 2090);
    assert_well(&w);
    run(&w, 20);
    assert_is(&w, CAN_FAULT, CAN_FAULT_IMAGE_STALE);
}

/* Two lists come after it, then again none: of intervals of 250 ms the limit is 1 s, of
 * 2 s it is 4 s.  A sensor that has just begun knows of none but the outage. */
static void an_outage_does_not_count_as_the_pace_of_lists(void **state)
{
    static const int64_t cycles_ms[] = {250, 2000}, limits_ms[] = {1000, 4000};
    struct world w;

    (void)state;
    for (size_t i = 0; i < 2; i++) {
        start(&w, &fixed);
        w.cycle_ns = cycles_ms[i] * MS;
        run(&w, 10000);
        w.lists = false;
        run(&w, 30000);
        w.lists = true;
        run(&w, 2 * cycles_ms[i]);
        w.lists = false;
        run(&w, 850);
        assert_well(&w);
        run(&w, limits_ms[i] - 740);
        assert_is(&w, CAN_FAULT, CAN_FAULT_IMAGE_STALE);
    }
    start(&w, &fixed);
    run(&w, 250);
    w.now_ns += 30000 * MS;
    run(&w, 250);
    w.lists = false;
    run(&w, 1110);
    assert_int_equal(watch_faults(&w.watch) & 1u << CAN_FAULT_IMAGE_STALE,
                     1u << CAN_FAULT_IMAGE_STALE);
}

static void motion_that_does_not_come_is_missing_after_100_ms(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    w.ego = false;
    run(&w, 100);
    assert_well(&w);
    run(&w, 10);
    assert_is(&w, CAN_DEGRADED, CAN_FAULT_EGO_MISSING);
    assert_true(watch_lets_objects(&w.watch));
    w.ego = true;
    run(&w, 990);
    assert_is(&w, CAN_DEGRADED, CAN_FAULT_EGO_MISSING);
    run(&w, 10);
    assert_well(&w);
    assert_int_equal(w.watch.raised[CAN_FAULT_EGO_MISSING], 1);
}

static void a_temperature_that_nobody_tells_is_unknown_after_3_s(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    w.ambient = false;
    run(&w, 3000);
    assert_well(&w);
    assert_true(watch_temperature_c(&w.watch) > 10.9);
    run(&w, 10);
    assert_is(&w, CAN_DEGRADED, CAN_FAULT_TEMPERATURE_UNKNOWN);
    assert_true(isnan(watch_temperature_c(&w.watch)));
    w.ambient = true;
    run(&w, 990); /* up to where one comes */
    assert_is(&w, CAN_DEGRADED, CAN_FAULT_TEMPERATURE_UNKNOWN);
    run(&w, 980);
    assert_is(&w, CAN_DEGRADED, CAN_FAULT_TEMPERATURE_UNKNOWN);
    run(&w, 20);
    assert_well(&w);
    assert_near(watch_temperature_c(&w.watch), 11.0, 1e-9);
}

/* A rig file's is a constant: what was measured must not give way to it unsaid. */
static void the_temperature_of_the_survey_counts_until_the_vehicle_tells_one(void **state)
{
    struct world w;

    (void)state;
    start(&w, &fixed);
    watch_survey(&w.watch, 20.0);
    w.ambient = false;
    run(&w, 5000);
    assert_well(&w);
    assert_near(watch_temperature_c(&w.watch), 20.0, 1e-9);
    w.ambient = true;
    run(&w, 2000);
    assert_well(&w);
    assert_near(watch_temperature_c(&w.watch), 11.0, 1e-9);
    w.ambient = false;
    watch_survey(&w.watch, 20.0); /* as it does every second */
    run(&w, 3000);
    assert_well(&w);
    run(&w, 10);
    assert_is(&w, CAN_DEGRADED, CAN_FAULT_TEMPERATURE_UNKNOWN);
    assert_true(isnan(watch_temperature_c(&w.watch)));
}

/* What a node tells at once is judged with the next step. */
static void tell_fault(struct world *w, const char *name, uint32_t count, uint32_t of)
{
    w->fault = name;
    w->count = count;
    w->of = of;
    tell_health(w, "dsp");
    tell_health(w, "array"); /* which says nothing of it, and does not take it back */
}

static void assert_channels(const char *name, enum can_fault fault)
{
    struct world w;

    start_well(&w);
    tell_fault(&w, name, 7, 16);
    run(&w, 10);
    assert_is(&w, CAN_DEGRADED, fault);
    assert_true(watch_lets_objects(&w.watch));
    tell_fault(&w, name, 8, 16);
    run(&w, 10);
    assert_is(&w, CAN_BLOCKED, fault);
    assert_false(watch_lets_objects(&w.watch));
    tell_fault(&w, name, 1, 16);
    run(&w, 990);
    assert_is(&w, CAN_BLOCKED, fault);
    run(&w, 10);
    assert_is(&w, CAN_DEGRADED, fault);
    tell_fault(&w, NULL, 0, 0);
    run(&w, 990);
    assert_is(&w, CAN_DEGRADED, fault);
    run(&w, 10);
    assert_well(&w);
}

static void silent_microphones_degrade_and_half_of_them_block(void **state)
{
    (void)state;
    assert_channels(NODE_FAULT_CHANNELS_SILENT, CAN_FAULT_CHANNELS_DEAD);
}

static void so_do_damaged_ones(void **state)
{
    (void)state;
    assert_channels(NODE_FAULT_ELEMENTS_DAMAGED, CAN_FAULT_ELEMENT_ERRORS);
}

static void and_clipped_ones(void **state)
{
    (void)state;
    assert_channels(NODE_FAULT_CHANNELS_CLIPPED, CAN_FAULT_CLIPPED);
}

static void so_do_speakers_that_nobody_hears(void **state)
{
    (void)state;
    assert_channels(NODE_FAULT_SPEAKERS_MUTE, CAN_FAULT_CHANNELS_DEAD);
}

static void tell_as(struct world *w, const char *node, const char *name, uint32_t count)
{
    Anlos__Health h = ANLOS__HEALTH__INIT;
    Anlos__Fault fault = ANLOS__FAULT__INIT, *faults[] = {&fault};

    fault.name = (char *)name;
    fault.count = count;
    fault.of = 16;
    h.node = (char *)node;
    h.state = ANLOS__HEALTH__STATE__READY;
    h.faults = faults;
    h.n_faults = 1;
    watch_health(&w->watch, &h, w->now_ns);
}

/* 7 of 16 that both tell of are 7, not 14; with a damaged one they are half. */
static void two_nodes_may_tell_of_the_same_microphones(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    tell_as(&w, "dsp", NODE_FAULT_CHANNELS_SILENT, 3);
    tell_as(&w, "array", NODE_FAULT_CHANNELS_SILENT, 7);
    run(&w, 10);
    assert_is(&w, CAN_DEGRADED, CAN_FAULT_CHANNELS_DEAD);
    tell_as(&w, "dsp", NODE_FAULT_ELEMENTS_DAMAGED, 1);
    run(&w, 10);
    assert_int_equal(watch_state(&w.watch), CAN_BLOCKED);
}

static void a_wall_that_is_not_likely_or_not_seen_is_lost(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    w.wall_existence = 0.4;
    run(&w, 90);
    assert_well(&w);
    run(&w, 10);
    assert_is(&w, CAN_DEGRADED, CAN_FAULT_WALL_LOST);
    w.wall_existence = 0.9;
    run(&w, 1080);
    assert_is(&w, CAN_DEGRADED, CAN_FAULT_WALL_LOST);
    run(&w, 20);
    assert_well(&w);
    w.wall_unseen_s = 2.1;
    run(&w, 100);
    assert_is(&w, CAN_DEGRADED, CAN_FAULT_WALL_LOST);
}

static void
a_wall_of_which_its_node_says_nothing_is_lost_after_half_a_second(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    w.walls = false;
    run(&w, 500);
    assert_well(&w);
    run(&w, 10);
    assert_is(&w, CAN_DEGRADED, CAN_FAULT_WALL_LOST);
}

/* Of a survey that names none, where no node looks for one; or nobody knows where on the
 * vehicle the array is.  Every place is then sent as not available. */
static void an_array_that_cannot_tell_places_is_degraded(void **state)
{
    static const struct watch_config alone = {.fixed = true, .ego = true};
    struct world w;

    (void)state;
    for (int mounted = 0; mounted < 2; mounted++) {
        start(&w, &alone);
        w.mounted = mounted;
        w.mirrored = !mounted;
        run(&w, 10500);
        assert_is(&w, CAN_DEGRADED, CAN_FAULT_WALL_LOST);
        w.mounted = w.mirrored = true;
        run(&w, 250); /* up to where a list comes, with the half second */
        assert_is(&w, CAN_DEGRADED, CAN_FAULT_WALL_LOST);
        run(&w, 1000);
        assert_well(&w);
    }
}

/* Of seconds or of hundredths, forward or back; less is how exactly it is measured. */
static void a_clock_that_was_set_is_told_for_5_s(void **state)
{
    static const int64_t jumps[] = {21 * MS, -21 * MS, 3600000 * MS};
    struct world w;

    (void)state;
    for (size_t i = 0; i < 3; i++) {
        start_well(&w);
        w.ahead_ns += 19 * MS;
        run(&w, 10);
        assert_well(&w);
        w.ahead_ns += jumps[i];
        run(&w, 10);
        assert_is(&w, CAN_DEGRADED, CAN_FAULT_CLOCK_JUMP);
        run(&w, 4990);
        assert_is(&w, CAN_DEGRADED, CAN_FAULT_CLOCK_JUMP);
        run(&w, 10);
        assert_well(&w);
    }
}

static void a_wrong_frame_of_the_vehicle_is_told_for_a_second(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    watch_wrong_input(&w.watch);
    run(&w, 1000);
    assert_is(&w, CAN_DEGRADED, CAN_FAULT_INPUT_E2E);
    run(&w, 10);
    assert_well(&w);
}

static void an_array_that_is_away_is_a_fault(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    tell_fault(&w, NODE_FAULT_ARRAY_AWAY, 1, 1);
    run(&w, 10);
    assert_is(&w, CAN_FAULT, CAN_FAULT_ARRAY_AWAY);
    assert_false(watch_lets_objects(&w.watch));
    tell_fault(&w, NULL, 0, 0);
    run(&w, 990);
    assert_is(&w, CAN_FAULT, CAN_FAULT_ARRAY_AWAY);
    run(&w, 10);
    assert_well(&w);
}

static void a_node_that_ended_is_lost_at_once(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    tell_fault(&w, NODE_FAULT_NODES_LOST, 1, 8);
    run(&w, 10);
    assert_is(&w, CAN_DEGRADED, CAN_FAULT_NODE_LOST);
}

static void so_is_one_that_calls_itself_faulty(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    w.state = ANLOS__HEALTH__STATE__FAULT;
    tell_health(&w, "dsp");
    run(&w, 10);
    assert_is(&w, CAN_DEGRADED, CAN_FAULT_NODE_LOST);
    w.state = ANLOS__HEALTH__STATE__DEGRADED;
    tell_health(&w, "dsp");
    run(&w, 1000);
    assert_well(&w);
}

/* It hangs; its last word came with the full second. */
static void a_node_that_says_nothing_is_lost_after_two_and_a_half_seconds(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    w.health = false;
    run(&w, 2500);
    assert_well(&w);
    run(&w, 10);
    assert_is(&w, CAN_DEGRADED, CAN_FAULT_NODE_LOST);
}

static void who_only_looks_on_may_come_and_go(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    tell_health(&w, "view");
    tell_health(&w, "record");
    run(&w, 5000);
    assert_well(&w);
}

/* Rounded down to the steps of its signal. */
static void noise_degrades_and_says_how_far_the_sensor_reaches(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    assert_near(watch_range_m(&w.watch), 3.8, 1e-9);
    w.range_m = 2.4;
    tell_fault(&w, NODE_FAULT_RANGE_REDUCED, 1, 1);
    run(&w, 1000);
    assert_is(&w, CAN_DEGRADED, CAN_FAULT_RANGE_REDUCED);
    assert_near(watch_range_m(&w.watch), 2.4, 1e-9);
    assert_true(watch_lets_objects(&w.watch));
    tell_fault(&w, NULL, 0, 0);
    w.range_m = 4.0;
    run(&w, 1000);
    assert_well(&w);
    assert_near(watch_range_m(&w.watch), 4.0, 1e-9);
}

static void without_a_wall_or_word_of_the_array_the_range_is_not_known(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    w.mirrored = false;
    run(&w, 260);
    assert_true(isnan(watch_range_m(&w.watch)));
    w.mirrored = true;
    run(&w, 1740);
    assert_near(watch_range_m(&w.watch), 3.8, 1e-9);
    w.health = false;
    run(&w, 2510);
    assert_true(isnan(watch_range_m(&w.watch)));
}

static void a_covered_element_blocks_until_it_is_free(void **state)
{
    static const char *const faults[] = {NODE_FAULT_MICROPHONES_COVERED,
                                         NODE_FAULT_SPEAKERS_COVERED};
    struct world w;

    (void)state;
    for (int k = 0; k < 2; k++) {
        start_well(&w);
        tell_fault(&w, faults[k], 1, 16);
        run(&w, 10);
        assert_is(&w, CAN_BLOCKED, CAN_FAULT_ELEMENTS_COVERED);
        assert_false(watch_lets_objects(&w.watch));
        tell_fault(&w, NULL, 0, 0);
        run(&w, 990);
        assert_is(&w, CAN_BLOCKED, CAN_FAULT_ELEMENTS_COVERED);
        run(&w, 10);
        assert_well(&w);
    }
}

static void a_moved_element_degrades_until_it_is_back(void **state)
{
    static const char *const faults[] = {NODE_FAULT_MICROPHONES_MOVED,
                                         NODE_FAULT_SPEAKERS_MOVED};
    struct world w;

    (void)state;
    for (int k = 0; k < 2; k++) {
        start_well(&w);
        tell_fault(&w, faults[k], 1, 16);
        run(&w, 10);
        assert_is(&w, CAN_DEGRADED, CAN_FAULT_ELEMENTS_MOVED);
        assert_true(watch_lets_objects(&w.watch));
        tell_fault(&w, NULL, 0, 0);
        run(&w, 990);
        assert_is(&w, CAN_DEGRADED, CAN_FAULT_ELEMENTS_MOVED);
        run(&w, 10);
        assert_well(&w);
    }
}

static void another_array_or_a_tone_degrades_as_long_as_it_is_heard(void **state)
{
    static const char *const faults[] = {NODE_FAULT_INTERFERENCE, NODE_FAULT_TONE};
    struct world w;

    (void)state;
    for (int k = 0; k < 2; k++) {
        start_well(&w);
        tell_fault(&w, faults[k], 1, 1);
        run(&w, 10);
        assert_is(&w, CAN_DEGRADED, CAN_FAULT_INTERFERENCE);
        assert_true(watch_lets_objects(&w.watch));
        tell_fault(&w, NULL, 0, 0);
        run(&w, 1000);
        assert_well(&w);
    }
}

static void lists_that_were_dropped_are_told_for_5_s(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    watch_dropped(&w.watch, 3);
    run(&w, 5000);
    assert_is(&w, CAN_DEGRADED, CAN_FAULT_LISTS_DROPPED);
    watch_dropped(&w.watch, 3);
    run(&w, 10);
    assert_well(&w);
}

static void the_worst_of_several_faults_is_the_state(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    w.ego = false;
    run(&w, 110);
    assert_int_equal(watch_state(&w.watch), CAN_DEGRADED);
    tell_fault(&w, NODE_FAULT_CHANNELS_SILENT, 16, 16);
    run(&w, 10);
    assert_int_equal(watch_state(&w.watch), CAN_BLOCKED);
    w.lists = false;
    run(&w, 400);
    assert_int_equal(watch_state(&w.watch), CAN_FAULT);
    assert_int_equal(watch_faults(&w.watch), 1u << CAN_FAULT_EGO_MISSING |
                                                 1u << CAN_FAULT_CHANNELS_DEAD |
                                                 1u << CAN_FAULT_IMAGE_STALE);
    assert_int_equal(w.watch.raised[CAN_FAULT_EGO_MISSING], 1);
}

static void a_sensor_that_begins_is_no_faulty_one(void **state)
{
    struct world w;

    (void)state;
    start(&w, &fixed);
    w.lists = w.walls = false;
    run(&w, 3000);
    assert_int_equal(watch_state(&w.watch), CAN_INIT);
    assert_int_equal(watch_faults(&w.watch),
                     1u << CAN_FAULT_IMAGE_STALE | 1u << CAN_FAULT_WALL_LOST);
    assert_false(watch_lets_objects(&w.watch));
    w.lists = w.walls = true;
    run(&w, 1500);
    assert_well(&w);
}

static void one_that_does_not_begin_within_10_s_is(void **state)
{
    struct world w;

    (void)state;
    start(&w, &fixed);
    w.lists = false;
    run(&w, 10000);
    assert_int_equal(watch_state(&w.watch), CAN_INIT);
    run(&w, 20);
    assert_is(&w, CAN_FAULT, CAN_FAULT_IMAGE_STALE);
}

static void the_state_of_the_scan_comes_first(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    tell_scan(&w, ANLOS__SCAN_STATUS__STATE__FAILED);
    run(&w, 10);
    assert_int_equal(watch_state(&w.watch), CAN_FAULT);
    tell_scan(&w, ANLOS__SCAN_STATUS__STATE__WAITING);
    run(&w, 10);
    assert_int_equal(watch_state(&w.watch), CAN_INIT);
}

/* Its image may take as long as it takes, and nobody waits for motion or walls. */
/* A stage that stalled is a fault; one that a person holds goes on when that ends. */
static void a_scan_that_a_person_holds_is_on_standby(void **state)
{
    static const struct watch_config stepped = {.ego = true};
    struct world w;

    (void)state;
    start(&w, &stepped);
    run(&w, 100);
    for (int held = 0; held < 2; held++) {
        Anlos__ScanStatus scan = ANLOS__SCAN_STATUS__INIT;
        scan.state = ANLOS__SCAN_STATUS__STATE__PAUSED;
        scan.held = held;
        watch_scan(&w.watch, &scan);
        run(&w, 10);
        assert_int_equal(watch_state(&w.watch), held ? CAN_STANDBY : CAN_FAULT);
        assert_false(watch_lets_objects(&w.watch));
        tell_scan(&w, ANLOS__SCAN_STATUS__STATE__RUNNING);
        run(&w, 10);
        assert_well(&w);
    }
}

static void a_scan_is_not_judged_by_what_it_does_not_need(void **state)
{
    struct world w;

    (void)state;
    start(&w, &(struct watch_config){.wall = true});
    w.lists = w.ego = w.walls = w.ambient = false;
    run(&w, 20);
    assert_well(&w);
    w.health = false;
    run(&w, 60000);
    assert_well(&w);
    tell_fault(&w, NODE_FAULT_ARRAY_AWAY, 1, 1);
    run(&w, 10);
    assert_is(&w, CAN_FAULT, CAN_FAULT_ARRAY_AWAY);
}

static void in_a_replay_only_the_scan_counts(void **state)
{
    struct world w;

    (void)state;
    start(&w, &(struct watch_config){.fixed = true, .ego = true, .replayed = true});
    w.lists = w.ego = w.ambient = false;
    tell_fault(&w, NODE_FAULT_ARRAY_AWAY, 1, 1);
    watch_wrong_input(&w.watch);
    run(&w, 20000);
    assert_well(&w);
    assert_true(watch_lets_objects(&w.watch));
    tell_scan(&w, ANLOS__SCAN_STATUS__STATE__FAILED);
    assert_int_equal(watch_state(&w.watch), CAN_FAULT);
    assert_false(watch_lets_objects(&w.watch));
}

/* Steps of 10 ms for five minutes; what the vehicle sees. */
struct flapping {
    unsigned changes, better;
    int64_t bad_ns; /* when it was bad last */
};

/* An array that is away for bad_ms of every period_ms.  Each step is checked: bad is
 * faulty at once, and what is better comes after a second without a break. */
static struct flapping flap(int64_t bad_ms, int64_t period_ms)
{
    struct flapping f = {0, 0, 0};
    struct world w;

    start_well(&w);
    for (int64_t ms = 0; ms < 300000; ms += 10) {
        bool bad = ms % period_ms < bad_ms;
        enum can_state before = watch_state(&w.watch);
        if (bad != (w.fault != NULL))
            tell_fault(&w, bad ? NODE_FAULT_ARRAY_AWAY : NULL, bad, 1);
        run(&w, 10);
        f.bad_ns = bad ? w.now_ns : f.bad_ns;
        enum can_state expected = w.now_ns - f.bad_ns < WATCH_HEALTH_NS ? CAN_FAULT
                                                                        : CAN_ACTIVE;
        assert_int_equal(watch_state(&w.watch), expected);
        assert_int_equal(watch_lets_objects(&w.watch), expected == CAN_ACTIVE);
        f.changes += watch_state(&w.watch) != before;
        f.better += before == CAN_FAULT && expected == CAN_ACTIVE;
    }
    return f;
}

/* Of any period.  Well for less than a second: once, and never back.  For longer: there
 * and back in each period, which is longer than a second. */
static void a_fault_that_flaps_changes_the_state_as_often_as_it_is_said(void **state)
{
    (void)state;
    for (int64_t period_ms = 20; period_ms <= 6000; period_ms += 330)
        for (int64_t bad_ms = 10; bad_ms < period_ms; bad_ms += 490) {
            struct flapping f = flap(bad_ms, period_ms);
            int64_t periods = (300000 + period_ms - 1) / period_ms;
            if (period_ms - bad_ms < 1000)
                assert_int_equal(f.changes, 1);
            else
                assert_in_range(f.changes, 2 * periods - 1, 2 * periods);
            assert_true(f.better <= 300);
        }
}

/* Three faults of three states go one after the other, a tenth of a second apart. */
static void the_state_gets_better_once_a_second_at_most(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    w.ego = false;
    tell_fault(&w, NODE_FAULT_CHANNELS_SILENT, 8, 16);
    tell_as(&w, "recon", NODE_FAULT_ARRAY_AWAY, 1);
    run(&w, 500);
    assert_int_equal(watch_state(&w.watch), CAN_FAULT);
    tell_as(&w, "recon", NODE_FAULT_ARRAY_AWAY, 0);
    run(&w, 100);
    tell_fault(&w, NODE_FAULT_CHANNELS_SILENT, 1, 16);
    run(&w, 890);
    assert_int_equal(watch_state(&w.watch), CAN_FAULT);
    run(&w, 10);
    assert_int_equal(watch_state(&w.watch), CAN_BLOCKED);
    run(&w, 990);
    assert_int_equal(watch_state(&w.watch), CAN_BLOCKED);
    run(&w, 10);
    assert_int_equal(watch_state(&w.watch), CAN_DEGRADED);
}

/* Nobody told of anything wrong, and still it has to be well for a second. */
static void a_scan_that_waited_for_a_moment_begins_anew(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    tell_scan(&w, ANLOS__SCAN_STATUS__STATE__WAITING);
    run(&w, 10);
    tell_scan(&w, ANLOS__SCAN_STATUS__STATE__RUNNING);
    run(&w, 1000);
    assert_int_equal(watch_state(&w.watch), CAN_INIT);
    assert_false(watch_lets_objects(&w.watch));
    run(&w, 10);
    assert_well(&w);
}

/* The node does not run for so long.  Its socket has kept the frames of the vehicle. */
static void sleep_on(struct world *w, int64_t ms)
{
    w->now_ns += ms * MS;
    watch_ego(&w->watch, w->now_ns);
}

/* It gets the processor again, and lists wait for it that it takes one by one. */
static void a_node_that_did_not_run_itself_misses_no_image(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    sleep_on(&w, 490);
    watch_step(&w.watch, w.now_ns);
    assert_well(&w);
    tell_list(&w);
    run(&w, 250);
    assert_well(&w);
}

/* What the stop excused is over with the list that waited: the next one is due as ever.
 */
static void a_list_that_waited_ends_what_is_excused(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    sleep_on(&w, 490);
    tell_list(&w);
    w.lists = false;
    run(&w, 350);
    assert_well(&w);
    run(&w, 10);
    assert_is(&w, CAN_FAULT, CAN_FAULT_IMAGE_STALE);
}

/* Of 510 ms from one step to the next 490 are not held against them; 350 are over then.
 */
static void nor_may_others_be_silent_for_that(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    w.lists = false;
    sleep_on(&w, 500);
    run(&w, 340);
    assert_well(&w);
    run(&w, 10);
    assert_is(&w, CAN_FAULT, CAN_FAULT_IMAGE_STALE);
}

/* The vehicle has not heard of it for so long either. */
static void who_did_not_run_for_long_is_faulty_when_it_goes_on(void **state)
{
    struct world w;

    (void)state;
    start_well(&w);
    sleep_on(&w, 900);
    watch_step(&w.watch, w.now_ns);
    assert_is(&w, CAN_FAULT, CAN_FAULT_IMAGE_STALE);
}

/* A machine that does much else for five minutes: this node does not run for up to 400 ms
 * every second, and of what comes every 24 ms nothing gets through for up to 100 ms. */
static void a_loaded_machine_changes_no_state_in_five_minutes(void **state)
{
    uint32_t random = 1;
    unsigned changes = 0;
    struct world w;

    (void)state;
    start(&w, &fixed);
    w.cycle_ns = 20 * MS;
    run(&w, 5000);
    assert_well(&w);
    for (int64_t end = w.now_ns + 300000 * MS; w.now_ns < end;) {
        random = random * 1664525u + 1013904223u;
        w.lists = false;
        run(&w, 10 * (random >> 16) / 65536 * 10);
        w.lists = true;
        run(&w, 500);
        random = random * 1664525u + 1013904223u;
        sleep_on(&w, 10 + 39 * (int64_t)(random >> 16) / 65536 * 10);
        watch_ambient(&w.watch, 11.0, w.now_ns);
        tell_health(&w, "array");
        tell_health(&w, "dsp");
        changes += watch_state(&w.watch) != CAN_ACTIVE;
        run(&w, 100);
        changes += watch_state(&w.watch) != CAN_ACTIVE;
    }
    assert_int_equal(changes, 0);
    assert_int_equal(w.watch.raised[CAN_FAULT_IMAGE_STALE], 0);
}

static void faults_have_names_for_a_person(void **state)
{
    struct world w;
    char text[256], tiny[16];

    (void)state;
    start_well(&w);
    watch_text(&w.watch, text, sizeof text);
    assert_string_equal(text, "");
    w.ego = false;
    tell_fault(&w, NODE_FAULT_CHANNELS_SILENT, 1, 16);
    run(&w, 110);
    watch_text(&w.watch, text, sizeof text);
    assert_string_equal(text, "no motion of the vehicle, silent microphones or speakers");
    watch_text(&w.watch, tiny, sizeof tiny);
    assert_string_equal(tiny, "no motion of th");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_image_that_does_not_come_is_a_fault_100_ms_after_it_was_due),
        cmocka_unit_test(an_image_of_old_sound_is_a_fault_when_it_comes),
        cmocka_unit_test(an_image_may_come_as_late_as_the_ones_before),
        cmocka_unit_test(a_slow_array_is_judged_by_its_own_pace),
        cmocka_unit_test(an_outage_does_not_count_as_the_pace_of_lists),
        cmocka_unit_test(motion_that_does_not_come_is_missing_after_100_ms),
        cmocka_unit_test(a_temperature_that_nobody_tells_is_unknown_after_3_s),
        cmocka_unit_test(
            the_temperature_of_the_survey_counts_until_the_vehicle_tells_one),
        cmocka_unit_test(silent_microphones_degrade_and_half_of_them_block),
        cmocka_unit_test(so_do_damaged_ones),
        cmocka_unit_test(and_clipped_ones),
        cmocka_unit_test(so_do_speakers_that_nobody_hears),
        cmocka_unit_test(two_nodes_may_tell_of_the_same_microphones),
        cmocka_unit_test(a_wall_that_is_not_likely_or_not_seen_is_lost),
        cmocka_unit_test(
            a_wall_of_which_its_node_says_nothing_is_lost_after_half_a_second),
        cmocka_unit_test(an_array_that_cannot_tell_places_is_degraded),
        cmocka_unit_test(a_clock_that_was_set_is_told_for_5_s),
        cmocka_unit_test(a_wrong_frame_of_the_vehicle_is_told_for_a_second),
        cmocka_unit_test(an_array_that_is_away_is_a_fault),
        cmocka_unit_test(a_node_that_ended_is_lost_at_once),
        cmocka_unit_test(so_is_one_that_calls_itself_faulty),
        cmocka_unit_test(a_node_that_says_nothing_is_lost_after_two_and_a_half_seconds),
        cmocka_unit_test(who_only_looks_on_may_come_and_go),
        cmocka_unit_test(noise_degrades_and_says_how_far_the_sensor_reaches),
        cmocka_unit_test(without_a_wall_or_word_of_the_array_the_range_is_not_known),
        cmocka_unit_test(a_covered_element_blocks_until_it_is_free),
        cmocka_unit_test(a_moved_element_degrades_until_it_is_back),
        cmocka_unit_test(another_array_or_a_tone_degrades_as_long_as_it_is_heard),
        cmocka_unit_test(lists_that_were_dropped_are_told_for_5_s),
        cmocka_unit_test(the_worst_of_several_faults_is_the_state),
        cmocka_unit_test(a_sensor_that_begins_is_no_faulty_one),
        cmocka_unit_test(one_that_does_not_begin_within_10_s_is),
        cmocka_unit_test(the_state_of_the_scan_comes_first),
        cmocka_unit_test(a_scan_that_a_person_holds_is_on_standby),
        cmocka_unit_test(a_scan_is_not_judged_by_what_it_does_not_need),
        cmocka_unit_test(in_a_replay_only_the_scan_counts),
        cmocka_unit_test(a_fault_that_flaps_changes_the_state_as_often_as_it_is_said),
        cmocka_unit_test(the_state_gets_better_once_a_second_at_most),
        cmocka_unit_test(a_scan_that_waited_for_a_moment_begins_anew),
        cmocka_unit_test(a_node_that_did_not_run_itself_misses_no_image),
        cmocka_unit_test(a_list_that_waited_ends_what_is_excused),
        cmocka_unit_test(nor_may_others_be_silent_for_that),
        cmocka_unit_test(who_did_not_run_for_long_is_faulty_when_it_goes_on),
        cmocka_unit_test(a_loaded_machine_changes_no_state_in_five_minutes),
        cmocka_unit_test(faults_have_names_for_a_person),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
