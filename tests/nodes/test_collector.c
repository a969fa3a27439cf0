/* SPDX-License-Identifier: MIT */
/* Health messages made by hand go in, a table comes out; the values are arithmetic. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/anlos/collector.h"
#include "tests/nodes/health.h"
#include "tests/nodes/near.h"

#define S  1000000000LL
#define MS 1000000LL

struct rig {
    struct collector *collector;
    struct table table;
    struct health health;
};

static int set_up(void **state)
{
    struct rig *r = calloc(1, sizeof *r);
    *state = r;
    return r ? collector_create(&r->collector) : -1;
}

static int tear_down(void **state)
{
    struct rig *r = *state;
    collector_destroy(r->collector);
    free(r);
    return 0;
}

static struct health *begin(struct rig *r, const char *node)
{
    return health_begin(&r->health, node);
}

static void say(struct rig *r, int64_t epoch_ns, int64_t now_ns)
{
    collector_health(r->collector, &r->health.message, epoch_ns, now_ns);
}

static const struct table_node *node(struct rig *r, const char *name, int64_t now_ns)
{
    collector_table(r->collector, now_ns, &r->table);
    for (size_t i = 0; i < r->table.n_nodes; i++)
        if (!strcmp(r->table.nodes[i].name, name))
            return &r->table.nodes[i];
    fail_msg("no row of %s", name);
    return NULL;
}

static const struct table_topic *topic(struct rig *r, const char *name, int64_t now_ns)
{
    collector_table(r->collector, now_ns, &r->table);
    for (size_t i = 0; i < r->table.n_topics; i++)
        if (!strcmp(r->table.topics[i].topic->name, name))
            return &r->table.topics[i];
    fail_msg("no row of %s", name);
    return NULL;
}

/* Health of the array: pings so far, each of 1000 bytes, and its CPU time. */
static void array_says(struct rig *r, int64_t now_ns, uint64_t pings, double cpu_s)
{
    begin(r, "array")->message.cpu_s = cpu_s;
    health_topic(&r->health, "ping", 1, pings)->bytes = 1000 * pings;
    health_topic(&r->health, "array/fire", 0, 3)->queued = 2;
    say(r, 1, now_ns);
}

static void scan_is_in(struct rig *r, Anlos__Pass pass)
{
    Anlos__ScanStatus m = ANLOS__SCAN_STATUS__INIT;
    m.state = ANLOS__SCAN_STATUS__STATE__RUNNING;
    m.pass = pass;
    m.pings_expected = 200;
    collector_scan(r->collector, &m);
}

static void scan_says(struct rig *r, Anlos__ScanStatus__State state)
{
    Anlos__ScanStatus m = ANLOS__SCAN_STATUS__INIT;
    m.state = state;
    collector_scan(r->collector, &m);
}

static void rates_are_what_was_counted_over_the_time_between(void **state)
{
    struct rig *r = *state;

    array_says(r, 10 * S, 100, 1.0);
    const struct table_node *n = node(r, "array", 10 * S);
    assert_true(isnan(n->rate_hz));
    assert_true(isnan(n->cpu));
    assert_true(isnan(n->links[0].bytes_s));

    array_says(r, 12 * S, 132, 1.5); /* 32 in 2 s, half a second of CPU */
    n = node(r, "array", 12 * S);
    assert_near(n->rate_hz, 16, 1e-9);
    assert_near(n->expected_hz, 16, 0);
    assert_near(n->cpu, 0.25, 1e-9);
    assert_near(n->links[0].bytes_s, 16000, 1e-6);
    assert_near(n->out_hz, 16, 1e-9);
    assert_near(n->in_hz, 0, 1e-9);
    assert_int_equal(n->queued, 2);
}

/* 10 a second until 13 s, none from then on: at 16 s the sample of 13 s is the oldest
 * within the window of 3.5 s. */
