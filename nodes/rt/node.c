/* SPDX-License-Identifier: MIT */
#include "nodes/rt/node.h"

#include <errno.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "hal/clock.h"
#include "nodes/rt/arguments.h"
#include "nodes/rt/health.h"
#include "nodes/rt/launchfile_hosts.h"
#include "nodes/rt/log_topic.h"
#include "nodes/rt/process.h"
#include "nodes/rt/replay_order.h"
#include "nodes/rt/rundir.h"
#include "nodes/rt/stop.h"

#define NS_PER_MS 1000000LL

struct node {
    char name[ENVELOPE_NODE_SIZE];
    char run_dir[RUNDIR_SIZE];
    struct log *log;
    struct log_topic log_topic;
    struct launchfile *launch;
    struct clock_replay clock;
    enum bus_world world;
    bool sounded; /* the replay's time is that of a message of sound */
    struct bus *bus;
    struct replay_order *order; /* of a replay; NULL: messages come as they come */
    int64_t epoch_ns;
    struct heartbeat heart;
    ProtobufCMessage *content; /* of the message that node_next gave out last */
    uint64_t errors;           /* that were logged before that */
};

static void log_refusal(void *ctx, const char *text)
{
    node_log(ctx, LOG_LEVEL_WARNING, "%s", text);
}

/* Those who show what there is take both, and follow what came last. */
static enum bus_world world_of(const struct node *n, bool replay)
{
    if (!strcmp(n->name, "view") || !strcmp(n->name, "record"))
        return BUS_ANY;
    return replay || (n->launch && launchfile_has_node(n->launch, "play")) ? BUS_REPLAY
                                                                           : BUS_LIVE;
}

static int open_bus(struct node *n, struct error *why)
{
    struct bus_config cfg = {.node = n->name,
                             .run_dir = n->run_dir,
                             .epoch_ns = n->epoch_ns,
                             .world = n->world};
    sigset_t before;

    stop_block(&before);
    int err = bus_create(&n->bus, &cfg, why);
    stop_unblock(&before);
    if (err)
        return err;
    n->heart.bus = n->bus;
    bus_on_refusal(n->bus, log_refusal, n);
    log_topic_start(&n->log_topic, n->log, n->bus, node_machine_ns(n));
    stop_wakes(n->bus);
    return 0;
}

static void print_help(const char *name, const char *what_it_does)
{
    printf("usage: anlos-%s --launch FILE [options]\n\n%s\n\n"
           "  --launch FILE      the launch file (YAML) with this node's settings\n%s",
           name, what_it_does, arguments_help());
}

static void node_free(struct node *n)
{
    if (!n)
        return;
    stop_wakes(NULL);
    if (n->content)
        protobuf_c_message_free_unpacked(n->content, NULL);
    if (n->bus) {
        log_tell_repeats(n->log);
        log_topic_stop(&n->log_topic, n->log);
    }
    if (n->order)
        replay_order_clear(n->order);
    free(n->order);
    bus_destroy(n->bus);
    launchfile_destroy(n->launch);
    log_destroy(n->log);
    free(n);
}

static int open_all(struct node *n, const struct arguments *args, struct error *why)
{
    struct launchfile_options options = {.out = args->out,
                                         .bag = args->bag,
                                         .rate = args->rate,
                                         .record = args->record,
                                         .snapshot = args->snapshot,
                                         .realtime = args->realtime};
    int err = args->launch ? launchfile_load(&n->launch, args->launch, &options, why) : 0;

    if (!err)
        err = rundir_open(n->run_dir, args->run_dir, why);
    if (!err && n->launch)
        err = launchfile_join_hosts(n->launch, args->host, n->run_dir, why);
    if (!err && n->launch)
        err = priority_take(n->launch, n->name, n->heart.priority, why);
    if (!err && (err = stop_install()))
        error_say(why, err, "signals: %s", strerror(-err));
    n->world = world_of(n, args->replay);
    return err ? err : open_bus(n, why);
}

/* For all whose work play waits for. */
static int follow_progress(struct node *n, struct error *why)
{
    if (n->world != BUS_REPLAY || !strcmp(n->name, "play") ||
        !topic_is_published_by(topic_progress(), n->name))
        return 0;
    n->order = calloc(1, sizeof *n->order);
    if (!n->order)
        return error_say(why, -ENOMEM, "out of memory");
    int err = bus_subscribe(n->bus, topic_progress());
    return err ? error_say(why, err, "progress: %s", strerror(-err)) : 0;
}

