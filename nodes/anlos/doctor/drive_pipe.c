/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/doctor/drive_pipe.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "msgs/convert.h"
#include "nodes/recon/volume_room.h"
#include "nodes/rt/launchfile_pipeline.h"

enum { MOST_PINGS = 4 * FRAMES_MAX_PINGS }; /* for an image */

static int create_stages(struct drive_pipe *p, size_t threads, struct error *why)
{
    const struct room_object *hidden;
    struct pipeline_config cfg;

    launchfile_pipeline(&cfg, p->launch);
    cfg.is_static = true;
    cfg.array.threads = threads;
    cfg.tracker.mode = OBJECT_TRACKER_TRACKS;
    int err = pipeline_create(&p->pipeline, &cfg);
    cfg.tracker.mode = OBJECT_TRACKER_LISTS;
    if (!err && room_objects(p->world.room, &hidden))
        err = object_tracker_create(&p->detector, &cfg.tracker);
    return err ? error_say(why, err, "processing: %s", strerror(-err)) : 0;
}

/* One whose image a node could not publish is refused. */
static int plan(struct drive_pipe *p, struct error *why)
{
    struct survey survey;
    int err = survey_from_message(&survey, p->world.survey, why);

    if (err)
        return err;
    err = volume_room_check(&survey, why);
    if (!err)
        err = launchfile_name_key(why, pipeline_survey(p->pipeline, &survey, why));
    if (!err && p->detector && object_tracker_survey(p->detector, &survey))
        err = error_say(why, -ENOMEM, "survey: %s", strerror(ENOMEM));
    survey_clear(&survey);
    return err;
}

/* -- messages ---------------------------------------------------------------------------
 */

/* The detector goes by the walls of the tracks. */
static int tell_walls(struct drive_pipe *p, struct error *why)
{
    int64_t stamp_ns;
    uint64_t lists;
    const struct walls *walls = pipeline_known_walls(p->pipeline, &stamp_ns, &lists);

    if (!p->detector || lists == p->wall_lists)
        return 0;
    p->wall_lists = lists;
    return object_tracker_walls(p->detector, walls, stamp_ns)
               ? error_say(why, -EINVAL, "walls with a stamp that is none")
               : 0;
}

static int tell_ego(struct drive_pipe *p, int64_t until_ns, struct error *why)
{
    struct ego_motion motion;
    Anlos__EgoMotion m;
    int err = 0;

    for (; !err && p->ego_ns <= until_ns; p->ego_ns += DRIVE_EGO_NS) {
        drive_world_ego(&p->world, p->ego_ns, &m);
        const struct ego_motion *ego = ego_from_message(&motion, &m);
        if (p->detector)
            object_tracker_ego(p->detector, ego, p->ego_ns);
        err = pipeline_ego(p->pipeline, ego, p->ego_ns, p->ego_ns, why);
        if (!err)
            err = tell_walls(p, why);
    }
    return err;
}

/* What the vehicle says of its walls. */
static int tell_given(struct drive_pipe *p, int64_t until_ns, struct error *why)
{
    struct drive_walls given;
    struct walls walls;
    int err = 0;

    if (p->launch->wall.from != WALL_FROM_TOPIC)
        return 0;
    for (; !err && p->given_ns <= until_ns; p->given_ns += DRIVE_WALL_NS) {
        drive_world_wall(&p->world, p->given_ns, &given);
        err = walls_from_message(&walls, &given.list, why);
        if (!err)
            err = pipeline_given(p->pipeline, &walls, p->given_ns, p->given_ns, why);
        if (!err)
            err = tell_walls(p, why);
    }
    return err;
}

static int make_lists(struct drive_pipe *p, const struct pipeline_output *of,
                      struct drive_image *out, struct error *why)
{
    int64_t stamp_ns = of->image->capture_ns;
    int err = detections_from_objects(&out->tracks, of->objects);

