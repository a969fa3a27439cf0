/* SPDX-License-Identifier: MIT */
#include "msgs/authenticator.h"

#include <arpa/inet.h>
#include <errno.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <time.h>
#include <zmq.h>

#include "dsp/error.h"
#include "msgs/monotonic.h"

#define DOMAIN       "anlos"
#define ZAP_ENDPOINT "inproc://zeromq.zap.01"
#define MAX_GUARDED  64 /* sockets; each is replaced when the peers change */
#define MIN_CALLERS  32 /* room for connections that have not ended; then it grows */
#define MAX_DECIDED  32
#define KEY_BYTES    32

enum kind { KIND_REFUSED, KIND_SENT_AWAY, KIND_FILE, KIND_BOUND, N_KINDS };

/* A connection that was accepted and has not ended. */
struct caller {
    int fd; /* -1: none */
    bool proven;
    char address[INET_ADDRSTRLEN];
};

/* Addresses, of which ZAP has decided and the sockets not yet; the newest ones. */
struct decisions {
    size_t next;
    char list[MAX_DECIDED][INET_ADDRSTRLEN];
};

struct guarded {
    void *monitor;
    const char *topic;
    struct caller *callers; /* [n_callers]: as many as there were files open at once */
    size_t n_callers;
    char failed[80]; /* why the connection that ends next has failed; empty: it has not */
};

struct authenticator {
    void *context;
    pthread_t thread;
    atomic_bool ends; /* the thread is to */
    void *control;    /* to the thread, under control_lock */
    pthread_mutex_t control_lock;
    void *control_end, *zap;
    size_t n_guarded;
    struct guarded *guarded;            /* [MAX_GUARDED], of the thread */
    struct decisions permitted, denied; /* of the thread */
    struct stat file;                   /* peers, as it was read last; of the thread */
    atomic_uint generation;
    _Atomic uint64_t refused;
    pthread_mutex_t lock; /* what follows */
    struct keys keys;
    void (*call)(void *ctx, const char *text);
    void *ctx;
    int64_t due_ms[N_KINDS];  /* when the next line may be written */
    unsigned unsaid[N_KINDS]; /* events since the last one */
};

struct request { /* to the thread */
    const char *topic;
    void *
        monitor; /* to be watched from now on; NULL: the socket was bound again, or not */
    int err;
};

__attribute__((format(printf, 3, 4))) static void
report(struct authenticator *a, enum kind kind, const char *format, ...)
{
    char text[600];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    int64_t now_ms = monotonic_ms();
    pthread_mutex_lock(&a->lock);
    void (*call)(void *, const char *) = now_ms < a->due_ms[kind] ? NULL : a->call;
    void *ctx = a->ctx;
    unsigned unsaid = a->unsaid[kind];
    a->unsaid[kind] = call ? 0 : unsaid + 1;
    if (call && kind != KIND_BOUND)
        a->due_ms[kind] = now_ms + AUTHENTICATOR_PAUSE_MS;
    pthread_mutex_unlock(&a->lock);
    if (!call)
        return;
    if (unsaid)
        text_add(text, sizeof text, " ", "(and %u times before)", unsaid);
    call(ctx, text); /* without the lock: it may ask for the counts */
}

static void decide(struct decisions *d, const char *address)
{
    snprintf(d->list[d->next], sizeof d->list[0], "%.15s", address);
    d->next = (d->next + 1) % MAX_DECIDED;
}

/* true: it was so decided, which is used up now. */
static bool take_decision(struct decisions *d, const char *address)
{
    for (size_t i = 0; i < MAX_DECIDED; i++)
        if (*address && !strcmp(d->list[i], address)) {
            d->list[i][0] = 0;
            return true;
        }
    return false;
}

/* ---- ZAP: is the key of who comes one of the peers'? */

#define N_FRAMES 7
enum {
    FRAME_VERSION,
    FRAME_ID,
    FRAME_DOMAIN,
    FRAME_ADDRESS,
    FRAME_IDENTITY,
    FRAME_MECHANISM,
    FRAME_KEY
};

/* A request of frames; what is longer or more is cut off.  How many there were. */
static size_t read_request(void *zap, char frames[N_FRAMES][64], size_t sizes[N_FRAMES])
{
    size_t n = 0;
    int more = 1;
    for (size_t option = sizeof more; more; n++) {
        char rest[64], *frame = n < N_FRAMES ? frames[n] : rest;
        int size = zmq_recv(zap, frame, sizeof rest - 1, ZMQ_DONTWAIT);
        if (size < 0)
            return 0;
        size = size < (int)sizeof rest ? size : (int)sizeof rest - 1;
        frame[size] = 0;
        if (n < N_FRAMES)
            sizes[n] = (size_t)size;
        if (zmq_getsockopt(zap, ZMQ_RCVMORE, &more, &option))
            return 0;
    }
    return n;
}

