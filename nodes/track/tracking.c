#include "nodes/track/tracking.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"
#include "nodes/rt/launchfile_track.h"

#define WALLS_S 3.0 /* as wall.lost_s of a launch file */

struct tracking {
    struct object_tracker *tracker;
    struct object_list list; /* the newest */
};

void tracking_config(struct object_tracker_config *cfg, const struct launchfile *l)
{
    struct launch_track track = launch_track_default;

    if (l)
        track = l->track;
    *cfg = (struct object_tracker_config){
        .detector = {.threshold_db = track.threshold_db,
                     .min_existence = track.min_existence,
                     .cfar = track.cfar,
                     .false_alarm_rate = track.false_alarm_rate},
        .mode = track.mode,
        .clutter = track.clutter,
        .sidelobe_db = track.sidelobe_db};
    track_config_default(&cfg->track);
    cfg->track.life.confirm_hits = track.confirm_hits;
    cfg->track.life.confirm_of = track.confirm_of;
    cfg->track.life.confirm_existence = track.confirm_existence;
    cfg->track.detection_probability = track.detection_probability;
    cfg->track.acceleration_psd_m2_s3 = track.acceleration_psd;
    cfg->track.join_m = track.join_m;
    cfg->track.coast_s = track.coast_s;
    cfg->look_s = track.look_s;
    cfg->walls_s = l ? l->wall.lost_s : WALLS_S;
}

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
        return err;
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
