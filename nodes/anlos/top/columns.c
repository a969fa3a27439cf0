#include "nodes/anlos/top/columns.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define REST_LEAST 10 /* a column of the rest that is narrower is left out */

static int width_of(const struct column *columns, int rank)
{
    int sum = 0;

    for (const struct column *c = columns; c->title; c++)
        if (c->rank <= rank)
            sum += 1 + (c->width ? c->width : REST_LEAST);
    return sum;
}

/* The ranks above it have no room. */
static int choose_rank(const struct column *columns, int width)
{
    int rank = 0;

    for (const struct column *c = columns; c->title; c++)
        if (c->rank > rank)
            rank = c->rank;
    while (rank > 0 && width_of(columns, rank) > width)
        rank--;
    return rank;
}

void columns_write(const struct column *columns, int width, const void *row, char *out,
                   size_t size)
{
    int rank = choose_rank(columns, width);
    size_t used = 0;

    *out = '\0';
    for (const struct column *c = columns; c->title; c++) {
        char cell[TEXT_CELL_SIZE];
        if (c->rank > rank)
            continue;
        if (row)
            c->write(row, cell);
        else
            snprintf(cell, sizeof cell, "%s", c->title);
        if (c->width)
            text_cut(cell, (size_t)c->width);
        int blanks = c->width - (int)text_columns(cell);
        int before = c->left || blanks < 0 ? 0 : blanks;
        int after = c->left && blanks > 0 ? blanks : 0;
        int n =
            snprintf(out + used, size - used, " %*s%s%*s", before, "", cell, after, "");
        used += n > 0 && (size_t)n < size - used ? (size_t)n : 0;
    }
    if (width < INT_MAX)
        text_cut(out, (size_t)width);
    for (used = strlen(out); used && out[used - 1] == ' ';)
        out[--used] = '\0';
}

void columns_state(const struct column *columns, int *at, int *n)
{
    *at = 1 + columns[0].width + 1;
    *n = columns[1].width;
}

#define CELL TEXT_CELL_SIZE

static const char *word(bool yes)
{
    return yes ? "out" : "in";
}

/* Nodes. */
static void node_name(const void *row, char out[CELL])
{
    snprintf(out, CELL, "%s", ((const struct table_node *)row)->name);
}

static void node_state(const void *row, char out[CELL])
{
    snprintf(out, CELL, "%s",
             table_node_state_name(((const struct table_node *)row)->state));
}

static void node_cpu(const void *row, char out[CELL])
{
    text_percent(out, CELL, ((const struct table_node *)row)->cpu);
}

static void node_memory(const void *row, char out[CELL])
{
    uint64_t bytes = ((const struct table_node *)row)->rss_bytes;
    text_bytes(out, CELL, bytes ? (double)bytes : NAN);
}

static void node_rate(const void *row, char out[CELL])
{
    const struct table_node *n = row;
    text_rate(out, CELL, n->rate_hz, n->expected_hz);
}

static void node_latency(const void *row, char out[CELL])
{
    text_latency(out, CELL, &((const struct table_node *)row)->latency);
}

static void node_queue(const void *row, char out[CELL])
{
    text_count(out, CELL, ((const struct table_node *)row)->queued);
}

static void node_drops(const void *row, char out[CELL])
{
    text_count(out, CELL, ((const struct table_node *)row)->dropped);
}

static void node_gaps(const void *row, char out[CELL])
{
    text_count(out, CELL, ((const struct table_node *)row)->gaps);
}

static void node_refused(const void *row, char out[CELL])
{
    text_count(out, CELL, ((const struct table_node *)row)->refused);
}

static void node_uptime(const void *row, char out[CELL])
{
    text_duration(out, CELL, ((const struct table_node *)row)->uptime_s);
}

static void node_pid(const void *row, char out[CELL])
{
    unsigned pid = ((const struct table_node *)row)->pid;
    snprintf(out, CELL, pid ? "%u" : "-", pid);
}

static void node_in(const void *row, char out[CELL])
{
    text_rate(out, CELL, ((const struct table_node *)row)->in_hz, 0);
    out[strcspn(out, "/")] = '\0';
}

static void node_out(const void *row, char out[CELL])
{
    text_rate(out, CELL, ((const struct table_node *)row)->out_hz, 0);
    out[strcspn(out, "/")] = '\0';
}

static void node_says(const void *row, char out[CELL])
{
    text_clean(out, CELL, ((const struct table_node *)row)->text);
}

