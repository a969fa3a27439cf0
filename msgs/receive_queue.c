/* SPDX-License-Identifier: MIT */
#include "msgs/receive_queue.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "dsp/list.h"
#include "msgs/monotonic.h"

#define REPLAYED_BYTES ((size_t)64 << 20)

/* A state that is replaced takes the turn of the new one: a survey not before the pings
 * of the one before.  But behind so many messages only, or who cannot keep up with
 * another topic never hears a state that is told often. */
#define MOST_PUT_BACK 256

struct letter {
    struct bus_message message;
    uint64_t arrival; /* whose turn it is, the least first */
    uint64_t since;   /* arrival of the first state that none has read since */
};

struct queue {
    enum topic_policy policy;
    size_t limit;          /* the topic's depth */
    size_t depth, head, n; /* of the ring, which may have grown */
    uint64_t dropped;
    struct letter *ring; /* [depth] */
};

struct receive_queue {
    pthread_mutex_t lock;
    int fd; /* eventfd: not 0 while a message waits or `interrupted` is set */
    atomic_bool interrupted;
    size_t waiting; /* over all queues */
    size_t waiting_bytes;
    size_t keep_bytes; /* 0: queues as their topics say */
    uint64_t arrivals;
    size_t n_queues, room;
    struct queue *queues; /* [n_queues] */
};

_Static_assert(ATOMIC_BOOL_LOCK_FREE == 2, "mailbox_interrupt runs in signal handlers");

int receive_queue_create(struct receive_queue **out)
{
    struct receive_queue *m = calloc(1, sizeof *m);
    if (!m)
        return -ENOMEM;
    m->fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    int err = m->fd < 0 ? -errno : -pthread_mutex_init(&m->lock, NULL);
    if (err) {
        if (m->fd >= 0)
            close(m->fd);
        free(m);
        return err;
    }
    *out = m;
    return 0;
}

int receive_queue_add(struct receive_queue *m, const struct topic *t, size_t *slot)
{
    struct queue q = {.policy = t->policy, .limit = t->depth, .depth = t->depth};
    q.ring = calloc(t->depth, sizeof *q.ring);
    if (!q.ring)
        return -ENOMEM;
    pthread_mutex_lock(&m->lock);
    int err = list_grow(&m->queues, m->n_queues, &m->room, sizeof *m->queues);
    if (!err) {
        *slot = m->n_queues++;
        m->queues[*slot] = q;
    }
    pthread_mutex_unlock(&m->lock);
    if (err)
        free(q.ring);
    return err;
}

void receive_queue_keep_all(struct receive_queue *m, size_t bytes)
{
    pthread_mutex_lock(&m->lock);
    m->keep_bytes = bytes;
    pthread_mutex_unlock(&m->lock);
}

static void signal_fd(int fd)
{
    int saved = errno; /* also in signal handlers */
    uint64_t one = 1;
    ssize_t n = write(fd, &one, sizeof one);
    (void)n; /* it fails only when the counter is full, and then it is readable */
    errno = saved;
}

/* An interrupt that comes between the read and the test is seen by the test, because it
 * sets the flag first. */
static void clear_fd(struct receive_queue *m)
{
    uint64_t count;
    ssize_t n = read(m->fd, &count, sizeof count);
    (void)n; /* nothing to read: as wanted */
    if (atomic_load(&m->interrupted))
        signal_fd(m->fd);
}

static struct letter pop(struct receive_queue *m, struct queue *q)
{
    struct letter first = q->ring[q->head];
    q->head = (q->head + 1) % q->depth;
    q->n--;
    m->waiting_bytes -= first.message.envelope.payload_size;
    if (--m->waiting == 0)
        clear_fd(m);
    return first;
}

static struct letter *push(struct receive_queue *m, struct queue *q,
                           const struct bus_message *message)
{
    struct letter *l = &q->ring[(q->head + q->n++) % q->depth];
    l->message = *message;
    l->arrival = l->since = m->arrivals++;
    m->waiting_bytes += message->envelope.payload_size;
    m->waiting++;
    return l;
}

static void put_back(struct letter *l, const struct letter *replaced)
{
    l->since = replaced->since;
    if (l->arrival - l->since > MOST_PUT_BACK)
        l->arrival = replaced->arrival;
}

/* false: no memory. */
static bool grow(struct queue *q)
{
    struct letter *ring = calloc(2 * q->depth, sizeof *ring);
    if (!ring)
        return false;
    for (size_t i = 0; i < q->n; i++)
        ring[i] = q->ring[(q->head + i) % q->depth];
    free(q->ring);
    q->ring = ring;
    q->head = 0;
    q->depth *= 2;
    return true;
}

