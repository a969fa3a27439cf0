/* SPDX-License-Identifier: MIT */
#include "nodes/recon/steady.h"

#include <errno.h>
#include <stdlib.h>

#include "msgs/convert.h"
#include "nodes/recon/volume_room.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/rt/processors.h"

struct steady {
    struct static_array *array;
    struct traces_room traces;
    struct volume_view view;
    int64_t capture_ns; /* of the newest image */
};

int steady_create(struct steady **out, const struct static_array_config *asked)
{
    struct static_array_config cfg = *asked;
    struct steady *s = calloc(1, sizeof *s);

    if (!s)
        return -ENOMEM;
    cfg.threads = cfg.threads ? cfg.threads : processors_usable();
    int err = static_array_create(&s->array, &cfg);
    if (err)
        free(s);
    else
        *out = s;
    return err;
}

int steady_survey(struct steady *s, const Anlos__Survey *message, struct error *why)
{
    struct survey survey;

    if (message->id && static_array_survey_id(s->array) == message->id)
        return 0;
    static_array_forget(s->array);
    int err = survey_from_message(&survey, message, why);
    if (err)
        return err;
    err = volume_room_check(&survey, why);
    if (!err)
        err = static_array_survey(s->array, &survey, why);
    survey_clear(&survey);
    return launchfile_name_key(why, err);
}

void steady_ego(struct steady *s, const Anlos__EgoMotion *ego, int64_t capture_ns)
{
    struct ego_motion motion;

    static_array_ego(s->array, ego_from_message(&motion, ego), capture_ns);
}

int steady_walls(struct steady *s, const Anlos__WallList *message, int64_t capture_ns,
                 struct error *why)
{
    struct walls walls;
    int err = walls_from_message(&walls, message, why);

    if (!err)
        static_array_walls(s->array, &walls, capture_ns);
    return err;
}

bool steady_traces(struct steady *s, const Anlos__Traces *message, int64_t capture_ns,
                   char *note, size_t size)
{
    struct traces traces;

    traces_from_message(&traces, &s->traces, message, capture_ns);
    return static_array_traces(s->array, &traces, note, size);
}

void steady_image(struct steady *s, Anlos__Volume *out)
{
    struct volume volume;

    static_array_image(s->array, &volume);
    s->capture_ns = volume.capture_ns;
    volume_to_message(&volume, &s->view, out);
}

int64_t steady_capture_ns(const struct steady *s)
{
    return s->capture_ns;
}

const struct static_array *steady_array(const struct steady *s)
{
    return s->array;
}

void steady_destroy(struct steady *s)
{
    if (!s)
        return;
    static_array_destroy(s->array);
    free(s);
}
