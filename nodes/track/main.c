/* nodes/track/main.c: "survey", "wall", "ego", "volume" -> detection, the wall's mirror,
 * tracks -> "detections" */
#include <errno.h>

#include "msgs/topics.h"
#include "nodes/rt/node.h"
#include "nodes/rt/objects.h"
#include "nodes/track/tracking.h"

static void tell_state(struct node *node, const struct tracking *t)
{
    if (!tracking_has_survey(t))
        return;
    if (!tracking_has_wall(t))
        node_state(node, ANLOS__HEALTH__STATE__DEGRADED,
                   "no wall is known: positions are those of the mirror images");
    else
        node_state(node, ANLOS__HEALTH__STATE__READY, "ready");
}

static int take_survey(struct node *node, struct tracking *t, const Anlos__Survey *survey)
{
    struct complaint why = {""};
    int err = tracking_survey(t, survey, &why);

    if (err)
        node_state(node, ANLOS__HEALTH__STATE__FAULT, "%s", why.text);
    else
        tell_state(node, t);
    return err;
}

static void take_walls(struct node *node, struct tracking *t,
                       const struct node_message *in)
{
    struct complaint why = {""};

    if (tracking_walls(t, (const Anlos__WallList *)in->content, in->capture_ns, &why))
        node_log(node, LOG_LEVEL_WARNING, "walls: %s", why.text);
    else
        tell_state(node, t);
}

struct listed { /* the volume that the newest list is of */
    bool any;
    uint32_t scan;
    int64_t capture_ns;
};

/* How many previews there are, and how often a volume is repeated, depends on the
 * machine.  The lists of a replay do not: there is one for each final image. */
static bool makes_list(const struct node *node, const struct listed *last,
                       const struct node_message *in)
{
    const Anlos__Volume *v = (const Anlos__Volume *)in->content;
    bool has_it = last->any && v->scan == last->scan &&
                  in->capture_ns == last->capture_ns;

    return !node_is_replayed(node) || !(v->preview || (v->repeated && has_it));
}

/* A volume that cannot be used is logged; recon repeats the last one of a scan. */
static void take_volume(struct node *node, struct tracking *t, struct listed *last,
                        const struct node_message *in)
{
    const Anlos__Volume *v = (const Anlos__Volume *)in->content;
    Anlos__DetectionList *list = NULL;
    struct complaint why = {""};

    if (!makes_list(node, last, in))
        return;
    int err = tracking_volume(t, v, in->capture_ns, &list, &why);
    if (err && !(err == -ESTALE && v->repeated))
        node_log(node, LOG_LEVEL_WARNING, "%s", why.text);
    if (err)
        return;
    *last = (struct listed){true, v->scan, in->capture_ns};
    node_publish(node, topic_detections(), in->capture_ns, &list->base);
    objects_free(list);
}

/* What the tracker had to leave out, said once for each time that it grew. */
static void tell_losses(struct node *node, const struct tracking *t,
                        struct track_counts *told)
{
    struct track_counts now = tracking_counts(t);

    if (now.crowded > told->crowded)
        node_log(node, LOG_LEVEL_WARNING, "more objects than tracks or ids: %zu left out",
                 (size_t)(now.crowded - told->crowded));
    if (now.resets > told->resets)
        node_log(node, LOG_LEVEL_WARNING, "the clock went back: all tracks begin anew");
    *told = now;
}

static int take(struct node *node, struct tracking *t, struct listed *last,
                const struct node_message *in)
{
    if (in->topic == topic_survey())
        return take_survey(node, t, (const Anlos__Survey *)in->content);
    if (in->topic == topic_wall())
        take_walls(node, t, in);
    else if (in->topic == topic_ego())
        tracking_ego(t, (const Anlos__EgoMotion *)in->content, in->capture_ns);
    else
        take_volume(node, t, last, in);
    return 0;
}

static int run(struct node *node, struct tracking *t)
{
    const struct topic *const topics[] = {topic_survey(), topic_wall(), topic_ego(),
                                          topic_volume()};
    struct node_message in;
    struct listed last = {.any = false};
    struct track_counts told = {0};
    int err = node_order_replay(node);

    for (size_t i = 0; !err && i < sizeof topics / sizeof *topics; i++)
        err = node_subscribe(node, topics[i]);
    node_state(node, ANLOS__HEALTH__STATE__STARTING, "waits for the survey");
    while (!err) {
        err = node_next(node, &in, -1);
        if (!err)
            err = take(node, t, &last, &in);
        tell_losses(node, t, &told);
    }
    return err;
}

int main(int argc, char **argv)
{
    struct node *node;
    struct tracking *t = NULL;
    struct tracking_config cfg;
    int err =
        node_create(&node, "track", "Finds the hidden objects in the image.", argc, argv);

    if (err)
        return err - 1;
    tracking_config(&cfg, node_launch(node));
    err = tracking_create(&t, &cfg);
    if (!err)
        err = run(node, t);
    tracking_destroy(t);
    return node_finish(node, err);
}
