/* SPDX-License-Identifier: MIT */
#include "nodes/track/tracking.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"
#include "nodes/rt/launchfile_pipeline.h"

struct tracking {
    struct object_tracker *tracker;
    struct object_list list; /* the newest */
};

int tracking_create(struct tracking **out, const struct object_tracker_config *cfg)
{
    struct tracking *t = calloc(1, sizeof *t);

    if (!t)
        return -ENOMEM;
    int err = object_tracker_create(&t->tracker, cfg);
    if (err)
        free(t);
    else
        *out = t;
    return err;
}

int tracking_survey(struct tracking *t, const Anlos__Survey *message, struct error *why)
{
    struct survey survey;

    if (tracking_has_survey(t) && object_tracker_survey_id(t->tracker) == message->id)
        return 0;
    int err = survey_from_message(&survey, message, why);
    if (err)
        return err;
    err = object_tracker_survey(t->tracker, &survey);
    survey_clear(&survey);
    return err ? error_say(why, err, "survey: %s", strerror(-err)) : 0;
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

void tracking_ego(struct tracking *t, const Anlos__EgoMotion *ego, int64_t capture_ns)
{
    struct ego_motion motion;

    object_tracker_ego(t->tracker, ego_from_message(&motion, ego), capture_ns);
}

bool tracking_has_survey(const struct tracking *t)
{
    return object_tracker_has_survey(t->tracker);
}

bool tracking_has_wall(const struct tracking *t)
{
    return object_tracker_has_wall(t->tracker);
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

struct track_counts tracking_counts(const struct tracking *t)
{
    return object_tracker_counts(t->tracker);
}

void tracking_destroy(struct tracking *t)
{
    if (!t)
        return;
    object_tracker_destroy(t->tracker);
    free(t);
}