static void rates_are_those_of_the_last_three_seconds(void **state)
{
    struct rig *r = *state;

    for (int i = 0; i <= 3; i++)
        array_says(r, (10 + i) * S, 10 * (uint64_t)i, 0);
    assert_near(node(r, "array", 13 * S)->rate_hz, 10, 1e-9);
    array_says(r, 14 * S, 30, 0); /* 11 to 14 s: 20 of them */
    assert_near(node(r, "array", 14 * S)->rate_hz, 20.0 / 3, 1e-9);
    array_says(r, 15 * S, 30, 0);
    array_says(r, 16 * S, 30, 0);
    assert_near(node(r, "array", 16 * S)->rate_hz, 0, 1e-9);
}

/* A node says at once when its state changes; that must not leave a rate over 1 ms. */
static void a_health_message_out_of_turn_does_not_upset_the_rate(void **state)
{
    struct rig *r = *state;

    array_says(r, 10 * S, 0, 0);
    array_says(r, 10 * S + MS, 5, 0);
    assert_true(isnan(node(r, "array", 10 * S + MS)->rate_hz));
    assert_int_equal(r->table.nodes[0].links[0].messages, 5); /* counts are the newest */
    array_says(r, 11 * S, 16, 0);
    array_says(r, 11 * S + MS, 40, 0);
    assert_near(node(r, "array", 11 * S + MS)->rate_hz, 16, 1e-9);
}

static void a_process_that_starts_again_counts_anew(void **state)
{
    struct rig *r = *state;

    begin(r, "dsp");
    health_topic(&r->health, "ping", 0, 500)->gaps = 7;
    say(r, 1, 10 * S);
    begin(r, "dsp");
    health_topic(&r->health, "ping", 0, 516)->gaps = 9;
    say(r, 1, 11 * S);
    const struct table_node *n = node(r, "dsp", 11 * S);
    assert_int_equal(n->gaps, 9);
    assert_int_equal(n->restarts, 0);
    assert_int_equal(n->links[0].lost_lately, 2);

    begin(r, "dsp");
    health_topic(&r->health, "ping", 0, 4);
    say(r, 2, 12 * S);
    n = node(r, "dsp", 12 * S);
    assert_int_equal(n->gaps, 0);
    assert_int_equal(n->restarts, 1);
    assert_int_equal(n->links[0].messages, 4);
    assert_true(isnan(n->rate_hz)); /* 4 - 500 is no rate */
    begin(r, "dsp");
    health_topic(&r->health, "ping", 0, 20);
    say(r, 2, 13 * S);
    assert_near(node(r, "dsp", 13 * S)->rate_hz, 16, 1e-9);
}

/* Two machines, a launcher on each: no restart with every message. */
static void of_two_processes_of_a_name_the_younger_is_shown(void **state)
{
    struct rig *r = *state;

    for (int i = 0; i < 3; i++) {
        array_says(r, (10 + i) * S, 16 * (uint64_t)i, 0);
        begin(r, "array");
        health_topic(&r->health, "ping", 1, 4 * (uint64_t)i);
        say(r, 2, (10 + i) * S + 100 * MS);
    }
    const struct table_node *n = node(r, "array", 12 * S + 100 * MS);
    assert_int_equal(n->restarts, 1);
    assert_true(n->twin);
    assert_near(n->rate_hz, 4, 1e-9);
    /* The older one stays, the younger is gone. */
    array_says(r, 13 * S, 48, 0);
    array_says(r, 15 * S, 80, 0);
    array_says(r, 16 * S, 96, 0);
    n = node(r, "array", 16 * S);
    assert_false(n->twin);
    assert_near(n->rate_hz, 16, 1e-9);
}

static void the_state_is_what_the_node_says(void **state)
{
    static const struct {
        Anlos__Health__State said;
        enum table_node_state is;
    } cases[] = {{ANLOS__HEALTH__STATE__STARTING, TABLE_STARTING},
                 {ANLOS__HEALTH__STATE__READY, TABLE_READY},
                 {ANLOS__HEALTH__STATE__DEGRADED, TABLE_DEGRADED},
                 {ANLOS__HEALTH__STATE__FAULT, TABLE_FAULT}};
    struct rig *r = *state;

    for (size_t i = 0; i < 4; i++) {
        begin(r, "can")->message.state = cases[i].said;
        say(r, 1, (10 + (int64_t)i) * S);
        assert_int_equal(node(r, "can", (10 + (int64_t)i) * S)->state, cases[i].is);
    }
    assert_string_equal(node(r, "can", 13 * S)->text, "at work");
}

