#include "nodes/rt/node.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "nodes/rt/arguments.h"
#include "nodes/rt/rundir.h"
#include "nodes/rt/stop.h"
#include "nodes/rt/vitals.h"

#define HEALTH_PERIOD_NS 1000000000LL
#define NS_PER_MS        1000000LL

struct node {
    char name[ENVELOPE_NODE_SIZE];
    char run_dir[RUNDIR_SIZE];
    struct log log;
    struct launchfile *launch;
    const struct clock_source *clock;
    struct bus *bus;
    int64_t epoch_ns;
    int64_t health_due_ns;
    Anlos__Health__State state;
    char text[256];
    uint64_t malformed;
    size_t (*counts)(void *device, struct device_count *out);
    void *device;              /* NULL: none */
    ProtobufCMessage *content; /* of the message that node_next gave out last */
};

static void log_refusal(void *ctx, const char *text)
{
    node_log(ctx, LOG_LEVEL_WARNING, "%s", text);
}

static int open_bus(struct node *n, struct complaint *why)
{
    struct bus_config cfg = {
        .node = n->name, .run_dir = n->run_dir, .epoch_ns = n->epoch_ns};
    sigset_t before;

    stop_block(&before);
    int err = bus_create(&n->bus, &cfg, why);
    stop_unblock(&before);
    if (err)
        return err;
    bus_on_refusal(n->bus, log_refusal, n);
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
    bus_destroy(n->bus);
    launchfile_destroy(n->launch);
    free(n);
}

static int open_all(struct node *n, const struct arguments *args, struct complaint *why)
{
    struct launchfile_options options = {.out = args->out, .realtime = args->realtime};
    int err = launchfile_load(&n->launch, args->launch, &options, why);

    if (!err)
        err = rundir_open(n->run_dir, args->run_dir, why);
    if (!err && (err = stop_install()))
        complain(why, err, "signals: %s", strerror(-err));
    return err ? err : open_bus(n, why);
}

int node_create(struct node **out, const char *name, const char *what_it_does, int argc,
                char **argv)
{
    struct arguments args;
    struct complaint why = {""};
    struct node *n = calloc(1, sizeof *n);
    int err = n ? arguments_parse(&args, argc, argv, &why) : -ENOMEM;

    if (!err && args.help) {
        print_help(name, what_it_does);
        free(n);
        return 1 + EXIT_WORKED;
    }
    if (!err) {
        snprintf(n->name, sizeof n->name, "%s", name);
        n->log = (struct log){.fd = STDERR_FILENO, .least = args.log_level};
        n->clock = clock_system();
        n->epoch_ns = clock_now_ns(n->clock);
        n->state = ANLOS__HEALTH__STATE__STARTING;
        snprintf(n->text, sizeof n->text, "starting");
        err = open_all(n, &args, &why);
    }
    if (err) {
        struct log log = {.fd = STDERR_FILENO};
        log_write(&log, LOG_LEVEL_ERROR, "%s", why.text[0] ? why.text : strerror(-err));
        node_free(n);
        return 1 + (err == -ENOMEM ? EXIT_FAILED : EXIT_BAD_INPUT);
    }
    *out = n;
    return 0;
}

const struct launchfile *node_launch(const struct node *n)
{
    return n->launch;
}

const struct clock_source *node_clock(const struct node *n)
{
    return n->clock;
}

int64_t node_now_ns(const struct node *n)
{
    return clock_now_ns(n->clock);
}

int node_subscribe(struct node *n, const struct topic *t)
{
    int err = bus_subscribe(n->bus, t);

    if (err)
        node_log(n, LOG_LEVEL_ERROR, "cannot subscribe to %s: %s", t->name,
                 strerror(-err));
    return err;
}

