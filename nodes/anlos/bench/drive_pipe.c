#include "nodes/anlos/bench/drive_pipe.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "nodes/rt/objects.h"

static int create_steps(struct drive_pipe *p, size_t threads, struct complaint *why)
{
    const struct launchfile *l = p->launch;
    const struct dsp_config dsp = {.window = l->dsp.window,
                                   .compression = l->dsp.compression,
                                   .background = l->dsp.background,
                                   .background_s = l->dsp.background_s};
    const struct steady_config steady = {.threads = threads,
                                         .window = l->dsp.window,
                                         .compression = l->dsp.compression,
                                         .pings = l->recon.frames.pings,
                                         .sum = l->recon.frames.sum,
                                         .every_ping = l->recon.frames.every_ping,
                                         .moving_only = l->dsp.background ==
                                                        BACKGROUND_ADAPTIVE};
    const struct room_object *hidden;
    struct tracking_config track;
    int err = dsp_create(&p->dsp, &dsp);

    if (!err)
        err = steady_create(&p->steady, &steady);
    tracking_config(&track, l);
    track.mode = LAUNCH_TRACK_TRACKS;
    if (!err)
        err = tracking_create(&p->tracker, &track);
    track.mode = LAUNCH_TRACK_LISTS;
    if (!err && room_objects(p->world.room, &hidden))
        err = tracking_create(&p->detector, &track);
    return err ? complain(why, err, "processing: %s", strerror(-err)) : 0;
}

static int create_wall(struct drive_pipe *p, struct complaint *why)
{
    const struct launchfile *l = p->launch;
    const struct listener_config cfg = {.vertical = l->wall.vertical,
                                        .vertical_rad = l->wall.vertical_deg * M_PI / 180,
                                        .reach_m = l->wall.reach_m,
                                        .every_s = l->wall.every_s};
    int err = survey_from_message(&p->survey, p->world.survey, why);

    if (err)
        return err;
    keeper_init(&p->keeper, l);
    keeper_survey(&p->keeper, &p->survey);
    return l->wall.from == WALL_FROM_ECHOES
               ? listener_create(&p->listener, &cfg, &p->survey, why)
               : 0;
}

static int tell_survey(struct drive_pipe *p, struct complaint *why)
{
    const Anlos__Survey *s = p->world.survey;
    int err = dsp_survey(p->dsp, s, why);

    if (!err)
        err = steady_survey(p->steady, s, why);
    if (!err)
        err = tracking_survey(p->tracker, s, why);
    return err || !p->detector ? err : tracking_survey(p->detector, s, why);
}

/* -- messages ---------------------------------------------------------------------------
 */

static void tell_ego(struct drive_pipe *p, int64_t until_ns)
{
    Anlos__EgoMotion m;

    for (; p->ego_ns <= until_ns; p->ego_ns += DRIVE_EGO_NS) {
        drive_world_ego(&p->world, p->ego_ns, &m);
        dsp_ego(p->dsp, &m, p->ego_ns);
        steady_ego(p->steady, &m, p->ego_ns);
        tracking_ego(p->tracker, &m, p->ego_ns);
        if (p->detector)
            tracking_ego(p->detector, &m, p->ego_ns);
        if (p->has_keeper)
            keeper_ego(&p->keeper, &m, p->ego_ns);
    }
}

static int tell_wall(struct drive_pipe *p, const Anlos__Ping *ping, int64_t stamp_ns,
                     struct complaint *why)
{
    struct drive_walls given;
    struct wall_estimates heard;
    bool blind = false;
    int err = 0;

    keeper_advance(&p->keeper, stamp_ns);
    if (p->listener &&
        listener_ping(p->listener, ping, stamp_ns, keeper_path(&p->keeper), &heard,
                      &blind) &&
        !blind)
        keeper_estimates(&p->keeper, &heard);
    if (stamp_ns < p->wall_ns)
        return 0;
    p->wall_ns = stamp_ns + DRIVE_WALL_NS;
    if (p->keeper.from == WALL_FROM_TOPIC) {
        drive_world_wall(&p->world, stamp_ns, &given);
        err = keeper_given(&p->keeper, &given.list, stamp_ns, why);
    }
    const Anlos__WallList *walls = keeper_list(&p->keeper);
    if (!err)
        err = steady_walls(p->steady, walls, stamp_ns, why);
    if (!err)
        err = tracking_walls(p->tracker, walls, stamp_ns, why);
    return err || !p->detector ? err : tracking_walls(p->detector, walls, stamp_ns, why);
}

