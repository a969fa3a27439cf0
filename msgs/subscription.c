/* SPDX-License-Identifier: MIT */
#include "msgs/subscription.h"

#include <errno.h>
#include <nanomsg/nn.h>
#include <nanomsg/pubsub.h>
#include <string.h>
#include <unistd.h>

#include "msgs/endpoint.h"

/* nanomsg drops the connection over this, without a word, and allocates what a header
 * asks for under it; what is over a topic's own bound is refused and counted
 * (subscriber). */
#define RECEIVE_MAX_BYTES    (1 << 30)
#define RECEIVE_BUFFER_BYTES (32 << 20)
#define RECONNECT_MS         20
#define RECONNECT_MAX_MS     200

static int set_options(struct subscription *subscription)
{
    const int max = RECEIVE_MAX_BYTES, buffer = RECEIVE_BUFFER_BYTES;
    const int first = RECONNECT_MS, last = RECONNECT_MAX_MS;
    size_t fd_size = sizeof subscription->fd;
    int s = subscription->socket;
    if (nn_setsockopt(s, NN_SOL_SOCKET, NN_RCVMAXSIZE, &max, sizeof max) < 0 ||
        nn_setsockopt(s, NN_SOL_SOCKET, NN_RCVBUF, &buffer, sizeof buffer) < 0 ||
        nn_setsockopt(s, NN_SOL_SOCKET, NN_RECONNECT_IVL, &first, sizeof first) < 0 ||
        nn_setsockopt(s, NN_SOL_SOCKET, NN_RECONNECT_IVL_MAX, &last, sizeof last) < 0 ||
        nn_setsockopt(s, NN_SUB, NN_SUB_SUBSCRIBE, "", 0) < 0 ||
        nn_getsockopt(s, NN_SOL_SOCKET, NN_RCVFD, &subscription->fd, &fd_size) < 0)
        return -errno;
    return 0;
}

/* By the socket for those who must have everything.  false: there is none. */
static bool join_reliably(struct subscription *subscription,
                          struct subscription_source *source, const char *url)
{
    char all[ENDPOINT_URL_SIZE];
    endpoint_url_of_all(all, url);
    if (!subscription->reliable || access(endpoint_path(all), F_OK) != 0)
        return false;
    if (!source->joined)
        source->joined = !reliable_subscription_connect(subscription->reliable, all);
    return source->joined;
}

/* To the publisher's socket in this run folder; of who awaits: only if there is one. */
static int connect_here(struct subscription *subscription,
                        struct subscription_source *source, const char *url, bool awaits)
{
    source->here = true;
    if (awaits && (join_reliably(subscription, source, url) ||
                   access(endpoint_path(url), F_OK) != 0))
        return 0;
    source->endpoint = nn_connect(subscription->socket, url);
    return source->endpoint < 0 ? -errno : 0;
}

/* To the publisher in this run folder, and in those of other hosts on this machine. */
static int connect_node(struct subscription *subscription,
                        struct subscription_source *source, const char *node,
                        const char *run_dir, const struct hosts *hosts, bool awaits)
{
    char url[ENDPOINT_URL_SIZE];
    int err = 0;
    source->endpoint = -1;
    for (size_t i = 0; !err && i < (hosts->n ? hosts->n : 1); i++) {
        bool here = !hosts->n || i == hosts->here;
        const char *folder = here ? run_dir : hosts->list[i].folder;
        if (!folder[0] || !hosts_may_run(hosts, i, node))
            continue;
        err = endpoint_url(url, folder, node, subscription->topic->name, NULL);
        if (!err && here)
            err = connect_here(subscription, source, url, awaits);
        else if (!err && nn_connect(subscription->socket, url) < 0)
            err = -errno;
    }
    return err;
}

