/* SPDX-License-Identifier: MIT */
#include "msgs/subscriber.h"

#include <dirent.h>
#include <errno.h>
#include <nanomsg/nn.h>
#include <nanomsg/pubsub.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "msgs/endpoint.h"
#include "msgs/monotonic.h"

/* -- how a topic is heard --------------------------------------------------------------
 */

#define MAX_PUBLISHERS 16
#define MAX_PROCESSES  4

/* nanomsg drops the connection over this, without a word, and allocates what a header
 * asks for under it; what is over a topic's own bound is refused and counted. */
#define RECEIVE_MAX_BYTES    (1 << 30)
#define RECEIVE_BUFFER_BYTES (32 << 20)
#define RECONNECT_MS         20
#define RECONNECT_MAX_MS     200

/* One publisher: of a name that runs on several machines (hand, launcher) each process is
 * counted for itself. */
struct subscription_source {
    bool here;    /* its socket is in the run folder, or will be */
    bool joined;  /* by the socket for those who must have everything */
    int endpoint; /* nanomsg's, to that socket; -1: not connected to it */
    struct {
        int64_t epoch_ns;
        uint64_t next;  /* sequence expected */
        uint64_t heard; /* the subscription's count of messages then; 0: never */
    } processes[MAX_PROCESSES];
};

/* A topic: a nanomsg SUB socket that is connected to each of its publishers on this
 * machine, another one to those on others (msgs/remote.h), and the account of what came.
 */
struct subscription {
    const struct topic *topic;
    size_t slot;    /* in the receive queue */
    int socket, fd; /* fd: readable while messages wait; the socket's own */
    struct remote_subscription *remote; /* NULL: no publisher is on another machine */
    int remote_fd;
    size_t remote_peers;
    struct reliable_subscription *reliable; /* NULL: need not have everything */
    int reliable_fd;
    int64_t since_ns; /* publishers that start after it count from their first message */
    struct subscription_source sources[MAX_PUBLISHERS];
    uint64_t messages, bytes, gaps;
};

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

/* A file of that name has appeared in the run folder: if it is a publisher's socket,
 * connects to it. */