static void publish_health(struct node *n)
{
    struct vitals v;
    struct device_count counts[DEVICE_MAX_COUNTS];
    int64_t now = node_now_ns(n);

    vitals_take(&v, n->bus, n->name, n->malformed);
    if (n->device)
        vitals_device(&v, counts, n->counts(n->device, counts));
    v.message.state = n->state;
    v.message.text = n->text;
    v.message.uptime_s = (double)(now - n->epoch_ns) * 1e-9;
    n->health_due_ns = now + HEALTH_PERIOD_NS;
    int err = bus_publish_message(n->bus, topic_health(), 0, now, &v.message.base);
    if (err)
        node_log(n, LOG_LEVEL_ERROR, "cannot publish health: %s", strerror(-err));
}

/* Milliseconds to t, rounded up. */
static int64_t ms_until(int64_t now_ns, int64_t t_ns)
{
    return t_ns > now_ns ? (t_ns - now_ns + NS_PER_MS - 1) / NS_PER_MS : 0;
}

static int unpack(struct node *n, struct bus_message *m, struct node_message *out)
{
    n->content = bus_message_unpack(m);
    if (!n->content) {
        if (!n->malformed++)
            node_log(n, LOG_LEVEL_WARNING,
                     "%s from %s is not a message of its schema; it is passed over",
                     m->topic->name, m->envelope.node);
        return -EPROTO;
    }
    *out = (struct node_message){.topic = m->topic,
                                 .content = n->content,
                                 .capture_ns = m->envelope.capture_ns,
                                 .publish_ns = m->envelope.publish_ns,
                                 .epoch_ns = m->envelope.epoch_ns};
    memcpy(out->from, m->envelope.node, sizeof out->from);
    return 0;
}

int node_next(struct node *n, struct node_message *out, int timeout_ms)
{
    int64_t now = node_now_ns(n);
    int64_t end = now + timeout_ms * NS_PER_MS;
    struct bus_message m;

    if (n->content)
        protobuf_c_message_free_unpacked(n->content, NULL);
    n->content = NULL;
    for (;;) {
        if (stop_requested())
            return -ESHUTDOWN;
        if (now >= n->health_due_ns)
            publish_health(n);
        int64_t wait = ms_until(now, n->health_due_ns);
        if (timeout_ms >= 0 && ms_until(now, end) < wait)
            wait = ms_until(now, end);
        int err = bus_receive(n->bus, &m, (int)wait);
        if (!err) {
            err = unpack(n, &m, out);
            bus_message_free(&m);
            if (!err)
                return 0;
        } else if (err != -ETIMEDOUT)
            return err;
        now = node_now_ns(n);
        if (timeout_ms >= 0 && now >= end)
            return -ETIMEDOUT;
    }
}

int node_publish(struct node *n, const struct topic *t, int64_t capture_ns,
                 const ProtobufCMessage *m)
{
    int err = bus_publish_message(n->bus, t, capture_ns, node_now_ns(n), m);

    if (err)
        node_log(n, LOG_LEVEL_ERROR, "cannot publish %s: %s", t->name, strerror(-err));
    return err;
}

void node_device(struct node *n, size_t (*counts)(void *device, struct device_count *out),
                 void *device)
{
    n->counts = counts;
    n->device = device;
}

void node_state(struct node *n, Anlos__Health__State state, const char *format, ...)
{
    char text[sizeof n->text];
    va_list args;

    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    if (state == n->state && !strcmp(text, n->text))
        return;
    if (state != n->state)
        node_log(n,
                 state == ANLOS__HEALTH__STATE__FAULT      ? LOG_LEVEL_ERROR
                 : state == ANLOS__HEALTH__STATE__DEGRADED ? LOG_LEVEL_WARNING
                                                           : LOG_LEVEL_DEBUG,
                 "%s", text);
    n->state = state;
    memcpy(n->text, text, sizeof text);
    publish_health(n);
}

void node_log(const struct node *n, enum log_level level, const char *format, ...)
{
    va_list args;

    va_start(args, format);
    log_vwrite(&n->log, level, format, args);
    va_end(args);
}

int node_finish(struct node *n, int err)
{
    if (err == -ESHUTDOWN)
        err = 0;
    if (err)
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
    case -EROFS:
        return EXIT_BAD_INPUT;
    default:
        return EXIT_FAILED;
    }
}
