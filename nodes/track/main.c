/* SPDX-License-Identifier: MIT */
/* nodes/track/main.c: "survey", "wall", "ego", "volume" -> detection, the wall's mirror,
 * tracks -> "detections" */
#include <errno.h>

#include "msgs/convert.h"
#include "msgs/topics.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/rt/loop.h"
#include "nodes/rt/pace.h"
#include "nodes/track/tracking.h"

#define BEHIND_NS INT64_C(150000000) /* an image so old has others waiting behind it */
#define LISTS_NS  INT64_C(250000000) /* but a list comes at least so often */

#define SEARCH_S 60.0 /* at most, in the volume of a scan */

struct listed { /* the volume that the newest list is of */
    bool any;
    uint32_t scan;
    int64_t capture_ns;
};

struct taken { /* the volume that was taken last */
    int64_t epoch_ns;
    uint64_t sequence;
};

struct job {
    struct node *node;
    struct tracking *tracking;
    struct listed last;
    struct taken taken;
    struct pace pace; /* of lists */
    struct node_dropped dropped;
    struct track_counts told;
};

static size_t counts(void *ctx, struct device_count *out)
{
    const struct job *j = ctx;

    out[0] = (struct device_count){"lists", j->pace.done};
    out[1] = (struct device_count){"images skipped", j->pace.skipped};
    return 2 + node_dropped_count(&j->dropped, out + 2);
}

static void tell_state(struct job *j)
{
    bool late = pace_is_late(&j->pace, node_machine_ns(j->node));

    if (!tracking_has_survey(j->tracking))
        return;
    if (!tracking_has_wall(j->tracking))
        node_state(j->node, ANLOS__HEALTH__STATE__DEGRADED,
                   "no wall is known: where objects really are is not known");
    else if (late)
        node_state(j->node, ANLOS__HEALTH__STATE__DEGRADED,
                   "images are skipped, for they come faster than objects are found");
    else
        node_state(j->node, ANLOS__HEALTH__STATE__READY, "ready");
}

static int take_survey(void *self, const struct node_message *in)
{
    struct job *j = self;
    struct error why = {""};
    int err = tracking_survey(j->tracking, (const Anlos__Survey *)in->content, &why);

    if (err) {
        node_state(j->node, ANLOS__HEALTH__STATE__FAULT, "%s", why.text);
    } else {
        tell_state(j);
        node_dropped_say(j->node, &j->dropped);
    }
    return err;
}

/* What the tracker had to leave out, said once for each time that it grew. */
static void tell_losses(struct job *j)
{
    struct track_counts now = tracking_counts(j->tracking);

    if (now.crowded > j->told.crowded)
        node_log(j->node, LOG_LEVEL_WARNING,
                 "more objects than tracks or ids: %zu left out",
                 (size_t)(now.crowded - j->told.crowded));
    if (now.resets > j->told.resets)
        node_log(j->node, LOG_LEVEL_WARNING, "the clock went back: all tracks restart");
    j->told = now;
}

static int take_walls(void *self, const struct node_message *in)
{
    struct job *j = self;
    const Anlos__WallList *walls = (const Anlos__WallList *)in->content;
    struct error why = {""};

    if (tracking_walls(j->tracking, walls, in->capture_ns, &why))
        node_log(j->node, LOG_LEVEL_WARNING, "walls: %s", why.text);
    else
        tell_state(j);
    tell_losses(j);
    return 0;
}

static int take_ego(void *self, const struct node_message *in)
{
    struct job *j = self;

    tracking_ego(j->tracking, (const Anlos__EgoMotion *)in->content, in->capture_ns);
    tell_losses(j);
    return 0;
}

/* How many previews there are, and how often a volume is repeated, depends on the
 * machine.  The lists of a replay do not: there is one for each final image. */
static bool makes_list(const struct job *j, const struct node_message *in)
{
    const Anlos__Volume *v = (const Anlos__Volume *)in->content;
    bool has_it = j->last.any && v->scan == j->last.scan &&
                  in->capture_ns == j->last.capture_ns;

    return !node_is_replayed(j->node) || !(v->preview || (v->repeated && has_it));
}

/* Of a fixed array: while this one was at work, new images replaced those that waited. */
static void count_replaced(struct job *j, const struct node_message *in)
{
    const Anlos__Volume *v = (const Anlos__Volume *)in->content;

    if (v->frame && in->epoch_ns == j->taken.epoch_ns && in->sequence > j->taken.sequence)
        j->pace.skipped += in->sequence - j->taken.sequence - 1;
    j->taken = (struct taken){in->epoch_ns, in->sequence};
}

/* Of a fixed array, whose images follow each other: what is old is worth less than what
 * waits behind it.  A replay waits. */
static bool skips(const struct job *j, const struct node_message *in)
{
    const Anlos__Volume *v = (const Anlos__Volume *)in->content;

    return !node_is_replayed(j->node) && v->frame && j->last.any &&
           node_now_ns(j->node) - in->capture_ns > BEHIND_NS &&
           in->capture_ns > j->last.capture_ns &&
           in->capture_ns - j->last.capture_ns < LISTS_NS;
}

/* A volume that cannot be used is logged; recon repeats the last one of a scan. */
static void follow_volume(struct job *j, const struct node_message *in)
{
    const Anlos__Volume *v = (const Anlos__Volume *)in->content;
    Anlos__DetectionList *list = NULL;
    struct error why = {""};

    if (!tracking_has_survey(j->tracking)) {
        j->dropped.n++;
        return;
    }
    count_replaced(j, in);
    if (!makes_list(j, in))
        return;
    if (skips(j, in)) {
        j->pace.skipped++;
        return;
    }
    if (!v->frame)
        node_busy(j->node, SEARCH_S);
    int err = tracking_volume(j->tracking, v, in->capture_ns, &list, &why);
    if (err && !(err == -ESTALE && v->repeated))
        node_log(j->node, LOG_LEVEL_WARNING, "%s", why.text);
    if (err)
        return;
    j->last = (struct listed){true, v->scan, in->capture_ns};
    j->pace.done++;
    node_publish(j->node, topic_detections(), in->capture_ns, &list->base);
    detections_free(list);
    tell_state(j);
}

static int take_volume(void *self, const struct node_message *in)
{
    follow_volume(self, in);
    tell_losses(self);
    return 0;
}

static const struct loop_input inputs[] = {
    {.topic = topic_survey, .take = take_survey},
    {.topic = topic_wall, .take = take_walls},
    {.topic = topic_ego, .take = take_ego},
    {.topic = topic_volume, .take = take_volume},
    {.topic = NULL},
};

static int run(struct job *j)
{
    const struct loop loop = {.inputs = inputs};

    node_device(j->node, counts, j);
    node_state(j->node, ANLOS__HEALTH__STATE__STARTING, "waits for the survey");
    int err = loop_run(j->node, &loop, j);
    node_device(j->node, NULL, NULL);
    return err;
}

int main(int argc, char **argv)
{
    struct job j = {.dropped = {.count = "volumes before the survey"}};
    struct pipeline_config cfg;
    int err = node_create(&j.node, "track", "Finds the hidden objects in the image.",
                          argc, argv);

    if (!j.node)
        return err;
    launchfile_pipeline(&cfg, node_launch(j.node));
    err = tracking_create(&j.tracking, &cfg.tracker);
    if (!err)
        err = run(&j);
    tracking_destroy(j.tracking);
    return node_finish(j.node, err);
}