static void a_node_whose_lock_is_let_go_is_dead_at_once(void **state)
{
    struct rig *r = *state;

    collector_presence(r->collector, "array", PRESENCE_ALIVE, 9 * S);
    assert_int_equal(node(r, "array", 9 * S)->state, TABLE_STARTING); /* not heard yet */
    array_says(r, 10 * S, 0, 0);
    array_says(r, 11 * S, 16, 0);
    assert_int_equal(node(r, "array", 11 * S)->state, TABLE_READY);
    collector_presence(r->collector, "array", PRESENCE_GONE, 9 * S);
    const struct table_node *n = node(r, "array", 11 * S + MS);
    assert_int_equal(n->state, TABLE_DEAD);
    assert_true(isnan(n->rate_hz) && isnan(n->cpu));
    assert_int_equal(n->queued, 0);
    assert_int_equal(topic(r, "ping", 11 * S + MS)->state, TABLE_CUT);
}

static void one_that_lives_and_says_nothing_is_silent(void **state)
{
    struct rig *r = *state;

    collector_presence(r->collector, "array", PRESENCE_ALIVE, 9 * S);
    array_says(r, 10 * S, 0, 0);
    assert_int_equal(node(r, "array", 12 * S + 499 * MS)->state, TABLE_READY);
    assert_int_equal(node(r, "array", 12 * S + 500 * MS)->state, TABLE_SILENT);
    assert_near(r->table.nodes[0].silent_s, 2.5, 1e-9);
}

/* Hung before anybody looked: that it starts is believed only for a while. */
static void one_that_lives_and_was_never_heard_is_silent_in_the_end(void **state)
{
    struct rig *r = *state;

    collector_presence(r->collector, "array", PRESENCE_ALIVE, 9 * S);
    collector_presence(r->collector, "array", PRESENCE_ALIVE, 10 * S);
    assert_int_equal(node(r, "array", 11 * S + 499 * MS)->state, TABLE_STARTING);
    assert_int_equal(node(r, "array", 11 * S + 500 * MS)->state, TABLE_SILENT);
    collector_presence(r->collector, "array", PRESENCE_GONE, 12 * S);
    collector_presence(r->collector, "array", PRESENCE_ALIVE, 13 * S);
    assert_int_equal(node(r, "array", 14 * S)->state, TABLE_STARTING);
}

/* On another host: there is no lock to be seen here. */
static void without_a_lock_to_see_silence_is_death(void **state)
{
    struct rig *r = *state;

    array_says(r, 10 * S, 0, 0);
    assert_int_equal(node(r, "array", 12 * S)->state, TABLE_READY);
    assert_int_equal(node(r, "array", 12 * S + 500 * MS)->state, TABLE_DEAD);
}

static void
what_ran_before_anybody_looked_is_off_and_what_never_ran_is_not_there(void **state)
{
    struct rig *r = *state;

    collector_presence(r->collector, "can", PRESENCE_GONE, 9 * S);
    collector_presence(r->collector, "dsp", PRESENCE_NEVER, 9 * S);
    assert_int_equal(node(r, "can", 10 * S)->state, TABLE_OFF);
    assert_int_equal(r->table.n_nodes, 1);
}

