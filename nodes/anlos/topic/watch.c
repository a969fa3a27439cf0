#include "nodes/anlos/topic/watch.h"

#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "hal/clock.h"
#include "nodes/anlos/interrupt.h"
#include "nodes/anlos/topic/message_json.h"

#define LOOK_UP_MS 100 /* between looks at Ctrl-C and the clock */

static bool socket_answers(const char *folder, const char *name)
{
    struct sockaddr_un to = {.sun_family = AF_UNIX};
    int n = snprintf(to.sun_path, sizeof to.sun_path, "%s/%s", folder, name);
    if (n < 0 || (size_t)n >= sizeof to.sun_path)
        return false;
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return false;
    bool answers = !connect(fd, (struct sockaddr *)&to, sizeof to);
    close(fd);
    return answers;
}

bool topic_watch_alive(const char *run_dir)
{
    DIR *d = opendir(run_dir);
    bool alive = false;
    if (!d)
        return false;
    for (struct dirent *e = readdir(d); e && !alive; e = readdir(d)) {
        const char *dot = strrchr(e->d_name, '.');
        alive = dot && !strcmp(dot, ".ipc") && socket_answers(run_dir, e->d_name);
    }
    closedir(d);
    return alive;
}

static double now_s(void)
{
    return 1e-9 * (double)clock_now_ns(clock_system());
}

int topic_watch_open(struct bus **out, const char *run_dir,
                     const struct topic *const *topics, size_t n, struct complaint *why)
{
    struct bus_config cfg = {.run_dir = run_dir, .listen_only = true};
    int err = bus_create(out, &cfg, why);
    for (size_t i = 0; !err && i < n; i++) {
        err = bus_subscribe(*out, topics[i]);
        if (err) {
            complain(why, err, "topic %s: %s", topics[i]->name, strerror(-err));
            bus_destroy(*out);
        }
    }
    return err;
}

static int echo_message(const struct bus_message *m, bool full)
{
    ProtobufCMessage *content = bus_message_unpack(m);
    json_t *o = json_object();
    json_object_set_new(o, "topic", json_string(m->topic->name));
    json_object_set_new(o, "from", json_string(m->envelope.node));
    json_object_set_new(o, "sequence", json_integer((json_int_t)m->envelope.sequence));
    json_object_set_new(o, "capture_ns", json_integer(m->envelope.capture_ns));
    json_object_set_new(o, "publish_ns", json_integer(m->envelope.publish_ns));
    json_object_set_new(o, "bytes", json_integer((json_int_t)m->envelope.payload_size));
    json_object_set_new(o, "content",
                        content ? message_json(content, full)
                                : json_string("not a message of the topic's schema"));
    errno = 0;
    int failed = json_dumpf(o, stdout, JSON_COMPACT | JSON_REAL_PRECISION(9)) ||
                 putchar('\n') == EOF || fflush(stdout);
    int err = failed ? (errno ? -errno : -ENOMEM) : 0;
    json_decref(o);
    if (content)
        protobuf_c_message_free_unpacked(content, NULL);
    return err;
}

int topic_watch_echo(struct bus *bus, size_t count, bool full)
{
    for (size_t seen = 0; !count || seen < count;) {
        struct bus_message m;
        int err = bus_receive(bus, &m, LOOK_UP_MS);
        if (interrupt_requested()) {
            if (!err)
                bus_message_free(&m);
            return -EINTR;
        }
        if (err == -ETIMEDOUT)
            continue;
        if (err)
            return err;
        err = echo_message(&m, full);
        bus_message_free(&m);
        if (err)
            return err == -EPIPE ? 0 : err; /* `| head` has seen enough */
        seen++;
    }
    return 0;
}

struct arrivals {
    double first_s, last_s;
};

static void print_rate(const struct topic *t, const struct arrivals *a,
                       const struct bus_count *c, double elapsed_s)
{
    char expected[32] = "now and then", measured[32] = "-";
    if (t->rate_hz > 0.0)
        snprintf(expected, sizeof expected, "%.1f Hz", t->rate_hz);
    if (c->messages > 1 && a->last_s > a->first_s)
        snprintf(measured, sizeof measured, "%.1f Hz",
                 (double)(c->messages - 1) / (a->last_s - a->first_s));
    printf("%-14s %10" PRIu64 " %12s %13s %12.1f %8" PRIu64 "\n", t->name, c->messages,
           measured, expected, 1e-3 * (double)c->bytes / elapsed_s, c->gaps);
}

static int print_rates(struct bus *bus, const struct topic *const *topics, size_t n,
                       const struct arrivals *arrivals, double elapsed_s)
{
    size_t all = bus_counts(bus, NULL, 0);
    struct bus_count *counts = calloc(all ? all : 1, sizeof *counts);
    if (!counts)
        return -ENOMEM;
    size_t room = all;
    all = bus_counts(bus, counts, room);
    all = all < room ? all : room;
    printf("%-14s %10s %12s %13s %12s %8s\n", "topic", "messages", "rate", "expected",
           "kB/s", "gaps");
    for (size_t i = 0; i < n; i++) {
        struct bus_count none = {0}, *c = &none;
        for (size_t k = 0; k < all; k++)
            if (counts[k].topic == topics[i] && !counts[k].published)
                c = &counts[k];
        print_rate(topics[i], &arrivals[i], c, elapsed_s);
    }
    if (bus_refused(bus))
        printf("%" PRIu64 " messages were refused (wrong magic, version or length)\n",
               bus_refused(bus));
    free(counts);
    return fflush(stdout) ? -errno : 0;
}

int topic_watch_rates(struct bus *bus, const struct topic *const *topics, size_t n,
                      double seconds)
{
    struct arrivals *arrivals = calloc(n ? n : 1, sizeof *arrivals);
    double began_s = now_s();
    int err = 0;
    if (!arrivals)
        return -ENOMEM;
    while (now_s() < began_s + seconds && !interrupt_requested()) {
        struct bus_message m;
        double left_ms = 1e3 * (began_s + seconds - now_s());
        err = bus_receive(bus, &m, (int)fmax(fmin(left_ms + 1.0, LOOK_UP_MS), 0.0));
        if (err == -ETIMEDOUT)
            continue;
        if (err)
            break;
        for (size_t i = 0; i < n; i++) {
            if (topics[i] != m.topic)
                continue;
            arrivals[i].last_s = now_s();
            if (arrivals[i].first_s == 0.0)
                arrivals[i].first_s = arrivals[i].last_s;
        }
        bus_message_free(&m);
    }
    if (!err || err == -ETIMEDOUT)
        err = print_rates(bus, topics, n, arrivals, now_s() - began_s);
    free(arrivals);
    return err ? err : interrupt_requested() ? -EINTR : 0;
}
