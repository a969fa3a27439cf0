#include "msgs/remote.h"

#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zmq.h>

#define KEEPALIVE_IDLE_S     2 /* a probe each second, after so long without a word */
#define KEEPALIVE_INTERVAL_S 1
#define CONNECT_MS           3000
#define RECONNECT_MS         100
#define RECONNECT_MAX_MS     1000
#define SUBSCRIPTION_MAX     256 /* bytes that a publisher takes from a stranger */
#define LATEST_DEPTH         2   /* of a state, in each direction's queue */

struct remote {
    struct hosts hosts;
    void *context; /* NULL: nothing of this system is reached by TCP */
};

static bool has_address(const struct hosts *h)
{
    return h->n && h->list[h->here].address[0];
}

int remote_create(struct remote **out, const char *run_dir, struct complaint *why)
{
    struct remote *r = calloc(1, sizeof *r);
    if (!r)
        return complain(why, -ENOMEM, "out of memory");
    int err = hosts_read(&r->hosts, run_dir, why);
    if (!err && has_address(&r->hosts) && !(r->context = zmq_ctx_new()))
        err = complain(why, -errno, "no TCP: %s", zmq_strerror(errno));
    if (err)
        free(r);
    else
        *out = r;
    return err;
}

void *remote_context(const struct remote *r)
{
    return r->context;
}

const struct hosts *remote_hosts(const struct remote *r)
{
    return &r->hosts;
}

static int set(void *socket, int option, int value)
{
    return zmq_setsockopt(socket, option, &value, sizeof value) ? -errno : 0;
}

int remote_set_options(void *socket, const struct topic *t, size_t incoming)
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

void remote_url(char url[REMOTE_URL_SIZE], const struct host *h, const char *node,
                const struct topic *t)
{
    snprintf(url, REMOTE_URL_SIZE, "tcp://%s:%u", h->address, hosts_port(h, node, t));
}

int remote_bind(void **socket, const struct remote *r, const char *node,
                const struct topic *t, struct complaint *why)
{
    char url[REMOTE_URL_SIZE];
    *socket = NULL;
    if (!r || !r->context)
        return 0;
    remote_url(url, &r->hosts.list[r->hosts.here], node, t);
    void *s = zmq_socket(r->context, ZMQ_XPUB); /* a PUB that tells of its subscribers */
    int err = s ? remote_set_options(s, t, SUBSCRIPTION_MAX) : -errno;
    if (!err)
        err = set(s, ZMQ_XPUB_VERBOSER, 1);
    if (!err && zmq_bind(s, url))
        err = -errno;
    if (!err) {
        *socket = s;
        return 0;
    }
    complain(why, err, "%s, for topic %s: cannot bind: %s%s", url, t->name,
             zmq_strerror(-err),
             err == -EADDRNOTAVAIL ? "; the host is not this machine"
             : err == -EADDRINUSE  ? "; another program has the port"
                                   : "");
    if (s)
        zmq_close(s);
    return err;
}

/* A PUB drops what does not fit and fails only without memory: then too it is a gap at
 * the other end. */
void remote_send(void *socket, const void *message, size_t size)
{
    while (zmq_send(socket, message, size, ZMQ_DONTWAIT) < 0 && errno == EINTR)
        ;
}

void remote_count_peers(void *socket, size_t *peers)
{
    uint8_t word[SUBSCRIPTION_MAX] = {2};
    int n;
    while ((n = zmq_recv(socket, word, sizeof word, ZMQ_DONTWAIT)) >= 0 || errno == EINTR)
        if (n > 0 && word[0] == 1)
            ++*peers;
        else if (n > 0 && word[0] == 0 && *peers)
            --*peers;
}

void remote_close(void *socket)
{
    if (socket)
        zmq_close(socket);
}

void remote_destroy(struct remote *r)
{
    if (!r)
        return;
    if (r->context)
        while (zmq_ctx_term(r->context) && errno == EINTR)
            ;
    free(r);
}