const struct column columns_nodes[] = {
    {"NODE", 8, true, 0, node_name},          {"STATE", 8, true, 0, node_state},
    {"CPU%", 5, false, 1, node_cpu},          {"MEM", 5, false, 5, node_memory},
    {"HZ/EXPECTED", 11, false, 3, node_rate}, {"LATENCY ms", 10, false, 4, node_latency},
    {"QUEUE", 5, false, 6, node_queue},       {"DROPS", 5, false, 2, node_drops},
    {"GAPS", 5, false, 2, node_gaps},         {"REFUSED", 7, false, 7, node_refused},
    {"UP", 6, false, 8, node_uptime},         {"PID", 7, false, 9, node_pid},
    {"IN Hz", 6, false, 10, node_in},         {"OUT Hz", 6, false, 10, node_out},
    {"SAYS", 0, true, 8, node_says},          {NULL, 0, false, 0, NULL},
};

/* Topics. */
static void topic_name(const void *row, char out[CELL])
{
    snprintf(out, CELL, "%s", ((const struct table_topic *)row)->topic->name);
}

static void topic_state(const void *row, char out[CELL])
{
    snprintf(out, CELL, "%s",
             table_topic_state_name(((const struct table_topic *)row)->state));
}

static void topic_rate(const void *row, char out[CELL])
{
    const struct table_topic *t = row;
    text_rate(out, CELL, t->rate_hz, t->expected_hz);
}

static void topic_bandwidth(const void *row, char out[CELL])
{
    text_bytes(out, CELL, ((const struct table_topic *)row)->bytes_s);
}

static void topic_size(const void *row, char out[CELL])
{
    text_bytes(out, CELL, ((const struct table_topic *)row)->size_bytes);
}

static void topic_publishers(const void *row, char out[CELL])
{
    const struct table_topic *t = row;
    snprintf(out, CELL, "%u/%u", t->alive, t->known);
}

static void topic_lost(const void *row, char out[CELL])
{
    text_count(out, CELL, ((const struct table_topic *)row)->lost);
}

static void topic_queue(const void *row, char out[CELL])
{
    text_count(out, CELL, ((const struct table_topic *)row)->queued);
}

static void topic_latency(const void *row, char out[CELL])
{
    text_latency(out, CELL, &((const struct table_topic *)row)->latency);
}

static void topic_messages(const void *row, char out[CELL])
{
    text_count(out, CELL, ((const struct table_topic *)row)->messages);
}

const struct column columns_topics[] = {
    {"TOPIC", 13, true, 0, topic_name},
    {"STATE", 6, true, 0, topic_state},
    {"HZ/EXPECTED", 11, false, 1, topic_rate},
    {"BYTES/s", 7, false, 3, topic_bandwidth},
    {"SIZE", 5, false, 6, topic_size},
    {"NODES", 5, false, 5, topic_publishers},
    {"LOST", 5, false, 2, topic_lost},
    {"QUEUE", 5, false, 7, topic_queue},
    {"LATENCY ms", 10, false, 4, topic_latency},
    {"MESSAGES", 8, false, 8, topic_messages},
    {NULL, 0, false, 0, NULL},
};

/* A topic at a node. */
static const struct table_link *link_of(const void *row)
{
    return ((const struct columns_link_row *)row)->link;
}

static void link_name(const void *row, char out[CELL])
{
    snprintf(out, CELL, "%s", ((const struct columns_link_row *)row)->name);
}

static void link_way(const void *row, char out[CELL])
{
    snprintf(out, CELL, "%s", word(link_of(row)->published));
}

static void link_rate(const void *row, char out[CELL])
{
    text_rate(out, CELL, link_of(row)->rate_hz, link_of(row)->expected_hz);
}

static void link_bandwidth(const void *row, char out[CELL])
{
    text_bytes(out, CELL, link_of(row)->bytes_s);
}

static void link_messages(const void *row, char out[CELL])
{
    text_count(out, CELL, link_of(row)->messages);
}

static void link_queue(const void *row, char out[CELL])
{
    text_count(out, CELL, link_of(row)->queued);
}

static void link_drops(const void *row, char out[CELL])
{
    text_count(out, CELL, link_of(row)->dropped);
}

static void link_gaps(const void *row, char out[CELL])
{
    text_count(out, CELL, link_of(row)->gaps);
}

static void link_latency(const void *row, char out[CELL])
{
    text_latency(out, CELL, &link_of(row)->latency);
}

const struct column columns_links[] = {
    {"", 13, true, 0, link_name},
    {"WAY", 6, true, 0, link_way},
    {"HZ/EXPECTED", 11, false, 1, link_rate},
    {"BYTES/s", 7, false, 4, link_bandwidth},
    {"MSGS", 5, false, 5, link_messages},
    {"GAPS", 5, false, 2, link_gaps},
    {"DROPS", 5, false, 2, link_drops},
    {"QUEUE", 5, false, 3, link_queue},
    {"LATENCY ms", 10, false, 4, link_latency},
    {NULL, 0, false, 0, NULL},
};
