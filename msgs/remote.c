/* SPDX-License-Identifier: MIT */
#include "msgs/remote.h"

#include <errno.h>
#include <nanomsg/nn.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <zmq.h>

#include "msgs/monotonic.h"

#define KEEPALIVE_IDLE_S     2 /* a probe each second, after so long without a word */
#define KEEPALIVE_INTERVAL_S 1
#define CONNECT_MS           3000
#define RECONNECT_MS         100
#define RECONNECT_MAX_MS     1000
#define SUBSCRIPTION_MAX     256 /* bytes that a publisher takes from a stranger */
#define HANDSHAKE_MAX        512 /* with keys: its commands, of which INITIATE has some 300 */
#define LATEST_DEPTH         2   /* of a state, in each direction's queue */
#define REBIND_TRIES         100 /* a port is free a moment after its socket was closed */
#define REBIND_PAUSE_NS      2000000
#define REBIND_MS            1000 /* later it is tried so often, without a wait */
#define URL_SIZE             64

struct remote {
    struct hosts hosts;
    void *context;                       /* NULL: nothing is reached by TCP */
    struct authenticator *authenticator; /* NULL: all of it is on this machine */
};

static bool has_address(const struct hosts *h)
{
    return h->n && h->list[h->here].address[0];
}

/* Without keys nothing may be reached from elsewhere; hosts_use_keys has seen to that. */
static int open_keys(struct remote *r, struct error *why)
{
    const struct host *here = &r->hosts.list[r->hosts.here];
    struct keys *keys = malloc(sizeof *keys);
    if (!keys)
        return error_say(why, -ENOMEM, "out of memory");
    int err = here->keys[0] ? keys_read(keys, here->keys, why)
                            : error_say(why, -EINVAL, "host %s: no keys are named for it",
                                        here->name);
    if (!err)
        err = keys_check_hosts(keys, &r->hosts, why);
    if (!err && (err = authenticator_create(&r->authenticator, r->context, keys)))
        error_say(why, err, "no authentication: %s", zmq_strerror(-err));
    keys_forget(keys);
    free(keys);
    return err;
}

int remote_create(struct remote **out, const char *run_dir, struct error *why)
{
    struct remote *r = calloc(1, sizeof *r);
    if (!r)
        return error_say(why, -ENOMEM, "out of memory");
    int err = hosts_read(&r->hosts, run_dir, why);
    if (!err && has_address(&r->hosts) && !(r->context = zmq_ctx_new()))
        err = error_say(why, -errno, "no TCP: %s", zmq_strerror(errno));
    if (!err && r->context && hosts_use_keys(&r->hosts))
        err = open_keys(r, why);
    if (err)
        remote_destroy(r);
    else
        *out = r;
    return err;
}

void remote_on_event(struct remote *r, void (*call)(void *ctx, const char *text),
                     void *ctx)
{
    if (r->authenticator)
        authenticator_on_event(r->authenticator, call, ctx);
}

uint64_t remote_refused(const struct remote *r)
{
    return r->authenticator ? authenticator_refused(r->authenticator) : 0;
}

const struct hosts *remote_hosts(const struct remote *r)
{
    return &r->hosts;
}

static int set(void *socket, int option, int value)
{
    return zmq_setsockopt(socket, option, &value, sizeof value) ? -errno : 0;
}

/* What all sockets have in common.  incoming: bytes of a message that comes in; a larger
 * one ends the connection before there is memory for it.  0 or a negative errno. */
static int set_options(void *socket, const struct topic *t, size_t incoming)
{
    const int depth = t->policy == TOPIC_LATEST ? LATEST_DEPTH : (int)t->depth;
    const int64_t max = (int64_t)incoming;
    const struct {
        int option, value;
    } options[] = {
        {ZMQ_SNDHWM, depth},
        {ZMQ_RCVHWM, depth},
        {ZMQ_LINGER, REMOTE_LINGER_MS},
        {ZMQ_TCP_KEEPALIVE, 1},
        {ZMQ_TCP_KEEPALIVE_IDLE, KEEPALIVE_IDLE_S},
        {ZMQ_TCP_KEEPALIVE_INTVL, KEEPALIVE_INTERVAL_S},
        {ZMQ_TCP_KEEPALIVE_CNT, REMOTE_PATIENCE_MS / 1000 - KEEPALIVE_IDLE_S},
        {ZMQ_TCP_MAXRT, REMOTE_PATIENCE_MS},
        {ZMQ_HANDSHAKE_IVL, REMOTE_PATIENCE_MS},
        {ZMQ_CONNECT_TIMEOUT, CONNECT_MS},
        {ZMQ_RECONNECT_IVL, RECONNECT_MS},
        {ZMQ_RECONNECT_IVL_MAX, RECONNECT_MAX_MS},
    };
    int err = zmq_setsockopt(socket, ZMQ_MAXMSGSIZE, &max, sizeof max) ? -errno : 0;
    for (size_t i = 0; !err && i < sizeof options / sizeof *options; i++)
        err = set(socket, options[i].option, options[i].value);
    return err;
}

