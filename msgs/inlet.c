#include "msgs/inlet.h"

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

#define MAX_TOPICS     16
#define MAX_PUBLISHERS 16
/* nanomsg drops the connection over this, without a word, and allocates what a header
 * asks for under it; what is over a topic's own bound is refused and counted here. */
#define RECEIVE_MAX_BYTES    (1 << 30)
#define RECEIVE_BUFFER_BYTES (32 << 20)
#define RECONNECT_MS         20
#define RECONNECT_MAX_MS     200

enum refusal { /* after those of enum envelope_fault */
               REFUSAL_TOPIC = ENVELOPE_TOO_LARGE + 1,
               REFUSAL_PUBLISHER,
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
    [REFUSAL_SOCKET] = "receiving failed",
};

struct source { /* one publisher of a topic */
    bool known;
    int64_t epoch_ns;
    uint64_t next; /* sequence expected */
};

struct ear { /* one topic */
    const struct topic *topic;
    size_t slot; /* in the mailbox */
    int socket, fd;
    struct source sources[MAX_PUBLISHERS];
    uint64_t messages, bytes, gaps;
};

struct inlet {
    char *run_dir;
    struct mailbox *mailbox;
    pthread_t thread;
    int wake_fd;
    pthread_mutex_t lock; /* what follows */
    bool stop;
    size_t n_ears;
    struct ear ears[MAX_TOPICS]; /* one that is in use keeps its place */
    uint64_t refused;
    bool told[N_REFUSALS];
    void (*on_refusal)(void *ctx, const char *text);
    void *on_refusal_ctx;
};

