/* SPDX-License-Identifier: MIT */
/* nodes/wall/main.c: "survey", "echoes" or "wall/given", "ego" -> the walls -> "wall" */
#include <errno.h>

#include "msgs/topics.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/rt/loop.h"
#include "nodes/wall/finding.h"

#define LOOK_NS 100000000LL /* the walls move on while nothing comes */

struct run {
    struct node *node;
    struct finding *finding;
    enum wall_from from;
    size_t unusable; /* pings, said in the log already */
    struct node_dropped dropped;
    bool came;           /* something that decides what is told */
    int64_t look_due_ns; /* otherwise */
};

static size_t counts(void *ctx, struct device_count *out)
{
    const struct run *r = ctx;

    return node_dropped_count(&r->dropped, out);
}

static void tell_state(struct run *r, const Anlos__WallList *list)
{
    if (list->text[0])
        node_state(r->node, ANLOS__HEALTH__STATE__DEGRADED, "%s", list->text);
    else
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "%zu wall%s", list->n_walls,
                   list->n_walls == 1 ? "" : "s");
}

/* In a replay the survey comes as often as play repeats it, and a while without messages
 * is of the machine: neither decides what is told when. */
static int take_survey(void *self, const struct node_message *in)
{
    struct run *r = self;
    const Anlos__Survey *m = (const Anlos__Survey *)in->content;
    struct error why = {""};
    bool known = wall_finder_survey_id(finding_finder(r->finding)) == m->id;
    int err = finding_survey(r->finding, m, &why);

    if (err) {
        node_state(r->node, ANLOS__HEALTH__STATE__FAULT, "%s", why.text);
    } else if (!known) {
        tell_state(r, finding_walls(r->finding));
        node_dropped_say(r->node, &r->dropped);
    }
    r->came |= !node_is_replayed(r->node);
    return err;
}

static int take_ego(void *self, const struct node_message *in)
{
    struct run *r = self;

    finding_ego(r->finding, (const Anlos__EgoMotion *)in->content, in->capture_ns);
    r->came = true;
    return 0;
}

static int take_echoes(void *self, const struct node_message *in)
{
    struct run *r = self;

    if (!finding_echoes(r->finding, (const Anlos__Echoes *)in->content, in->capture_ns,
                        node_now_ns(r->node)))
        r->dropped.n++;
    size_t unusable = wall_finder_unusable(finding_finder(r->finding));
    if (unusable != r->unusable)
        node_log(r->node, LOG_LEVEL_WARNING, "%zu pings could not be used", unusable);
    r->unusable = unusable;
    r->came = true;
    return 0;
}

static int take_given(void *self, const struct node_message *in)
{
    struct run *r = self;
    struct error why = {""};

    if (finding_given(r->finding, (const Anlos__WallList *)in->content, in->capture_ns,
                      &why))
        node_log(r->node, LOG_LEVEL_WARNING, "%s", why.text);
    r->came = true;
    return 0;
}

/* In a replay, for the time that it is. */
static int take_ping(void *self, const struct node_message *in)
{
    (void)in;
    ((struct run *)self)->came = true;
    return 0;
}

static int64_t publish_due_ns(const void *self)
{
    const struct run *r = self;

    if (r->came)
        return 0;
    return node_is_replayed(r->node) ? LOOP_NEVER : r->look_due_ns;
}

static int publish(void *self)
{
    struct run *r = self;
    int64_t stamp_ns;
    const Anlos__WallList *list =
        finding_list(r->finding, node_now_ns(r->node), &stamp_ns);

    r->came = false;
    r->look_due_ns = node_machine_ns(r->node) + LOOK_NS;
    if (!list)
        return 0;
    node_publish(r->node, topic_wall(), stamp_ns, &list->base);
    tell_state(r, list);
    return 0;
}

static bool has_echoes(const void *self)
{
    return ((const struct run *)self)->from == WALL_FROM_ECHOES;
}

static bool needs_time(const void *self)
{
    const struct run *r = self;

    return r->from != WALL_FROM_ECHOES && node_is_replayed(r->node);
}

static bool has_given(const void *self)
{
    return ((const struct run *)self)->from == WALL_FROM_TOPIC;
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

static int run(struct run *r)
{
    const struct loop loop = {.inputs = inputs, .timers = timers};

    node_device(r->node, counts, r);
    node_state(r->node, ANLOS__HEALTH__STATE__STARTING, "waits for the survey");
    if (r->from == WALL_FROM_ECHOES && !launchfile_has_node(node_launch(r->node), "dsp"))
        node_log(r->node, LOG_LEVEL_WARNING,
                 "node dsp hears the echoes of walls, and the launch file has none: none "
                 "will be found; add it to nodes, or name the walls in the survey");
    int err = loop_run(r->node, &loop, r);
    node_device(r->node, NULL, NULL);
    return err;
}

int main(int argc, char **argv)
{
    struct run r = {.dropped = {.count = "pings before the survey"}};
    struct pipeline_config cfg;
    int err = node_create(&r.node, "wall", "Tells where the walls are that mirror sound.",
                          argc, argv);

    if (!r.node)
        return err;
    launchfile_pipeline(&cfg, node_launch(r.node));
    r.from = cfg.walls.map.from;
    r.look_due_ns = node_machine_ns(r.node) + LOOK_NS;
    err = finding_create(&r.finding, &cfg.walls);
    if (!err)
        err = run(&r);
    finding_destroy(r.finding);
    return node_finish(r.node, err);
}
