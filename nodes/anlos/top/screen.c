#include "nodes/anlos/top/screen.h"

#include <stdio.h>
#include <string.h>

#include "nodes/anlos/top/columns.h"
#include "nodes/anlos/top/detail.h"
#include "nodes/anlos/top/help.h"
#include "nodes/anlos/top/share.h"

#define FRAME_LINES 3 /* two above the panels, the keys below */
#define FAIR_LOGS   5

/* The first row of n to show in `room` so that the one at `at` is seen. */
static size_t first_seen(size_t at, size_t room)
{
    return room && at >= room ? at - room + 1 : 0;
}

static void title(struct page *p, const struct look *v, enum look_panel panel,
                  const char *text)
{
    struct page_line *line = page_add(p, "%s", text);

    if (line)
        line->kind = v->focus == panel ? PAGE_FOCUSED_TITLE : PAGE_TITLE;
}

static void add_row(struct page *p, const struct column *columns, const void *row,
                    enum page_tone tone, bool selected)
{
    char text[PAGE_LINE_SIZE];

    columns_write(columns, p->width, row, text, sizeof text);
    if (selected)
        text[0] = '>';
    struct page_line *line = page_add(p, "%s", text);
    if (!line)
        return;
    line->selected = selected;
    line->tone = tone;
    columns_state(columns, &line->tone_at, &line->tone_n);
}

static void add_titles(struct page *p, const struct look *v, enum look_panel panel,
                       const struct column *columns)
{
    char text[PAGE_LINE_SIZE];

    columns_write(columns, p->width, NULL, text, sizeof text);
    title(p, v, panel, text);
}

static enum page_tone node_tone(enum table_node_state state)
{
    switch (state) {
    case TABLE_READY:
        return PAGE_GOOD;
    case TABLE_OFF:
        return PAGE_FAINT;
    case TABLE_FAULT:
    case TABLE_DEAD:
        return PAGE_BAD;
    default:
        return PAGE_NOTE;
    }
}

static enum page_tone topic_tone(enum table_topic_state state)
{
    switch (state) {
    case TABLE_OK:
        return PAGE_GOOD;
    case TABLE_LOW:
        return PAGE_NOTE;
    case TABLE_LOSING:
    case TABLE_CUT:
        return PAGE_BAD;
    default:
        return PAGE_FAINT;
    }
}

static void draw_nodes(struct page *p, const struct table *t, const struct look *v,
                       size_t room)
{
    size_t order[TABLE_MAX_NODES], n = look_nodes(v, t, order);
    size_t at = look_selected_node(v, t, order, n);

    if (!room--)
        return;
    add_titles(p, v, LOOK_NODES, columns_nodes);
    for (size_t i = first_seen(at, room), k = 0; i < n && k < room; i++, k++) {
        const struct table_node *row = &t->nodes[order[i]];
        add_row(p, columns_nodes, row, node_tone(row->state),
                !v->detail_of_topic && i == at);
    }
}

static void draw_topics(struct page *p, const struct table *t, const struct look *v,
                        size_t room)
{
    size_t order[TABLE_MAX_TOPICS], n = look_topics(v, t, order);
    size_t at = look_selected_topic(v, t, order, n);

    if (!room--)
        return;
    add_titles(p, v, LOOK_TOPICS, columns_topics);
    for (size_t i = first_seen(at, room), k = 0; i < n && k < room; i++, k++) {
        const struct table_topic *row = &t->topics[order[i]];
        add_row(p, columns_topics, row, topic_tone(row->state),
                v->detail_of_topic && i == at);
    }
}

static enum page_tone object_tone(const struct table_object *o)
{
    return o->measurement == ANLOS__MEASUREMENT__PREDICTED ? PAGE_NOTE : PAGE_GOOD;
}

static void draw_objects(struct page *p, const struct table *t, struct look *v,
                         size_t room)
{
    const struct table_objects *all = &t->objects;

    if (!room--)
        return;
    if (all->n && !all->over)
        add_titles(p, v, LOOK_OBJECTS, columns_objects);
    else
        title(p, v, LOOK_OBJECTS,
              all->over ? " OBJECTS (those of the last list; nobody tracks now)"
                        : " OBJECTS (none now)");
    size_t last = all->n > room ? all->n - room : 0;
    if (v->object_line > last)
        v->object_line = last;
    for (size_t i = v->object_line, k = 0; i < all->n && k < room; i++, k++)
        add_row(p, columns_objects, &all->list[i], object_tone(&all->list[i]), false);
}

/* Returns the name of whose detail it is. */
static const char *make_detail(struct detail *d, const struct table *t,
                               const struct look *v, int width)
{
    size_t nodes[TABLE_MAX_NODES], topics[TABLE_MAX_TOPICS];
    size_t n_nodes = look_nodes(v, t, nodes), n_topics = look_topics(v, t, topics);

    d->n = 0;
    if (v->detail_of_topic && n_topics) {
        const struct topic *topic =
            t->topics[topics[look_selected_topic(v, t, topics, n_topics)]].topic;
        detail_of_topic(d, t, topic, width);
        return topic->name;
    }
    if (v->detail_of_topic || !n_nodes)
        return "nothing selected";
    const struct table_node *node =
        &t->nodes[nodes[look_selected_node(v, t, nodes, n_nodes)]];
    detail_of_node(d, node, width);
    return node->name;
}