    p->volume = *of->image;
    out->t_s = drive_world_s(stamp_ns);
    out->out_s = out->t_s + p->ping_s;
    if (err || !p->detector)
        return err ? error_say(why, err, "not enough memory to list objects") : 0;
    err = object_tracker_volume(p->detector, of->image, &p->detected, why);
    if (!err && detections_from_objects(&out->detections, &p->detected))
        err = error_say(why, -ENOMEM, "not enough memory to list objects");
    return err;
}

static void note(struct drive_pipe *p, const struct pipeline_output *made)
{
    const char *text = made->note[0] ? made->note : made->front ? made->front->note : "";

    if (text[0])
        snprintf(p->note, sizeof p->note, "%.*s", (int)sizeof p->note - 1, text);
}

/* *due: there is an image, whose lists are in out. */
static int take_ping(struct drive_pipe *p, enum pass pass, bool *due,
                     struct drive_image *out, struct error *why)
{
    struct pipeline_output made;
    Anlos__Ping message;
    struct ping ping;
    int64_t stamp_ns;

    *due = false;
    int err = drive_world_ping(&p->world, pass, &message, &stamp_ns);
    if (err)
        return error_say(why, err, "sound of the drive: %s", strerror(-err));
    int64_t end_ns = stamp_ns + llround(1e9 * p->ping_s);
    err = tell_ego(p, end_ns, why);
    if (!err)
        err = tell_given(p, end_ns, why);
    if (err)
        return err;
    ping_from_message(&ping, &message, stamp_ns);
    err = pipeline_ping(p->pipeline, &ping, end_ns, &made, why);
    if (!err)
        note(p, &made);
    *due = made.image != NULL;
    if (!err && made.image)
        err = make_lists(p, &made, out, why);
    return err ? err : tell_walls(p, why);
}

/* -- from beginning to end --------------------------------------------------------------
 */

static int take_background(struct drive_pipe *p, struct error *why)
{
    size_t n = p->launch->scan.background_frames * p->world.n_speakers;
    struct drive_image none; /* no image is due of a background */
    bool due;
    int err = drive_world_shoot(&p->world, PASS_BACKGROUND, why);

    for (size_t i = 0; !err && i < n; i++)
        err = take_ping(p, PASS_BACKGROUND, &due, &none, why);
    return err;
}

int drive_pipe_create(struct drive_pipe *p, const struct launchfile *l, const char *scene,
                      uint32_t draw, size_t threads, struct error *why)
{
    struct firing firing;
    const struct drive_world_config world = {.scene = scene,
                                             .firing = &firing,
                                             .draw = draw,
                                             .speakers = l->scan.speakers,
                                             .n_speakers = l->scan.n_speakers};

    *p = (struct drive_pipe){.launch = l};
    int err = firing_from_uri(&firing, l->array.uri, why);
    if (!err)
        err = drive_world_create(&p->world, &world, why);
    if (!err)
        err = create_stages(p, threads, why);
    if (!err)
        err = plan(p, why);
    if (err)
        return err;
    p->ego_ns = p->given_ns = p->world.begin_ns;
    p->ping_s = (double)p->world.n_samples / room_survey(p->world.room)->sample_rate_hz;
    if (l->scan.background)
        err = take_background(p, why);
    return err ? err : drive_world_shoot(&p->world, PASS_SCENE, why);
}

int drive_pipe_next(struct drive_pipe *p, struct drive_image *out, struct error *why)
{
    bool due = false;
    int err = 0;

    *out = (struct drive_image){.tracks = NULL};
    for (size_t i = 0; !err && !due; i++)
        err = i < MOST_PINGS ? take_ping(p, PASS_SCENE, &due, out, why)
                             : error_say(why, -ENODATA, "%d pings make no image%s%s",
                                         MOST_PINGS, p->note[0] ? ": " : "", p->note);
    if (!err)
        return 0;
    detections_free(out->tracks);
    detections_free(out->detections);
    *out = (struct drive_image){.tracks = NULL};
    return err;
}

void drive_pipe_clear(struct drive_pipe *p)
{
    object_tracker_destroy(p->detector);
    pipeline_destroy(p->pipeline);
    drive_world_clear(&p->world);
}
