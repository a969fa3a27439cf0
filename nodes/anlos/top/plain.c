#include "nodes/anlos/top/plain.h"

#include <errno.h>
#include <inttypes.h>
#include <limits.h>

#include "nodes/anlos/top/columns.h"
#include "nodes/anlos/top/screen.h"
#include "nodes/anlos/text.h"

/* Without the blank in front, which is the screen's room for a mark. */
static void print_row(FILE *to, const struct column *columns, const void *row)
{
    char text[PAGE_LINE_SIZE];

    columns_write(columns, INT_MAX, row, text, sizeof text);
    fprintf(to, "%s\n", text + 1);
}

static void print_devices(FILE *to, const struct table *t)
{
    char name[sizeof t->nodes[0].device[0].name];

    for (size_t i = 0; i < t->n_nodes; i++) {
        const struct table_node *n = &t->nodes[i];
        if (!n->n_device)
            continue;
        fprintf(to, "%s device:", n->name);
        for (size_t k = 0; k < n->n_device; k++) {
            text_clean(name, sizeof name, n->device[k].name);
            fprintf(to, "%s %s %" PRIu64, k ? "," : "", name, n->device[k].value);
        }
        fprintf(to, "\n");
    }
}

static void print_objects(FILE *to, const struct table_objects *all)
{
    if (!all->known)
        return;
    if (!all->n)
        fprintf(to, "no hidden objects now\n\n");
    if (!all->n)
        return;
    print_row(to, columns_objects, NULL);
    for (size_t i = 0; i < all->n; i++)
        print_row(to, columns_objects, &all->list[i]);
    fprintf(to, "%s\n", all->over ? "(of the last list; nobody tracks now)\n" : "");
}

int plain_print(FILE *to, const struct table *t)
{
    char text[PAGE_LINE_SIZE];

    layout_summary(t, text, sizeof text);
    fprintf(to, "%s\n", text);
    layout_scan(&t->scan, text, sizeof text);
    fprintf(to, "%s\n\n", text);
    print_row(to, columns_nodes, NULL);
    for (size_t i = 0; i < t->n_nodes; i++)
        print_row(to, columns_nodes, &t->nodes[i]);
    fprintf(to, "\n");
    print_row(to, columns_topics, NULL);
    for (size_t i = 0; i < t->n_topics; i++)
        if (t->topics[i].state != TABLE_ABSENT)
            print_row(to, columns_topics, &t->topics[i]);
    fprintf(to, "\n");
    print_objects(to, &t->objects);
    print_devices(to, t);
    for (size_t i = 0; i < t->n_logs; i++) {
        layout_log(&t->logs[i], text, sizeof text);
        fprintf(to, "%s\n", text);
    }
    errno = 0;
    return fflush(to) || ferror(to) ? (errno ? -errno : -EIO) : 0;
}