/* tcp://ADDRESS:PORT of a node's topic. */
static void write_url(char url[URL_SIZE], const struct host *h, const char *node,
                      const struct topic *t)
{
    snprintf(url, URL_SIZE, "tcp://%s:%u", h->address, hosts_port(h, node, t));
}

/* Of the keys. */
static unsigned generation_of(const struct remote *r)
{
    return r->authenticator ? authenticator_generation(r->authenticator) : 0;
}

/* -- the publishing end ----------------------------------------------------------------
 */

struct remote_publisher {
    const struct remote *remote;
    const struct topic *topic;
    char url[URL_SIZE];
    void *socket; /* NULL: there could not be another one yet */
    bool is_bound;
    bool was_reported; /* that it could not be bound again */
    int64_t due_ms;    /* when that is tried again */
    size_t peers;
    unsigned generation; /* of the keys with which its peers were let in */
};

/* Not bound yet. */
static int open_publishing(struct remote_publisher *o)
{
    struct authenticator *a = o->remote->authenticator;
    void *s = zmq_socket(o->remote->context, ZMQ_XPUB); /* tells of its subscribers */
    if (!s)
        return -errno;
    o->peers = 0;
    int err = set_options(s, o->topic, a ? HANDSHAKE_MAX : SUBSCRIPTION_MAX);
    if (!err)
        err = set(s, ZMQ_XPUB_VERBOSER, 1);
    if (!err && a)
        err = authenticator_guard(a, s, o->topic->name);
    if (err)
        zmq_close(s);
    else
        o->socket = s;
    return err;
}

static int bind_socket(struct remote_publisher *o)
{
    o->generation = generation_of(o->remote);
    o->is_bound = !zmq_bind(o->socket, o->url);
    return o->is_bound ? 0 : -errno;
}

int remote_bind(struct remote_publisher **out, const struct remote *r, const char *node,
                const struct topic *t, struct error *why)
{
    *out = NULL;
    if (!r || !r->context)
        return 0;
    struct remote_publisher *o = calloc(1, sizeof *o);
    if (!o)
        return error_say(why, -ENOMEM, "out of memory");
    o->remote = r;
    o->topic = t;
    write_url(o->url, &r->hosts.list[r->hosts.here], node, t);
    int err = open_publishing(o);
    if (!err)
        err = bind_socket(o);
    if (!err) {
        *out = o;
        return 0;
    }
    error_say(why, err, "%s, for topic %s: cannot bind: %s%s", o->url, t->name,
              zmq_strerror(-err),
              err == -EADDRNOTAVAIL ? "; the host is not this machine"
              : err == -EADDRINUSE  ? "; another program has the port"
                                    : "");
    remote_close(o);
    return err;
}

static int bind_again(struct remote_publisher *o, int tries)
{
    const struct timespec pause = {.tv_nsec = REBIND_PAUSE_NS};
    int err = o->socket ? 0 : open_publishing(o);
    if (err)
        return err;
    while ((err = bind_socket(o)) == -EADDRINUSE && --tries)
        nanosleep(&pause, NULL);
    return err;
}

/* ZeroMQ cannot end one connection of many: all are, and those still permitted come back.
 * What waits in their queues does not go out any more.  Where somebody else took the port
 * meanwhile, nobody waits for it: it is reported once, and tried now and then. */
static void keep_to_permitted(struct remote_publisher *o)
{
    struct authenticator *a = o->remote->authenticator;
    int tries = 1;
    if (!a || (o->is_bound && o->generation == authenticator_generation(a)))
        return;
    if (o->is_bound) {
        set(o->socket, ZMQ_LINGER, 0);
        zmq_close(o->socket);
        o->socket = NULL;
        o->is_bound = false;
        tries = REBIND_TRIES;
    } else if (monotonic_ms() < o->due_ms) {
        return;
    }
    int err = bind_again(o, tries);
    o->due_ms = monotonic_ms() + REBIND_MS;
    if ((err != 0) != o->was_reported)
        authenticator_bound_again(a, o->topic->name, err);
    o->was_reported = err != 0;
}

/* A PUB drops what does not fit and fails only without memory: then too it is a gap at
 * the other end. */
void remote_send(struct remote_publisher *o, const void *message, size_t size)
{
    keep_to_permitted(o);
    while (o->socket && zmq_send(o->socket, message, size, ZMQ_DONTWAIT) < 0 &&
           errno == EINTR)
        ;
}

