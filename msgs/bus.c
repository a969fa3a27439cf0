/* SPDX-License-Identifier: MIT */
#include "msgs/bus.h"

#include <errno.h>
#include <nanomsg/nn.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "msgs/endpoint.h"
#include "msgs/publisher.h"
#include "msgs/receive_queue.h"
#include "msgs/reliable.h"
#include "msgs/remote.h"
#include "msgs/subscriber.h"
#include "msgs/unpack.h"
#include "msgs/wire_guard.h"

struct bus {
    int lock_fd; /* -1: listens only */
    struct remote *remote;
    struct reliable *reliable;
    struct receive_queue *receive_queue;
    struct subscriber *subscriber;
    size_t n_outlets;
    struct publisher *outlets[16];
};

static int open_outlets(struct bus *b, const struct bus_config *cfg, struct error *why)
{
    const size_t max = sizeof b->outlets / sizeof *b->outlets;
    b->lock_fd = endpoint_lock(cfg->run_dir, cfg->node, cfg->world == BUS_REPLAY, why);
    if (b->lock_fd < 0)
        return b->lock_fd;
    for (const struct topic *t = topics_all(); t->name; t++) {
        if (!topic_is_published_by(t, cfg->node))
            continue;
        if (b->n_outlets == max)
            return error_say(why, -E2BIG, "node \"%s\" publishes over %zu topics",
                             cfg->node, max);
        int err = publisher_create(&b->outlets[b->n_outlets], cfg, b->remote, b->reliable,
                                   t, why);
        if (err)
            return err;
        b->n_outlets++;
    }
    return 0;
}

static int check_config(const struct bus_config *cfg, struct error *why)
{
    if (!cfg->run_dir || !cfg->run_dir[0])
        return error_say(why, -EINVAL, "no run folder is given");
    if (cfg->listen_only)
        return 0;
    size_t length = cfg->node ? strlen(cfg->node) : 0;
    if (length < 1 || length >= ENVELOPE_NODE_SIZE || strchr(cfg->node, '/'))
        return error_say(why, -EINVAL,
                         "node name \"%s\": expected 1 to %d characters without '/'",
                         cfg->node ? cfg->node : "", ENVELOPE_NODE_SIZE - 1);
    return 0;
}

int bus_create(struct bus **out, const struct bus_config *cfg, struct error *why)
{
    int err = check_config(cfg, why);
    if (!err)
        err = endpoint_make_folder(cfg->run_dir, why);
    if (err)
        return err;
    struct bus *b = calloc(1, sizeof *b);
    if (!b)
        return error_say(why, -ENOMEM, "out of memory");
    b->lock_fd = -1;
    err = remote_create(&b->remote, cfg->run_dir, why);
    if (!err)
        err = reliable_create(&b->reliable, why);
    if (err)
        goto fail;
    err = receive_queue_create(&b->receive_queue);
    if (!err)
        err = subscriber_create(&b->subscriber, cfg->run_dir, cfg->world, b->remote,
                                b->reliable, b->receive_queue);
    if (err)
        error_say(why, err, "run folder %s: no bus: %s", cfg->run_dir, strerror(-err));
    if (!err && !cfg->listen_only)
        err = open_outlets(b, cfg, why);
    if (!err && cfg->world == BUS_REPLAY)
        bus_set_replayed(b, true);
    if (!err)
        publishers_await_recorders(b->outlets, b->n_outlets, cfg->run_dir);
    if (err)
        goto fail;
    *out = b;
    return 0;
fail:
    bus_destroy(b);
    return err;
}

int bus_subscribe(struct bus *b, const struct topic *t)
{
    return subscriber_subscribe(b->subscriber, t);
}

void bus_keep_all(struct bus *b, size_t bytes, int64_t now_ns)
{
    receive_queue_keep_all(b->receive_queue, bytes);
    subscriber_count_from_start(b->subscriber, now_ns);
}

size_t bus_waiting_bytes(struct bus *b)
{
    return receive_queue_waiting_bytes(b->receive_queue);
}

static struct publisher *find_publisher(const struct bus *b, const struct topic *t)
{
    for (size_t i = 0; i < b->n_outlets; i++)
        if (publisher_topic(b->outlets[i]) == t)
            return b->outlets[i];
    return NULL;
}

int bus_publish(struct bus *b, const struct topic *t, int64_t capture_ns,
                int64_t publish_ns, const void *payload, size_t size)
{
    struct publisher *o = find_publisher(b, t);
    return o ? publisher_send_copy(o, capture_ns, publish_ns, payload, size) : -EINVAL;
}

int bus_publish_message(struct bus *b, const struct topic *t, int64_t capture_ns,
                        int64_t publish_ns, const ProtobufCMessage *m)
{
    struct publisher *o = find_publisher(b, t);
    if (!o || m->descriptor != t->schema)
        return -EINVAL;
    size_t size = protobuf_c_message_get_packed_size(m);
    if (size > t->max_size)
        return -EMSGSIZE;
    void *room, *message = publisher_allocate(size, &room);
    if (!message)
        return -ENOMEM;
    protobuf_c_message_pack(m, room);
    return publisher_send(o, capture_ns, publish_ns, message, size);
}

void bus_set_replayed(struct bus *b, bool replayed)
{
    for (size_t i = 0; i < b->n_outlets; i++)
        publisher_set_replayed(b->outlets[i], replayed);
}

int bus_receive(struct bus *b, struct bus_message *out, int timeout_ms)
{
    return receive_queue_take(b->receive_queue, out, timeout_ms);
}

void bus_message_free(struct bus_message *m)
{
    if (m->owner)
        nn_freemsg(m->owner);
    memset(m, 0, sizeof *m);
}

ProtobufCMessage *bus_message_unpack(const struct bus_message *m)
{
    return message_unpack(m->topic->schema, m->envelope.payload_size, m->payload);
}

int bus_fd(const struct bus *b)
{
    return receive_queue_fd(b->receive_queue);
}

void bus_interrupt(struct bus *b)
{
    receive_queue_interrupt(b->receive_queue);
}

void bus_resume(struct bus *b)
{
    receive_queue_resume(b->receive_queue);
}

size_t bus_counts(struct bus *b, struct bus_count *out, size_t max)
{
    for (size_t i = 0; i < b->n_outlets && i < max; i++)
        publisher_count(b->outlets[i], &out[i]);
    bool room = max > b->n_outlets;
    return b->n_outlets + subscriber_counts(b->subscriber,
                                            room ? out + b->n_outlets : NULL,
                                            room ? max - b->n_outlets : 0);
}

uint64_t bus_refused(struct bus *b)
{
    return subscriber_refused(b->subscriber) + wire_guard_refused();
}

void bus_on_refusal(struct bus *b, void (*call)(void *ctx, const char *text), void *ctx)
{
    subscriber_on_refusal(b->subscriber, call, ctx);
    remote_on_event(b->remote, call, ctx);
}

uint64_t bus_refused_connections(struct bus *b)
{
    return remote_refused(b->remote);
}

void bus_destroy(struct bus *b)
{
    if (!b)
        return;
    for (size_t i = 0; i < b->n_outlets; i++)
        publisher_destroy(b->outlets[i]);
    subscriber_destroy(b->subscriber);
    remote_destroy(b->remote);
    reliable_destroy(b->reliable);
    receive_queue_destroy(b->receive_queue);
    if (b->lock_fd >= 0)
        close(b->lock_fd); /* last: until here the socket files are ours */
    free(b);
}
