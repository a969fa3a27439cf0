/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/feed.h"

#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "hal/clock.h"
#include "msgs/bus.h"
#include "msgs/endpoint.h"
#include "nodes/rt/log_history.h"

#define LOOK_NS    500000000LL  /* between two looks at who lives */
#define OWN_CPU_NS 3000000000LL /* over which our own share is taken */

struct feed {
    char run_dir[sizeof((struct table *)0)->run_dir];
    struct hosts hosts;
    struct bus *bus; /* NULL: nobody is listened to */
    struct collector *collector;
    struct presence_locks locks;
    bool alive;
    bool blind; /* somebody lives, and the kernel does not show who holds which lock */
    int64_t look_due_ns;
    int64_t history_due_ns; /* what was said before we came; 0: it was read */
    int64_t own_since_ns;
    double own_since_s, own_cpu;
    uint64_t malformed;
    struct table table; /* of feed_is_ready */
};

static double own_cpu_s(void)
{
    struct rusage u;

    getrusage(RUSAGE_SELF, &u);
    return (double)(u.ru_utime.tv_sec + u.ru_stime.tv_sec) +
           1e-6 * (double)(u.ru_utime.tv_usec + u.ru_stime.tv_usec);
}

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

bool feed_answers(const char *run_dir)
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

void feed_say_nothing_runs(const char *command, const char *run_dir, bool waits)
{
    fprintf(stderr, "anlos %s: nothing is running in %s%s\n", command, run_dir,
            waits ? " yet; waiting"
                  : "; start it with 'anlos launch FILE', or name its folder with "
                    "--run-dir");
}

static void look_who_lives(struct feed *f)
{
    const char *const *names = topics_nodes();

    presence_read(&f->locks, NULL);
    f->alive = f->blind = !f->locks.n && feed_answers(f->run_dir);
    for (size_t i = 0; names[i]; i++) {
        enum presence presence = presence_of(&f->locks, f->run_dir, names[i]);
        collector_presence(f->collector, names[i], presence, clock_monotonic_ns());
        f->alive |= presence == PRESENCE_ALIVE;
    }
    f->look_due_ns = clock_monotonic_ns() + LOOK_NS;
}

int feed_open(struct feed **out, const char *run_dir, struct error *why)
{
    struct feed *f = calloc(1, sizeof *f);

    if (!f || collector_create(&f->collector)) {
        free(f);
        return error_say(why, -ENOMEM, "out of memory");
    }
    snprintf(f->run_dir, sizeof f->run_dir, "%s", run_dir);
    int err = access(run_dir, F_OK) ? 0 : hosts_read(&f->hosts, run_dir, why);
    if (err) {
        feed_close(f);
        return err;
    }
    f->own_cpu = NAN;
    f->own_since_ns = clock_monotonic_ns();
    f->own_since_s = own_cpu_s();
    look_who_lives(f);
    *out = f;
    return 0;
}

int feed_listen(struct feed *f, struct error *why)
{
    const struct topic *const wanted[] = {topic_health(), topic_scan_status(),
                                          topic_detections(), topic_log()};
    const struct bus_config cfg = {.run_dir = f->run_dir, .listen_only = true};
    int err = bus_create(&f->bus, &cfg, why);

    for (size_t i = 0; !err && i < sizeof wanted / sizeof wanted[0]; i++) {
        err = bus_subscribe(f->bus, wanted[i]);
        if (err)
            error_say(why, err, "topic %s: %s", wanted[i]->name, strerror(-err));
    }
    f->history_due_ns = clock_monotonic_ns() + LOG_HISTORY_READ_NS;
    return err;
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
                         m->envelope.epoch_ns, clock_monotonic_ns());
    else if (m->topic == topic_scan_status())
        collector_scan(f->collector, (const Anlos__ScanStatus *)content);
    else if (m->topic == topic_detections())
        collector_objects(f->collector, (const Anlos__DetectionList *)content);
    else
        collector_log(f->collector, (const Anlos__Log *)content);
    protobuf_c_message_free_unpacked(content, NULL);
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
    int64_t now_ns = clock_monotonic_ns();
    int err;

    while (!(err = bus_receive(f->bus, &m, 0))) {
        take_message(f, &m);
        bus_message_free(&m);
    }
    if (f->history_due_ns && now_ns >= f->history_due_ns) {
        log_history_read(f->run_dir, take_line, f);
        f->history_due_ns = 0;
    }
    if (now_ns >= f->look_due_ns)
        look_who_lives(f);
    measure_own(f, now_ns);
    return err == -ETIMEDOUT ? 0 : err;
}

void feed_table(struct feed *f, struct table *out)
{
    collector_table(f->collector, clock_monotonic_ns(), out);
    snprintf(out->run_dir, sizeof out->run_dir, "%s", f->run_dir);
    out->own_cpu = f->own_cpu;
    out->own_refused = f->malformed + (f->bus ? bus_refused(f->bus) : 0);
}