static bool has_room(const struct receive_queue *m, struct queue *q, size_t most_bytes,
                     size_t bytes)
{
    if (m->waiting &&
        (m->waiting_bytes >= most_bytes || bytes > most_bytes - m->waiting_bytes))
        return false;
    return q->n < q->depth || grow(q);
}

/* A replay is to give the same each time, however fast. */
static bool keeps_replayed(const struct receive_queue *m, struct queue *q,
                           const struct envelope *e)
{
    return e->replayed && has_room(m, q, REPLAYED_BYTES, e->payload_size);
}

void receive_queue_put(struct receive_queue *m, size_t slot,
                       const struct bus_message *message)
{
    struct letter lost = {.arrival = 0};
    bool replaces = false;
    pthread_mutex_lock(&m->lock);
    struct queue *q = &m->queues[slot];
    /* What waits for a recorder is without a hole: it is the new one that goes. */
    bool fits = !m->keep_bytes ||
                has_room(m, q, m->keep_bytes, message->envelope.payload_size);
    if (!fits) {
        lost.message = *message;
        q->dropped++;
    } else if (!m->keep_bytes && q->n >= q->limit &&
               !keeps_replayed(m, q, &message->envelope)) {
        lost = pop(m, q);
        replaces = q->policy == TOPIC_LATEST;
        q->dropped += !replaces;
    }
    bool first = fits && !m->waiting;
    struct letter *put = fits ? push(m, q, message) : NULL;
    if (put && replaces)
        put_back(put, &lost);
    pthread_mutex_unlock(&m->lock);
    if (first) /* without the lock, which who wakes up wants */
        signal_fd(m->fd);
    bus_message_free(&lost.message);
}

static struct queue *find_oldest(struct receive_queue *m)
{
    struct queue *oldest = NULL;
    for (size_t i = 0; i < m->n_queues; i++) {
        struct queue *q = &m->queues[i];
        if (q->n &&
            (!oldest || q->ring[q->head].arrival < oldest->ring[oldest->head].arrival))
            oldest = q;
    }
    return oldest;
}

/* Until the descriptor is readable or the time is over; a signal just ends the wait. */
static int wait_until(const struct receive_queue *m, int64_t end_ms, bool for_ever)
{
    struct pollfd p = {.fd = m->fd, .events = POLLIN};
    int64_t left_ms = for_ever ? -1 : end_ms - monotonic_ms();
    if (!for_ever && left_ms < 0)
        left_ms = 0;
    int n = poll(&p, 1, (int)left_ms);
    return n < 0 && errno != EINTR ? -errno : n == 0 ? -ETIMEDOUT : 0;
}

int receive_queue_take(struct receive_queue *m, struct bus_message *out, int timeout_ms)
{
    int64_t end_ms = timeout_ms > 0 ? monotonic_ms() + timeout_ms : 0;
    for (int err = 0;;) {
        if (atomic_load(&m->interrupted))
            return -ESHUTDOWN;
        pthread_mutex_lock(&m->lock);
        struct queue *q = find_oldest(m);
        if (q)
            *out = pop(m, q).message;
        else
            clear_fd(m); /* of a signal for what was taken before it came */
        pthread_mutex_unlock(&m->lock);
        if (q)
            return 0;
        if (err)
            return err;
        err = wait_until(m, end_ms, timeout_ms < 0); /* then looks once more */
    }
}

int receive_queue_fd(const struct receive_queue *m)
{
    return m->fd;
}

void receive_queue_interrupt(struct receive_queue *m)
{
    atomic_store(&m->interrupted, true);
    signal_fd(m->fd);
}

void receive_queue_resume(struct receive_queue *m)
{
    pthread_mutex_lock(&m->lock);
    atomic_store(&m->interrupted, false);
    if (!m->waiting)
        clear_fd(m);
    pthread_mutex_unlock(&m->lock);
}

size_t receive_queue_waiting_bytes(struct receive_queue *m)
{
    pthread_mutex_lock(&m->lock);
    size_t bytes = m->waiting_bytes;
    pthread_mutex_unlock(&m->lock);
    return bytes;
}

void receive_queue_count(struct receive_queue *m, size_t slot, uint64_t *dropped,
                         size_t *queued)
{
    pthread_mutex_lock(&m->lock);
    *dropped = m->queues[slot].dropped;
    *queued = m->queues[slot].n;
    pthread_mutex_unlock(&m->lock);
}

void receive_queue_destroy(struct receive_queue *m)
{
    if (!m)
        return;
    for (size_t i = 0; i < m->n_queues; i++) {
        struct queue *q = &m->queues[i];
        while (q->n) {
            struct bus_message message = pop(m, q).message;
            bus_message_free(&message);
        }
        free(q->ring);
    }
    free(m->queues);
    pthread_mutex_destroy(&m->lock);
    close(m->fd);
    free(m);
}
