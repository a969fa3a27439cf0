/* SPDX-License-Identifier: MIT */
#include "msgs/remote_subscription.h"

#include <errno.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zmq.h>

#define MAX_ENDPOINTS (HOSTS_MAX * 16)
#define GONE_EVENTS                                                                      \
    (ZMQ_EVENT_DISCONNECTED | ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL |                     \
     ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL | ZMQ_EVENT_HANDSHAKE_FAILED_AUTH)
#define CURVE_OVERHEAD   33 /* of a message with keys: name, nonce, MAC, flags (RFC 26) */
#define TELLING_FAILURES 3
#define FAILURE_EVENTS                                                                   \
    (ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL | ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL |        \
     ZMQ_EVENT_HANDSHAKE_FAILED_AUTH)
#define HELD_EVENTS                                                                      \
    (ZMQ_EVENT_CONNECT_DELAYED | ZMQ_EVENT_CONNECT_RETRIED | ZMQ_EVENT_CONNECTED)

struct endpoint {
    char url[REMOTE_URL_SIZE];
    const char *host;
    bool connected;    /* and has answered as ZeroMQ does */
    bool gone;         /* the newest word of it: nothing has been tried since */
    bool was_gone;     /* when it was tended last */
    unsigned failures; /* handshakes since the last one that succeeded */
};

struct remote_subscription {
    const struct remote *remote;
    void *socket, *monitor;
    unsigned generation; /* of the keys with which it has connected */
    size_t n;
    struct endpoint endpoints[MAX_ENDPOINTS];
};

/* The publishers on other machines.  0, -E2BIG. */
static int list_endpoints(struct remote_subscription *e, const struct remote *r,
                          const struct topic *t)
{
    const struct hosts *h = remote_hosts(r);
    const char *node;
    for (size_t i = 0; i < h->n; i++)
        for (size_t k = 0; i != h->here && (node = topic_publisher(t, k)); k++) {
            if (!hosts_may_run(h, i, node))
                continue;
            if (e->n == MAX_ENDPOINTS)
                return -E2BIG;
            e->endpoints[e->n].host = h->list[i].name;
            remote_url(e->endpoints[e->n++].url, &h->list[i], node, t);
        }
    return 0;
}

static int open_monitor(struct remote_subscription *e, const struct remote *r)
{
    char url[48];
    snprintf(url, sizeof url, "inproc://monitor-%p", (void *)e);
    if (zmq_socket_monitor(e->socket, url,
                           GONE_EVENTS | HELD_EVENTS | ZMQ_EVENT_HANDSHAKE_SUCCEEDED))
        return -errno;
    e->monitor = zmq_socket(remote_context(r), ZMQ_PAIR);
    return !e->monitor || zmq_connect(e->monitor, url) ? -errno : 0;
}

/* 0; -EACCES: the host has no key, or none any more, and is not connected to. */
static int connect_to(struct remote_subscription *e, const struct endpoint *end)
{
    struct authenticator *a = remote_authenticator(e->remote);
    int err = a ? authenticator_address(a, e->socket, end->host) : 0;
    return err ? err : zmq_connect(e->socket, end->url) ? -errno : 0;
}

static unsigned generation_of(const struct remote *r)
{
    const struct authenticator *a = remote_authenticator(r);
    return a ? authenticator_generation(a) : 0;
}

static int open_socket(struct remote_subscription *e, int *fd, const struct remote *r,
                       const struct topic *t)
{
    size_t size = sizeof *fd;
    e->socket = zmq_socket(remote_context(r), ZMQ_SUB);
    size_t most = ENVELOPE_SIZE + t->max_size;
    if (remote_authenticator(r))
        most += CURVE_OVERHEAD;
    int err = e->socket ? remote_set_options(e->socket, t, most) : -errno;
    if (!err && (zmq_setsockopt(e->socket, ZMQ_SUBSCRIBE, "", 0) ||
                 zmq_getsockopt(e->socket, ZMQ_FD, fd, &size)))
        err = -errno;
    if (!err)
        err = open_monitor(e, r);
    e->generation = generation_of(r);
    for (size_t i = 0; !err && i < e->n; i++)
        if ((err = connect_to(e, &e->endpoints[i])) == -EACCES)
            err = 0; /* its key was taken away a moment ago */
    return err;
}