bool feed_is_anybody(struct feed *f)
{
    look_who_lives(f);
    return f->alive || f->hosts.n > 1;
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

/* -- the census -------------------------------------------------------------------------
 */

#define LONGEST_NS  3500000000LL
#define SHORTEST_NS 1300000000LL /* elsewhere: shows only by its health */
#define LOOK_UP_MS  100

/* What a process writes into its lock. */
static long read_pid(const char *run_dir, const char *node)
{
    char path[ENDPOINT_URL_SIZE + 16];
    long pid = 0;
    int n = snprintf(path, sizeof path, "%s/%s.lock", run_dir, node);
    FILE *f = n > 0 && (size_t)n < sizeof path ? fopen(path, "re") : NULL;

    if (f && fscanf(f, "%ld", &pid) != 1)
        pid = 0;
    if (f)
        fclose(f);
    return pid;
}

/* A node takes its sockets away when it ends. */
static bool left_sockets(const char *run_dir, const char *node)
{
    char url[ENDPOINT_URL_SIZE];

    for (const struct topic *t = topics_all(); t->name; t++)
        if (topic_is_published_by(t, node) &&
            !endpoint_url(url, run_dir, node, t->name, NULL) &&
            !access(endpoint_path(url), F_OK))
            return true;
    return false;
}

static bool is_complete(const struct census *c, const struct census_config *cfg)
{
    for (const char *const *name = topics_nodes(); *name; name++) {
        const struct table_node *row = table_find(&c->table, *name);
        bool wanted = cfg->node ? !strcmp(cfg->node, *name)
                                : row && row->presence == PRESENCE_ALIVE;
        if (wanted && (!row || !row->pid || (cfg->rates && !isfinite(row->cpu))))
            return false;
    }
    return true;
}

static int listen_for_all(struct feed *f, struct census *c,
                          const struct census_config *cfg)
{
    bool sees_all = f->hosts.n <= 1 && !f->blind;
    int64_t began_ns = clock_monotonic_ns(), now_ns = began_ns;

    while (now_ns < began_ns + LONGEST_NS) {
        struct pollfd p = {.fd = feed_fd(f), .events = POLLIN};
        poll(&p, 1, LOOK_UP_MS);
        int err = feed_take(f);
        if (err)
            return err;
        if (cfg->stop && cfg->stop())
            return -EINTR;
        now_ns = clock_monotonic_ns();
        feed_table(f, &c->table);
        if (is_complete(c, cfg) && (sees_all || now_ns > began_ns + SHORTEST_NS))
            break;
    }
    look_who_lives(f);
    return 0;
}

/* A node that has started within the time of the census has not been heard yet and is not
 * silent for that; it counts as such all the same: it was listened to for seconds. */
static void judge(struct census_node *node, const struct feed *f, const struct table *t)
{
    const struct table_node *row = table_find(t, node->name);
    enum presence presence = row ? row->presence : PRESENCE_NEVER;
    bool heard = row && row->pid && row->silent_s < 1e-9 * COLLECTOR_SILENT_NS;

    node->row = row && row->pid ? row : NULL;
    node->pid = row && row->pid ? (long)row->pid : read_pid(f->run_dir, node->name);
    if (presence == PRESENCE_ALIVE || (f->blind && heard))
        node->life = heard ? CENSUS_ALIVE : CENSUS_SILENT;
    else if (heard && presence == PRESENCE_NEVER)
        node->life = CENSUS_ELSEWHERE;
    else if (presence == PRESENCE_NEVER)
        node->life = CENSUS_NEVER;
    else
        node->life = left_sockets(f->run_dir, node->name) ? CENSUS_DIED : CENSUS_ENDED;
}

static void set_host(struct census_node *node, const struct hosts *h)
{
    if (!h->n || hosts_may_run(h, h->here, node->name))
        return;
    for (size_t i = 0; i < h->n; i++)
        if (hosts_may_run(h, i, node->name))
            memcpy(node->host, h->list[i].name, sizeof node->host);
}

int census_take(struct census **out, const struct census_config *cfg, struct error *why)
{
    struct census *c = calloc(1, sizeof *c);
    struct feed *f = NULL;
    int err = c ? feed_open(&f, cfg->run_dir, why)
                : error_say(why, -ENOMEM, "out of memory");

    if (!err && feed_is_anybody(f)) {
        err = feed_listen(f, why);
        if (!err)
            err = listen_for_all(f, c, cfg);
    }
    if (!err) {
        feed_table(f, &c->table);
        for (const char *const *n = topics_nodes(); *n && c->n < CENSUS_MAX; n++) {
            c->nodes[c->n].name = *n;
            judge(&c->nodes[c->n], f, &c->table);
            set_host(&c->nodes[c->n++], &f->hosts);
        }
        *out = c;
    } else {
        free(c);
    }
    feed_close(f);
    return err;
}

const struct census_node *census_find(const struct census *c, const char *node)
{
    for (size_t i = 0; i < c->n; i++)
        if (!strcmp(c->nodes[i].name, node))
            return &c->nodes[i];
    return NULL;
}

size_t census_count_alive(const struct census *c)
{
    size_t n = 0;

    for (size_t i = 0; i < c->n; i++)
        n += c->nodes[i].life >= CENSUS_ALIVE;
    return n;
}

void census_free(struct census *c)
{
    free(c);
}

const char *census_life_name(enum census_life life)
{
    static const char *const names[] = {"never", "ended",  "died",
                                        "alive", "silent", "elsewhere"};
    return names[life];
}