static void draw_detail(struct page *p, const struct detail *d, const char *name,
                        struct look *v, size_t room)
{
    char text[64];

    if (!room--)
        return;
    snprintf(text, sizeof text, " %s", name);
    title(p, v, LOOK_DETAIL, text);
    size_t last = d->n > room ? d->n - room : 0;
    if (v->detail_line > last)
        v->detail_line = last;
    for (size_t i = v->detail_line, k = 0; i < d->n && k < room; i++, k++)
        page_add(p, "%s", d->lines[i]);
}

static enum page_tone log_tone(const char *level)
{
    return !strcmp(level, "error")     ? PAGE_BAD
           : !strcmp(level, "warning") ? PAGE_NOTE
           : !strcmp(level, "debug")   ? PAGE_FAINT
                                       : PAGE_PLAIN;
}

static void draw_log(struct page *p, const struct table *t, struct look *v, size_t room)
{
    char text[PAGE_LINE_SIZE];

    if (!room--)
        return;
    title(p, v, LOOK_LOG, t->n_logs ? " LOG" : " LOG (nothing was said yet)");
    size_t most = t->n_logs > room ? t->n_logs - room : 0;
    if (v->log_line > most)
        v->log_line = most;
    size_t end = t->n_logs - v->log_line;
    for (size_t i = end > room ? end - room : 0; i < end; i++) {
        layout_log(&t->logs[i], text, sizeof text);
        struct page_line *line = page_add(p, " %s", text);
        if (line) {
            line->tone = log_tone(t->logs[i].level);
            line->tone_n = p->width;
        }
    }
}

static void draw_head(struct page *p, const struct table *t, const struct look *v)
{
    char summary[PAGE_LINE_SIZE], scan[PAGE_LINE_SIZE], cpu[16];

    layout_summary(t, summary, sizeof summary);
    text_percent(cpu, sizeof cpu, t->own_cpu);
    struct page_line *line = page_add(
        p, "%s%s%s%s%s%s  (top itself: %s%% CPU)", v->paused ? "PAUSED  " : "", summary,
        v->sort ? "  sorted by " : "", v->sort ? look_sort_name(v->sort) : "",
        *v->filter ? "  names with " : "", v->filter, cpu);
    if (line && v->paused) {
        line->tone = PAGE_NOTE;
        line->tone_n = 6;
    }
    layout_scan(&t->scan, scan, sizeof scan);
    page_add(p, "%s", scan);
}

static void draw_keys(struct page *p, const struct look *v)
{
    page_fill(p, p->height - 1);
    struct page_line *line =
        v->typing ? page_add(p, "/%s_   part of a name; enter keeps it, escape clears it",
                             v->filter)
                  : page_add(p, "q quit  tab panel  arrows select  s sort  p pause  "
                                "/ filter  h help");
    if (line)
        line->kind = PAGE_TITLE;
}

/* Those that somebody publishes; the others come behind them. */
static size_t count_present(const struct table *t, const size_t *topics, size_t n)
{
    size_t present = 0;

    for (size_t i = 0; i < n; i++)
        present += t->topics[topics[i]].state != TABLE_ABSENT;
    return present;
}

static void draw_panels(struct page *p, const struct table *t, struct look *v)
{
    size_t nodes[TABLE_MAX_NODES], topics[TABLE_MAX_TOPICS];
    size_t n_nodes = look_nodes(v, t, nodes), n_topics = look_topics(v, t, topics);
    struct detail detail;
    const char *name = make_detail(&detail, t, v, p->width);
    struct share s[LOOK_PANELS] = {
        [LOOK_NODES] = share_want(3, n_nodes, n_nodes),
        [LOOK_TOPICS] = share_want(3, count_present(t, topics, n_topics), n_topics),
        [LOOK_OBJECTS] = share_want(3, t->objects.n, t->objects.n),
        [LOOK_DETAIL] = share_want(2, detail.n, detail.n),
        [LOOK_LOG] = share_want(2, FAIR_LOGS, TABLE_MAX_LOGS)};

    if (!t->objects.known)
        s[LOOK_OBJECTS] = (struct share){0};
    share_height(s, v->focus, (size_t)(p->height - FRAME_LINES));
    draw_nodes(p, t, v, s[LOOK_NODES].got);
    draw_topics(p, t, v, s[LOOK_TOPICS].got);
    draw_objects(p, t, v, s[LOOK_OBJECTS].got);
    draw_detail(p, &detail, name, v, s[LOOK_DETAIL].got);
    draw_log(p, t, v, s[LOOK_LOG].got);
}

void layout_draw(struct page *p, const struct table *t, struct look *v)
{
    draw_head(p, t, v);
    if (v->help)
        help_draw(p);
    else if (p->height > FRAME_LINES)
        draw_panels(p, t, v);
    if (p->n_lines < p->height)
        draw_keys(p, v);
}
