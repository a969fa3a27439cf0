#include "nodes/anlos/node/node.h"

#include <string.h>

#include "nodes/anlos/top/text.h"

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
