/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/doctor/drive_pipe.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"
#include "nodes/recon/volume_room.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "recon/survey.h"

#define BEGIN_NS     INT64_C(1000000000) /* stamps are above 0 */
#define WALL_SIGMA_M 0.02
#define WALL_TURN    (0.3 * M_PI / 180.0)

static int pack_survey(struct drive_world *w)
{
    uint8_t *bytes = NULL;
    size_t size;
    int err = survey_pack(room_survey(w->room), &bytes, &size);

    if (err)
        return err;
    w->survey = anlos__survey__unpack(NULL, size, bytes);
    free(bytes);
    return w->survey ? 0 : -ENOMEM;
}

int drive_world_create(struct drive_world *w, const struct drive_world_config *cfg,
                       struct error *why)
{
    *w = (struct drive_world){.begin_ns = BEGIN_NS};
    int err = room_load_drawn(&w->room, cfg->scene, cfg->firing, cfg->draw, why);
    if (err)
        return err;
    if (!room_is_drive(w->room))
        return error_say(why, -ENOTSUP, "%s: not a drive: the key \"drive\" is missing",
                         cfg->scene);
    const struct survey *s = room_survey(w->room);
    w->n_samples = room_frames(w->room, 1);
    w->n_speakers = cfg->n_speakers ? cfg->n_speakers : s->n_speakers;
    w->clipped = calloc(s->n_microphones, sizeof *w->clipped);
    w->speakers = calloc(w->n_speakers, sizeof *w->speakers);
    err = w->clipped && w->speakers ? pack_survey(w) : -ENOMEM;
    for (size_t i = 0; !err && i < w->n_speakers; i++)
        w->speakers[i] = cfg->n_speakers ? cfg->speakers[i] : (uint32_t)i;
    return err ? error_say(why, err, "%s: not enough memory", cfg->scene) : 0;
}

double drive_world_s(int64_t stamp_ns)
{
    return 1e-9 * (double)(stamp_ns - BEGIN_NS);
}

static int64_t start_ns(const struct drive_world *w, uint64_t n)
{
    double s = (double)room_stream_start(w->stream, n) /
               room_survey(w->room)->sample_rate_hz;
    return w->begin_ns + llround(1e9 * s);
}

int drive_world_shoot(struct drive_world *w, enum pass pass, struct error *why)
{
    if (w->stream)
        w->begin_ns = start_ns(w, w->n);
    const struct room_stream_config cfg = {.pass = pass,
                                           .speakers = w->speakers,
                                           .n_speakers = w->n_speakers,
                                           .start_s = drive_world_s(w->begin_ns)};
    room_stream_destroy(w->stream);
    w->stream = NULL;
    w->n = 0;
    int err = room_stream_create(&w->stream, w->room, &cfg);
    return err ? error_say(why, err, "sound of the drive: %s", strerror(-err)) : 0;
}

int drive_world_ping(struct drive_world *w, enum pass pass, Anlos__Ping *out,
                     int64_t *capture_ns)
{
    const struct survey *s = room_survey(w->room);
    const float *samples;
    uint64_t n = w->n++;
    int err = room_stream_ping(w->stream, n, &samples);

    if (err)
        return err;
    *capture_ns = start_ns(w, n);
    anlos__ping__init(out);
    out->survey_id = w->survey->id;
    out->scan = 1;
    out->pass = (Anlos__Pass)pass;
    out->speaker = w->speakers[n % w->n_speakers];
    out->frame = (uint32_t)(n / w->n_speakers) + 1;
    out->down = survey_is_down(s, n % w->n_speakers);
    out->samples =
        tensor_borrow_f32(&w->view, samples, 2, s->n_microphones, w->n_samples);
    out->n_clipped = out->n_not_finite = s->n_microphones;
    out->clipped = out->not_finite = w->clipped;
    out->valid = true;
    out->temperature_c = s->temperature_c;
    return 0;
}

void drive_world_ego(const struct drive_world *w, int64_t stamp_ns, Anlos__EgoMotion *out)
{
    struct room_ego ego;

    room_ego(w->room, drive_world_s(stamp_ns), &ego);
    anlos__ego_motion__init(out);
    out->speed_m_s = ego.speed_m_s;
    out->yaw_rate_rad_s = ego.yaw_rate_rad_s;
    out->standstill = ego.standstill;
    out->valid = true;
}

/* normal . p = distance of the array frame, in the vehicle's. */
void drive_world_wall(const struct drive_world *w, int64_t stamp_ns,
                      struct drive_walls *out)
{
    double n[3], distance_m;

    room_vehicle_wall(w->room, drive_world_s(stamp_ns), n, &distance_m);
    anlos__wall_list__init(&out->list);
    anlos__wall__init(&out->wall);
    anlos__vec3__init(&out->normal);
    out->normal.x = n[0];
    out->normal.y = n[1];
    out->normal.z = n[2];
    memset(out->covariance, 0, sizeof out->covariance);
    out->covariance[0] = out->covariance[3] = WALL_TURN * WALL_TURN;
    out->covariance[5] = WALL_SIGMA_M * WALL_SIGMA_M;
    out->wall.id = 1;
    out->wall.origin = ANLOS__WALL__ORIGIN__GIVEN;
    out->wall.normal = &out->normal;
    out->wall.distance_m = distance_m;
    out->wall.covariance = out->covariance;
    out->wall.n_covariance = 6;
    out->wall.existence = 1.0;
    out->walls[0] = &out->wall;
    out->list.walls = out->walls;
    out->list.n_walls = 1;
}

void drive_world_clear(struct drive_world *w)
{
    room_stream_destroy(w->stream);
    room_destroy(w->room);
    if (w->survey)
        anlos__survey__free_unpacked(w->survey, NULL);
    free(w->clipped);
    free(w->speakers);
}

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
