#include "nodes/anlos/node/node.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>
#include <unistd.h>

#include "msgs/endpoint.h"
#include "msgs/hosts.h"
#include "nodes/anlos/top/text.h"

static void print_link(const struct table_link *l, FILE *f)
{
    char rate[TEXT_CELL_SIZE], bytes[TEXT_CELL_SIZE], latency[TEXT_CELL_SIZE],
        queue[48] = "-";

    text_rate(rate, sizeof rate, l->rate_hz, l->topic->rate_hz);
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
    struct complaint why = {""};

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

void node_info_print(const struct census_node *n, const char *run_dir, FILE *f)
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
