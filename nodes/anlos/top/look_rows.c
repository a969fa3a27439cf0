/* Which rows of the table are shown, in which order. */
#include <math.h>
#include <string.h>

#include "nodes/anlos/top/look.h"

const char *look_sort_name(enum look_sort sort)
{
    static const char *const names[] = {"order",   "load",   "rate",
                                        "latency", "losses", "name"};
    return names[sort];
}

/* What is not known goes last. */
static double known(double v)
{
    return isnan(v) ? -INFINITY : v;
}

static double latency_key(const struct table_latency *l)
{
    return l->n ? l->median_s : -INFINITY;
}

static double node_key(const struct table_node *n, enum look_sort sort)
{
    switch (sort) {
    case LOOK_BY_LOAD:
        return known(n->cpu);
    case LOOK_BY_RATE:
        return known(n->rate_hz);
    case LOOK_BY_LATENCY:
        return latency_key(&n->latency);
    case LOOK_BY_LOSSES:
        return (double)(n->gaps + n->dropped + n->refused);
    default:
        return 0;
    }
}

/* What is absent stays below whatever is there. */
static double topic_key(const struct table_topic *t, enum look_sort sort)
{
    if (t->state == TABLE_ABSENT)
        return -INFINITY;
    switch (sort) {
    case LOOK_BY_LOAD:
        return fmax(known(t->bytes_s), 0);
    case LOOK_BY_RATE:
        return fmax(known(t->rate_hz), 0);
    case LOOK_BY_LATENCY:
        return fmax(latency_key(&t->latency), 0);
    case LOOK_BY_LOSSES:
        return (double)t->lost;
    default:
        return 0;
    }
}

/* Puts a row among order[n] by descending key, by name if there are names, else behind
 * its equals. */
static void insert(size_t *order, double *keys, const char **names, size_t n, size_t row,
                   double key, const char *name)
{
    size_t i = n;

    for (; i > 0; i--) {
        if (keys[i - 1] > key)
            break;
        if (keys[i - 1] == key && (!name || strcmp(names[i - 1], name) <= 0))
            break;
        order[i] = order[i - 1];
        keys[i] = keys[i - 1];
        names[i] = names[i - 1];
    }
    order[i] = row;
    keys[i] = key;
    names[i] = name;
}

size_t look_nodes(const struct look *v, const struct table *t,
                  size_t order[TABLE_MAX_NODES])
{
    double keys[TABLE_MAX_NODES];
    const char *names[TABLE_MAX_NODES];
    size_t n = 0;

    for (size_t i = 0; i < t->n_nodes; i++) {
        const struct table_node *row = &t->nodes[i];
        if (!strstr(row->name, v->filter))
            continue;
        insert(order, keys, names, n, i, node_key(row, v->sort),
               v->sort == LOOK_BY_NAME ? row->name : NULL);
        n++;
    }
    return n;
}

size_t look_topics(const struct look *v, const struct table *t,
                   size_t order[TABLE_MAX_TOPICS])
{
    double keys[TABLE_MAX_TOPICS];
    const char *names[TABLE_MAX_TOPICS];
    size_t n = 0;

    for (size_t i = 0; i < t->n_topics; i++) {
        const struct table_topic *row = &t->topics[i];
        if (!strstr(row->topic->name, v->filter))
            continue;
        insert(order, keys, names, n, i, topic_key(row, v->sort),
               v->sort == LOOK_BY_NAME ? row->topic->name : NULL);
        n++;
    }
    return n;
}

size_t look_selected_node(const struct look *v, const struct table *t,
                          const size_t *order, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (!strcmp(t->nodes[order[i]].name, v->node))
            return i;
    return 0;
}

size_t look_selected_topic(const struct look *v, const struct table *t,
                           const size_t *order, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (t->topics[order[i]].topic == v->topic)
            return i;
    return 0;
}
