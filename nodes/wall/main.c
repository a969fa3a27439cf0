/* SPDX-License-Identifier: MIT */
/* nodes/wall/main.c: "survey", "echoes" or "wall/given", "ego" -> the walls -> "wall" */
#include <errno.h>

#include "msgs/topics.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/rt/node.h"
#include "nodes/wall/finding.h"

struct run {
    struct node *node;
    struct finding *finding;
    enum wall_from from;
    size_t unusable; /* pings, said in the log already */
    struct node_dropped dropped;
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

static int take_survey(struct run *r, const Anlos__Survey *m)
{
    struct error why = {""};
    bool known = wall_finder_survey_id(finding_finder(r->finding)) == m->id;
    int err = finding_survey(r->finding, m, &why);

    if (err) {
        node_state(r->node, ANLOS__HEALTH__STATE__FAULT, "%s", why.text);
    } else if (!known) {
        tell_state(r, finding_walls(r->finding));
        node_dropped_say(r->node, &r->dropped);
    }
    return err;
}

static void take_echoes(struct run *r, const struct node_message *in)
{
    if (!finding_echoes(r->finding, (const Anlos__Echoes *)in->content, in->capture_ns,
                        node_now_ns(r->node)))
        r->dropped.n++;
    size_t unusable = wall_finder_unusable(finding_finder(r->finding));
    if (unusable != r->unusable)
        node_log(r->node, LOG_LEVEL_WARNING, "%zu pings could not be used", unusable);
    r->unusable = unusable;
}

static void take_given(struct run *r, const struct node_message *in)
{
    struct error why = {""};

    if (finding_given(r->finding, (const Anlos__WallList *)in->content, in->capture_ns,
                      &why))
        node_log(r->node, LOG_LEVEL_WARNING, "%s", why.text);
}

static void publish(struct run *r)
{
    int64_t stamp_ns;
    const Anlos__WallList *list =
        finding_list(r->finding, node_now_ns(r->node), &stamp_ns);

    if (!list)
        return;
    node_publish(r->node, topic_wall(), stamp_ns, &list->base);
    tell_state(r, list);
}

/* In a replay the survey comes as often as play repeats it, and a while without messages
 * is of the machine: neither decides what is told when. */
static bool may_publish(const struct run *r, const struct topic *came)
{
    return !node_is_replayed(r->node) || (came && came != topic_survey());
}

static int subscribe(struct run *r)
{
    int err = node_subscribe(r->node, topic_survey());

    if (!err)
        err = node_subscribe(r->node, topic_ego());
    if (!err && r->from == WALL_FROM_ECHOES)
        err = node_subscribe(r->node, topic_echoes());
    else if (!err && node_is_replayed(r->node)) /* only for the time that it is */
        err = node_subscribe(r->node, topic_ping());
    if (!err && r->from == WALL_FROM_TOPIC)
        err = node_subscribe(r->node, topic_wall_given());
    return err;
}

static int run(struct run *r)
{
    struct node_message in;
    int err = subscribe(r);

    node_device(r->node, counts, r);
    node_state(r->node, ANLOS__HEALTH__STATE__STARTING, "waits for the survey");
    if (r->from == WALL_FROM_ECHOES && !launchfile_has_node(node_launch(r->node), "dsp"))
        node_log(r->node, LOG_LEVEL_WARNING,
                 "node dsp hears the echoes of walls, and the launch file has none: none "
                 "will be found; add it to nodes, or name the walls in the survey");
    while (!err) {
        in.topic = NULL;
        err = node_next(r->node, &in, 100);
        if (err == -ETIMEDOUT)
            err = 0;
        else if (!err && in.topic == topic_survey())
            err = take_survey(r, (const Anlos__Survey *)in.content);
        else if (!err && in.topic == topic_ego())
            finding_ego(r->finding, (const Anlos__EgoMotion *)in.content, in.capture_ns);
        else if (!err && in.topic == topic_echoes())
            take_echoes(r, &in);
        else if (!err && in.topic == topic_wall_given())
            take_given(r, &in);
        if (!err && may_publish(r, in.topic))
            publish(r);
    }
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
    err = finding_create(&r.finding, &cfg.walls);
    if (!err)
        err = run(&r);
    finding_destroy(r.finding);
    return node_finish(r.node, err);
}