/* Receipts come of dsp (2 a second) and recon (5); they get lost at the scan. */
static void a_topic_is_the_sum_of_its_nodes(void **state)
{
    struct rig *r = *state;

    for (uint64_t i = 0; i < 2; i++) {
        int64_t now = (10 + (int64_t)i) * S;
        begin(r, "dsp");
        health_topic(&r->health, "receipt", 1, 2 * i)->bytes = 20 * i;
        say(r, 1, now);
        begin(r, "recon");
        health_topic(&r->health, "receipt", 1, 5 * i)->bytes = 50 * i;
        say(r, 1, now);
        begin(r, "scan");
        Anlos__TopicCount *c = health_topic(&r->health, "receipt", 0, 6 * i);
        c->gaps = 3;
        c->dropped = i;
        c->queued = 4;
        say(r, 1, now);
    }
    const struct table_topic *t = topic(r, "receipt", 11 * S);
    assert_near(t->rate_hz, 7, 1e-9);
    assert_near(t->bytes_s, 70, 1e-9);
    assert_near(t->size_bytes, 10, 1e-9);
    assert_near(t->expected_hz, 16, 0);
    assert_int_equal(t->messages, 7);
    assert_int_equal(t->lost, 4);
    assert_int_equal(t->queued, 4);
    assert_int_equal(t->known, 2);
    assert_int_equal(t->alive, 2);
    assert_int_equal(t->state, TABLE_LOSING); /* one of the four just now */
    assert_int_equal(r->table.lost, 4);
    assert_int_equal(topic(r, "detections", 11 * S)->state, TABLE_ABSENT);
}

/* As when a bag is played: what is received must come from somewhere. */
static void a_topic_without_a_publisher_is_told_by_its_receivers(void **state)
{
    struct rig *r = *state;

    for (uint64_t i = 0; i < 2; i++) {
        begin(r, "dsp");
        health_topic(&r->health, "ping", 0, 8 * i)->bytes = 800 * i;
        say(r, 1, (10 + (int64_t)i) * S);
        begin(r, "scan");
        health_topic(&r->health, "ping", 0, 6 * i)->bytes = 600 * i;
        say(r, 1, (10 + (int64_t)i) * S);
    }
    const struct table_topic *t = topic(r, "ping", 11 * S);
    assert_int_equal(t->state, TABLE_OK);
    assert_int_equal(t->known, 0);
    assert_int_equal(t->messages, 8);
    assert_near(t->rate_hz, 8, 1e-9);
    assert_near(t->bytes_s, 800, 1e-9);
    assert_near(t->size_bytes, 100, 1e-9);
}

static void every_living_node_is_expected_to_tell_of_its_health(void **state)
{
    static const char *const names[] = {"array", "dsp", "can"};
    struct rig *r = *state;

    for (int i = 0; i < 3; i++) {
        begin(r, names[i]);
        health_topic(&r->health, "health", 1, 1);
        say(r, 1, 10 * S);
    }
    assert_near(topic(r, "health", 10 * S)->expected_hz, 3, 0);
    collector_presence(r->collector, "can", PRESENCE_ALIVE, 9 * S);
    collector_presence(r->collector, "can", PRESENCE_GONE, 9 * S);
    assert_near(topic(r, "health", 10 * S)->expected_hz, 2, 0);
}

static void a_rate_is_low_only_while_a_scan_runs(void **state)
{
    struct rig *r = *state;

    array_says(r, 10 * S, 0, 0);
    array_says(r, 11 * S, 3, 0); /* of 16 */
    assert_int_equal(topic(r, "ping", 11 * S)->state, TABLE_OK);
    scan_says(r, ANLOS__SCAN_STATUS__STATE__RUNNING);
    assert_int_equal(topic(r, "ping", 11 * S)->state, TABLE_LOW);
    scan_says(r, ANLOS__SCAN_STATUS__STATE__PAUSED);
    assert_int_equal(topic(r, "ping", 11 * S)->state, TABLE_OK);
    scan_says(r, ANLOS__SCAN_STATUS__STATE__RUNNING);
    array_says(r, 12 * S, 8, 0); /* 4 a second: a quarter */
    assert_int_equal(topic(r, "ping", 12 * S)->state, TABLE_OK);
    /* The scan is dead, and its last word stands. */
    begin(r, "scan");
    say(r, 1, 12 * S);
    collector_presence(r->collector, "scan", PRESENCE_ALIVE, 9 * S);
    collector_presence(r->collector, "scan", PRESENCE_GONE, 9 * S);
    array_says(r, 13 * S, 8, 0);
    assert_int_equal(topic(r, "ping", 13 * S)->state, TABLE_OK);
    assert_true(r->table.scan.over);
}

