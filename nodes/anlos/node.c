/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/commands.h"
#include "nodes/anlos/feed.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <string.h>
#include <unistd.h>

#include "msgs/endpoint.h"
#include "msgs/hosts.h"
#include "nodes/anlos/text.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"
#include "nodes/rt/rundir.h"
#include "nodes/rt/stop.h"

static void print_link(const struct table_link *l, FILE *f)
{
    char rate[TEXT_CELL_SIZE], bytes[TEXT_CELL_SIZE], latency[TEXT_CELL_SIZE],
        queue[48] = "-";

    text_rate(rate, sizeof rate, l->rate_hz, l->expected_hz);
    text_bytes(bytes, sizeof bytes, l->bytes_s);
    text_latency(latency, sizeof latency, &l->latency);
    if (!l->published)
        snprintf(queue, sizeof queue, "%u/%zu", l->queued, l->topic->depth);
    fprintf(f, "  %-14s %9" PRIu64 " %12s %8s %12s", l->topic->name, l->messages, rate,
            bytes, latency);
    if (!l->published)
        fprintf(f, " %9s %7" PRIu64 " %8" PRIu64, queue, l->gaps, l->dropped);
    fprintf(f, "\n");
}

static void print_links(const struct table_node *row, bool published, FILE *f)
{
    size_t n = 0;

    for (size_t i = 0; i < row->n_links; i++) {
        if (row->links[i].published != published)
            continue;
        if (!n++) {
            fprintf(f, "\n%-16s %9s %12s %8s %12s", published ? "publishes" : "receives",
                    "messages", "Hz", "bytes/s", "age in ms");
            fprintf(f, "%s\n", published ? "" : "     queue    gaps  dropped");
        }
        print_link(&row->links[i], f);
    }
}

static void print_device(const struct table_node *row, FILE *f)
{
    char name[TEXT_CELL_SIZE];

    if (row->n_device)
        fprintf(f, "\ndevice\n");
    for (size_t i = 0; i < row->n_device; i++) {
        text_clean(name, sizeof name, row->device[i].name);
        fprintf(f, "  %-24s %12" PRIu64 "\n", name, row->device[i].value);
    }
}

static void print_local(const char *run_dir, const char *node, const struct topic *t,
                        FILE *f)
{
    char url[ENDPOINT_URL_SIZE];
    struct error why = {""};

    if (endpoint_url(url, run_dir, node, t->name, &why))
        fprintf(f, "  %-14s %s\n", t->name, why.text);
    else
        fprintf(f, "  %-14s %s%s\n", t->name, url,
                access(endpoint_path(url), F_OK) ? " (not there)" : "");
}

/* Of a system on several machines, the address by which the others reach it too. */
static void print_endpoints(const char *run_dir, const char *node, FILE *f)
{
    struct hosts hosts = {0};

    hosts_read(&hosts, run_dir, NULL); /* bad: census_take has said so */
    fprintf(f, "\nendpoints\n");
    for (const struct topic *t = topics_all(); t->name; t++) {
        if (!topic_is_published_by(t, node))
            continue;
        bool here = !hosts.n;
        for (size_t i = 0; i < hosts.n; i++) {
            const struct host *h = &hosts.list[i];
            if (!hosts_may_run(&hosts, i, node))
                continue;
            here |= i == hosts.here;
            if (h->address[0])
                fprintf(f, "  %-14s tcp://%s:%u (%s)\n", t->name, h->address,
                        hosts_port(h, node, t), h->name);
        }
        if (here)
            print_local(run_dir, node, t, f);
    }
}

/* All of one node: what it publishes and receives, its queues, losses and endpoints, what
 * its device counts. */
static void node_info_print(const struct census_node *n, const char *run_dir, FILE *f)
{
    char up[TEXT_CELL_SIZE], cpu[TEXT_CELL_SIZE], memory[TEXT_CELL_SIZE],
        text[TABLE_TEXT_SIZE];
    const struct table_node *row = n->row;

    fprintf(f, "node       %s\nprocess    %s", n->name, census_life_name(n->life));
    if (n->life != CENSUS_NEVER && n->pid)
        fprintf(f, ", %s%ld", n->life >= CENSUS_ALIVE ? "" : "it was ", n->pid);
    fprintf(f, "\n");
    if (row) {
        text_duration(up, sizeof up, row->uptime_s);
        text_percent(cpu, sizeof cpu, row->cpu);
        text_bytes(memory, sizeof memory, (double)row->rss_bytes);
        text_clean(text, sizeof text, row->priority);
        if (*text)
            fprintf(f, "priority   %s\n", text);
        text_clean(text, sizeof text, row->text);
        fprintf(f,
                "state      %s: %s\nup         %s, %s %% of a core, %s bytes of memory\n",
                table_node_state_name(row->state), *text ? text : "-", up, cpu, memory);
        fprintf(f, "refused    %" PRIu64 " messages that were none or not whole\n",
                row->refused);
        if (row->refused_connections)
            fprintf(f,
                    "           %" PRIu64 " connections of other machines, without a key "
                    "that is permitted here\n",
                    row->refused_connections);
        print_links(row, true, f);
        print_links(row, false, f);
        print_device(row, f);
    }
    print_endpoints(run_dir, n->name, f);
}

