/* SPDX-License-Identifier: MIT */
#include "msgs/subscriber.h"

#include <dirent.h>
#include <errno.h>
#include <nanomsg/nn.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

#include "msgs/discovery.h"
#include "msgs/endpoint.h"
#include "msgs/monotonic.h"
#include "msgs/subscription.h"

#define MAX_TOPICS 32
#define FDS        3 /* of a subscription */

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
        subscriptions[MAX_TOPICS]; /* one that is in use keeps its place */
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
    struct pollfd fds[2 + FDS * MAX_TOPICS] = {{.fd = in->wake_fd, .events = POLLIN},
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
    int err = in->n_subscriptions < MAX_TOPICS ? 0 : -E2BIG;
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