static void check_clock(struct node *n)
{
    struct error why = {""};

    if (clock_check_shared(&why))
        node_log(n, LOG_LEVEL_WARNING, "%s", why.text);
}

static int open_log(struct node *n, const char *name, const struct arguments *args)
{
    const struct log_config cfg = {.fd = STDERR_FILENO,
                                   .least = args->log_level,
                                   .format = args->log_format,
                                   .node = name,
                                   .clock = clock_system()};

    return log_create(&n->log, &cfg);
}

static int begin(struct node *n, const char *name, const struct arguments *args,
                 struct error *why)
{
    heap_share();
    snprintf(n->name, sizeof n->name, "%s", name);
    clock_replay_init(&n->clock, clock_system());
    n->epoch_ns = node_now_ns(n);
    n->heart = (struct heartbeat){.node = n->name,
                                  .log = n->log,
                                  .clock = &n->clock,
                                  .epoch_ns = n->epoch_ns,
                                  .state = ANLOS__HEALTH__STATE__STARTING,
                                  .text = "starting"};
    int err = open_all(n, args, why);
    if (!err)
        err = follow_progress(n, why);
    if (!err)
        check_clock(n);
    return err;
}

int node_start(struct node **out, const char *name, const struct arguments *args,
               struct error *why)
{
    struct node *n = calloc(1, sizeof *n);
    int err = n ? open_log(n, name, args) : -ENOMEM;

    if (!err)
        err = begin(n, name, args, why);
    if (err)
        node_free(n);
    else
        *out = n;
    return err == -ENOMEM ? error_say(why, err, "out of memory") : err;
}

int node_create(struct node **out, const char *name, const char *what_it_does, int argc,
                char **argv)
{
    struct arguments args;
    struct error why = {""};
    struct node *n = calloc(1, sizeof *n);
    int err = n ? arguments_parse(&args, argc, argv, &why) : -ENOMEM;
    int log_err = n ? open_log(n, name, &args) : 0;

    *out = NULL;
    if (!err && (args.help || args.version)) {
        if (args.values)
            choice_print(args.values, stdout);
        else if (args.help)
            print_help(name, what_it_does);
        else
            printf("anlos-%s %s\n", name, ANLOS_VERSION);
        node_free(n);
        return EXIT_WORKED;
    }
    err = err ? err : log_err;
    if (!err)
        err = begin(n, name, &args, &why);
    if (err) {
        if (n && n->log)
            node_log(n, LOG_LEVEL_ERROR, "%s", why.text[0] ? why.text : strerror(-err));
        node_free(n);
        return err == -ENOMEM ? EXIT_FAILED : EXIT_BAD_INPUT;
    }
    *out = n;
    return 0;
}

const struct launchfile *node_launch(const struct node *n)
{
    return n->launch;
}

const char *node_run_dir(const struct node *n)
{
    return n->run_dir;
}

int64_t node_epoch_ns(const struct node *n)
{
    return n->epoch_ns;
}

int node_fd(const struct node *n)
{
    return bus_fd(n->bus);
}

size_t node_counts(struct node *n, struct bus_count *out, size_t max)
{
    return bus_counts(n->bus, out, max);
}

const struct clock_source *node_clock(const struct node *n)
{
    return &n->clock.source;
}

int64_t node_now_ns(const struct node *n)
{
    return clock_now_ns(&n->clock.source);
}

int64_t node_machine_ns(const struct node *n)
{
    return clock_now_ns(n->clock.machine);
}

bool node_is_replayed(const struct node *n)
{
    return n->clock.on || n->world == BUS_REPLAY;
}

bool node_follows_replay(const struct node *n)
{
    return n->clock.on;
}

int node_subscribe(struct node *n, const struct topic *t)
{
    int err = bus_subscribe(n->bus, t);

    if (n->order)
        replay_order_expect(n->order, t);
    if (err)
        node_log(n, LOG_LEVEL_ERROR, "cannot subscribe to %s: %s", t->name,
                 strerror(-err));
    return err;
}

/* Messages of sound come down one chain, one after the other; what else comes has an
 * order by chance, and decides about time only while there is nothing better. */
