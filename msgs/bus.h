/* SPDX-License-Identifier: MIT */
/* msgs/bus.h -- publish and subscribe over nanomsg, with accounting.  The only place that
 * knows nanomsg (with its parts publisher, subscriber, receive queue).  A node has an
 * endpoint for each topic that it publishes ("ipc://RUN_DIR/NODE.TOPIC.ipc"), and
 * connects to those of the publishers of what it wants (msgs/topics.h).  In a system on
 * several machines it has one more at an address of its host (msgs/hosts.h), and those on
 * other machines are heard there, by ZeroMQ (msgs/remote.h), encrypted.
 *
 * nanomsg PUB drops silently when a peer is slow, filters at the subscriber, refuses what
 * exceeds NN_RCVMAXSIZE by dropping the connection, loses what is sent before a
 * subscriber has joined, returns EINTR, and must not be forked after a socket exists.  So
 * a receive thread moves messages into a bounded queue for each topic, gaps in sequence
 * numbers are counted, and the buffers are set large.  Create a bus after the last fork.
 * Who must have everything hears the same by sockets of ZeroMQ (msgs/reliable.h). */
#ifndef ANLOS_MSGS_BUS_H
#define ANLOS_MSGS_BUS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <protobuf-c/protobuf-c.h>

#include "dsp/error.h"
#include "msgs/envelope.h"
#include "msgs/topics.h"

struct bus;

/* Whose time a process lives in is decided when it starts, never by what arrives. */
enum bus_world {
    BUS_ANY, /* an optional node's, which shows whatever there is: a tool, view, record */
    BUS_LIVE,   /* what is replayed is refused and counted, and so is "clock" */
    BUS_REPLAY, /* what is not is refused, but for health, log and host; all that is
                 * published is marked as replayed */
};

struct bus_config {
    const char *node;    /* under ENVELOPE_NODE_SIZE characters; NULL: listen_only */
    const char *run_dir; /* folder of the sockets; made when missing */
    int64_t epoch_ns;    /* when this process started */
    bool listen_only;    /* a tool: subscribes, publishes nothing, binds nothing */
    enum bus_world world;
};

struct bus_count {
    const struct topic *topic;
    bool published;
    uint64_t messages, bytes, gaps, dropped;
    size_t queued;
    size_t peers; /* connected now: subscribers, or of a topic received, publishers */
};

/* Opens an endpoint for each topic that the node publishes.  0, -EINVAL, -ENOMEM,
 * -EADDRINUSE (a live node of that name already runs in the folder), -ENAMETOOLONG (a
 * socket path takes 107 characters), other negative errno; the error says where. */
int bus_create(struct bus **out, const struct bus_config *cfg, struct error *why);

/* Connects to every publisher of the topic.  A publisher may come later, go and come
 * back.  Counting of gaps starts with the first message that arrives of each publisher.
 * 0, -ENOMEM, -ENAMETOOLONG, other negative errno. */
int bus_subscribe(struct bus *b, const struct topic *t);

/* For a recorder: from now on all messages of all topics wait for bus_receive, whatever
 * the topic's depth and policy, up to so many bytes in all; what comes beyond is dropped,
 * and counted.  On this machine what has not come here yet waits at its publisher, up to
 * RELIABLE_BYTES over all its topics, and one that starts later waits 2 s at most for
 * this one to join; what it sent before the first message that arrives is a gap too, if
 * it is of this machine, whose clock now_ns is of.  Before the first bus_subscribe. */
void bus_keep_all(struct bus *b, size_t bytes, int64_t now_ns);

/* Bytes of payload that wait. */
size_t bus_waiting_bytes(struct bus *b);

/* Sends to whoever listens; never blocks on a slow one, but keeps to 500 MB/s for each
 * subscriber of a topic, beyond what the kernel's buffer holds (msgs/publisher.h).
 * Thread-safe. 0, -EINVAL (not a topic of this node's), -EMSGSIZE (over the topic's
 * max_size), -ENOMEM, other negative errno. */
int bus_publish(struct bus *b, const struct topic *t, int64_t capture_ns,
                int64_t publish_ns, const void *payload, size_t size);

/* Packs a protobuf-c message of the topic's schema and publishes it; as bus_publish. */
int bus_publish_message(struct bus *b, const struct topic *t, int64_t capture_ns,
                        int64_t publish_ns, const ProtobufCMessage *m);

/* Whether what is published from now on is marked as replayed (msgs/envelope.h).
 * Thread-safe. */
void bus_set_replayed(struct bus *b, bool replayed);

/* A message as it came in over the bus.  It owns its payload; bus_message_free it. */
struct bus_message {
    const struct topic *topic;
    struct envelope envelope;
    const uint8_t *payload; /* [envelope.payload_size] */
    void *owner;            /* the bus's own */
};

/* Frees what m owns and zeroes it; a zeroed one may be freed too. */
void bus_message_free(struct bus_message *m);

/* Unpacks the payload by the topic's schema.  NULL and errno: as message_unpack
 * (msgs/unpack.h).  Free the result with protobuf_c_message_free_unpacked(m, NULL). */
ProtobufCMessage *bus_message_unpack(const struct bus_message *m);

/* The next message of any subscribed topic, in the order of arrival.  timeout_ms < 0:
 * waits for ever.  0, -ETIMEDOUT, -ESHUTDOWN (bus_interrupt was called). */
int bus_receive(struct bus *b, struct bus_message *out, int timeout_ms);

/* A descriptor that poll(2) finds readable while messages wait, for loops that wait for
 * something else too; also after bus_interrupt.  Owned by the bus. */
int bus_fd(const struct bus *b);

/* Wakes bus_receive for good.  Safe in a signal handler. */
void bus_interrupt(struct bus *b);

/* Ends that: for who takes what still waits before it closes. */
void bus_resume(struct bus *b);

/* Writes up to max counts, returns how many there are. */
size_t bus_counts(struct bus *b, struct bus_count *out, size_t max);

/* Messages with a wrong magic, version, length, topic or publisher, or too large, or of
 * another world than this bus's; and connections of this process on which came what is no
 * message at all (msgs/wire_guard.h). */
uint64_t bus_refused(struct bus *b);

/* Connections from other machines that were refused: they had no permitted key. */
uint64_t bus_refused_connections(struct bus *b);

/* Called once for each kind of refusal, from other threads, for the log; of connections
 * now and then. */
void bus_on_refusal(struct bus *b, void (*call)(void *ctx, const char *text), void *ctx);

void bus_destroy(struct bus *b);

#endif