size_t remote_read_peers(void *socket, size_t before)
{
    uint8_t word[SUBSCRIPTION_MAX] = {2};
    size_t peers = before;
    int n;
    while ((n = zmq_recv(socket, word, sizeof word, ZMQ_DONTWAIT)) >= 0 || errno == EINTR)
        if (n > 0 && word[0] == 1)
            ++peers;
        else if (n > 0 && word[0] == 0 && peers)
            --peers;
    return peers;
}

size_t remote_count_peers(struct remote_publisher *o)
{
    keep_to_permitted(o);
    if (o->socket)
        o->peers = remote_read_peers(o->socket, o->peers);
    return o->peers;
}

void remote_close(struct remote_publisher *o)
{
    if (o && o->socket)
        zmq_close(o->socket);
    free(o);
}

/* -- the subscribing end ---------------------------------------------------------------
 */

#define MAX_ENDPOINTS    (HOSTS_MAX * 16)
#define CURVE_OVERHEAD   33 /* of a message with keys: name, nonce, MAC, flags (RFC 26) */
#define TELLING_FAILURES 3
#define FAILURE_EVENTS                                                                   \
    (ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL | ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL |        \
     ZMQ_EVENT_HANDSHAKE_FAILED_AUTH)
#define GONE_EVENTS (ZMQ_EVENT_DISCONNECTED | FAILURE_EVENTS)
#define HELD_EVENTS                                                                      \
    (ZMQ_EVENT_CONNECT_DELAYED | ZMQ_EVENT_CONNECT_RETRIED | ZMQ_EVENT_CONNECTED)

struct endpoint {
    char url[URL_SIZE];
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
    const struct hosts *h = &r->hosts;
    const char *node;
    for (size_t i = 0; i < h->n; i++)
        for (size_t k = 0; i != h->here && (node = topic_publisher(t, k)); k++) {
            if (!hosts_may_run(h, i, node))
                continue;
            if (e->n == MAX_ENDPOINTS)
                return -E2BIG;
            e->endpoints[e->n].host = h->list[i].name;
            write_url(e->endpoints[e->n++].url, &h->list[i], node, t);
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
    e->monitor = zmq_socket(r->context, ZMQ_PAIR);
    return !e->monitor || zmq_connect(e->monitor, url) ? -errno : 0;
}

/* 0; -EACCES: the host has no key, or none any more, and is not connected to. */
static int connect_to(struct remote_subscription *e, const struct endpoint *end)
{
    struct authenticator *a = e->remote->authenticator;
    int err = a ? authenticator_address(a, e->socket, end->host) : 0;
    return err ? err : zmq_connect(e->socket, end->url) ? -errno : 0;
}

static int open_subscribing(struct remote_subscription *e, int *fd,
                            const struct remote *r, const struct topic *t)
{
    size_t size = sizeof *fd;
    e->socket = zmq_socket(r->context, ZMQ_SUB);
    size_t most = ENVELOPE_SIZE + t->max_size;
    if (r->authenticator)
        most += CURVE_OVERHEAD;
    int err = e->socket ? set_options(e->socket, t, most) : -errno;
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
    if (!r->context)
        return 0;
    struct remote_subscription *e = calloc(1, sizeof *e);
    if (e)
        e->remote = r;
    int err = e ? list_endpoints(e, r, t) : -ENOMEM;
    if (!err && e->n)
        err = open_subscribing(e, fd, r, t);
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

static struct endpoint *find_endpoint(struct remote_subscription *e, const char *url)
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
    struct authenticator *a = e->remote->authenticator;
    bool certain = event != ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL;
    end->failures++;
    if (a && (certain || end->failures >= TELLING_FAILURES))
        authenticator_sent_away(a, end->host, event == ZMQ_EVENT_HANDSHAKE_FAILED_AUTH);
}

/* An event is two frames: u16 which, u32 value; and of which endpoint. */
static void read_events(struct remote_subscription *e)
{
    char what[8], url[URL_SIZE];
    while (take_frame(e->monitor, what, sizeof what) &&
           take_frame(e->monitor, url, sizeof url)) {
        struct endpoint *end = find_endpoint(e, url);
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

void *remote_take_message(void *socket, size_t *size)
{
    zmq_msg_t in;
    void *message = NULL;
    zmq_msg_init(&in);
    while (!message) { /* without memory it is lost, and a gap */
        if (zmq_msg_recv(&in, socket, ZMQ_DONTWAIT) < 0) {
            if (errno == EINTR)
                continue;
            break;
        }
        *size = zmq_msg_size(&in);
        message = nn_allocmsg(*size ? *size : 1, 0);
        if (message)
            memcpy(message, zmq_msg_data(&in), *size);
    }
    zmq_msg_close(&in);
    return message;
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

void remote_destroy(struct remote *r)
{
    if (!r)
        return;
    authenticator_destroy(r->authenticator);
    if (r->context)
        while (zmq_ctx_term(r->context) && errno == EINTR)
            ;
    free(r);
}
