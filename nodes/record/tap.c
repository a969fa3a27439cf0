/* SPDX-License-Identifier: MIT */
#include "nodes/record/tap.h"

#include <errno.h>
#include <fnmatch.h>
#include <stdlib.h>

#include "nodes/rt/patterns.h"
#include "nodes/rt/process.h"

/* The first pattern that no topic matches, in out. */
static bool finds_stray(const char *patterns, char out[PATTERN_SIZE])
{
    while (patterns && (patterns = patterns_next(patterns, out))) {
        const struct topic *t = topics_all();
        while (t->name && fnmatch(out, t->name, 0))
            t++;
        if (!t->name)
            return true;
    }
    return false;
}

int choice_make(struct choice *c, const char *topics, const char *exclude,
                struct error *why)
{
    char stray[PATTERN_SIZE];

    *c = (struct choice){0};
    if (finds_stray(topics, stray) || finds_stray(exclude, stray))
        return error_say(why, -EINVAL,
                         "no topic is called \"%s\"; 'anlos topic list' has their names",
                         stray);
    c->topics = calloc(TOPICS_COUNT, sizeof *c->topics);
    if (!c->topics)
        return error_say(why, -ENOMEM, "out of memory");
    for (const struct topic *t = topics_all(); t->name; t++)
        if (patterns_match(topics, t->name) &&
            !(exclude && patterns_match(exclude, t->name)))
            c->topics[c->n++] = t;
    if (c->n)
        return 0;
    choice_clear(c);
    return error_say(why, -EINVAL, "no topic is left to be recorded");
}

void choice_clear(struct choice *c)
{
    free(c->topics);
    *c = (struct choice){0};
}

#define COUNT_PERIOD_NS 100000000LL
#define TRIM_PERIOD_NS  10000000000LL
#define NS_PER_MS       1000000LL
#define QUIET_MS        300 /* also where this process does not run for a moment */
#define LAST_NS         2000000000LL /* to wait for what is on its way */

static bool is_chosen(const struct tap *t, const struct topic *topic)
{
    for (size_t i = 0; i < t->n_topics; i++)
        if (t->topics[i] == topic)
            return true;
    return false;
}

int tap_open(struct tap *t, struct bus *bus, struct recorder *recorder,
             struct snapshot *snapshot, const struct topic *const *topics, size_t n,
             const struct clock_source *clock)
{
    int err = 0;

    *t = (struct tap){.bus = bus,
                      .recorder = recorder,
                      .snapshot = snapshot,
                      .topics = topics,
                      .n_topics = n,
                      .clock = clock};
    bus_keep_all(bus, TAP_QUEUE_BYTES, clock_now_ns(clock));
    for (const struct topic *topic = topics_all(); !err && topic->name; topic++)
        if (is_chosen(t, topic) || (snapshot && snapshot_wants(snapshot, topic)))
            err = bus_subscribe(bus, topic);
    if (err)
        return err;
    t->room = bus_counts(bus, NULL, 0);
    t->counts = calloc(t->room ? t->room : 1, sizeof *t->counts);
    return t->counts ? 0 : -ENOMEM;
}

/* What is lost by now, to both. */
static void count_lost(struct tap *t)
{
    size_t n = bus_counts(t->bus, t->counts, t->room);
    int64_t now_ns = clock_now_ns(t->clock);

    t->lost = 0;
    for (size_t i = 0; i < n && i < t->room; i++) {
        uint64_t lost = t->counts[i].gaps + t->counts[i].dropped;
        if (t->counts[i].published || !is_chosen(t, t->counts[i].topic))
            continue;
        t->lost += lost;
        if (t->recorder)
            recorder_lost(t->recorder, t->counts[i].topic, lost);
        if (t->snapshot)
            snapshot_lost(t->snapshot, t->counts[i].topic, lost, now_ns);
    }
}