static void answer(void *zap, const char *id, size_t id_size, const char *host)
{
    const char *status = host ? "200" : "400", *user = host ? host : "";
    zmq_send(zap, "1.0", 3, ZMQ_SNDMORE);
    zmq_send(zap, id, id_size, ZMQ_SNDMORE);
    zmq_send(zap, status, 3, ZMQ_SNDMORE);
    zmq_send(zap, host ? "OK" : "not permitted", host ? 2 : 13, ZMQ_SNDMORE);
    zmq_send(zap, user, strlen(user), ZMQ_SNDMORE);
    zmq_send(zap, "", 0, 0);
}

static void judge(struct authenticator *a)
{
    char frames[N_FRAMES][64], key[KEYS_TEXT_SIZE] = "", host[HOSTS_NAME_SIZE] = "";
    size_t sizes[N_FRAMES] = {0};
    size_t n = read_request(a->zap, frames, sizes);
    if (!n)
        return;
    bool whole = n == N_FRAMES && !strcmp(frames[FRAME_MECHANISM], "CURVE") &&
                 !strcmp(frames[FRAME_DOMAIN], DOMAIN) && sizes[FRAME_KEY] == KEY_BYTES;
    if (whole)
        zmq_z85_encode(key, (const uint8_t *)frames[FRAME_KEY], KEY_BYTES);
    pthread_mutex_lock(&a->lock);
    const struct peer *p = whole ? peers_find_key(&a->keys.peers, key) : NULL;
    if (p)
        memcpy(host, p->host, sizeof host);
    pthread_mutex_unlock(&a->lock);
    answer(a->zap, frames[FRAME_ID], sizes[FRAME_ID], p ? host : NULL);
    decide(p ? &a->permitted : &a->denied, frames[FRAME_ADDRESS]);
    if (p)
        return;
    a->refused++;
    report(a, KIND_REFUSED,
           "a connection from %s was refused: its key %s is not in %s/peers; such are "
           "counted",
           frames[FRAME_ADDRESS], key, a->keys.folder);
}

/* ---- the sockets: who comes without such a key, and never gets so far */

static void forget_guarded(struct guarded *g)
{
    if (g->monitor)
        zmq_close(g->monitor);
    free(g->callers);
    *g = (struct guarded){0};
}

static struct caller *find_caller(struct guarded *g, int fd)
{
    for (size_t i = 0; i < g->n_callers; i++)
        if (g->callers[i].fd == fd)
            return &g->callers[i];
    return NULL;
}

/* A place that is free.  NULL: there is no memory for another. */
static struct caller *add_caller(struct guarded *g)
{
    size_t room = g->n_callers ? 2 * g->n_callers : MIN_CALLERS;
    struct caller *free_one = find_caller(g, -1);
    if (free_one)
        return free_one;
    struct caller *grown = realloc(g->callers, room * sizeof *grown);
    if (!grown)
        return NULL;
    for (size_t i = g->n_callers; i < room; i++)
        grown[i] = (struct caller){.fd = -1};
    free_one = &grown[g->n_callers];
    g->callers = grown;
    g->n_callers = room;
    return free_one;
}

static void remember_caller(struct guarded *g, int fd)
{
    struct sockaddr_in at;
    socklen_t size = sizeof at;
    struct caller *c = find_caller(g, fd);
    if (!c && !(c = add_caller(g)))
        return;
    *c = (struct caller){.fd = fd};
    if (getpeername(fd, (struct sockaddr *)&at, &size) || at.sin_family != AF_INET ||
        !inet_ntop(AF_INET, &at.sin_addr, c->address, sizeof c->address))
        c->address[0] = 0; /* it is gone already */
}

/* The event does not tell of which connection it is, but ZAP has let in its address. */
static void prove_caller(struct authenticator *a, struct guarded *g)
{
    struct caller *unknown = NULL;
    for (size_t i = 0; i < g->n_callers; i++) {
        struct caller *c = &g->callers[i];
        if (c->fd < 0 || c->proven)
            continue;
        if (take_decision(&a->permitted, c->address)) {
            c->proven = true;
            return;
        }
        if (!c->address[0])
            unknown = c;
    }
    if (unknown)
        unknown->proven = true;
}