/* true: an image is due. */
static int take_ping(struct drive_pipe *p, Anlos__Pass pass, bool *due,
                     struct complaint *why)
{
    struct dsp_output out;
    Anlos__Ping ping;
    int64_t stamp_ns;
    char note[128];

    *due = false;
    int err = drive_world_ping(&p->world, pass, &ping, &stamp_ns);
    if (err)
        return complain(why, err, "sound of the drive: %s", strerror(-err));
    tell_ego(p, stamp_ns + llround(1e9 * p->ping_s));
    if (p->has_keeper)
        err = tell_wall(p, &ping, stamp_ns, why);
    if (err)
        return err;
    dsp_stamp(p->dsp, stamp_ns);
    dsp_ping(p->dsp, &ping, &out);
    if (out.has_traces)
        *due = steady_traces(p->steady, &out.traces, stamp_ns, note, sizeof note);
    return 0;
}

/* -- from beginning to end --------------------------------------------------------------
 */

static int take_background(struct drive_pipe *p, struct complaint *why)
{
    size_t n = p->launch->scan.background_frames * p->world.n_speakers;
    bool due;
    int err = drive_world_shoot(&p->world, ANLOS__PASS__BACKGROUND, why);

    for (size_t i = 0; !err && i < n; i++)
        err = take_ping(p, ANLOS__PASS__BACKGROUND, &due, why);
    return err;
}

static bool has_wall_node(const struct launchfile *l)
{
    return launchfile_has_node(l, "wall");
}

int drive_pipe_create(struct drive_pipe *p, const struct launchfile *l, const char *scene,
                      uint32_t draw, size_t threads, struct complaint *why)
{
    struct firing firing;
    const struct drive_world_config world = {.scene = scene,
                                             .firing = &firing,
                                             .draw = draw,
                                             .speakers = l->scan.speakers,
                                             .n_speakers = l->scan.n_speakers};

    *p = (struct drive_pipe){.launch = l, .has_keeper = has_wall_node(l)};
    int err = firing_from_uri(&firing, l->array.uri, why);
    if (!err)
        err = drive_world_create(&p->world, &world, why);
    if (!err)
        err = create_steps(p, threads, why);
    if (!err)
        err = tell_survey(p, why);
    if (!err && p->has_keeper)
        err = create_wall(p, why);
    if (err)
        return err;
    p->ego_ns = p->wall_ns = p->world.begin_ns;
    p->ping_s = (double)p->world.n_samples / room_survey(p->world.room)->sample_rate_hz;
    if (l->scan.background)
        err = take_background(p, why);
    return err ? err : drive_world_shoot(&p->world, ANLOS__PASS__SCENE, why);
}

int drive_pipe_next(struct drive_pipe *p, struct drive_image *out, struct complaint *why)
{
    Anlos__Volume volume;
    bool due = false;
    int err = 0;

    *out = (struct drive_image){.tracks = NULL};
    while (!err && !due)
        err = take_ping(p, ANLOS__PASS__SCENE, &due, why);
    if (err)
        return err;
    steady_image(p->steady, &volume);
    int64_t stamp_ns = steady_capture_ns(p->steady);
    err = tracking_volume(p->tracker, &volume, stamp_ns, &out->tracks, why);
    if (!err && p->detector)
        err = tracking_volume(p->detector, &volume, stamp_ns, &out->detections, why);
    if (err) {
        objects_free(out->tracks);
        return err;
    }
    out->t_s = drive_world_s(stamp_ns);
    out->out_s = out->t_s + p->ping_s;
    return 0;
}

void drive_pipe_clear(struct drive_pipe *p)
{
    listener_destroy(p->listener);
    survey_clear(&p->survey);
    tracking_destroy(p->tracker);
    tracking_destroy(p->detector);
    steady_destroy(p->steady);
    dsp_destroy(p->dsp);
    drive_world_clear(&p->world);
}