static void follow_time(struct node *n, const struct bus_message *m)
{
    const struct envelope *e = &m->envelope;

    if (m->topic == topic_health() || m->topic == topic_log() ||
        m->topic == topic_clock())
        return;
    if (n->world == BUS_ANY && e->replayed != n->clock.on)
        bus_set_replayed(n->bus, e->replayed);
    if (!e->replayed) {
        clock_replay_end(&n->clock);
        n->sounded = false;
        return;
    }
    if (e->capture_ns || !n->sounded)
        clock_replay_set(&n->clock, e->publish_ns);
    n->sounded |= e->capture_ns != 0;
}

/* Milliseconds to t, rounded up. */
static int64_t ms_until(int64_t now_ns, int64_t t_ns)
{
    return t_ns > now_ns ? (t_ns - now_ns + NS_PER_MS - 1) / NS_PER_MS : 0;
}

static int unpack(struct node *n, struct bus_message *m, struct node_message *out)
{
    n->content = bus_message_unpack(m);
    if (!n->content && errno == ENOMEM) {
        node_log(n, LOG_LEVEL_WARNING, "a message of %s from %s is lost: out of memory",
                 m->topic->name, m->envelope.node);
        n->heart.malformed++;
        return -ENOMEM;
    }
    if (!n->content) {
        if (!n->heart.malformed++)
            node_log(n, LOG_LEVEL_WARNING,
                     "%s from %s is not a message of its schema; it is ignored",
                     m->topic->name, m->envelope.node);
        return -EPROTO;
    }
    follow_time(n, m);
    latencies_add(&n->heart.latencies, m->topic, false, node_now_ns(n),
                  m->envelope.capture_ns);
    *out = (struct node_message){.topic = m->topic,
                                 .content = n->content,
                                 .capture_ns = m->envelope.capture_ns,
                                 .publish_ns = m->envelope.publish_ns,
                                 .epoch_ns = m->envelope.epoch_ns,
                                 .sequence = m->envelope.sequence};
    memcpy(out->from, m->envelope.node, sizeof out->from);
    return 0;
}

static void add_sent(const struct bus_count *c, Anlos__Sent *sent, Anlos__Progress *p,
                     const char *node)
{
    if (!c->published) {
        p->lost += c->gaps + c->dropped;
        return;
    }
    anlos__sent__init(sent);
    sent->node = (char *)node;
    sent->topic = (char *)c->topic->name;
    sent->next = c->messages;
    p->sent[p->n_sent++] = sent;
}

/* What was taken is used, and what came of it is out. */
static void tell_progress(struct node *n)
{
    struct bus_count counts[HEALTH_MAX_TOPICS];
    Anlos__Sent sent[HEALTH_MAX_TOPICS], *list[HEALTH_MAX_TOPICS];
    Anlos__Progress p = ANLOS__PROGRESS__INIT;

    if (!replay_order_done(n->order, &p.time_ns))
        return;
    size_t n_counts = bus_counts(n->bus, counts, HEALTH_MAX_TOPICS);
    p.round = n->order->round;
    p.sent = list;
    for (size_t i = 0; i < n_counts && i < HEALTH_MAX_TOPICS; i++)
        if (replay_order_has(counts[i].topic))
            add_sent(&counts[i], &sent[i], &p, n->name);
    bus_publish_message(n->bus, topic_progress(), 0, node_now_ns(n), &p.base);
}

/* true: it waits for its turn, or was for the order itself. */
static bool put_in_order(struct node *n, struct bus_message *m)
{
    if (m->topic == topic_progress()) {
        Anlos__Progress *p = (Anlos__Progress *)bus_message_unpack(m);
        if (p)
            replay_order_progress(n->order, n->name, m->envelope.node,
                                  m->envelope.epoch_ns, p);
        else
            n->heart.malformed++;
        if (p)
            anlos__progress__free_unpacked(p, NULL);
        bus_message_free(m);
        return true;
    }
    return replay_order_has(m->topic) && !replay_order_put(n->order, m);
}

static int receive(struct node *n, struct bus_message *m, int64_t wait_ms)
{
    int64_t now = node_machine_ns(n), end = now + wait_ms * NS_PER_MS;

    if (!n->order)
        return bus_receive(n->bus, m, (int)wait_ms);
    for (;;) {
        if (replay_order_take(n->order, m))
            return 0;
        tell_progress(n);
        int err = bus_receive(n->bus, m, (int)ms_until(now, end));
        if (err || !put_in_order(n, m))
            return err;
        if (stop_requested())
            return -ESHUTDOWN;
        now = node_machine_ns(n);
        heartbeat_turn(&n->heart); /* however much comes that has to wait */
        heartbeat_tick(&n->heart, now);
    }
}

