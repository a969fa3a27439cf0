/* SPDX-License-Identifier: MIT */
#include "msgs/publisher.h"

#include <errno.h>
#include <math.h>
#include <nanomsg/nn.h>
#include <nanomsg/pubsub.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "msgs/endpoint.h"
#include "msgs/monotonic.h"

#define AWAIT_MS           2000 /* for who must have everything, and is late or hangs */
#define SEND_BUFFER_BYTES  (32 << 20) /* the kernel takes up to net.core.wmem_max */
#define MESSAGE_COST_BYTES 4096  /* the kernel's and the reader's, of a small message */
#define PACE_BYTES_S       500e6 /* less than half of what a reader can take */

static double level_at(const struct pace *p, int64_t now_ns)
{
    double elapsed_s = now_ns > p->stamp_ns ? (double)(now_ns - p->stamp_ns) * 1e-9 : 0;
    return fmax(0, p->level_bytes - elapsed_s * p->rate_bytes_s);
}

int64_t pace_delay_ns(const struct pace *p, int64_t now_ns)
{
    double over = level_at(p, now_ns) - p->burst_bytes;
    return over > 0 ? (int64_t)ceil(over / p->rate_bytes_s * 1e9) : 0;
}

void pace_spend(struct pace *p, int64_t now_ns, double bytes)
{
    p->level_bytes = level_at(p, now_ns) + bytes;
    p->stamp_ns = now_ns;
}

struct publisher {
    const struct topic *topic;
    pthread_mutex_t lock; /* numbers and sends in one step: the order is the sequence */
    struct envelope envelope;
    uint64_t messages, bytes;
    struct pace pace;
    int socket;
    char url[ENDPOINT_URL_SIZE];
    struct remote_publisher *remote; /* NULL: nobody on another machine */
    struct reliable_publisher *reliable;
};

/* What the kernel keeps of a connection: asked of a socket like nanomsg's, which does not
 * show its own.  The kernel doubles what it grants, for its own use. */
static double kernel_buffer_bytes(void)
{
    int pair[2], bytes = SEND_BUFFER_BYTES;
    socklen_t size = sizeof bytes;
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair) != 0)
        return 0; /* the pace holds without a burst */
    if (setsockopt(pair[0], SOL_SOCKET, SO_SNDBUF, &bytes, sizeof bytes) != 0 ||
        getsockopt(pair[0], SOL_SOCKET, SO_SNDBUF, &bytes, &size) != 0)
        bytes = 0;
    close(pair[0]);
    close(pair[1]);
    return bytes / 2.0;
}

static int bind_socket(struct publisher *o, struct error *why)
{
    int bytes = SEND_BUFFER_BYTES;
    const char *path = endpoint_path(o->url);
    o->socket = nn_socket(AF_SP, NN_PUB);
    if (o->socket < 0)
        return error_say(why, -errno, "%s: no socket: %s", path, nn_strerror(errno));
    if (unlink(path) != 0 && errno != ENOENT)
        return error_say(why, -errno, "%s: %s", path, strerror(errno));
    if (nn_setsockopt(o->socket, NN_SOL_SOCKET, NN_SNDBUF, &bytes, sizeof bytes) < 0 ||
        nn_bind(o->socket, o->url) < 0)
        return error_say(why, -errno, "%s: cannot bind: %s", path, nn_strerror(errno));
    return 0;
}

int publisher_create(struct publisher **out, const struct bus_config *cfg,
                     struct remote *remote, struct reliable *reliable,
                     const struct topic *t, struct error *why)
{
    char url[ENDPOINT_URL_SIZE];
    struct publisher *o = calloc(1, sizeof *o);
    if (!o)
        return error_say(why, -ENOMEM, "out of memory");
    o->topic = t;
    o->socket = -1;
    snprintf(o->envelope.topic, sizeof o->envelope.topic, "%s", t->name);
    snprintf(o->envelope.node, sizeof o->envelope.node, "%s", cfg->node);
    o->envelope.epoch_ns = cfg->epoch_ns;
    o->pace.rate_bytes_s = PACE_BYTES_S;
    o->pace.burst_bytes = kernel_buffer_bytes() / 2; /* half is for a reader that naps */
    int err = -pthread_mutex_init(&o->lock, NULL);
    if (err) {
        free(o);
        return error_say(why, err, "no mutex: %s", strerror(-err));
    }
    err = endpoint_url(o->url, cfg->run_dir, cfg->node, t->name, why);
    if (err)
        o->url[0] = 0; /* nothing to unlink */
    if (!err) {
        endpoint_url_of_all(url, o->url);
        err = reliable_bind(&o->reliable, reliable, url, why);
    }
    if (!err) /* after the other: who finds this one looks for that first */
        err = bind_socket(o, why);
    if (!err)
        err = remote_bind(&o->remote, remote, cfg->node, t, why);
    if (err)
        publisher_destroy(o);
    else
        *out = o;
    return err;
}

