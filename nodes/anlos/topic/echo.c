/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/topic/topic.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "dsp/list.h"
#include "hal/clock.h"
#include "msgs/bag/schemas.h"
#include "msgs/bag/topic_message.h"
#include "nodes/anlos/feed.h"
#include "nodes/anlos/topic/message_json.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/stop.h"

#define LOOK_UP_MS  100 /* between looks at Ctrl-C and the clock */
#define PATIENCE_NS 2000000000LL
#define LOSSES_NS   1000000000LL

enum { MAX_TOPICS = 64 };

/* Messages as a bag (MCAP) that goes into a pipe: without chunks, index and summary, each
 * message as soon as it comes, behind its schema and channel. */
struct mcap_pipe {
    FILE *f;
    struct bytes_buffer out;
    struct bag_source *sources; /* [n]: channel id is the index from 1 */
    size_t n, room;
};

static int write_out(struct mcap_pipe *p)
{
    if (p->out.failed)
        return -ENOMEM;
    errno = 0;
    size_t written = fwrite(p->out.data, 1, p->out.size, p->f);
    if (written != p->out.size || fflush(p->f))
        return errno ? -errno : -EIO;
    p->out.size = 0;
    return 0;
}

/* Each writes through to f.  0, -ENOMEM, -E2BIG (65535 channels), errno of writing. */
static int mcap_pipe_begin(struct mcap_pipe *p, FILE *f)
{
    const struct bytes magic = {(const uint8_t *)BAG_MAGIC, BAG_MAGIC_SIZE};
    const struct bag_record header = {.opcode = BAG_HEADER,
                                      .header = {.library = bytes_of("anlos")}};

    *p = (struct mcap_pipe){.f = f};
    bytes_put(&p->out, magic);
    bag_record_put(&p->out, &header);
    return write_out(p);
}

static uint16_t schema_id(const struct topic *t)
{
    return (uint16_t)(t - topics_all() + 1);
}

static void put_schema(struct mcap_pipe *p, const struct topic *t)
{
    struct bag_record r = {.opcode = BAG_SCHEMA, .schema = bag_schema_of(t)};

    for (size_t i = 0; i < p->n; i++)
        if (p->sources[i].topic == t)
            return;
    r.schema.id = schema_id(t);
    bag_record_put(&p->out, &r);
}

static int put_channel(struct mcap_pipe *p, const struct bag_source *s)
{
    struct bytes_buffer metadata = {0};

    if (p->n == UINT16_MAX)
        return -E2BIG;
    if (list_grow(&p->sources, p->n, &p->room, sizeof *p->sources))
        return -ENOMEM;
    put_schema(p, s->topic);
    p->sources[p->n++] = *s;
    bag_source_describe(s, &metadata);
    const struct bag_record r = {.opcode = BAG_CHANNEL,
                                 .channel = {.id = (uint16_t)p->n,
                                             .schema_id = schema_id(s->topic),
                                             .topic = bytes_of(s->topic->name),
                                             .message_encoding = bytes_of(BAG_PROTOBUF),
                                             .metadata = bytes_in(&metadata)}};
    bag_record_put(&p->out, &r);
    p->out.failed |= metadata.failed;
    bytes_free(&metadata);
    return 0;
}

static int mcap_pipe_put(struct mcap_pipe *p, const struct bus_message *m)
{
    struct bag_record r = {.opcode = BAG_MESSAGE};
    struct bag_source source;
    size_t i = 0;

    bag_source_from(&source, &r.message, &m->envelope, m->payload);
    while (i < p->n && !bag_source_is_same(&p->sources[i], &source))
        i++;
    int err = i == p->n ? put_channel(p, &source) : 0;
    if (err)
        return err;
    r.message.channel_id = (uint16_t)(i + 1);
    bag_record_put(&p->out, &r);
    return write_out(p);
}

/* What came is a whole file then. */
static int mcap_pipe_end(struct mcap_pipe *p)
{
    const struct bytes magic = {(const uint8_t *)BAG_MAGIC, BAG_MAGIC_SIZE};
    const struct bag_record end = {.opcode = BAG_DATA_END},
                            footer = {.opcode = BAG_FOOTER};

    bag_record_put(&p->out, &end);
    bag_record_put(&p->out, &footer);
    bytes_put(&p->out, magic);
    return write_out(p);
}

static void mcap_pipe_free(struct mcap_pipe *p)
{
    free(p->sources);
    bytes_free(&p->out);
}

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

    e->said_ns = clock_monotonic_ns();
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
    int64_t silent_ns = clock_monotonic_ns() - e->heard_ns;

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
    e->heard_ns = clock_monotonic_ns();
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

    e.heard_ns = e.said_ns = clock_monotonic_ns();
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
