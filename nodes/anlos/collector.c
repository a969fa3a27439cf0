#include "nodes/anlos/collector.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/anlos/top/member.h"

struct collector {
    size_t n_members;
    struct member members[TABLE_MAX_NODES]; /* in the order of msgs/topics.h */
    struct table_scan scan;
    struct table_objects objects;
    size_t n_logs; /* ever come; the newest stands at (n_logs - 1) % TABLE_MAX_LOGS */
    struct table_log logs[TABLE_MAX_LOGS];
};

int collector_create(struct collector **out)
{
    const char *const *names = topics_nodes();
    struct collector *c = calloc(1, sizeof *c);

    if (!c)
        return -ENOMEM;
    for (; names[c->n_members] && c->n_members < TABLE_MAX_NODES; c->n_members++)
        snprintf(c->members[c->n_members].row.name, ENVELOPE_NODE_SIZE, "%s",
                 names[c->n_members]);
    *out = c;
    return 0;
}

static struct member *find_member(struct collector *c, const char *node)
{
    for (size_t i = 0; i < c->n_members; i++)
        if (!strcmp(c->members[i].row.name, node))
            return &c->members[i];
    return NULL;
}

void collector_health(struct collector *c, const Anlos__Health *m, int64_t epoch_ns,
                      int64_t now_ns)
{
    struct member *member = find_member(c, m->node);

    if (member)
        member_health(member, m, epoch_ns, now_ns);
}

void collector_presence(struct collector *c, const char *node, enum presence presence,
                        int64_t now_ns)
{
    struct member *member = find_member(c, node);

    if (member)
        member_presence(member, presence, now_ns);
}

void collector_scan(struct collector *c, const Anlos__ScanStatus *m)
{
    c->scan = (struct table_scan){.known = true,
                                  .state = m->state,
                                  .pass = m->pass,
                                  .scan = m->scan,
                                  .position = m->position,
                                  .done = m->pings_done,
                                  .expected = m->pings_expected,
                                  .retaken = m->pings_retaken,
                                  .given_up = m->pings_lost,
                                  .left_s = m->time_left_s};
    snprintf(c->scan.text, sizeof c->scan.text, "%s", m->text);
}

static void take_object(struct table_object *o, const Anlos__DetectionList *list,
                        const Anlos__Detection *d)
{
    const Anlos__Vec3 *p = d->position_m;

    *o = (struct table_object){.id = d->id,
                               .measurement = d->measurement,
                               .shape = d->shape,
                               .in_vehicle_frame = list->in_vehicle_frame,
                               .mirrored = list->mirrored,
                               .at_m = {NAN, NAN, NAN},
                               .velocity_m_s = {NAN, NAN},
                               .existence = d->existence,
                               .age_s = list->tracked ? d->age_s : NAN,
                               .unseen_s = list->tracked ? d->unseen_s : NAN};
    if (p)
        memcpy(o->at_m, (double[3]){p->x, p->y, p->z}, sizeof o->at_m);
    if (d->n_velocity_m_s == 2)
        memcpy(o->velocity_m_s, d->velocity_m_s, sizeof o->velocity_m_s);
}

void collector_objects(struct collector *c, const Anlos__DetectionList *m)
{
    c->objects.known = true;
    c->objects.n = 0;
    for (size_t i = 0; i < m->n_detections && c->objects.n < TABLE_MAX_OBJECTS; i++)
        if (m->detections[i]->measurement != ANLOS__MEASUREMENT__DELETED)
            take_object(&c->objects.list[c->objects.n++], m, m->detections[i]);
}

/* Of the n-th line that has ever come. */
static struct table_log *log_at(struct collector *c, size_t n)
{
    return &c->logs[n % TABLE_MAX_LOGS];
}

/* A line may come over the bus and stand in the file for late comers. */
static bool is_known(struct collector *c, const Anlos__Log *m)
{
    size_t first = c->n_logs > TABLE_MAX_LOGS ? c->n_logs - TABLE_MAX_LOGS : 0;

    for (size_t i = first; i < c->n_logs; i++) {
        const struct table_log *l = log_at(c, i);
        if (l->stamp_ns == m->stamp_ns && !strcmp(l->node, m->node) &&
            !strncmp(l->text, m->text, sizeof l->text - 1))
            return true;
    }
    return false;
}

/* The newest comes last, whenever it was heard of. */
static void sort_last(struct collector *c)
{
    size_t first = c->n_logs > TABLE_MAX_LOGS ? c->n_logs - TABLE_MAX_LOGS : 0;

    for (size_t i = c->n_logs - 1; i > first; i--) {
        struct table_log *before = log_at(c, i - 1), *l = log_at(c, i), other = *l;
        if (before->stamp_ns <= l->stamp_ns)
            break;
        *l = *before;
        *before = other;
    }
}

void collector_log(struct collector *c, const Anlos__Log *m)
{
    static const char *const levels[] = {"debug", "info", "warning", "error"};
    unsigned level = (unsigned)m->level;

    if (is_known(c, m))
        return;
    struct table_log *l = log_at(c, c->n_logs++);

    *l = (struct table_log){
        .stamp_ns = m->stamp_ns, .repeats = m->repeats, .left_out = m->left_out};
    snprintf(l->level, sizeof l->level, "%s", level < 4 ? levels[level] : "?");
    snprintf(l->node, sizeof l->node, "%s", m->node);
    snprintf(l->text, sizeof l->text, "%s", m->text);
    sort_last(c);
}

static void fill_logs(const struct collector *c, struct table *out)
{
    out->n_logs = c->n_logs < TABLE_MAX_LOGS ? c->n_logs : TABLE_MAX_LOGS;
    for (size_t i = 0; i < out->n_logs; i++)
        out->logs[i] = c->logs[(c->n_logs - out->n_logs + i) % TABLE_MAX_LOGS];
}

static void fill_nodes(const struct collector *c, int64_t now_ns, struct table *out)
{
    out->n_nodes = 0;
    out->lost = 0;
    for (size_t i = 0; i < c->n_members; i++) {
        if (!member_is_known(&c->members[i]))
            continue;
        struct table_node *row = &out->nodes[out->n_nodes++];
        member_row(&c->members[i], now_ns, &c->scan, row);
        out->lost += row->gaps + row->dropped;
        if (!strcmp(row->name, "scan"))
            out->scan.over = !table_node_is_alive(row);
        if (!strcmp(row->name, "track"))
            out->objects.over = !table_node_is_alive(row);
    }
}

void collector_table(const struct collector *c, int64_t now_ns, struct table *out)
{
    out->scan = c->scan;
    out->objects = c->objects;
    fill_nodes(c, now_ns, out);
    fill_logs(c, out);
    table_fill_topics(out);
}

void collector_destroy(struct collector *c)
{
    free(c);
}
