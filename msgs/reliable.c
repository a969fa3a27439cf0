/* SPDX-License-Identifier: MIT */
#include "msgs/reliable.h"

#include <errno.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <zmq.h>

#include "msgs/remote.h"

#define RECONNECT_MS     20 /* of who was there and is gone */
#define RECONNECT_MAX_MS 200
#define WORD_MAX         64 /* bytes that a publisher takes from a subscriber */
#define UNLIMITED        0  /* messages: it is their bytes that are bounded */

struct reliable {
    void *context;
    atomic_size_t waiting; /* bytes that have not been read by all who should */
};

struct reliable_publisher {
    struct reliable *shared;
    void *socket;
    size_t peers;
};

struct reliable_subscription {
    void *socket;
};

/* A message that waits. */
struct parcel {
    struct reliable *shared;
    size_t size;
    uint8_t data[];
};

int reliable_create(struct reliable **out, struct error *why)
{
    struct reliable *r = calloc(1, sizeof *r);
    if (!r)
        return error_say(why, -ENOMEM, "out of memory");
    r->context = zmq_ctx_new(); /* its threads start with the first socket */
    if (!r->context) {
        free(r);
        return error_say(why, -errno, "no ZeroMQ: %s", zmq_strerror(errno));
    }
    *out = r;
    return 0;
}

void reliable_destroy(struct reliable *r)
{
    if (!r)
        return;
    while (zmq_ctx_term(r->context) && errno == EINTR)
        ;
    free(r);
}

static int set(void *socket, int option, int value)
{
    return zmq_setsockopt(socket, option, &value, sizeof value) ? -errno : 0;
}

static int open_socket(void **out, const struct reliable *r, int type, size_t most)
{
    const int64_t max = (int64_t)most;
    const struct {
        int option, value;
    } options[] = {
        {ZMQ_SNDHWM, UNLIMITED},
        {ZMQ_RCVHWM, UNLIMITED},
        {ZMQ_LINGER, type == ZMQ_XPUB ? RELIABLE_LINGER_MS : 0},
        {ZMQ_RECONNECT_IVL, RECONNECT_MS},
        {ZMQ_RECONNECT_IVL_MAX, RECONNECT_MAX_MS},
    };
    void *s = zmq_socket(r->context, type);
    if (!s)
        return -errno;
    int err = zmq_setsockopt(s, ZMQ_MAXMSGSIZE, &max, sizeof max) ? -errno : 0;
    for (size_t i = 0; !err && i < sizeof options / sizeof *options; i++)
        err = set(s, options[i].option, options[i].value);
    if (err)
        zmq_close(s);
    else
        *out = s;
    return err;
}

int reliable_bind(struct reliable_publisher **out, struct reliable *r, const char *url,
                  struct error *why)
{
    struct reliable_publisher *o = calloc(1, sizeof *o);
    if (!o)
        return error_say(why, -ENOMEM, "out of memory");
    o->shared = r;
    int err = open_socket(&o->socket, r, ZMQ_XPUB, WORD_MAX);
    if (!err)
        err = set(o->socket, ZMQ_XPUB_VERBOSER, 1); /* tells of each who comes and goes */
    if (!err && zmq_bind(o->socket, url))
        err = -errno;
    if (err) {
        reliable_close(o);
        return error_say(why, err, "%s: cannot bind: %s", url, zmq_strerror(-err));
    }
    *out = o;
    return 0;
}

static void release(void *data, void *hint)
{
    struct parcel *p = hint;
    (void)data;
    atomic_fetch_sub(&p->shared->waiting, p->size);
    free(p);
}

/* One by itself always fits. */
static bool has_room(const struct reliable *r, size_t size)
{
    size_t waiting = atomic_load(&r->waiting);
    return !waiting || (waiting < RELIABLE_BYTES && size <= RELIABLE_BYTES - waiting);
}

/* Without memory too it is a gap at the other end. */
void reliable_send(struct reliable_publisher *o, const void *message, size_t size)
{
    zmq_msg_t out;
    if (!reliable_count_peers(o) || !has_room(o->shared, size))
        return;
    struct parcel *p = malloc(sizeof *p + size);
    if (!p)
        return;
    *p = (struct parcel){o->shared, size};
    memcpy(p->data, message, size);
    atomic_fetch_add(&o->shared->waiting, size);
    if (zmq_msg_init_data(&out, p->data, size, release, p)) {
        release(p->data, p);
        return;
    }
    int n;
    do
        n = zmq_msg_send(&out, o->socket, ZMQ_DONTWAIT);
    while (n < 0 && errno == EINTR);
    if (n < 0)
        zmq_msg_close(&out);
}

size_t reliable_count_peers(struct reliable_publisher *o)
{
    return o->peers = remote_read_peers(o->socket, o->peers);
}

void reliable_close(struct reliable_publisher *o)
{
    if (o && o->socket)
        zmq_close(o->socket);
    free(o);
}

int reliable_subscription_open(struct reliable_subscription **out, int *fd,
                               struct reliable *r, size_t most)
{
    struct reliable_subscription *s = calloc(1, sizeof *s);
    size_t size = sizeof *fd;
    if (!s)
        return -ENOMEM;
    int err = open_socket(&s->socket, r, ZMQ_SUB, most);
    if (!err && (zmq_setsockopt(s->socket, ZMQ_SUBSCRIBE, "", 0) ||
                 zmq_getsockopt(s->socket, ZMQ_FD, fd, &size)))
        err = -errno;
    if (err)
        reliable_subscription_close(s);
    else
        *out = s;
    return err;
}

int reliable_subscription_connect(struct reliable_subscription *s, const char *url)
{
    return zmq_connect(s->socket, url) ? -errno : 0;
}

void *reliable_subscription_receive(struct reliable_subscription *s, size_t *size)
{
    return remote_take_message(s->socket, size);
}

void reliable_subscription_close(struct reliable_subscription *s)
{
    if (s && s->socket)
        zmq_close(s->socket);
    free(s);
}
