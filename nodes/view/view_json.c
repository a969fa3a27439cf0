/* SPDX-License-Identifier: MIT */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "nodes/rt/export.h"
#include "nodes/view/view_state.h"

#define NS_PER_MS 1000000

json_t *view_scan_json(const Anlos__ScanStatus *s)
{
    return json_pack("{ss ss ss si si si si si si so ss}", "type", "scan", "state",
                     name_of_scan_state(s->state), "pass", name_of_pass(s->pass), "scan",
                     (int)s->scan, "position", (int)s->position, "done",
                     (int)s->pings_done, "expected", (int)s->pings_expected, "retaken",
                     (int)s->pings_retaken, "lost", (int)s->pings_lost, "left_s",
                     export_real(s->time_left_s), "text", s->text);
}

json_t *view_stage_json(const Anlos__StageState *s)
{
    return json_pack("{ss ss so so sb sb ss}", "type", "stage", "state",
                     name_of_stage_state(s->state), "position_m",
                     export_real(s->position_m), "target_m", export_real(s->target_m),
                     "homed", s->homed, "held", s->held, "text", s->text);
}

json_t *view_record_json(const Anlos__SaveStatus *s, bool may_save, int64_t now_ns)
{
    static const char *const states[] = {"keeps", "saves", "nothing"};
    unsigned state = (unsigned)s->state;

    return json_pack("{ss ss sb sI ss ss so so sI}", "type", "record", "state",
                     states[state < 3 ? state : 2], "may_save", may_save, "at",
                     (json_int_t)(now_ns / NS_PER_MS), "path", s->path, "error", s->error,
                     "before_s", export_real(s->before_s), "kept_s",
                     export_real(s->kept_s), "saved", (json_int_t)s->saved);
}

json_t *view_clock_json(const Anlos__Clock *c)
{
    return json_pack("{ss sf sf so sb sb ss}", "type", "clock", "at_s",
                     1e-9 * (double)(c->time_ns - c->start_ns), "span_s",
                     1e-9 * (double)(c->end_ns - c->start_ns), "rate",
                     export_real(c->rate), "paused", c->paused, "ended", c->ended, "bag",
                     c->bag);
}

/* Nodes in the order of the table of all nodes, that is, of the way the data goes. */
static size_t rank(const char *name)
{
    const char *const *names = topics_nodes();
    size_t i = 0;

    while (names[i] && strcmp(names[i], name))
        i++;
    return i;
}

static struct view_node *find_node(struct view *v, const char *name)
{
    for (size_t i = 0; i < v->n_nodes; i++)
        if (!strcmp(v->nodes[i].name, name))
            return &v->nodes[i];
    if (v->n_nodes == VIEW_MAX_NODES)
        return NULL;
    size_t at = v->n_nodes++;
    while (at && rank(v->nodes[at - 1].name) > rank(name))
        at--;
    struct view_node *n = &v->nodes[at];
    memmove(n + 1, n, (v->n_nodes - 1 - at) * sizeof *n);
    memset(n, 0, sizeof *n);
    snprintf(n->name, sizeof n->name, "%s", name);
    return n;
}

void view_take_health(struct view *v, const Anlos__Health *h, int64_t epoch_ns,
                      int64_t now_ns)
{
    struct view_node *n = find_node(v, h->node);

    if (!n || epoch_ns < n->epoch_ns) /* late, of the process before */
        return;
    double elapsed_s = h->uptime_s - n->uptime_s;
    n->cpu_share = epoch_ns != n->epoch_ns
                       ? (h->uptime_s > 0.0 ? h->cpu_s / h->uptime_s : 0.0)
                   : elapsed_s > 0.2 ? (h->cpu_s - n->cpu_s) / elapsed_s
                                     : n->cpu_share;
    if (epoch_ns != n->epoch_ns || elapsed_s > 0.2) {
        n->uptime_s = h->uptime_s;
        n->cpu_s = h->cpu_s;
    }
    n->epoch_ns = epoch_ns;
    n->heard_ns = now_ns;
    n->state = h->state;
    n->pid = h->pid;
    n->rss_bytes = h->rss_bytes;
    n->refused = h->refused;
    n->lost = 0;
    for (size_t i = 0; i < h->n_topics; i++)
        if (!h->topics[i]->published)
            n->lost += h->topics[i]->gaps + h->topics[i]->dropped;
    snprintf(n->text, sizeof n->text, "%s", h->text);
}

json_t *view_nodes_json(const struct view *v, int64_t now_ns)
{
    json_t *list = json_array();

    for (size_t i = 0; i < v->n_nodes; i++) {
        const struct view_node *n = &v->nodes[i];
        int64_t age_ns = now_ns - n->heard_ns;
        bool silent = age_ns > VIEW_SILENT_NS;
        json_array_append_new(
            list,
            json_pack("{ss ss ss si so so sI sI sI sI}", "node", n->name, "state",
                      silent ? "silent" : name_of_health_state(n->state), "text", n->text,
                      "pid", (int)n->pid, "cpu", export_real(n->cpu_share), "up_s",
                      export_real(n->uptime_s), "rss_bytes", (json_int_t)n->rss_bytes,
                      "lost", (json_int_t)n->lost, "refused", (json_int_t)n->refused,
                      "age_ms", (json_int_t)(age_ns / NS_PER_MS)));
    }
    return json_pack("{ss so}", "type", "nodes", "nodes", list);
}

/* A line may come over the bus and stand in the file for late comers. */
static bool is_known(const struct view *v, const Anlos__Log *l)
{
    uint64_t first = v->n_lines > VIEW_LINES ? v->n_lines - VIEW_LINES : 0;

    for (uint64_t i = first; i < v->n_lines; i++) {
        const struct view_line *line = &v->lines[i % VIEW_LINES];
        if (line->stamp_ns == l->stamp_ns && !strcmp(line->node, l->node) &&
            !strncmp(line->text, l->text, sizeof line->text - 1))
            return true;
    }
    return false;
}

void view_take_line(struct view *v, const Anlos__Log *l)
{
    if (is_known(v, l))
        return;
    struct view_line *line = &v->lines[v->n_lines++ % VIEW_LINES];

    line->stamp_ns = l->stamp_ns;
    line->level = name_of_log_level(l->level);
    line->repeats = l->repeats;
    line->left_out = l->left_out;
    snprintf(line->node, sizeof line->node, "%s", l->node);
    snprintf(line->text, sizeof line->text, "%s", l->text);
}

json_t *view_log_json(const struct view *v)
{
    json_t *list = json_array();
    uint64_t first = v->n_lines > VIEW_LINES ? v->n_lines - VIEW_LINES : 0;

    for (uint64_t i = first; i < v->n_lines; i++) {
        const struct view_line *l = &v->lines[i % VIEW_LINES];
        json_array_append_new(
            list, json_pack("{sI sI ss ss ss sI sI}", "id", (json_int_t)i, "ms",
                            (json_int_t)(l->stamp_ns / NS_PER_MS), "level", l->level,
                            "node", l->node, "text", l->text, "repeats",
                            (json_int_t)l->repeats, "left_out", (json_int_t)l->left_out));
    }
    return json_pack("{ss so}", "type", "log", "lines", list);
}
