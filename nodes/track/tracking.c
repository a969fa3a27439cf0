/* SPDX-License-Identifier: MIT */
#include "nodes/track/tracking.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"
#include "msgs/topics.h"
#include "nodes/rt/health.h"
#include "nodes/rt/launchfile_pipeline.h"

#define BEHIND_NS INT64_C(150000000) /* an image so old has others waiting behind it */
#define LISTS_NS  INT64_C(250000000) /* but a list comes at least so often */
#define SEARCH_S  60.0               /* at most, in the volume of a scan */

struct listed { /* the volume that the newest list is of */
    bool any;
    uint32_t scan;
    int64_t capture_ns;
};

struct taken { /* the volume that was taken last */
    int64_t epoch_ns;
    uint64_t sequence;
};

struct tracking {
    struct node *node;
    struct object_tracker *tracker;
    struct object_list list; /* the newest */
    struct listed last;
    struct taken taken;
    struct pace pace; /* of lists */
    struct node_dropped dropped;
    struct track_counts told;
};

int tracking_create(struct tracking **out, struct node *node,
                    const struct object_tracker_config *cfg)
{
    struct tracking *t = calloc(1, sizeof *t);

    if (!t)
        return -ENOMEM;
    t->node = node;
    t->dropped.count = "volumes before the survey";
    int err = object_tracker_create(&t->tracker, cfg);
    if (err)
        free(t);
    else
        *out = t;
    return err;
}

static bool has_survey(const struct tracking *t)
{
    return object_tracker_has_survey(t->tracker);
}

bool tracking_has_wall(const struct tracking *t)
{
    return object_tracker_has_wall(t->tracker);
}

struct track_counts tracking_counts(const struct tracking *t)
{
    return object_tracker_counts(t->tracker);
}

static size_t counts(void *self, struct device_count *out)
{
    const struct tracking *t = self;

    out[0] = (struct device_count){"lists", t->pace.done};
    out[1] = (struct device_count){"images skipped", t->pace.skipped};
    return 2 + node_dropped_count(&t->dropped, out + 2);
}

static void tell_state(struct tracking *t)
{
    bool late = pace_is_late(&t->pace, node_machine_ns(t->node));

    if (!has_survey(t))
        return;
    if (!tracking_has_wall(t))
        node_state(t->node, ANLOS__HEALTH__STATE__DEGRADED,
                   "no wall is known: where objects really are is not known");
    else if (late)
        node_state(t->node, ANLOS__HEALTH__STATE__DEGRADED,
                   "images are skipped, for they come faster than objects are found");
    else
        node_state(t->node, ANLOS__HEALTH__STATE__READY, "ready");
}

/* What the tracker had to leave out, said once for each time that it grew. */
static void tell_losses(struct tracking *t)
{
    struct track_counts now = tracking_counts(t);

    if (now.crowded > t->told.crowded)
        node_log(t->node, LOG_LEVEL_WARNING,
                 "more objects than tracks or ids: %zu left out",
                 (size_t)(now.crowded - t->told.crowded));
    if (now.resets > t->told.resets)
        node_log(t->node, LOG_LEVEL_WARNING, "the clock went back: all tracks restart");
    t->told = now;
}

int tracking_survey(struct tracking *t, const Anlos__Survey *message, struct error *why)
{
    struct survey survey;

    if (has_survey(t) && object_tracker_survey_id(t->tracker) == message->id)
        return 0;
    int err = survey_from_message(&survey, message, why);
    if (err)
        return err;
    err = object_tracker_survey(t->tracker, &survey);
    survey_clear(&survey);
    return err ? error_say(why, err, "survey: %s", strerror(-err)) : 0;
}

static int take_survey(void *self, const struct node_message *in)
{
    struct tracking *t = self;
    struct error why = {""};
    int err = tracking_survey(t, (const Anlos__Survey *)in->content, &why);

    if (err) {
        node_state(t->node, ANLOS__HEALTH__STATE__FAULT, "%s", why.text);
    } else {
        tell_state(t);
        node_dropped_say(t->node, &t->dropped);
    }
    return err;
}

int tracking_walls(struct tracking *t, const Anlos__WallList *message, int64_t capture_ns,
                   struct error *why)
{
    struct walls walls;
    int err = walls_from_message(&walls, message, why);

    if (!err && object_tracker_walls(t->tracker, &walls, capture_ns))
        err = error_say(why, -EINVAL, "walls with a stamp that is none");
    return err;
}