/* Some topics are only of use in some systems. */
static void what_never_flowed_is_idle_not_low(void **state)
{
    struct rig *r = *state;

    scan_says(r, ANLOS__SCAN_STATUS__STATE__RUNNING);
    array_says(r, 10 * S, 0, 0);
    array_says(r, 11 * S, 0, 0);
    assert_int_equal(topic(r, "ping", 11 * S)->state, TABLE_IDLE);
}

static void the_latency_is_that_of_what_the_node_puts_out(void **state)
{
    struct rig *r = *state;

    begin(r, "dsp");
    Anlos__TopicCount *in = health_topic(&r->health, "ping", 0, 9);
    in->latency_n = 80;
    in->latency_median_s = 0.2;
    in->latency_p99_s = 0.3;
    say(r, 1, 10 * S);
    assert_near(node(r, "dsp", 10 * S)->latency.median_s, 0.2, 0);

    Anlos__TopicCount *out = health_topic(&r->health, "traces", 1, 9);
    out->latency_n = 60;
    out->latency_median_s = 0.4;
    out->latency_p99_s = 0.5;
    say(r, 1, 11 * S);
    const struct table_node *n = node(r, "dsp", 11 * S);
    assert_int_equal(n->latency.n, 60);
    assert_near(n->latency.median_s, 0.4, 0);
    assert_near(n->latency.p99_s, 0.5, 0);
    assert_near(topic(r, "traces", 11 * S)->latency.p99_s, 0.5, 0);
}

static void the_main_rate_is_the_most_frequent_output_else_input(void **state)
{
    struct rig *r = *state;

    begin(r, "report");
    health_topic(&r->health, "health", 1, 0);
    health_topic(&r->health, "log", 1, 0);
    health_topic(&r->health, "volume", 0, 0);
    health_topic(&r->health, "scan/status", 0, 0);
    say(r, 1, 10 * S);
    assert_near(node(r, "report", 10 * S)->expected_hz, 5, 0);

    begin(r, "array");
    health_topic(&r->health, "survey", 1, 0);
    health_topic(&r->health, "ping", 1, 0);
    health_topic(&r->health, "stage/state", 0, 0);
    say(r, 1, 10 * S);
    assert_near(node(r, "array", 10 * S)->expected_hz, 16, 0);
}

/* Background pings end in dsp, which says so by receipts; scene pings in recon. */
static void each_pass_expects_what_flows_in_it(void **state)
{
    struct rig *r = *state;

    begin(r, "dsp");
    health_topic(&r->health, "traces", 1, 0);
    health_topic(&r->health, "receipt", 1, 0)->latency_n = 9;
    say(r, 1, 10 * S);
    begin(r, "recon");
    health_topic(&r->health, "volume", 1, 0);
    health_topic(&r->health, "receipt", 1, 0);
    say(r, 1, 10 * S);
    scan_is_in(r, ANLOS__PASS__BACKGROUND);
    assert_near(topic(r, "traces", 10 * S)->expected_hz, 0, 0);
    assert_near(topic(r, "receipt", 10 * S)->expected_hz, 16, 0);
    assert_near(node(r, "dsp", 10 * S)->expected_hz, 16, 0); /* of receipts */
    assert_near(node(r, "dsp", 10 * S)->links[1].expected_hz, 16, 0);
    assert_near(node(r, "recon", 10 * S)->expected_hz, 0, 0);
    scan_is_in(r, ANLOS__PASS__SCENE);
    assert_near(topic(r, "traces", 10 * S)->expected_hz, 16, 0);
    assert_near(node(r, "dsp", 10 * S)->links[1].expected_hz, 0, 0);
    assert_near(node(r, "recon", 10 * S)->expected_hz, 16, 0);
}

/* An array that stands has no end and no receipts: recon takes 41 pings a second in, and
 * images every fourth. */
