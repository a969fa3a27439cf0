/* SPDX-License-Identifier: MIT */
#include "nodes/wall/finding.h"

#include <errno.h>
#include <stdlib.h>

#include "msgs/convert.h"
#include "msgs/topics.h"
#include "nodes/rt/launchfile_pipeline.h"

#define LOOK_NS 100000000LL /* the walls move on while nothing comes */

struct finding {
    struct node *node;
    struct wall_finder *finder;
    enum wall_from from;
    struct returns_room room;
    struct walls_view view;
    Anlos__WallList list; /* the newest; borrows from both */
    size_t unusable;      /* pings, said in the log already */
    struct node_dropped dropped;
    bool came;           /* something that decides what is told */
    int64_t look_due_ns; /* otherwise */
};

int finding_create(struct finding **out, struct node *node,
                   const struct wall_finder_config *cfg)
{
    struct finding *f = calloc(1, sizeof *f);

    if (!f)
        return -ENOMEM;
    f->node = node;
    f->from = cfg->map.from;
    f->dropped.count = "pings before the survey";
    int err = wall_finder_create(&f->finder, cfg);
    if (err)
        free(f);
    else
        *out = f;
    return err;
}

static size_t counts(void *self, struct device_count *out)
{
    return node_dropped_count(&((const struct finding *)self)->dropped, out);
}

static const Anlos__WallList *message(struct finding *f, const struct walls *walls)
{
    walls_to_message(walls, wall_finder_map(f->finder)->text, &f->view, &f->list);
    return &f->list;
}

const Anlos__WallList *finding_list(struct finding *f, int64_t now_ns, int64_t *stamp_ns)
{
    const struct walls *walls = wall_finder_list(f->finder, now_ns, stamp_ns);

    return walls ? message(f, walls) : NULL;
}

const Anlos__WallList *finding_walls(struct finding *f)
{
    return message(f, wall_map_list(wall_finder_map(f->finder)));
}

struct wall_finder *finding_finder(const struct finding *f)
{
    return f->finder;
}

static void tell_state(struct finding *f, const Anlos__WallList *list)
{
    if (list->text[0])
        node_state(f->node, ANLOS__HEALTH__STATE__DEGRADED, "%s", list->text);
    else
        node_state(f->node, ANLOS__HEALTH__STATE__READY, "%zu wall%s", list->n_walls,
                   list->n_walls == 1 ? "" : "s");
}

int finding_survey(struct finding *f, const Anlos__Survey *m, struct error *why)
{
    struct survey survey;

    if (m->id && wall_finder_survey_id(f->finder) == m->id)
        return 0;
    int err = survey_from_message(&survey, m, why);
    if (err)
        return err;
    err = wall_finder_survey(f->finder, &survey, why);
    survey_clear(&survey);
    return launchfile_name_key(why, err);
}

/* In a replay the survey comes as often as play repeats it, and a while without messages
 * is of the machine: neither decides what is told when. */
static int take_survey(void *self, const struct node_message *in)
{
    struct finding *f = self;
    const Anlos__Survey *m = (const Anlos__Survey *)in->content;
    struct error why = {""};
    bool known = wall_finder_survey_id(f->finder) == m->id;
    int err = finding_survey(f, m, &why);

    if (err) {
        node_state(f->node, ANLOS__HEALTH__STATE__FAULT, "%s", why.text);
    } else if (!known) {
        tell_state(f, finding_walls(f));
        node_dropped_say(f->node, &f->dropped);
    }
    f->came |= !node_is_replayed(f->node);
    return err;
}

void finding_ego(struct finding *f, const Anlos__EgoMotion *m, int64_t capture_ns)
{
    struct ego_motion motion;

    wall_finder_ego(f->finder, ego_from_message(&motion, m), capture_ns);
    f->came = true;
}

static int take_ego(void *self, const struct node_message *in)
{
    finding_ego(self, (const Anlos__EgoMotion *)in->content, in->capture_ns);
    return 0;
}