static json_t *link_json(const struct table_link *l)
{
    json_t *o =
        json_pack("{ss, sb, sI, sI, so, so, so}", "topic", l->topic->name, "published",
                  l->published, "messages", (json_int_t)l->messages, "bytes",
                  (json_int_t)l->bytes, "rate_hz", export_real(l->rate_hz), "expected_hz",
                  export_real(l->expected_hz), "bytes_s", export_real(l->bytes_s));

    if (!l->published) {
        json_object_set_new(o, "gaps", json_integer((json_int_t)l->gaps));
        json_object_set_new(o, "dropped", json_integer((json_int_t)l->dropped));
        json_object_set_new(o, "queued", json_integer(l->queued));
        json_object_set_new(o, "depth", json_integer((json_int_t)l->topic->depth));
    }
    if (l->latency.n) {
        json_object_set_new(o, "age_median_s", export_real(l->latency.median_s));
        json_object_set_new(o, "age_p99_s", export_real(l->latency.p99_s));
    }
    return o;
}

static void add_details(json_t *o, const struct table_node *row)
{
    json_t *topics = json_array(), *device = json_object();

    for (size_t i = 0; i < row->n_links; i++)
        json_array_append_new(topics, link_json(&row->links[i]));
    for (size_t i = 0; i < row->n_device; i++)
        json_object_set_new(device, row->device[i].name,
                            json_integer((json_int_t)row->device[i].value));
    json_object_set_new(o, "topics", topics);
    json_object_set_new(o, "device", device);
}

/* The same for programs; topics and device only when `all` is asked for.  NULL: no
 * memory.
 */
static json_t *node_json(const struct census_node *n, bool all)
{
    json_t *o =
        json_pack("{ss, ss}", "node", n->name, "process", census_life_name(n->life));
    const struct table_node *row = n->row;

    if (n->pid)
        json_object_set_new(o, "pid", json_integer(n->pid));
    if (!row)
        return o;
    json_t *text = json_string(row->text);
    json_object_set_new(o, "state", json_string(table_node_state_name(row->state)));
    json_object_set_new(o, "text", text ? text : json_null());
    json_object_set_new(o, "uptime_s", export_real(row->uptime_s));
    json_object_set_new(o, "cpu", export_real(row->cpu));
    json_object_set_new(o, "memory_bytes", json_integer((json_int_t)row->rss_bytes));
    json_object_set_new(o, "refused", json_integer((json_int_t)row->refused));
    json_object_set_new(o, "refused_connections",
                        json_integer((json_int_t)row->refused_connections));
    json_object_set_new(o, "gaps", json_integer((json_int_t)row->gaps));
    json_object_set_new(o, "dropped", json_integer((json_int_t)row->dropped));
    if (all)
        add_details(o, row);
    return o;
}

/* What a command does is no node's: its page or its bag is there all the same. */
static const char *says_of_never(const char *node)
{
    if (!strcmp(node, "view"))
        return "is no node here; an `anlos view` that looks on is not listed";
    if (!strcmp(node, "record"))
        return "is no node here; an `anlos bag record` that listens is not listed";
    return "has not run in this folder";
}

static const char *what_it_says(const struct census_node *n, char out[TABLE_TEXT_SIZE])
{
    switch (n->life) {
    case CENSUS_NEVER:
        if (!n->host[0])
            return says_of_never(n->name);
        snprintf(out, TABLE_TEXT_SIZE, "is to run on %s, and is not heard", n->host);
        return out;
    case CENSUS_ENDED:
        return "ran in this folder and has ended";
    case CENSUS_DIED:
        return "was killed or crashed: its sockets are still there";
    default:
        if (!n->row)
            return "its process lives, but its health does not come";
        text_clean(out, TABLE_TEXT_SIZE, n->row->text);
        return out;
    }
}

static void print_node(const struct census_node *n, FILE *f)
{
    char pid[24] = "-", up[TEXT_CELL_SIZE] = "-", cpu[TEXT_CELL_SIZE] = "-",
         memory[TEXT_CELL_SIZE] = "-", text[TABLE_TEXT_SIZE];
    bool alive = n->life >= CENSUS_ALIVE && n->row;

    if (n->life >= CENSUS_DIED && n->pid)
        snprintf(pid, sizeof pid, "%ld", n->pid);
    if (alive) {
        text_duration(up, sizeof up, n->row->uptime_s);
        text_percent(cpu, sizeof cpu, n->row->cpu);
        text_bytes(memory, sizeof memory, (double)n->row->rss_bytes);
    }
    fprintf(f, "%-9s %-9s %-9s %7s %7s %6s %7s  %s\n", n->name, census_life_name(n->life),
            alive ? table_node_state_name(n->row->state) : "-", pid, up, cpu, memory,
            what_it_says(n, text));
}