/* Of two that came from one address it was the other one. */
static void hand_proof_on(struct guarded *g, struct caller *failed)
{
    failed->proven = false;
    for (size_t i = 0; i < g->n_callers; i++) {
        struct caller *c = &g->callers[i];
        if (c != failed && c->fd >= 0 && !c->proven &&
            !strcmp(c->address, failed->address)) {
            c->proven = true;
            return;
        }
    }
}

static void end_caller(struct authenticator *a, struct guarded *g, int fd)
{
    struct caller *c = find_caller(g, fd);
    if (c && c->proven && g->failed[0])
        hand_proof_on(g, c);
    bool refused = c && !c->proven && !take_decision(&a->denied, c->address);
    const char *why = g->failed[0] ? g->failed
                                   : "it does not speak as a host of anlos does";
    if (refused) {
        a->refused++;
        report(a, KIND_REFUSED,
               "a connection from %s to topic %s was refused: %s; such are counted",
               c->address[0] ? c->address : "an address that was gone at once", g->topic,
               why);
    }
    g->failed[0] = 0;
    if (c)
        c->fd = -1;
}

static const char *explain(uint16_t event, uint32_t value)
{
    if (event == ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL)
        return "it ended without having shown a key";
    if (value == ZMQ_PROTOCOL_ERROR_ZMTP_MECHANISM_MISMATCH)
        return "it has no keys";
    if (value == ZMQ_PROTOCOL_ERROR_ZMTP_CRYPTOGRAPHIC ||
        value == ZMQ_PROTOCOL_ERROR_ZMTP_KEY_EXCHANGE)
        return "it has another key for this host than this host has";
    return "it does not speak as a host of anlos does";
}

/* An event is two frames, u16 which and u32 value; and an endpoint.  In the order in
 * which things happen: accepted, succeeded or failed, disconnected.  What ZAP has denied
 * is counted there. */
static bool read_event(struct authenticator *a, struct guarded *g)
{
    uint8_t what[8];
    char endpoint[80];
    uint16_t event;
    uint32_t value;
    int n = zmq_recv(g->monitor, what, sizeof what, ZMQ_DONTWAIT);
    if (n < 6)
        return n < 0 && errno == EAGAIN ? false : n >= 0;
    memcpy(&event, what, sizeof event);
    memcpy(&value, what + sizeof event, sizeof value);
    zmq_recv(g->monitor, endpoint, sizeof endpoint, ZMQ_DONTWAIT);
    if (event == ZMQ_EVENT_ACCEPTED)
        remember_caller(g, (int)value);
    else if (event == ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL ||
             event == ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL)
        snprintf(g->failed, sizeof g->failed, "%s", explain(event, value));
    else if (event == ZMQ_EVENT_HANDSHAKE_SUCCEEDED)
        prove_caller(a, g);
    else if (event == ZMQ_EVENT_DISCONNECTED)
        end_caller(a, g, (int)value);
    else if (event == ZMQ_EVENT_MONITOR_STOPPED) {
        forget_guarded(g);
        return false;
    }
    return true;
}

/* ---- the file */

static bool is_same_file(const struct stat *a, const struct stat *b)
{
    return a->st_ino == b->st_ino && a->st_size == b->st_size &&
           a->st_mode == b->st_mode && a->st_uid == b->st_uid &&
           a->st_ctim.tv_sec == b->st_ctim.tv_sec &&
           a->st_ctim.tv_nsec == b->st_ctim.tv_nsec;
}

static size_t count_missing(const struct peers *of, const struct peers *in)
{
    size_t n = 0;
    for (size_t i = 0; i < of->n; i++) {
        const struct peer *p = peers_find(in, of->list[i].host);
        n += !p || strcmp(p->key, of->list[i].key) != 0;
    }
    return n;
}

/* What cannot be read changes nothing: a slip of the pen must not end a drive. */
static void look_at_file(struct authenticator *a)
{
    char path[HOSTS_KEYS_SIZE + 8];
    struct stat now = {0};
    struct error why = {""};
    struct peers peers;
    snprintf(path, sizeof path, "%s/peers", a->keys.folder);
    bool there = !stat(path, &now);
    if (is_same_file(&now, &a->file))
        return;
    a->file = now;
    if (keys_read_peers(&peers, a->keys.folder, &why)) {
        report(a, KIND_FILE, "%.450s; who was permitted %s still is", why.text,
               there ? "before" : "while it was there");
        return;
    }
    pthread_mutex_lock(&a->lock);
    size_t gone = count_missing(&a->keys.peers, &peers);
    size_t come = count_missing(&peers, &a->keys.peers);
    a->keys.peers = peers;
    pthread_mutex_unlock(&a->lock);
    if (!gone && !come)
        return;
    a->generation++;
    report(a, KIND_FILE,
           "%s has changed: %zu keys are permitted now, %zu of them new, %zu no longer; "
           "hosts are connected anew",
           path, peers.n, come, gone);
}

