#include "nodes/anlos/top/detail.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "nodes/anlos/top/columns.h"
#include "nodes/anlos/text.h"

__attribute__((format(printf, 2, 3))) static void add(struct detail *d,
                                                      const char *format, ...)
{
    va_list args;

    if (d->n == DETAIL_MAX_LINES)
        return;
    va_start(args, format);
    vsnprintf(d->lines[d->n++], sizeof d->lines[0], format, args);
    va_end(args);
}

/* Counts in as many lines as the width asks for. */
static void add_device(struct detail *d, const struct table_node *node, int width)
{
    char line[PAGE_LINE_SIZE] = "", name[sizeof node->device[0].name], item[96];

    for (size_t i = 0; i < node->n_device; i++) {
        text_clean(name, sizeof name, node->device[i].name);
        snprintf(item, sizeof item, " %s%s %" PRIu64, i ? "" : "device: ", name,
                 node->device[i].value);
        if (*line && text_columns(line) + text_columns(item) + 1 > (size_t)width) {
            add(d, "%s", line);
            *line = '\0';
        }
        size_t used = strlen(line);
        snprintf(line + used, sizeof line - used, "%s%s", used ? "," : "", item);
    }
    if (*line)
        add(d, "%s", line);
}

static void add_link(struct detail *d, const char *name, const struct table_link *link,
                     int width)
{
    const struct columns_link_row row = {.name = name, .link = link};

    if (d->n < DETAIL_MAX_LINES) {
        columns_write(columns_links, width, &row, d->lines[d->n], sizeof d->lines[0]);
        d->n++;
    }
}

static void add_link_titles(struct detail *d, int width)
{
    if (d->n < DETAIL_MAX_LINES) {
        columns_write(columns_links, width, NULL, d->lines[d->n], sizeof d->lines[0]);
        d->n++;
    }
}

void detail_of_node(struct detail *d, const struct table_node *node, int width)
{
    char up[32], silent[32], text[TABLE_TEXT_SIZE];

    d->n = 0;
    text_duration(up, sizeof up, node->uptime_s);
    text_duration(silent, sizeof silent, node->silent_s);
    text_clean(text, sizeof text, node->text);
    if (node->state == TABLE_SILENT && !node->pid)
        add(d, " its process lives, but its health does not come");
    else if (node->state == TABLE_SILENT || node->state == TABLE_DEAD)
        add(d, " last heard %s ago: %s", silent, *text ? text : "-");
    else if (node->state == TABLE_OFF)
        add(d, " it ran here once, and does not run now");
    else
        add(d, " %s", *text ? text : "-");
    add_device(d, node, width);
    if (!node->pid)
        return;
    add(d, " process %u, up %s, started again %u times%s", (unsigned)node->pid, up,
        node->restarts, node->twin ? "; another process of this name speaks too" : "");
    add_link_titles(d, width);
    for (size_t i = 0; i < node->n_links; i++)
        add_link(d, node->links[i].topic->name, &node->links[i], width);
}

void detail_of_topic(struct detail *d, const struct table *t, const struct topic *topic,
                     int width)
{
    char bytes[32];

    d->n = 0;
    text_bytes(bytes, sizeof bytes, (double)topic->max_size);
    add(d, " %s; a queue keeps %s %zu; at most %s bytes each", topic->schema->name,
        topic->policy == TOPIC_ALL ? "all up to" : "the latest", topic->depth, bytes);
    add_link_titles(d, width);
    for (int published = 1; published >= 0; published--)
        for (size_t i = 0; i < t->n_nodes; i++)
            for (size_t k = 0; k < t->nodes[i].n_links; k++) {
                const struct table_link *link = &t->nodes[i].links[k];
                if (link->topic == topic && link->published == (bool)published)
                    add_link(d, t->nodes[i].name, link, width);
            }
}