static void subscription_meet(struct subscription *subscription, const char *run_dir,
                              const char *name)
{
    char url[ENDPOINT_URL_SIZE], all[ENDPOINT_URL_SIZE];
    const char *node;
    for (size_t i = 0;
         i < MAX_PUBLISHERS && (node = topic_publisher(subscription->topic, i)); i++) {
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

static void subscription_close(struct subscription *subscription)
{
    remote_subscription_close(subscription->remote);
    reliable_subscription_close(subscription->reliable);
    while (nn_close(subscription->socket) < 0 && errno == EINTR)
        ;
}

/* Publishers may come later, go and come back.  awaits: nothing may be missed; who is not
 * there yet is connected to by subscription_meet.  0, -ENAMETOOLONG, -E2BIG (more
 * publishers than there is room for), other negative errno.
 *
 * Subscribes to everything on the endpoints, which carry this topic only: whatever else
 * comes out of them is refused and counted, not filtered away in silence. */
static int subscription_open(struct subscription *subscription, const struct topic *t,
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
        err = i < MAX_PUBLISHERS
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

/* Which publisher of the topic it is; NULL: none of them. */
static struct subscription_source *
subscription_find_source(struct subscription *subscription, const char *node)
{
    const char *name;
    for (size_t i = 0;
         i < MAX_PUBLISHERS && (name = topic_publisher(subscription->topic, i)); i++)
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
    for (; i < MAX_PROCESSES; i++) {
        if (s->processes[i].heard && s->processes[i].epoch_ns == e->epoch_ns)
            break;
        if (s->processes[i].heard < s->processes[oldest].heard)
            oldest = i;
    }
    bool goes_on = i < MAX_PROCESSES;
    i = goes_on ? i : oldest;
    bool is_younger = s->here && e->epoch_ns > subscription->since_ns;
    uint64_t expected = goes_on ? s->processes[i].next : is_younger ? 0 : e->sequence;
    s->processes[i].epoch_ns = e->epoch_ns;
    s->processes[i].next = e->sequence + 1;
    s->processes[i].heard = subscription->messages;
    return e->sequence > expected ? e->sequence - expected : 0;
}

/* A message of that source has arrived: counts it, and what is missing before it. */
static void subscription_count(struct subscription *subscription,
                               struct subscription_source *source,
                               const struct envelope *e)
{
    subscription->messages++;
    subscription->bytes += e->payload_size;
    subscription->gaps += count_gap(subscription, source, e);
}

/* Publishers that are connected now, as far as nanomsg and remotes go. */
static size_t subscription_peers(const struct subscription *subscription)
{
    uint64_t peers = nn_get_statistic(subscription->socket, NN_STAT_CURRENT_CONNECTIONS);
    return subscription->remote_peers + (peers == (uint64_t)-1 ? 0 : (size_t)peers);
}

/* -- the receiving thread --------------------------------------------------------------
 */

#define FDS 3 /* of a subscription */

enum refusal { /* after those of enum envelope_fault */
               REFUSAL_TOPIC = ENVELOPE_TOO_LARGE + 1,
               REFUSAL_PUBLISHER,
               REFUSAL_REPLAYED,
               REFUSAL_LIVE,
               REFUSAL_SOCKET,
               N_REFUSALS
};

static const char *const refusal_texts[N_REFUSALS] = {
    [ENVELOPE_SHORT] = "it ends within the envelope",
    [ENVELOPE_FOREIGN] = "wrong magic",
    [ENVELOPE_OTHER_VERSION] = "the envelope is of another version",
    [ENVELOPE_GARBLED] = "the envelope is garbled",
    [ENVELOPE_LENGTH] = "its length is not what the envelope says",
    [ENVELOPE_TOO_LARGE] = "it is larger than the topic allows",
    [REFUSAL_TOPIC] = "it is of another topic",
    [REFUSAL_PUBLISHER] = "its node does not publish this topic",
    [REFUSAL_REPLAYED] = "it is replayed, and this system is live: play recordings in "
                         "another runtime directory",
    [REFUSAL_LIVE] = "it is live, and this system replays a recording: run live nodes in "
                     "another runtime directory",
    [REFUSAL_SOCKET] = "receiving failed",
};

struct subscriber {
    char *run_dir;
    enum bus_world world;
    struct remote *remote;
    struct reliable *reliable;
    struct receive_queue *receive_queue;
    pthread_t thread;
    int wake_fd;
    struct discovery discovery; /* fd -1: sockets that appear are not waited for */
    pthread_mutex_t lock;       /* what follows */
    bool stop;
    int64_t since_ns; /* for subscriptions to come */
    size_t n_subscriptions;
    struct subscription
        subscriptions[TOPICS_COUNT]; /* one that is in use keeps its place */
    uint64_t refused;
    bool told[N_REFUSALS];
    void (*on_refusal)(void *ctx, const char *text);
    void *on_refusal_ctx;
};

static void refuse(struct subscriber *in, const struct topic *t, int kind, size_t size)
{
    char text[300];
    pthread_mutex_lock(&in->lock);
    in->refused++;
    void (*call)(void *, const char *) = in->told[kind] ? NULL : in->on_refusal;
    void *ctx = in->on_refusal_ctx;
    in->told[kind] |= call != NULL;
    pthread_mutex_unlock(&in->lock);
    if (!call)
        return;
    snprintf(text, sizeof text,
             "a message of %zu bytes on topic \"%s\" was refused: %s; more of this kind "
             "are only counted",
             size, t->name, refusal_texts[kind]);
    call(ctx, text); /* without the lock: it may ask for the counts */
}

/* Processes speak of themselves: of those who look on, it may be live beside a replay. */
static bool is_of_both_worlds(const struct topic *t)
{
    return t == topic_health() || t == topic_log() || t == topic_host();
}

/* A REFUSAL_*, or 0. */
static int check_world(const struct subscriber *in, const struct topic *t, bool replayed)
{
    if (in->world == BUS_LIVE && (replayed || t == topic_clock()))
        return REFUSAL_REPLAYED;
    if (in->world == BUS_REPLAY && !replayed && !is_of_both_worlds(t))
        return REFUSAL_LIVE;
    return 0;
}

static void accept_message(struct subscriber *in, struct subscription *subscription,
                           uint8_t *data, size_t size)
{
    struct bus_message message = {
        .topic = subscription->topic, .payload = data + ENVELOPE_SIZE, .owner = data};
    struct envelope *e = &message.envelope;
    struct subscription_source *source = NULL;
    int fault = envelope_inspect(data, size, subscription->topic->max_size);
    if (!fault) {
        envelope_unpack(e, data, size, subscription->topic->max_size);
        source = subscription_find_source(subscription, e->node);
        if (strcmp(e->topic, subscription->topic->name) != 0)
            fault = REFUSAL_TOPIC;
        else if (!source)
            fault = REFUSAL_PUBLISHER;
        else
            fault = check_world(in, subscription->topic, e->replayed);
    }
    if (fault) {
        refuse(in, subscription->topic, fault, size);
        nn_freemsg(data);
        return;
    }
    pthread_mutex_lock(&in->lock);
    subscription_count(subscription, source, e);
    pthread_mutex_unlock(&in->lock);
    receive_queue_put(in->receive_queue, subscription->slot, &message);
}

/* Takes what is there.  -EBADF: never try this socket again. */
static int listen_once(struct subscriber *in, struct subscription *subscription)
{
    for (;;) {
        void *data = NULL;
        int n = nn_recv(subscription->socket, &data, NN_MSG, NN_DONTWAIT);
        if (n >= 0) {
            accept_message(in, subscription, data, (size_t)n);
        } else if (errno == EAGAIN) {
            return 0;
        } else if (errno != EINTR) {
            refuse(in, subscription->topic, REFUSAL_SOCKET, 0);
            return -EBADF;
        }
    }
}

static void listen_remote(struct subscriber *in, struct subscription *subscription)
{
    void *data;
    size_t size;
    while ((data = remote_subscription_receive(subscription->remote, &size)))
        accept_message(in, subscription, data, size);
}

static void listen_reliably(struct subscriber *in, struct subscription *subscription)
{
    void *data;
    size_t size;
    while (subscription->reliable &&
           (data = reliable_subscription_receive(subscription->reliable, &size)))
        accept_message(in, subscription, data, size);
}

/* When it is time.  How long then may be waited, in ms. */
static int tend_remotes(struct subscriber *in, size_t n_subscriptions, int64_t *due_ms)
{
    int64_t now_ms = monotonic_ms();
    bool any = false, due = now_ms >= *due_ms;
    for (size_t i = 0; i < n_subscriptions; i++) {
        struct subscription *subscription = &in->subscriptions[i];
        if (!subscription->remote)
            continue;
        any = true;
        if (!due)
            continue;
        size_t peers = remote_subscription_tend(subscription->remote);
        listen_remote(in, subscription); /* the descriptor tells only of what is new */
        pthread_mutex_lock(&in->lock);
        subscription->remote_peers = peers;
        pthread_mutex_unlock(&in->lock);
    }
    if (due)
        *due_ms = now_ms + REMOTE_SUBSCRIPTION_TEND_MS;
    return any ? (int)(*due_ms - now_ms) : -1;
}

/* FDS descriptors for each subscription; poll skips what is -1. */
static void listen_to_all(struct subscriber *in, size_t n_subscriptions,
                          struct pollfd *fds)
{
    for (size_t i = 0; i < n_subscriptions; i++) {
        struct pollfd *of = fds + FDS * i;
        if (of[0].revents && listen_once(in, &in->subscriptions[i]) != 0)
            of[0].fd = -1;
        if (of[1].revents)
            listen_remote(in, &in->subscriptions[i]);
        if (of[2].revents)
            listen_reliably(in, &in->subscriptions[i]);
    }
}

/* Takes in the subscriptions that have come, and who tells of new publishers, as fds[0].
 * false: stop.
 */
static bool heed_wake(struct subscriber *in, size_t *n_subscriptions, struct pollfd *fds)
{
    uint64_t count;
    ssize_t got = read(in->wake_fd, &count, sizeof count);
    (void)got;
    pthread_mutex_lock(&in->lock);
    bool stop = in->stop;
    fds[0].fd = in->discovery.fd;
    for (; *n_subscriptions < in->n_subscriptions; ++*n_subscriptions) {
        const struct subscription *subscription = &in->subscriptions[*n_subscriptions];
        struct pollfd *of = fds + 1 + FDS * *n_subscriptions;
        of[0] = (struct pollfd){.fd = subscription->fd, .events = POLLIN};
        of[1] = (struct pollfd){.fd = subscription->remote_fd, .events = POLLIN};
        of[2] = (struct pollfd){.fd = subscription->reliable_fd, .events = POLLIN};
    }
    pthread_mutex_unlock(&in->lock);
    return !stop;
}

static void meet(void *context, const char *name)
{
    struct subscriber *in = context;
    pthread_mutex_lock(&in->lock);
    for (size_t i = 0; i < in->n_subscriptions; i++)
        subscription_meet(&in->subscriptions[i], in->run_dir, name);
    pthread_mutex_unlock(&in->lock);
}

/* Somebody has removed the run folder; what starts from now on meets in a new one.
 * Returns the descriptor that tells of it, or -1. */
static int await_in_new_folder(struct subscriber *in)
{
    pthread_mutex_lock(&in->lock);
    discovery_close(&in->discovery);
    if (!endpoint_make_folder(in->run_dir, NULL))
        discovery_open(&in->discovery, in->run_dir);
    for (size_t i = 0; in->discovery.fd >= 0 && i < in->n_subscriptions; i++)
        discovery_await(&in->discovery, in->subscriptions[i].topic);
    int fd = in->discovery.fd;
    pthread_mutex_unlock(&in->lock);
    DIR *d = fd < 0 ? NULL : opendir(in->run_dir);
    for (const struct dirent *e; d && (e = readdir(d));)
        meet(in, e->d_name); /* who was there sooner */
    if (d)
        closedir(d);
    return fd;
}

static void *listen_for_ever(void *arg)
{
    struct subscriber *in = arg;
    struct pollfd fds[2 + FDS * TOPICS_COUNT] = {{.fd = in->wake_fd, .events = POLLIN},
                                                 {.fd = -1, .events = POLLIN}};
    size_t n_subscriptions = 0;
    int64_t due_ms = 0;
    for (;;) {
        int n = poll(fds, 2 + FDS * n_subscriptions,
                     tend_remotes(in, n_subscriptions, &due_ms));
        if (n < 0 && errno != EINTR)
            abort(); /* only a bug gets here: a bad pointer or count */
        if (n <= 0)
            continue;
        if (fds[1].revents && !discovery_read(&in->discovery, meet, in))
            fds[1].fd = await_in_new_folder(in);
        bool met = fds[1].revents;
        listen_to_all(in, n_subscriptions, fds + 2);
        if (fds[0].revents) {
            if (!heed_wake(in, &n_subscriptions, fds + 1))
                return NULL;
            due_ms = 0;
            met = true;
        }
        for (size_t i = 0; met && i < n_subscriptions; i++)
            listen_reliably(in, &in->subscriptions[i]); /* as of remotes */
    }
}

static void wake(const struct subscriber *in)
{
    uint64_t one = 1;
    ssize_t n = write(in->wake_fd, &one, sizeof one);
    (void)n; /* it fails only when the counter is full, and then it is readable */
}

/* Signals are for the node's own threads. */
static int start_thread(struct subscriber *in)
{
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int err = -pthread_create(&in->thread, NULL, listen_for_ever, in);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return err;
}

int subscriber_create(struct subscriber **out, const char *run_dir, enum bus_world world,
                      struct remote *remote, struct reliable *reliable,
                      struct receive_queue *receive_queue)
{
    struct subscriber *in = calloc(1, sizeof *in);
    if (!in)
        return -ENOMEM;
    in->world = world;
    in->remote = remote;
    in->reliable = reliable;
    in->receive_queue = receive_queue;
    in->since_ns = INT64_MAX;
    in->run_dir = strdup(run_dir);
    in->discovery = (struct discovery){-1, -1};
    in->wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    int err = !in->run_dir ? -ENOMEM : in->wake_fd < 0 ? -errno : 0;
    if (err)
        goto no_parts;
    err = -pthread_mutex_init(&in->lock, NULL);
    if (err)
        goto no_parts;
    err = start_thread(in);
    if (err)
        goto no_thread;
    *out = in;
    return 0;
no_thread:
    pthread_mutex_destroy(&in->lock);
no_parts:
    if (in->wake_fd >= 0)
        close(in->wake_fd);
    free(in->run_dir);
    free(in);
    return err;
}

int subscriber_subscribe(struct subscriber *in, const struct topic *t)
{
    pthread_mutex_lock(&in->lock);
    int err = in->n_subscriptions < TOPICS_COUNT ? 0 : -E2BIG;
    bool known = false;
    for (size_t i = 0; i < in->n_subscriptions; i++)
        known |= in->subscriptions[i].topic == t;
    if (!known && !err) {
        struct subscription *subscription = &in->subscriptions[in->n_subscriptions];
        if (in->discovery.fd >= 0) /* before it looks who is there */
            discovery_await(&in->discovery, t);
        err = subscription_open(subscription, t, in->run_dir, in->remote, in->reliable,
                                in->discovery.fd >= 0);
        subscription->since_ns = in->since_ns;
        if (!err && (err = receive_queue_add(in->receive_queue, t, &subscription->slot)))
            subscription_close(subscription);
        in->n_subscriptions += !err;
    }
    pthread_mutex_unlock(&in->lock);
    wake(in);
    return known ? 0 : err;
}

void subscriber_count_from_start(struct subscriber *in, int64_t now_ns)
{
    pthread_mutex_lock(&in->lock);
    in->since_ns = now_ns;
    if (in->discovery.fd < 0)
        discovery_open(&in->discovery, in->run_dir); /* without: nanomsg tries often */
    pthread_mutex_unlock(&in->lock);
}

size_t subscriber_counts(struct subscriber *in, struct bus_count *out, size_t max)
{
    pthread_mutex_lock(&in->lock);
    size_t n = in->n_subscriptions;
    for (size_t i = 0; i < n && i < max; i++) {
        const struct subscription *subscription = &in->subscriptions[i];
        out[i] = (struct bus_count){.topic = subscription->topic,
                                    .messages = subscription->messages,
                                    .bytes = subscription->bytes,
                                    .gaps = subscription->gaps,
                                    .peers = subscription_peers(subscription)};
        receive_queue_count(in->receive_queue, subscription->slot, &out[i].dropped,
                            &out[i].queued);
    }
    pthread_mutex_unlock(&in->lock);
    return n;
}

uint64_t subscriber_refused(struct subscriber *in)
{
    pthread_mutex_lock(&in->lock);
    uint64_t refused = in->refused;
    pthread_mutex_unlock(&in->lock);
    return refused;
}

void subscriber_on_refusal(struct subscriber *in,
                           void (*call)(void *ctx, const char *text), void *ctx)
{
    pthread_mutex_lock(&in->lock);
    in->on_refusal = call;
    in->on_refusal_ctx = ctx;
    pthread_mutex_unlock(&in->lock);
}

void subscriber_destroy(struct subscriber *in)
{
    if (!in)
        return;
    pthread_mutex_lock(&in->lock);
    in->stop = true;
    pthread_mutex_unlock(&in->lock);
    wake(in);
    pthread_join(in->thread, NULL);
    discovery_close(&in->discovery);
    for (size_t i = 0; i < in->n_subscriptions; i++)
        subscription_close(&in->subscriptions[i]);
    pthread_mutex_destroy(&in->lock);
    close(in->wake_fd);
    free(in->run_dir);
    free(in);
}