/* Milliseconds to t, rounded up. */
static int ms_until(int64_t now_ns, int64_t t_ns)
{
    return t_ns > now_ns ? (int)((t_ns - now_ns + NS_PER_MS - 1) / NS_PER_MS) : 0;
}

/* The last seconds need no disk until somebody asks for them. */
static int stop_recorder(struct tap *t, int err, struct error *why)
{
    if (!err || !t->snapshot)
        return err;
    t->recorder = NULL;
    t->stopped = err;
    t->stopped_why = *why;
    *why = (struct error){""};
    return 0;
}

static int put(struct tap *t, struct bus_message *m, struct error *why)
{
    int64_t now_ns = clock_now_ns(t->clock);
    bool chosen = is_chosen(t, m->topic);
    int err = t->recorder && chosen ? recorder_put(t->recorder, m, now_ns, why) : 0;

    err = stop_recorder(t, err, why);
    t->messages += chosen;
    t->due_ns = 0; /* it may be sooner now */
    if (t->snapshot && !err)
        snapshot_put(t->snapshot, m, now_ns);
    bus_message_free(m); /* a zeroed one, where it was taken over */
    return err;
}

/* Messages pile up whenever the disk takes its time.  ZeroMQ takes the buffers that it
 * reads into anew while it does: one that came above the pile stays there, with it all
 * that the pile took, and each pile that is higher than those before would be growth. */
static void trim_heap(struct tap *t, int64_t now_ns)
{
    if (now_ns < t->trim_due_ns)
        return;
    heap_trim();
    t->trim_due_ns = now_ns + TRIM_PERIOD_NS;
}

static int tick(struct tap *t, struct error *why)
{
    int64_t now = clock_now_ns(t->clock);

    trim_heap(t, now);
    if (now >= t->count_due_ns) {
        count_lost(t);
        t->count_due_ns = now + COUNT_PERIOD_NS;
    }
    t->due_ns = INT64_MAX;
    int err = t->recorder ? recorder_tick(t->recorder, now, &t->due_ns, why) : 0;
    err = stop_recorder(t, err, why);
    if (t->stopped)
        t->due_ns = INT64_MAX;
    if (t->snapshot && now >= snapshot_due_ns(t->snapshot))
        snapshot_step(t->snapshot, now);
    int64_t due_ns = t->snapshot ? snapshot_due_ns(t->snapshot) : INT64_MAX;
    if (due_ns < t->due_ns)
        t->due_ns = due_ns;
    return err;
}

int tap_step(struct tap *t, int timeout_ms, struct error *why)
{
    struct bus_message m;
    int err = tick(t, why);

    if (err)
        return err;
    if (t->due_ns != INT64_MAX) {
        int ms = ms_until(clock_now_ns(t->clock), t->due_ns);
        timeout_ms = ms < timeout_ms ? ms : timeout_ms;
    }
    err = bus_receive(t->bus, &m, timeout_ms);
    if (err)
        return err == -ETIMEDOUT ? 0 : err;
    return put(t, &m, why);
}

/* Stamps of a replay tell nothing of when it was sent. */
int tap_drain(struct tap *t, struct error *why)
{
    int64_t stop_ns = clock_now_ns(t->clock);
    int err = 0;

    bus_resume(t->bus);
    while (!err) {
        struct bus_message m;
        err = bus_receive(t->bus, &m, QUIET_MS);
        if (err)
            break;
        bool late = clock_now_ns(t->clock) > stop_ns + LAST_NS;
        if (m.envelope.publish_ns <= stop_ns && !(late && m.envelope.replayed)) {
            err = put(t, &m, why);
            if (!err)
                err = tick(t, why);
        } else {
            bus_message_free(&m);
            if (late)
                break;
        }
    }
    count_lost(t);
    return err == -ETIMEDOUT || err == -ESHUTDOWN ? 0 : err;
}

void tap_close(struct tap *t)
{
    free(t->counts);
    t->counts = NULL;
}