bool finding_echoes(struct finding *f, const Anlos__Echoes *m, int64_t capture_ns,
                    int64_t now_ns)
{
    struct wall_returns returns;

    if (returns_from_message(&returns, &f->room, m, capture_ns))
        returns = (struct wall_returns){.ping = {.capture_ns = capture_ns}};
    f->came = true;
    return wall_finder_returns(f->finder, &returns, now_ns);
}

static int take_echoes(void *self, const struct node_message *in)
{
    struct finding *f = self;

    if (!finding_echoes(f, (const Anlos__Echoes *)in->content, in->capture_ns,
                        node_now_ns(f->node)))
        f->dropped.n++;
    size_t unusable = wall_finder_unusable(f->finder);
    if (unusable != f->unusable)
        node_log(f->node, LOG_LEVEL_WARNING, "%zu pings could not be used", unusable);
    f->unusable = unusable;
    return 0;
}

int finding_given(struct finding *f, const Anlos__WallList *m, int64_t capture_ns,
                  struct error *why)
{
    struct walls given;
    int err = walls_from_message(&given, m, why);

    f->came = true;
    return err ? err : wall_finder_given(f->finder, &given, capture_ns, why);
}

static int take_given(void *self, const struct node_message *in)
{
    struct finding *f = self;
    struct error why = {""};

    if (finding_given(f, (const Anlos__WallList *)in->content, in->capture_ns, &why))
        node_log(f->node, LOG_LEVEL_WARNING, "%s", why.text);
    return 0;
}

/* In a replay, for the time that it is. */
static int take_ping(void *self, const struct node_message *in)
{
    (void)in;
    ((struct finding *)self)->came = true;
    return 0;
}

static int64_t publish_due_ns(const void *self)
{
    const struct finding *f = self;

    if (f->came)
        return 0;
    return node_is_replayed(f->node) ? LOOP_NEVER : f->look_due_ns;
}

static int publish(void *self)
{
    struct finding *f = self;
    int64_t stamp_ns;
    const Anlos__WallList *list = finding_list(f, node_now_ns(f->node), &stamp_ns);

    f->came = false;
    f->look_due_ns = node_machine_ns(f->node) + LOOK_NS;
    if (!list)
        return 0;
    node_publish(f->node, topic_wall(), stamp_ns, &list->base);
    tell_state(f, list);
    return 0;
}

static bool has_echoes(const void *self)
{
    return ((const struct finding *)self)->from == WALL_FROM_ECHOES;
}

static bool needs_time(const void *self)
{
    return !has_echoes(self) && node_is_replayed(((const struct finding *)self)->node);
}

static bool has_given(const void *self)
{
    return ((const struct finding *)self)->from == WALL_FROM_TOPIC;
}

static const struct loop_input inputs[] = {
    {.topic = topic_survey, .take = take_survey},
    {.topic = topic_ego, .take = take_ego},
    {.topic = topic_echoes, .take = take_echoes, .wanted = has_echoes},
    {.topic = topic_ping, .take = take_ping, .wanted = needs_time},
    {.topic = topic_wall_given, .take = take_given, .wanted = has_given},
    {.topic = NULL},
};

static const struct loop_timer timers[] = {
    {.due_ns = publish_due_ns, .run = publish},
    {.run = NULL},
};

static void start(void *self)
{
    struct finding *f = self;

    f->look_due_ns = node_machine_ns(f->node) + LOOK_NS;
    if (has_echoes(f) && !launchfile_has_node(node_launch(f->node), "dsp"))
        node_log(f->node, LOG_LEVEL_WARNING,
                 "node dsp hears the echoes of walls, and the launch file has none: none "
                 "will be found; add it to nodes, or name the walls in the survey");
}

static void destroy(void *self)
{
    finding_destroy(self);
}

const struct loop finding_loop = {.inputs = inputs,
                                  .timers = timers,
                                  .waits_for = "the survey",
                                  .start = start,
                                  .counts = counts,
                                  .close = destroy};

void finding_destroy(struct finding *f)
{
    if (!f)
        return;
    wall_finder_destroy(f->finder);
    returns_room_clear(&f->room);
    free(f);
}