/* ---- the thread */

static void watch(struct authenticator *a, const struct request *r)
{
    size_t i = 0;
    while (i < a->n_guarded && a->guarded[i].monitor)
        i++;
    if (i == MAX_GUARDED) {
        zmq_close(r->monitor);
        return;
    }
    a->n_guarded += i == a->n_guarded;
    a->guarded[i] = (struct guarded){.monitor = r->monitor, .topic = r->topic};
}

static void report_bound(struct authenticator *a, const struct request *r)
{
    if (r->err)
        report(a, KIND_BOUND,
               "topic %s: after the keys have changed its port cannot be bound: %s; "
               "other hosts do not hear it until that works",
               r->topic,
               r->err == -EADDRINUSE ? "another program has it" : zmq_strerror(-r->err));
    else
        report(a, KIND_BOUND,
               "topic %s: its port is bound again; other hosts may hear it", r->topic);
}

/* false: the end. */
static bool heed_control(struct authenticator *a)
{
    struct request r;
    int n;
    while ((n = zmq_recv(a->control_end, &r, sizeof r, ZMQ_DONTWAIT)) == sizeof r)
        if (r.monitor)
            watch(a, &r);
        else
            report_bound(a, &r);
    return n < 0;
}

static void *serve(void *arg)
{
    struct authenticator *a = arg;
    int64_t due_ms = 0;
    while (!a->ends) {
        zmq_pollitem_t items[2 + MAX_GUARDED] = {
            {.socket = a->control_end, .events = ZMQ_POLLIN},
            {.socket = a->zap, .events = ZMQ_POLLIN}};
        size_t at[MAX_GUARDED], n = 0;
        for (size_t i = 0; i < a->n_guarded; i++)
            if (a->guarded[i].monitor) {
                items[2 + n] = (zmq_pollitem_t){.socket = a->guarded[i].monitor,
                                                .events = ZMQ_POLLIN};
                at[n++] = i;
            }
        int64_t left_ms = due_ms - monotonic_ms();
        if (left_ms <= 0) {
            look_at_file(a);
            left_ms = AUTHENTICATOR_PERIOD_MS;
            due_ms = monotonic_ms() + left_ms;
        }
        if (zmq_poll(items, (int)(2 + n), left_ms) < 0 && errno != EINTR)
            return NULL; /* the context has ended */
        if (items[1].revents)
            judge(a);
        for (size_t i = 0; i < n; i++)
            while (items[2 + i].revents && read_event(a, &a->guarded[at[i]]))
                ;
        if (items[0].revents && !heed_control(a))
            return NULL;
    }
    heed_control(a); /* monitors that are on their way are closed with the others */
    return NULL;
}

static int open_pair(void **out, void *context, const char *endpoint, bool binds)
{
    const int none = 0;
    *out = zmq_socket(context, ZMQ_PAIR);
    return !*out || zmq_setsockopt(*out, ZMQ_LINGER, &none, sizeof none) ||
                   (binds ? zmq_bind(*out, endpoint) : zmq_connect(*out, endpoint))
               ? -errno
               : 0;
}

static int open_sockets(struct authenticator *a, void *context)
{
    const int none = 0;
    int err = open_pair(&a->control_end, context, "inproc://authenticator", true);
    if (!err)
        err = open_pair(&a->control, context, "inproc://authenticator", false);
    if (!err && (!(a->zap = zmq_socket(context, ZMQ_REP)) ||
                 zmq_setsockopt(a->zap, ZMQ_LINGER, &none, sizeof none) ||
                 zmq_bind(a->zap, ZAP_ENDPOINT)))
        err = -errno;
    return err;
}

/* Signals are for the node's own threads. */
static int start_thread(struct authenticator *a)
{
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int err = -pthread_create(&a->thread, NULL, serve, a);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return err;
}

static void release(struct authenticator *a)
{
    for (size_t i = 0; i < a->n_guarded; i++)
        forget_guarded(&a->guarded[i]);
    if (a->control)
        zmq_close(a->control);
    if (a->control_end)
        zmq_close(a->control_end);
    if (a->zap)
        zmq_close(a->zap);
    pthread_mutex_destroy(&a->control_lock);
    pthread_mutex_destroy(&a->lock);
    keys_forget(&a->keys);
    free(a->guarded);
    free(a);
}