void subscription_meet(struct subscription *subscription, const char *run_dir,
                       const char *name)
{
    char url[ENDPOINT_URL_SIZE], all[ENDPOINT_URL_SIZE];
    const char *node;
    for (size_t i = 0; i < SUBSCRIPTION_MAX_PUBLISHERS &&
                       (node = topic_publisher(subscription->topic, i));
         i++) {
        struct subscription_source *s = &subscription->sources[i];
        if (!s->here ||
            endpoint_url(url, run_dir, node, subscription->topic->name, NULL) != 0)
            continue;
        endpoint_url_of_all(all, url);
        bool is_all = !strcmp(strrchr(all, '/') + 1, name);
        if ((!is_all && strcmp(strrchr(url, '/') + 1, name) != 0) ||
            join_reliably(subscription, s, url) || is_all)
            continue;
        if (s->endpoint >= 0) /* to one that is gone; it would try again, but later */
            nn_shutdown(subscription->socket, s->endpoint);
        s->endpoint = nn_connect(subscription->socket, url);
    }
}

/* Subscribes to everything on the endpoints, which carry this topic only: whatever else
 * comes out of them is refused and counted, not filtered away in silence. */
int subscription_open(struct subscription *subscription, const struct topic *t,
                      const char *run_dir, const struct remote *remote,
                      struct reliable *reliable, bool awaits)
{
    const char *node;
    *subscription = (struct subscription){.topic = t, .remote_fd = -1, .reliable_fd = -1};
    subscription->socket = nn_socket(AF_SP, NN_SUB);
    if (subscription->socket < 0)
        return -errno;
    int err = set_options(subscription);
    if (!err && awaits)
        err = reliable_subscription_open(&subscription->reliable,
                                         &subscription->reliable_fd, reliable,
                                         ENVELOPE_SIZE + t->max_size);
    for (size_t i = 0; !err && (node = topic_publisher(t, i)); i++)
        err = i < SUBSCRIPTION_MAX_PUBLISHERS
                  ? connect_node(subscription, &subscription->sources[i], node, run_dir,
                                 remote_hosts(remote), awaits)
                  : -E2BIG;
    if (!err)
        err = remote_subscription_open(&subscription->remote, &subscription->remote_fd,
                                       remote, t);
    if (err)
        subscription_close(subscription);
    return err;
}

struct subscription_source *subscription_find_source(struct subscription *subscription,
                                                     const char *node)
{
    const char *name;
    for (size_t i = 0; i < SUBSCRIPTION_MAX_PUBLISHERS &&
                       (name = topic_publisher(subscription->topic, i));
         i++)
        if (strcmp(name, node) == 0)
            return &subscription->sources[i];
    return NULL;
}

/* What was sent before the first message that arrives here is not missed, unless the
 * process started after since_ns, by the clock of this machine, nor is what one sent that
 * has been restarted since.  A new process takes the place of the one that was heard
 * longest ago. */
static uint64_t count_gap(struct subscription *subscription,
                          struct subscription_source *s, const struct envelope *e)
{
    size_t i = 0, oldest = 0;
    for (; i < SUBSCRIPTION_MAX_PROCESSES; i++) {
        if (s->processes[i].heard && s->processes[i].epoch_ns == e->epoch_ns)
            break;
        if (s->processes[i].heard < s->processes[oldest].heard)
            oldest = i;
    }
    bool goes_on = i < SUBSCRIPTION_MAX_PROCESSES;
    i = goes_on ? i : oldest;
    bool is_younger = s->here && e->epoch_ns > subscription->since_ns;
    uint64_t expected = goes_on ? s->processes[i].next : is_younger ? 0 : e->sequence;
    s->processes[i].epoch_ns = e->epoch_ns;
    s->processes[i].next = e->sequence + 1;
    s->processes[i].heard = subscription->messages;
    return e->sequence > expected ? e->sequence - expected : 0;
}

void subscription_count(struct subscription *subscription,
                        struct subscription_source *source, const struct envelope *e)
{
    subscription->messages++;
    subscription->bytes += e->payload_size;
    subscription->gaps += count_gap(subscription, source, e);
}

size_t subscription_peers(const struct subscription *subscription)
{
    uint64_t peers = nn_get_statistic(subscription->socket, NN_STAT_CURRENT_CONNECTIONS);
    return subscription->remote_peers + (peers == (uint64_t)-1 ? 0 : (size_t)peers);
}

void subscription_close(struct subscription *subscription)
{
    remote_subscription_close(subscription->remote);
    reliable_subscription_close(subscription->reliable);
    while (nn_close(subscription->socket) < 0 && errno == EINTR)
        ;
}