static void an_array_that_stands_has_the_pace_of_its_pings(void **state)
{
    struct rig *r = *state;
    const struct table_node *n;

    scan_says(r, ANLOS__SCAN_STATUS__STATE__RUNNING);
    for (unsigned s = 0; s < 3; s++) {
        begin(r, "dsp");
        health_topic(&r->health, "receipt", 1, 0);
        health_topic(&r->health, "ping", 0, 41 * s);
        health_topic(&r->health, "traces", 1, 41 * s);
        say(r, 1, (10 + s) * S);
        begin(r, "recon");
        health_topic(&r->health, "receipt", 1, 0);
        health_topic(&r->health, "volume", 1, 10 * s);
        health_topic(&r->health, "traces", 0, 41 * s);
        say(r, 1, (10 + s) * S);
        begin(r, "wall");
        health_topic(&r->health, "wall", 1, 10 * s);
        health_topic(&r->health, "ping", 0, 41 * s);
        say(r, 1, (10 + s) * S);
    }
    n = node(r, "recon", 12 * S);
    assert_near(n->rate_hz, 41, 1e-9);
    assert_near(n->expected_hz, 0, 0);
    n = node(r, "dsp", 12 * S);
    assert_near(n->rate_hz, 41, 1e-9);
    assert_near(n->expected_hz, 0, 0);
    n = node(r, "wall", 12 * S);
    assert_near(n->rate_hz, 10, 1e-9);
    assert_near(n->expected_hz, 10, 0);
    assert_near(topic(r, "traces", 12 * S)->expected_hz, 0, 0);
    assert_int_equal(topic(r, "traces", 12 * S)->state, TABLE_OK);
    for (unsigned s = 3; s < 30; s++) { /* and none any more */
        begin(r, "dsp");
        health_topic(&r->health, "traces", 1, 82);
        say(r, 1, (10 + s) * S);
    }
    assert_int_equal(topic(r, "traces", 39 * S)->state, TABLE_LOW);
}

static void what_is_foreign_or_too_much_is_left_out(void **state)
{
    struct rig *r = *state;
    char text[2000];

    memset(text, 'x', sizeof text);
    text[sizeof text - 1] = '\0';
    begin(r, "intruder");
    say(r, 1, 10 * S);
    begin(r, "array")->message.text = text;
    health_topic(&r->health, "of/a/later/version", 1, 9);
    for (int i = 0; i < 40; i++)
        health_topic(&r->health, "ping", 1, (uint64_t)i);
    for (int i = 0; i < TABLE_MAX_DEVICE + 4; i++)
        health_device(&r->health, text, (uint64_t)i);
    say(r, 1, 10 * S);
    const struct table_node *n = node(r, "array", 10 * S);
    assert_int_equal(r->table.n_nodes, 1);
    assert_int_equal(n->n_links, 1);
    assert_int_equal(n->links[0].messages, 39);
    assert_int_equal(n->n_device, TABLE_MAX_DEVICE);
    assert_int_equal(strlen(n->text), TABLE_TEXT_SIZE - 1);
}

static void the_log_keeps_its_newest_lines(void **state)
{
    struct rig *r = *state;
    char text[32];
    Anlos__Log m = ANLOS__LOG__INIT;

    m.node = "dsp";
    m.text = text;
    m.level = ANLOS__LOG__LEVEL__WARNING;
    for (int i = 0; i < TABLE_MAX_LOGS + 3; i++) {
        snprintf(text, sizeof text, "line %d", i);
        m.repeats = (uint64_t)i;
        collector_log(r->collector, &m);
    }
    collector_table(r->collector, 10 * S, &r->table);
    assert_int_equal(r->table.n_logs, TABLE_MAX_LOGS);
    assert_string_equal(r->table.logs[0].text, "line 3");
    assert_string_equal(r->table.logs[TABLE_MAX_LOGS - 1].text, "line 66");
    assert_string_equal(r->table.logs[0].level, "warning");
    assert_int_equal(r->table.logs[0].repeats, 3);
}

