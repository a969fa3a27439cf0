/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/topic/echo.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "nodes/anlos/feed.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/topic/field_path.h"
#include "nodes/anlos/topic/mcap_pipe.h"
#include "nodes/anlos/topic/message_json.h"
#include "nodes/anlos/usage.h"

#define LOOK_UP_MS  100 /* between looks at Ctrl-C and the clock */
#define PATIENCE_NS 2000000000LL
#define LOSSES_NS   1000000000LL

enum { MAX_TOPICS = 64 };

struct echo {
    const struct echo_options *o;
    struct bus *bus;
    const struct topic *const *topics;
    size_t n;
    struct mcap_pipe pipe;
    size_t seen;
    uint64_t lost, refused; /* said so far */
    int64_t heard_ns, said_ns;
    bool waits; /* that is said */
};

static int write_field(const char *field, const ProtobufCMessage *content, bool full)
{
    json_t *all = message_json(content, full);
    json_t *one = all ? field_path_pick(field, all) : NULL;

    json_decref(all);
    return usage_json_line(one, stdout);
}

static int write_json(const struct echo_options *o, const struct bus_message *m)
{
    ProtobufCMessage *content = bus_message_unpack(m);
    const struct message_line l = {.topic = m->topic->name,
                                   .n_topic = strlen(m->topic->name),
                                   .envelope = &m->envelope,
                                   .n_bytes = m->envelope.payload_size,
                                   .content = content,
                                   .why_not = "not a message of the topic's schema"};
    errno = 0;
    int err = o->field && content ? write_field(o->field, content, o->full)
                                  : message_line_write(&l, o->full, stdout);
    if (!err && fflush(stdout))
        err = errno ? -errno : -EIO;
    if (content)
        protobuf_c_message_free_unpacked(content, NULL);
    return err;
}

static void say_losses(struct echo *e)
{
    struct bus_count counts[MAX_TOPICS];
    uint64_t gaps = 0, dropped = 0, refused = bus_refused(e->bus);
    size_t n = bus_counts(e->bus, counts, MAX_TOPICS);

    e->said_ns = feed_now_ns();
    for (size_t i = 0; i < n && i < MAX_TOPICS; i++) {
        gaps += counts[i].gaps;
        dropped += counts[i].dropped;
    }
    if (gaps + dropped > e->lost)
        fprintf(stderr,
                "anlos topic: %" PRIu64 " messages lost so far: %" PRIu64
                " on the way here, %" PRIu64 " came faster than they were taken\n",
                gaps + dropped, gaps, dropped);
    if (refused > e->refused)
        fprintf(stderr,
                "anlos topic: %" PRIu64
                " messages refused so far (wrong magic, version or length)\n",
                refused);
    e->lost = gaps + dropped;
    e->refused = refused;
}

static void say_who_is_awaited(const struct echo *e)
{
    const struct topic *t = e->topics[0];

    fprintf(stderr, "anlos topic: nothing on %s%s so far; it comes from ", t->name,
            e->n > 1 ? " and the others" : "");
    for (size_t i = 0; t->publishers[i]; i++)
        fprintf(stderr, "%s%s", i ? " or " : "",
                !strcmp(t->publishers[i], "*") ? "every process" : t->publishers[i]);
    fprintf(stderr, "; waiting\n");
}

/* Nothing has come for a moment.  0, -EPIPE, -ETIMEDOUT. */
static int idle(struct echo *e)
{
    int64_t silent_ns = feed_now_ns() - e->heard_ns;

    if (e->o->timeout_s > 0.0 && (double)silent_ns > 1e9 * e->o->timeout_s)
        return -ETIMEDOUT;
    if (!e->waits && !e->seen && silent_ns > PATIENCE_NS) {
        e->waits = true;
        say_who_is_awaited(e);
    }
    return usage_is_read() ? 0 : -EPIPE;
}

static int take_next(struct echo *e)
{
    struct bus_message m;
    int err = bus_receive(e->bus, &m, LOOK_UP_MS);

    if (interrupt_requested()) {
        if (!err)
            bus_message_free(&m);
        return -EINTR;
    }
    if (err)
        return err == -ETIMEDOUT ? idle(e) : err;
    err = e->o->mcap ? mcap_pipe_put(&e->pipe, &m) : write_json(e->o, &m);
    bus_message_free(&m);
    e->heard_ns = feed_now_ns();
    if (e->heard_ns - e->said_ns > LOSSES_NS)
        say_losses(e);
    e->seen += !err;
    return err;
}

int echo_run(struct bus *bus, const struct topic *const *topics, size_t n,
             const struct echo_options *o)
{
    struct echo e = {.o = o, .bus = bus, .topics = topics, .n = n};
    int err = o->mcap ? mcap_pipe_begin(&e.pipe, stdout) : 0;

    e.heard_ns = e.said_ns = feed_now_ns();
    while (!err && (!o->count || e.seen < o->count))
        err = take_next(&e);
    say_losses(&e);
    if (o->mcap && (!err || err == -EINTR || err == -ETIMEDOUT)) {
        int ended = mcap_pipe_end(&e.pipe);
        err = err ? err : ended;
    }
    mcap_pipe_free(&e.pipe);
    return err == -EPIPE ? 0 : err; /* `| head` has seen enough */
}