void node_list_print(const struct census *c, FILE *f)
{
    fprintf(f, "%-9s %-9s %-9s %7s %7s %6s %7s  %s\n", "node", "process", "state", "pid",
            "up", "cpu %", "memory", "says");
    for (size_t i = 0; i < c->n; i++)
        print_node(&c->nodes[i], f);
}

/* `anlos node`: who runs, and how. */

static const char help[] =
    "anlos node -- look at the processes of a running system\n"
    "\n"
    "usage: anlos node list [--json] [--run-dir DIR]\n"
    "       anlos node info NODE [--json] [--run-dir DIR]\n"
    "\n"
    "  list            every node: whether its process is alive, its state, process "
    "number,\n"
    "                  time since its start, share of a core, memory, what it says.  A "
    "process\n"
    "                  is alive; silent (it lives, but nothing was heard of it for "
    "seconds);\n"
    "                  elsewhere (on another machine of the system); ended; died (killed "
    "or\n"
    "                  crashed, its sockets are left); or never (no trace in this "
    "folder)\n"
    "  info            one node: each topic with rate against the expected one, bytes a\n"
    "                  second, age of the sound in it (median/p99), queue, messages that "
    "got\n"
    "                  lost before it (gaps) and in its queue (dropped); what its "
    "device\n"
    "                  counts; its endpoints\n"
    "\n"
    "  --json          as JSON\n"
    "  --run-dir DIR   where the system's sockets are, default $XDG_RUNTIME_DIR/anlos, "
    "else\n"
    "                  /tmp/anlos-UID\n"
    "  --help          this text\n"
    "\n"
    "Listens for up to 4 seconds: each node says once a second how it is.  Writes no\n"
    "files.\n"
    "\n"
    "examples\n"
    "  anlos node list\n"
    "  anlos node info recon --json | jq '.topics[] | select(.dropped > 0)'\n"
    "\n"
    "exit codes: 0 done; 1 nothing is running, the node is not alive, or failed; 2 bad\n"
    "arguments; 130 stopped by Ctrl-C\n";

struct request {
    const char *run_dir; /* NULL: the default */
    bool json;
};

static const struct usage_option options[] = {
    {"json", USAGE_FLAG(struct request, json)},
    {"run-dir", USAGE_TEXT(struct request, run_dir)},
    {.name = NULL},
};

static json_t *census_json(const struct census *c, const struct census_node *one)
{
    json_t *o = one ? node_json(one, true) : json_array();

    for (size_t i = 0; !one && i < c->n; i++)
        json_array_append_new(o, node_json(&c->nodes[i], false));
    return o;
}

static int print(const struct census *c, const struct census_node *one,
                 const char *run_dir, bool json)
{
    if (!json && one)
        node_info_print(one, run_dir, stdout);
    else if (!json)
        node_list_print(c, stdout);
    int code = json ? usage_json("node", census_json(c, one)) : usage_flush("node");
    if (code)
        return code;
    if (one ? one->life >= CENSUS_ALIVE : census_count_alive(c) > 0)
        return EXIT_WORKED;
    if (one)
        fprintf(stderr, "anlos node: %s does not run in %s\n", one->name, run_dir);
    else
        feed_say_nothing_runs("node", run_dir, false);
    return EXIT_FAILED;
}

static int run(const char *node, const struct request *q)
{
    char run_dir[RUNDIR_SIZE];
    struct error why = {""};
    struct census *c = NULL;
    struct census_config cfg = {
        .run_dir = run_dir, .node = node, .rates = true, .stop = interrupt_requested};

    if (rundir_name(run_dir, q->run_dir, &why) || rundir_check(run_dir, &why)) {
        fprintf(stderr, "anlos node: %s\n", why.text);
        return EXIT_BAD_INPUT;
    }
    interrupt_catch();
    int err = census_take(&c, &cfg, &why);
    if (err == -EINTR)
        return EXIT_INTERRUPTED;
    if (err) {
        fprintf(stderr, "anlos node: %s\n", why.text);
        return EXIT_FAILED;
    }
    int code = print(c, node ? census_find(c, node) : NULL, run_dir, q->json);
    census_free(c);
    return code;
}

int command_node(int argc, char **argv)
{
    struct request q = {.run_dir = NULL};
    struct usage usage = {
        .command = "node", .help = help, .options = options, .into = &q};
    int code = usage_next(&usage, argc, argv);

    if (code)
        return ~code;
    const char *verb = optind < argc ? argv[optind] : "";
    int n_names = argc - optind - 1;
    if (!strcmp(verb, "list") && n_names == 0)
        return run(NULL, &q);
    if (strcmp(verb, "info"))
        return usage_error("node", "%s%sexpected list or info NODE", verb,
                           *verb ? ": " : "");
    if (n_names != 1)
        return usage_error("node", "info: expected one node");
    const char *near = usage_nearest(argv[optind + 1], topics_nodes());
    if (!topics_have_node(argv[optind + 1]) && near)
        return usage_error("node", "%s: no such node; did you mean %s?", argv[optind + 1],
                           near);
    if (!topics_have_node(argv[optind + 1]))
        return usage_error("node", "%s: no such node; 'anlos node list' has their names",
                           argv[optind + 1]);
    return run(argv[optind + 1], &q);
}