int node_next(struct node *n, struct node_message *out, int timeout_ms)
{
    int64_t now = node_machine_ns(n);
    int64_t end = now + timeout_ms * NS_PER_MS;
    struct bus_message m;

    if (n->content)
        protobuf_c_message_free_unpacked(n->content, NULL);
    n->content = NULL;
    n->errors = log_errors(n->log);
    for (;;) {
        if (stop_requested())
            return -ESHUTDOWN;
        heartbeat_turn(&n->heart);
        int64_t wait = ms_until(now, heartbeat_tick(&n->heart, now));
        if (timeout_ms >= 0 && ms_until(now, end) < wait)
            wait = ms_until(now, end);
        int err = receive(n, &m, wait);
        if (!err) {
            err = unpack(n, &m, out);
            bus_message_free(&m);
            if (!err)
                return 0;
        } else if (err != -ETIMEDOUT)
            return err;
        now = node_machine_ns(n);
        if (timeout_ms >= 0 && now >= end)
            return -ETIMEDOUT;
    }
}

int node_publish(struct node *n, const struct topic *t, int64_t capture_ns,
                 const ProtobufCMessage *m)
{
    int64_t now = node_now_ns(n);
    int err = bus_publish_message(n->bus, t, capture_ns, now, m);

    if (!err)
        latencies_add(&n->heart.latencies, t, true, now, capture_ns);
    else
        node_log(n, LOG_LEVEL_ERROR, "cannot publish %s: %s", t->name, strerror(-err));
    return err;
}

void node_device(struct node *n, size_t (*counts)(void *device, struct device_count *out),
                 void *device)
{
    n->heart.counts = counts;
    n->heart.device = device;
}

void node_state(struct node *n, Anlos__Health__State state, const char *format, ...)
{
    char text[sizeof n->heart.text];
    va_list args;

    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    heartbeat_state(&n->heart, state, text);
}

void node_turn_limit(struct node *n, double limit_s)
{
    n->heart.turn_limit_s = limit_s;
}

void node_busy(struct node *n, double limit_s)
{
    heartbeat_busy(&n->heart, limit_s);
}

void node_fault(struct node *n, const char *name, size_t count, size_t of)
{
    heartbeat_fault(&n->heart, name, (uint32_t)count, (uint32_t)of);
}

void node_ended(struct node *n, bool ended)
{
    n->heart.ended = ended;
}

void node_sensing(struct node *n, const Anlos__Sensing *sensing)
{
    n->heart.sensing = sensing;
}

void node_log(const struct node *n, enum log_level level, const char *format, ...)
{
    va_list args;

    va_start(args, format);
    log_vwrite(n->log, level, format, args);
    va_end(args);
}

void node_log_each(const struct node *n, enum log_level level, const char *format, ...)
{
    va_list args;

    va_start(args, format);
    log_vwrite_each(n->log, level, format, args);
    va_end(args);
}

size_t node_dropped_count(const struct node_dropped *d, struct device_count *out)
{
    *out = (struct device_count){d->count, d->n};
    return 1;
}

void node_dropped_say(const struct node *n, struct node_dropped *d)
{
    if (d->n > d->said)
        node_log(n, LOG_LEVEL_INFO, "%s, ignored: %" PRIu64, d->count, d->n - d->said);
    d->said = d->n;
}

int node_finish(struct node *n, int err)
{
    if (err == -ESHUTDOWN)
        err = 0;
    /* What is said of this turn says it better. */
    if (err && err != NODE_TOLD && log_errors(n->log) == n->errors)
        node_log(n, LOG_LEVEL_ERROR, "ends: %s", strerror(-err));
    node_free(n);
    switch (err) {
    case 0:
        return EXIT_WORKED;
    case -EINVAL:
    case -ENOENT:
    case -ENODEV:
    case -ENOTSUP:
    case -EACCES:
    case -ENOTDIR:
    case -EISDIR:
    case -ENAMETOOLONG:
    case -ELOOP:  /* a link, */
    case -EMLINK: /* or a file of several names, through which nothing is written */
    case -EROFS:
    case -EADDRINUSE:
    case -EADDRNOTAVAIL:
    case -EBADMSG: /* a bag that is damaged, and stays so */
        return EXIT_BAD_INPUT;
    default:
        return EXIT_FAILED;
    }
}

bool node_is_optional(const char *name)
{
    static const char *const names[] = {"can", "play", "record", "report", "view"};

    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (!strcmp(name, names[i]))
            return true;
    return false;
}