int remote_subscription_open(struct remote_subscription **out, int *fd,
                             const struct remote *r, const struct topic *t)
{
    *out = NULL;
    *fd = -1;
    if (!remote_context(r))
        return 0;
    struct remote_subscription *e = calloc(1, sizeof *e);
    if (e)
        e->remote = r;
    int err = e ? list_endpoints(e, r, t) : -ENOMEM;
    if (!err && e->n)
        err = open_socket(e, fd, r, t);
    if (err || !e->n) {
        *fd = -1;
        remote_subscription_close(e);
        return err;
    }
    *out = e;
    return 0;
}

/* Takes a frame that waits; true: there was one, and text has its beginning. */
static bool take_frame(void *socket, char *text, size_t size)
{
    int n;
    do
        n = zmq_recv(socket, text, size - 1, ZMQ_DONTWAIT);
    while (n < 0 && errno == EINTR);
    if (n >= 0)
        text[(size_t)n < size ? (size_t)n : size - 1] = 0;
    return n >= 0;
}

static struct endpoint *find(struct remote_subscription *e, const char *url)
{
    for (size_t i = 0; i < e->n; i++)
        if (!strcmp(e->endpoints[i].url, url))
            return &e->endpoints[i];
    return NULL;
}

/* A host that goes away may end a handshake too, but not one after the other. */
static void report_failure(struct remote_subscription *e, struct endpoint *end,
                           uint16_t event)
{
    struct authenticator *a = remote_authenticator(e->remote);
    bool certain = event != ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL;
    end->failures++;
    if (a && (certain || end->failures >= TELLING_FAILURES))
        authenticator_sent_away(a, end->host, event == ZMQ_EVENT_HANDSHAKE_FAILED_AUTH);
}

/* An event is two frames: u16 which, u32 value; and of which endpoint. */
static void read_events(struct remote_subscription *e)
{
    char what[8], url[REMOTE_URL_SIZE];
    while (take_frame(e->monitor, what, sizeof what) &&
           take_frame(e->monitor, url, sizeof url)) {
        struct endpoint *end = find(e, url);
        uint16_t event;
        memcpy(&event, what, sizeof event);
        if (!end)
            continue;
        if (event & FAILURE_EVENTS)
            report_failure(e, end, event);
        if (event == ZMQ_EVENT_HANDSHAKE_SUCCEEDED)
            end->failures = 0;
        end->connected = event == ZMQ_EVENT_HANDSHAKE_SUCCEEDED;
        end->gone = event & GONE_EVENTS;
    }
}

/* ZeroMQ says at once when it tries again; it did not from one time to the next. */
static void connect_again(struct remote_subscription *e, struct endpoint *end)
{
    if (end->gone && end->was_gone) {
        zmq_disconnect(e->socket, end->url); /* -ENOENT when it has forgotten it */
        end->gone = connect_to(e, end) != 0;
    }
    end->was_gone = end->gone;
}

/* The keys have changed: to each host by the one that it has now, or not at all. */
static void connect_with_new_keys(struct remote_subscription *e)
{
    unsigned generation = generation_of(e->remote);
    if (generation == e->generation)
        return;
    e->generation = generation;
    for (size_t i = 0; i < e->n; i++) {
        struct endpoint *end = &e->endpoints[i];
        zmq_disconnect(e->socket, end->url);
        end->connected = false;
        end->gone = end->was_gone = connect_to(e, end) != 0; /* then it is tried again */
    }
}

size_t remote_subscription_tend(struct remote_subscription *e)
{
    size_t connected = 0;
    read_events(e);
    connect_with_new_keys(e);
    for (size_t i = 0; i < e->n; i++) {
        connect_again(e, &e->endpoints[i]);
        connected += e->endpoints[i].connected;
    }
    return connected;
}

void *remote_subscription_receive(struct remote_subscription *e, size_t *size)
{
    return remote_take_message(e->socket, size);
}

void remote_subscription_close(struct remote_subscription *e)
{
    if (!e)
        return;
    if (e->socket)
        zmq_socket_monitor(e->socket, NULL, 0);
    if (e->monitor)
        zmq_close(e->monitor);
    if (e->socket)
        zmq_close(e->socket);
    free(e);
}