static int take_walls(void *self, const struct node_message *in)
{
    struct tracking *t = self;
    struct error why = {""};

    if (tracking_walls(t, (const Anlos__WallList *)in->content, in->capture_ns, &why))
        node_log(t->node, LOG_LEVEL_WARNING, "walls: %s", why.text);
    else
        tell_state(t);
    tell_losses(t);
    return 0;
}

void tracking_ego(struct tracking *t, const Anlos__EgoMotion *ego, int64_t capture_ns)
{
    struct ego_motion motion;

    object_tracker_ego(t->tracker, ego_from_message(&motion, ego), capture_ns);
}

static int take_ego(void *self, const struct node_message *in)
{
    tracking_ego(self, (const Anlos__EgoMotion *)in->content, in->capture_ns);
    tell_losses(self);
    return 0;
}

int tracking_volume(struct tracking *t, const Anlos__Volume *message, int64_t capture_ns,
                    Anlos__DetectionList **out, struct error *why)
{
    struct volume volume;

    volume_from_message(&volume, message, capture_ns);
    int err = object_tracker_volume(t->tracker, &volume, &t->list, why);
    if (err)
        return launchfile_name_key(why, err);
    err = detections_from_objects(out, &t->list);
    return err ? error_say(why, err, "not enough memory to list objects") : 0;
}

/* How many previews there are, and how often a volume is repeated, depends on the
 * machine.  The lists of a replay do not: there is one for each final image. */
static bool makes_list(const struct tracking *t, const struct node_message *in)
{
    const Anlos__Volume *v = (const Anlos__Volume *)in->content;
    bool has_it = t->last.any && v->scan == t->last.scan &&
                  in->capture_ns == t->last.capture_ns;

    return !node_is_replayed(t->node) || !(v->preview || (v->repeated && has_it));
}

/* Of a fixed array: while this one was at work, new images replaced those that waited. */
static void count_replaced(struct tracking *t, const struct node_message *in)
{
    const Anlos__Volume *v = (const Anlos__Volume *)in->content;

    if (v->frame && in->epoch_ns == t->taken.epoch_ns && in->sequence > t->taken.sequence)
        t->pace.skipped += in->sequence - t->taken.sequence - 1;
    t->taken = (struct taken){in->epoch_ns, in->sequence};
}

/* Of a fixed array, whose images follow each other: what is old is worth less than what
 * waits behind it.  A replay waits. */
static bool skips(const struct tracking *t, const struct node_message *in)
{
    const Anlos__Volume *v = (const Anlos__Volume *)in->content;

    return !node_is_replayed(t->node) && v->frame && t->last.any &&
           node_now_ns(t->node) - in->capture_ns > BEHIND_NS &&
           in->capture_ns > t->last.capture_ns &&
           in->capture_ns - t->last.capture_ns < LISTS_NS;
}

/* A volume that cannot be used is logged; recon repeats the last one of a scan. */
static void list_objects(struct tracking *t, const struct node_message *in)
{
    const Anlos__Volume *v = (const Anlos__Volume *)in->content;
    Anlos__DetectionList *list = NULL;
    struct error why = {""};

    if (!v->frame)
        node_busy(t->node, SEARCH_S);
    int err = tracking_volume(t, v, in->capture_ns, &list, &why);
    if (err && !(err == -ESTALE && v->repeated))
        node_log(t->node, LOG_LEVEL_WARNING, "%s", why.text);
    if (err)
        return;
    t->last = (struct listed){true, v->scan, in->capture_ns};
    t->pace.done++;
    node_publish(t->node, topic_detections(), in->capture_ns, &list->base);
    detections_free(list);
    tell_state(t);
}

static int take_volume(void *self, const struct node_message *in)
{
    struct tracking *t = self;

    if (!has_survey(t)) {
        t->dropped.n++;
        return 0;
    }
    count_replaced(t, in);
    if (!makes_list(t, in))
        return 0;
    if (skips(t, in))
        t->pace.skipped++;
    else
        list_objects(t, in);
    tell_losses(t);
    return 0;
}

static const struct loop_input inputs[] = {
    {.topic = topic_survey, .take = take_survey},
    {.topic = topic_wall, .take = take_walls},
    {.topic = topic_ego, .take = take_ego},
    {.topic = topic_volume, .take = take_volume},
    {.topic = NULL},
};

static void destroy(void *self)
{
    tracking_destroy(self);
}

const struct loop tracking_loop = {
    .inputs = inputs, .waits_for = "the survey", .counts = counts, .close = destroy};

void tracking_destroy(struct tracking *t)
{
    if (!t)
        return;
    object_tracker_destroy(t->tracker);
    free(t);
}