static void refuse(struct inlet *in, const struct topic *t, int kind, size_t size)
{
    char text[200];
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

/* Which publisher of the topic sent it; NULL: none of them. */
static struct source *find_source(struct ear *ear, const char *node)
{
    const char *name;
    for (size_t i = 0; i < MAX_PUBLISHERS && (name = topic_publisher(ear->topic, i)); i++)
        if (strcmp(name, node) == 0)
            return &ear->sources[i];
    return NULL;
}

/* What was sent before the first message that arrives here is not missed, nor is what a
 * process sent that has been restarted since. */
static uint64_t count_gap(struct source *s, const struct envelope *e)
{
    uint64_t gap = 0;
    if (s->known && s->epoch_ns == e->epoch_ns && e->sequence > s->next)
        gap = e->sequence - s->next;
    s->known = true;
    s->epoch_ns = e->epoch_ns;
    s->next = e->sequence + 1;
    return gap;
}

static void accept_message(struct inlet *in, struct ear *ear, uint8_t *data, size_t size)
{
    struct bus_message message = {
        .topic = ear->topic, .payload = data + ENVELOPE_SIZE, .owner = data};
    struct envelope *e = &message.envelope;
    struct source *source = NULL;
    int fault = envelope_inspect(data, size, ear->topic->max_size);
    if (!fault) {
        envelope_unpack(e, data, size, ear->topic->max_size);
        source = find_source(ear, e->node);
        if (strcmp(e->topic, ear->topic->name) != 0)
            fault = REFUSAL_TOPIC;
        else if (!source)
            fault = REFUSAL_PUBLISHER;
    }
    if (fault) {
        refuse(in, ear->topic, fault, size);
        nn_freemsg(data);
        return;
    }
    pthread_mutex_lock(&in->lock);
    ear->messages++;
    ear->bytes += e->payload_size;
    ear->gaps += count_gap(source, e);
    pthread_mutex_unlock(&in->lock);
    mailbox_put(in->mailbox, ear->slot, &message);
}

/* Takes what is there.  -EBADF: never try this socket again. */
static int listen_once(struct inlet *in, struct ear *ear)
{
    for (;;) {
        void *data = NULL;
        int n = nn_recv(ear->socket, &data, NN_MSG, NN_DONTWAIT);
        if (n >= 0) {
            accept_message(in, ear, data, (size_t)n);
        } else if (errno == EAGAIN) {
            return 0;
        } else if (errno != EINTR) {
            refuse(in, ear->topic, REFUSAL_SOCKET, 0);
            return -EBADF;
        }
    }
}

static void *listen_for_ever(void *arg)
{
    struct inlet *in = arg;
    struct pollfd fds[MAX_TOPICS + 1] = {{.fd = in->wake_fd, .events = POLLIN}};
    size_t n_ears = 0;
    for (;;) {
        int n = poll(fds, n_ears + 1, -1);
        if (n < 0 && errno != EINTR)
            abort(); /* only a bug gets here: a bad pointer or count */
        if (n <= 0)
            continue;
        for (size_t i = 0; i < n_ears; i++)
            if (fds[1 + i].revents && listen_once(in, &in->ears[i]) != 0)
                fds[1 + i].fd = -1; /* poll skips it */
        if (!fds[0].revents)
            continue;
        uint64_t count;
        ssize_t got = read(in->wake_fd, &count, sizeof count);
        (void)got;
        pthread_mutex_lock(&in->lock);
        bool stop = in->stop;
        for (; n_ears < in->n_ears; n_ears++)
            fds[1 + n_ears] =
                (struct pollfd){.fd = in->ears[n_ears].fd, .events = POLLIN};
        pthread_mutex_unlock(&in->lock);
        if (stop)
            return NULL;
    }
}

static void wake(const struct inlet *in)
{
    uint64_t one = 1;
    ssize_t n = write(in->wake_fd, &one, sizeof one);
    (void)n; /* it fails only when the counter is full, and then it is readable */
}

/* Signals are for the node's own threads. */
static int start_thread(struct inlet *in)
{
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int err = -pthread_create(&in->thread, NULL, listen_for_ever, in);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return err;
}

int inlet_create(struct inlet **out, const char *run_dir, struct mailbox *mailbox)
{
    struct inlet *in = calloc(1, sizeof *in);
    if (!in)
        return -ENOMEM;
    in->mailbox = mailbox;
    in->run_dir = strdup(run_dir);
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

static int set_options(struct ear *ear)
{
    const int max = RECEIVE_MAX_BYTES, buffer = RECEIVE_BUFFER_BYTES;
    const int first = RECONNECT_MS, last = RECONNECT_MAX_MS;
    size_t fd_size = sizeof ear->fd;
    int s = ear->socket;
    if (nn_setsockopt(s, NN_SOL_SOCKET, NN_RCVMAXSIZE, &max, sizeof max) < 0 ||
        nn_setsockopt(s, NN_SOL_SOCKET, NN_RCVBUF, &buffer, sizeof buffer) < 0 ||
        nn_setsockopt(s, NN_SOL_SOCKET, NN_RECONNECT_IVL, &first, sizeof first) < 0 ||
        nn_setsockopt(s, NN_SOL_SOCKET, NN_RECONNECT_IVL_MAX, &last, sizeof last) < 0 ||
        nn_setsockopt(s, NN_SUB, NN_SUB_SUBSCRIBE, "", 0) < 0 ||
        nn_getsockopt(s, NN_SOL_SOCKET, NN_RCVFD, &ear->fd, &fd_size) < 0)
        return -errno;
    return 0;
}

/* Subscribes to everything on the endpoints, which carry this topic only: whatever else
 * comes out of them is refused and counted, not filtered away in silence. */
static int open_ear(struct inlet *in, struct ear *ear)
{
    char url[ENDPOINT_URL_SIZE];
    const char *node;
    ear->socket = nn_socket(AF_SP, NN_SUB);
    if (ear->socket < 0)
        return -errno;
    int err = set_options(ear);
    for (size_t i = 0; !err && (node = topic_publisher(ear->topic, i)); i++) {
        err = i < MAX_PUBLISHERS
                  ? endpoint_url(url, in->run_dir, node, ear->topic->name, NULL)
                  : -E2BIG;
        if (!err && nn_connect(ear->socket, url) < 0)
            err = -errno;
    }
    if (!err)
        err = mailbox_add(in->mailbox, ear->topic, &ear->slot);
    if (err)
        nn_close(ear->socket);
    return err;
}

int inlet_subscribe(struct inlet *in, const struct topic *t)
{
    pthread_mutex_lock(&in->lock);
    int err = in->n_ears < MAX_TOPICS ? 0 : -E2BIG;
    bool known = false;
    for (size_t i = 0; i < in->n_ears; i++)
        known |= in->ears[i].topic == t;
    if (!known && !err) {
        struct ear *ear = &in->ears[in->n_ears];
        *ear = (struct ear){.topic = t};
        err = open_ear(in, ear);
        in->n_ears += !err;
    }
    pthread_mutex_unlock(&in->lock);
    wake(in);
    return known ? 0 : err;
}

size_t inlet_counts(struct inlet *in, struct bus_count *out, size_t max)
{
    pthread_mutex_lock(&in->lock);
    size_t n = in->n_ears;
    for (size_t i = 0; i < n && i < max; i++) {
        const struct ear *ear = &in->ears[i];
        out[i] = (struct bus_count){.topic = ear->topic,
                                    .messages = ear->messages,
                                    .bytes = ear->bytes,
                                    .gaps = ear->gaps};
        mailbox_count(in->mailbox, ear->slot, &out[i].dropped, &out[i].queued);
    }
    pthread_mutex_unlock(&in->lock);
    return n;
}

uint64_t inlet_refused(struct inlet *in)
{
    pthread_mutex_lock(&in->lock);
    uint64_t refused = in->refused;
    pthread_mutex_unlock(&in->lock);
    return refused;
}

void inlet_on_refusal(struct inlet *in, void (*call)(void *ctx, const char *text),
                      void *ctx)
{
    pthread_mutex_lock(&in->lock);
    in->on_refusal = call;
    in->on_refusal_ctx = ctx;
    pthread_mutex_unlock(&in->lock);
}

void inlet_destroy(struct inlet *in)
{
    if (!in)
        return;
    pthread_mutex_lock(&in->lock);
    in->stop = true;
    pthread_mutex_unlock(&in->lock);
    wake(in);
    pthread_join(in->thread, NULL);
    for (size_t i = 0; i < in->n_ears; i++)
        while (nn_close(in->ears[i].socket) < 0 && errno == EINTR)
            ;
    pthread_mutex_destroy(&in->lock);
    close(in->wake_fd);
    free(in->run_dir);
    free(in);
}