int authenticator_create(struct authenticator **out, void *context,
                         const struct keys *keys)
{
    struct authenticator *a = calloc(1, sizeof *a);
    if (!a)
        return -ENOMEM;
    a->context = context;
    a->keys = *keys;
    a->guarded = calloc(MAX_GUARDED, sizeof *a->guarded);
    pthread_mutex_init(&a->control_lock, NULL); /* with these attributes it cannot fail */
    pthread_mutex_init(&a->lock, NULL);
    int err = a->guarded ? open_sockets(a, context) : -ENOMEM;
    if (!err)
        err = start_thread(a);
    if (err)
        release(a);
    else
        *out = a;
    return err;
}

/* ---- for the other threads */

int authenticator_guard(struct authenticator *a, void *socket, const char *topic)
{
    static atomic_uint number;
    const int yes = 1;
    char endpoint[40];
    struct request r = {.topic = topic};
    if (zmq_setsockopt(socket, ZMQ_CURVE_SERVER, &yes, sizeof yes) ||
        zmq_setsockopt(socket, ZMQ_CURVE_SECRETKEY, a->keys.secret, KEYS_TEXT_SIZE) ||
        zmq_setsockopt(socket, ZMQ_ZAP_DOMAIN, DOMAIN, strlen(DOMAIN)))
        return -errno;
    snprintf(endpoint, sizeof endpoint, "inproc://guarded-%u", number++);
    if (zmq_socket_monitor(socket, endpoint,
                           ZMQ_EVENT_ACCEPTED | ZMQ_EVENT_DISCONNECTED |
                               ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL |
                               ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL |
                               ZMQ_EVENT_HANDSHAKE_SUCCEEDED | ZMQ_EVENT_MONITOR_STOPPED))
        return -errno;
    pthread_mutex_lock(&a->control_lock);
    int err = open_pair(&r.monitor, a->context, endpoint, false);
    if (!err && zmq_send(a->control, &r, sizeof r, ZMQ_DONTWAIT) < 0)
        err = -errno;
    pthread_mutex_unlock(&a->control_lock);
    if (err && r.monitor)
        zmq_close(r.monitor);
    return err;
}

int authenticator_address(struct authenticator *a, void *socket, const char *host)
{
    char key[KEYS_TEXT_SIZE] = "";
    pthread_mutex_lock(&a->lock);
    const struct peer *p = peers_find(&a->keys.peers, host);
    if (p)
        memcpy(key, p->key, sizeof key);
    pthread_mutex_unlock(&a->lock);
    if (!p)
        return -EACCES;
    return zmq_setsockopt(socket, ZMQ_CURVE_SERVERKEY, key, KEYS_TEXT_SIZE) ||
                   zmq_setsockopt(socket, ZMQ_CURVE_PUBLICKEY, a->keys.public,
                                  KEYS_TEXT_SIZE) ||
                   zmq_setsockopt(socket, ZMQ_CURVE_SECRETKEY, a->keys.secret,
                                  KEYS_TEXT_SIZE)
               ? -errno
               : 0;
}

unsigned authenticator_generation(const struct authenticator *a)
{
    return a->generation;
}

void authenticator_bound_again(struct authenticator *a, const char *topic, int err)
{
    const struct request r = {.topic = topic, .err = err};
    pthread_mutex_lock(&a->control_lock);
    zmq_send(a->control, &r, sizeof r, ZMQ_DONTWAIT);
    pthread_mutex_unlock(&a->control_lock);
}

void authenticator_sent_away(struct authenticator *a, const char *host, bool denied)
{
    if (denied)
        report(a, KIND_SENT_AWAY,
               "host %s does not let this one in: its file peers needs the line that "
               "'anlos keys show --out %s' prints",
               host, a->keys.folder);
    else
        report(a, KIND_SENT_AWAY,
               "host %s is not who it should be, or has no keys: its line in %s/peers "
               "is not what 'anlos keys show' prints there, or somebody else has its "
               "address",
               host, a->keys.folder);
}

uint64_t authenticator_refused(const struct authenticator *a)
{
    return a->refused;
}

void authenticator_on_event(struct authenticator *a,
                            void (*call)(void *ctx, const char *text), void *ctx)
{
    pthread_mutex_lock(&a->lock);
    a->call = call;
    a->ctx = ctx;
    pthread_mutex_unlock(&a->lock);
}

void authenticator_destroy(struct authenticator *a)
{
    if (!a)
        return;
    a->ends = true;
    pthread_mutex_lock(&a->control_lock);
    zmq_send(a->control, "", 0, 0); /* sooner than with its next look at the file */
    pthread_mutex_unlock(&a->control_lock);
    pthread_join(a->thread, NULL);
    release(a);
}
