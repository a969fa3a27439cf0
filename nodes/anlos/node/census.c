#include "nodes/anlos/node/census.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "hal/clock.h"
#include "msgs/bus.h"
#include "msgs/endpoint.h"
#include "msgs/hosts.h"
#include "nodes/anlos/collector.h"
#include "nodes/anlos/topic/watch.h"

#define LONGEST_NS 3500000000LL
#define SHORTEST_NS                                                                      \
    1300000000LL /* who is on another machine shows only by its health                   \
                  */
#define LOOK_UP_MS 100

struct census_taker {
    const struct census_config *cfg;
    struct census *census;
    struct collector *collector;
    enum presence presence[CENSUS_MAX];
    bool remote; /* some nodes may be on other machines */
    bool blind;  /* somebody lives, and the kernel does not show who holds which lock */
};

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

static void look_at_locks(struct census_taker *k)
{
    struct presence_locks *locks = malloc(sizeof *locks);

    if (!locks)
        return;
    presence_read(locks, NULL);
    k->blind = !locks->n && topic_watch_alive(k->cfg->run_dir);
    for (size_t i = 0; i < k->census->n; i++) {
        const char *name = k->census->nodes[i].name;
        k->presence[i] = presence_of(locks, k->cfg->run_dir, name);
        collector_presence(k->collector, name, k->presence[i],
                           clock_now_ns(clock_system()));
    }
    free(locks);
}

static const struct table_node *find_row(const struct table *t, const char *node)
{
    for (size_t i = 0; i < t->n_nodes; i++)
        if (!strcmp(t->nodes[i].name, node))
            return &t->nodes[i];
    return NULL;
}

static bool is_complete(const struct census_taker *k)
{
    for (size_t i = 0; i < k->census->n; i++) {
        const char *name = k->census->nodes[i].name;
        const struct table_node *row = find_row(&k->census->table, name);
        bool wanted = k->cfg->node ? !strcmp(k->cfg->node, name)
                                   : k->presence[i] == PRESENCE_ALIVE;
        if (wanted && (!row || !row->pid || (k->cfg->rates && !isfinite(row->cpu))))
            return false;
    }
    return true;
}

static bool anybody_lives(const struct census_taker *k)
{
    if (k->blind)
        return true;
    for (size_t i = 0; i < k->census->n; i++)
        if (k->presence[i] == PRESENCE_ALIVE)
            return true;
    return false;
}

static void take_health(struct census_taker *k, const struct bus_message *m,
                        int64_t now_ns)
{
    ProtobufCMessage *content = bus_message_unpack(m);

    if (!content)
        return;
    collector_health(k->collector, (const Anlos__Health *)content, m->envelope.epoch_ns,
                     now_ns);
    protobuf_c_message_free_unpacked(content, NULL);
}

static int listen_to(struct census_taker *k, struct bus *bus)
{
    int64_t began_ns = clock_now_ns(clock_system()), now_ns = began_ns;

    while (now_ns < began_ns + LONGEST_NS) {
        struct bus_message m;
        int err = bus_receive(bus, &m, LOOK_UP_MS);
        now_ns = clock_now_ns(clock_system());
        if (!err) {
            take_health(k, &m, now_ns);
            bus_message_free(&m);
        } else if (err != -ETIMEDOUT) {
            return err;
        }
        if (k->cfg->stop && k->cfg->stop())
            return -EINTR;
        collector_table(k->collector, now_ns, &k->census->table);
        if (is_complete(k) &&
            ((!k->remote && !k->blind) || now_ns > began_ns + SHORTEST_NS))
            break;
    }
    look_at_locks(k);
    collector_table(k->collector, now_ns, &k->census->table);
    return 0;
}

/* A node that has started within the time of the census has not been heard yet and is not
 * silent for that; it counts as such all the same: it was listened to for seconds. */
static void judge(struct census_taker *k, size_t i)
{
    struct census_node *node = &k->census->nodes[i];
    const struct table_node *row = find_row(&k->census->table, node->name);
    bool heard = row && row->pid && row->silent_s < 1e-9 * COLLECTOR_SILENT_NS;

    node->row = row && row->pid ? row : NULL;
    node->pid = row && row->pid ? (long)row->pid : read_pid(k->cfg->run_dir, node->name);
    if (k->presence[i] == PRESENCE_ALIVE || (k->blind && heard))
        node->life = heard ? CENSUS_ALIVE : CENSUS_SILENT;
    else if (heard && k->presence[i] == PRESENCE_NEVER)
        node->life = CENSUS_ELSEWHERE;
    else if (k->presence[i] == PRESENCE_NEVER)
        node->life = CENSUS_NEVER;
    else
        node->life = left_sockets(k->cfg->run_dir, node->name) ? CENSUS_DIED
                                                               : CENSUS_ENDED;
}

static void set_host(struct census_node *node, const struct hosts *h)
{
    if (!h->n || hosts_may_run(h, h->here, node->name))
        return;
    for (size_t i = 0; i < h->n; i++)
        if (hosts_may_run(h, i, node->name))
            memcpy(node->host, h->list[i].name, sizeof node->host);
}

static int count_people(struct census_taker *k, struct error *why)
{
    const struct bus_config bus_cfg = {.run_dir = k->cfg->run_dir, .listen_only = true};
    struct hosts hosts = {0};
    struct bus *bus = NULL;
    int err = access(k->cfg->run_dir, F_OK) ? 0
                                            : hosts_read(&hosts, k->cfg->run_dir, why);

    if (err)
        return err;
    k->remote = hosts.n > 1;
    look_at_locks(k);
    if (anybody_lives(k) || k->remote) {
        err = bus_create(&bus, &bus_cfg, why);
        if (!err && (err = bus_subscribe(bus, topic_health())))
            error_say(why, err, "topic health: %s", strerror(-err));
        if (!err)
            err = listen_to(k, bus);
        bus_destroy(bus);
    } else {
        collector_table(k->collector, clock_now_ns(clock_system()), &k->census->table);
    }
    for (size_t i = 0; i < k->census->n; i++)
        judge(k, i);
    for (size_t i = 0; i < k->census->n; i++)
        set_host(&k->census->nodes[i], &hosts);
    return err;
}

int census_take(struct census **out, const struct census_config *cfg, struct error *why)
{
    struct census_taker k = {.cfg = cfg, .census = calloc(1, sizeof **out)};
    int err = k.census ? collector_create(&k.collector) : -ENOMEM;

    if (err) {
        free(k.census);
        return error_say(why, err, "out of memory");
    }
    for (const char *const *n = topics_nodes(); *n && k.census->n < CENSUS_MAX; n++)
        k.census->nodes[k.census->n++].name = *n;
    err = count_people(&k, why);
    collector_destroy(k.collector);
    if (err)
        free(k.census);
    else
        *out = k.census;
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