void *publisher_allocate(size_t size, void **payload)
{
    uint8_t *message = nn_allocmsg(ENVELOPE_SIZE + size, 0);
    if (message)
        *payload = message + ENVELOPE_SIZE;
    return message;
}

static void keep_pace(const struct publisher *o)
{
    int64_t now_ns = monotonic_ns();
    int64_t delay_ns = pace_delay_ns(&o->pace, now_ns);
    if (!delay_ns)
        return;
    int64_t end_ns = now_ns + delay_ns;
    struct timespec end = {.tv_sec = end_ns / 1000000000, .tv_nsec = end_ns % 1000000000};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &end, NULL) == EINTR)
        ;
}

static size_t count_peers(const struct publisher *o)
{
    uint64_t peers = nn_get_statistic(o->socket, NN_STAT_CURRENT_CONNECTIONS);
    return peers == (uint64_t)-1 ? 0 : (size_t)peers;
}

/* Each connection carries its own copy; without one, nothing is under way. */
static void spend_pace(struct publisher *o, size_t size)
{
    size_t peers = count_peers(o) + reliable_count_peers(o->reliable);
    pace_spend(&o->pace, monotonic_ns(),
               (MESSAGE_COST_BYTES + (double)size) * (double)peers);
}

int publisher_send(struct publisher *o, int64_t capture_ns, int64_t publish_ns,
                   void *message, size_t size)
{
    int n;
    pthread_mutex_lock(&o->lock);
    o->envelope.capture_ns = capture_ns;
    o->envelope.publish_ns = publish_ns;
    o->envelope.payload_size = (uint32_t)size;
    envelope_pack(&o->envelope, message);
    keep_pace(o);
    if (o->remote)
        remote_send(o->remote, message, ENVELOPE_SIZE + size);
    reliable_send(o->reliable, message, ENVELOPE_SIZE + size);
    do
        n = nn_send(o->socket, &message, NN_MSG, 0);
    while (n < 0 && errno == EINTR);
    int err = n < 0 ? -errno : 0;
    if (!err) {
        o->envelope.sequence++;
        o->messages++;
        o->bytes += size;
        spend_pace(o, ENVELOPE_SIZE + size);
    }
    pthread_mutex_unlock(&o->lock);
    if (err)
        nn_freemsg(message);
    return err;
}

int publisher_send_copy(struct publisher *o, int64_t capture_ns, int64_t publish_ns,
                        const void *payload, size_t size)
{
    if (size > publisher_topic(o)->max_size)
        return -EMSGSIZE;
    void *room, *message = publisher_allocate(size, &room);
    if (!message)
        return -ENOMEM;
    if (size)
        memcpy(room, payload, size);
    return publisher_send(o, capture_ns, publish_ns, message, size);
}

void publisher_set_replayed(struct publisher *o, bool replayed)
{
    pthread_mutex_lock(&o->lock);
    o->envelope.replayed = replayed;
    pthread_mutex_unlock(&o->lock);
}

const struct topic *publisher_topic(const struct publisher *o)
{
    return o->topic;
}

void publisher_count(struct publisher *o, struct bus_count *out)
{
    pthread_mutex_lock(&o->lock);
    *out =
        (struct bus_count){.topic = o->topic,
                           .published = true,
                           .messages = o->messages,
                           .bytes = o->bytes,
                           .peers = count_peers(o) + reliable_count_peers(o->reliable)};
    if (o->remote)
        out->peers += remote_count_peers(o->remote);
    pthread_mutex_unlock(&o->lock);
}

/* Has each who must have everything joined? */
static bool have_joined(struct publisher *const *o, size_t n, const char *run_dir)
{
    for (size_t i = 0; i < n; i++) {
        pthread_mutex_lock(&o[i]->lock);
        size_t joined = reliable_count_peers(o[i]->reliable);
        pthread_mutex_unlock(&o[i]->lock);
        if (joined < discovery_awaited(run_dir, o[i]->topic))
            return false;
    }
    return true;
}

void publishers_await_recorders(struct publisher *const *o, size_t n, const char *run_dir)
{
    const struct timespec pause = {.tv_nsec = 1000000};
    int64_t end_ns = monotonic_ns() + AWAIT_MS * INT64_C(1000000);
    while (!have_joined(o, n, run_dir) && monotonic_ns() < end_ns)
        nanosleep(&pause, NULL);
}

size_t publisher_room(const struct publisher *o)
{
    return (size_t)(2.0 * o->pace.burst_bytes); /* of which a burst is half */
}

void publisher_destroy(struct publisher *o)
{
    if (!o)
        return;
    remote_close(o->remote);
    reliable_close(o->reliable);
    keep_pace(o); /* nanomsg does not linger: what the kernel has not got yet is lost */
    if (o->socket >= 0)
        while (nn_close(o->socket) < 0 && errno == EINTR)
            ;
    if (o->url[0]) {
        char all[ENDPOINT_URL_SIZE];
        endpoint_url_of_all(all, o->url);
        unlink(endpoint_path(all));
        unlink(endpoint_path(o->url));
    }
    pthread_mutex_destroy(&o->lock);
    free(o);
}
