#include "nodes/anlos/feed.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

#include "msgs/bus.h"
#include "msgs/hosts.h"
#include "nodes/anlos/collector.h"
#include "nodes/rt/log_history.h"

#define LOOK_NS    500000000LL  /* between two looks at who lives */
#define OWN_CPU_NS 3000000000LL /* over which our own share is taken */

struct feed {
    char run_dir[sizeof((struct table *)0)->run_dir];
    struct bus *bus;
    struct collector *collector;
    struct presence_locks locks;
    bool alive, remote; /* remote: nodes may live on other machines */
    int64_t look_due_ns;
    int64_t history_due_ns; /* what was said before we came; 0: it was read */
    int64_t own_since_ns;
    double own_since_s, own_cpu;
    uint64_t malformed;
    struct table table; /* of feed_is_ready */
};

int64_t feed_now_ns(void)
{
    struct timespec t;

    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static double own_cpu_s(void)
{
    struct rusage u;

    getrusage(RUSAGE_SELF, &u);
    return (double)(u.ru_utime.tv_sec + u.ru_stime.tv_sec) +
           1e-6 * (double)(u.ru_utime.tv_usec + u.ru_stime.tv_usec);
}

static int subscribe(struct feed *f, struct error *why)
{
    const struct topic *const wanted[] = {topic_health(), topic_scan_status(),
                                          topic_detections(), topic_log()};
    int err = 0;

    for (size_t i = 0; !err && i < sizeof wanted / sizeof wanted[0]; i++) {
        err = bus_subscribe(f->bus, wanted[i]);
        if (err)
            error_say(why, err, "topic %s: %s", wanted[i]->name, strerror(-err));
    }
    return err;
}

int feed_open(struct feed **out, const char *run_dir, struct error *why)
{
    const struct bus_config cfg = {.run_dir = run_dir, .listen_only = true};
    struct feed *f = calloc(1, sizeof *f);
    struct hosts hosts = {0};

    if (!f || collector_create(&f->collector)) {
        free(f);
        return error_say(why, -ENOMEM, "out of memory");
    }
    snprintf(f->run_dir, sizeof f->run_dir, "%s", run_dir);
    int err = hosts_read(&hosts, run_dir, why);
    if (!err)
        err = bus_create(&f->bus, &cfg, why);
    if (!err)
        err = subscribe(f, why);
    if (err) {
        feed_close(f);
        return err;
    }
    f->remote = hosts.n > 1;
    f->own_cpu = NAN;
    f->own_since_ns = feed_now_ns();
    f->history_due_ns = f->own_since_ns + LOG_HISTORY_READ_NS;
    f->own_since_s = own_cpu_s();
    *out = f;
    return 0;
}

int feed_fd(const struct feed *f)
{
    return bus_fd(f->bus);
}

static void take_message(struct feed *f, const struct bus_message *m)
{
    ProtobufCMessage *content = bus_message_unpack(m);

    if (!content) {
        f->malformed++;
        return;
    }
    if (m->topic == topic_health())
        collector_health(f->collector, (const Anlos__Health *)content,
                         m->envelope.epoch_ns, feed_now_ns());
    else if (m->topic == topic_scan_status())
        collector_scan(f->collector, (const Anlos__ScanStatus *)content);
    else if (m->topic == topic_detections())
        collector_objects(f->collector, (const Anlos__DetectionList *)content);
    else
        collector_log(f->collector, (const Anlos__Log *)content);
    protobuf_c_message_free_unpacked(content, NULL);
}

static void look_who_lives(struct feed *f)
{
    const char *const *names = topics_nodes();

    f->alive = false;
    presence_read(&f->locks, NULL);
    for (size_t i = 0; names[i]; i++) {
        enum presence presence = presence_of(&f->locks, f->run_dir, names[i]);
        collector_presence(f->collector, names[i], presence, feed_now_ns());
        f->alive |= presence == PRESENCE_ALIVE;
    }
}

static void measure_own(struct feed *f, int64_t now_ns)
{
    if (now_ns - f->own_since_ns < OWN_CPU_NS)
        return;
    double cpu_s = own_cpu_s();
    f->own_cpu = (cpu_s - f->own_since_s) / (1e-9 * (double)(now_ns - f->own_since_ns));
    f->own_since_ns = now_ns;
    f->own_since_s = cpu_s;
}

static void take_line(void *ctx, const Anlos__Log *line)
{
    const struct feed *f = ctx;

    collector_log(f->collector, line);
}

int feed_take(struct feed *f)
{
    struct bus_message m;
    int64_t now_ns = feed_now_ns();
    int err;

    while (!(err = bus_receive(f->bus, &m, 0))) {
        take_message(f, &m);
        bus_message_free(&m);
    }
    if (f->history_due_ns && now_ns >= f->history_due_ns) {
        log_history_read(f->run_dir, take_line, f);
        f->history_due_ns = 0;
    }
    if (now_ns >= f->look_due_ns) {
        look_who_lives(f);
        f->look_due_ns = now_ns + LOOK_NS;
    }
    measure_own(f, now_ns);
    return err == -ETIMEDOUT ? 0 : err;
}

void feed_table(struct feed *f, struct table *out)
{
    collector_table(f->collector, feed_now_ns(), out);
    snprintf(out->run_dir, sizeof out->run_dir, "%s", f->run_dir);
    out->own_cpu = f->own_cpu;
    out->own_refused = bus_refused(f->bus) + f->malformed;
}

bool feed_is_anybody(struct feed *f)
{
    look_who_lives(f);
    return f->alive || f->remote;
}

bool feed_is_ready(struct feed *f)
{
    bool known = false;

    feed_table(f, &f->table);
    for (size_t i = 0; i < f->table.n_nodes; i++) {
        if (!table_node_is_alive(&f->table.nodes[i]))
            continue;
        if (isnan(f->table.nodes[i].cpu))
            return false;
        known = true;
    }
    return known;
}

void feed_close(struct feed *f)
{
    if (!f)
        return;
    bus_destroy(f->bus);
    collector_destroy(f->collector);
    free(f);
}