/* The file for late comers is read after a second, when newer lines may have come. */
static void older_lines_that_are_heard_of_later_come_before_and_none_twice(void **state)
{
    static const int order[] = {30, 40, 10, 20, 30, 40, 50};
    struct rig *r = *state;
    char text[32];
    Anlos__Log m = ANLOS__LOG__INIT;

    m.node = (char *)"dsp";
    m.text = text;
    for (size_t i = 0; i < sizeof order / sizeof *order; i++) {
        snprintf(text, sizeof text, "line %d", order[i]);
        m.stamp_ns = order[i];
        collector_log(r->collector, &m);
    }
    collector_table(r->collector, 10 * S, &r->table);
    assert_int_equal(r->table.n_logs, 5);
    for (int i = 0; i < 5; i++)
        assert_int_equal(r->table.logs[i].stamp_ns, 10 * (i + 1));
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

/* Velocity and age are of tracks alone; one that was deleted is none. */
static void the_newest_list_of_objects_is_kept(void **state)
{
    struct rig *r = *state;
    double velocity[2] = {-0.5, 1.25};
    Anlos__Vec3 at = ANLOS__VEC3__INIT;
    Anlos__Detection d = ANLOS__DETECTION__INIT, gone = ANLOS__DETECTION__INIT;
    Anlos__Detection *both[2] = {&d, &gone};
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;

    collector_table(r->collector, S, &r->table);
    assert_false(r->table.objects.known);
    at.x = 4.5;
    d.id = 3;
    d.position_m = &at;
    d.existence = 0.75;
    d.age_s = 1.5;
    gone.id = 2;
    gone.measurement = ANLOS__MEASUREMENT__DELETED;
    list.detections = both;
    list.n_detections = 2;
    collector_objects(r->collector, &list);
    collector_table(r->collector, S, &r->table);
    assert_int_equal(r->table.objects.n, 1);
    assert_near(r->table.objects.list[0].at_m[0], 4.5, 1e-12);
    assert_true(isnan(r->table.objects.list[0].velocity_m_s[0]));
    assert_true(isnan(r->table.objects.list[0].age_s));
    list.tracked = true;
    d.velocity_m_s = velocity;
    d.n_velocity_m_s = 2;
    collector_objects(r->collector, &list);
    collector_table(r->collector, S, &r->table);
    assert_near(r->table.objects.list[0].velocity_m_s[1], 1.25, 1e-12);
    assert_near(r->table.objects.list[0].age_s, 1.5, 1e-12);
    list.n_detections = 0;
    collector_objects(r->collector, &list);
    collector_table(r->collector, S, &r->table);
    assert_true(r->table.objects.known);
    assert_int_equal(r->table.objects.n, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(rates_are_what_was_counted_over_the_time_between),
        TEST(rates_are_those_of_the_last_three_seconds),
        TEST(a_health_message_out_of_turn_does_not_upset_the_rate),
        TEST(a_process_that_starts_again_counts_anew),
        TEST(of_two_processes_of_a_name_the_younger_is_shown),
        TEST(the_state_is_what_the_node_says),
        TEST(a_node_whose_lock_is_let_go_is_dead_at_once),
        TEST(one_that_lives_and_says_nothing_is_silent),
        TEST(one_that_lives_and_was_never_heard_is_silent_in_the_end),
        TEST(without_a_lock_to_see_silence_is_death),
        TEST(what_ran_before_anybody_looked_is_off_and_what_never_ran_is_not_there),
        TEST(a_topic_is_the_sum_of_its_nodes),
        TEST(a_topic_without_a_publisher_is_told_by_its_receivers),
        TEST(every_living_node_is_expected_to_tell_of_its_health),
        TEST(a_rate_is_low_only_while_a_scan_runs),
        TEST(what_never_flowed_is_idle_not_low),
        TEST(the_latency_is_that_of_what_the_node_puts_out),
        TEST(the_main_rate_is_the_most_frequent_output_else_input),
        TEST(each_pass_expects_what_flows_in_it),
        TEST(an_array_that_stands_has_the_pace_of_its_pings),
        TEST(what_is_foreign_or_too_much_is_left_out),
        TEST(the_newest_list_of_objects_is_kept),
        TEST(the_log_keeps_its_newest_lines),
        TEST(older_lines_that_are_heard_of_later_come_before_and_none_twice),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
