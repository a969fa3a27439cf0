#include "nodes/anlos/doctor/drive_pipe.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "msgs/convert.h"
#include "nodes/recon/fixed.h"

static int create_steps(struct drive_pipe *p, size_t threads, struct error *why)
{
    const struct launchfile *l = p->launch;
    const struct room_object *hidden;
    struct frontend_config dsp;
    struct static_array_config steady;
    struct object_tracker_config track;
    struct wall_finder_config walls;

    dsp_config(&dsp, l);
    fixed_config(&steady, l);
    steady.threads = threads;
    int err = dsp_create(&p->dsp, &dsp);
    if (!err)
        err = steady_create(&p->steady, &steady);
    tracking_config(&track, l);
    track.mode = OBJECT_TRACKER_TRACKS;
    if (!err)
        err = tracking_create(&p->tracker, &track);
    track.mode = OBJECT_TRACKER_LISTS;
    if (!err && room_objects(p->world.room, &hidden))
        err = tracking_create(&p->detector, &track);
    finding_config(&walls, l);
    if (!err && launchfile_has_node(l, "wall"))
        err = finding_create(&p->finding, &walls);
    return err ? error_say(why, err, "processing: %s", strerror(-err)) : 0;
}

static int tell_survey(struct drive_pipe *p, struct error *why)
{
    const Anlos__Survey *s = p->world.survey;
    int err = dsp_survey(p->dsp, s, why);

    if (!err)
        err = steady_survey(p->steady, s, why);
    if (!err)
        err = tracking_survey(p->tracker, s, why);
    if (!err && p->detector)
        err = tracking_survey(p->detector, s, why);
    return err || !p->finding ? err : finding_survey(p->finding, s, why);
}

/* -- messages ---------------------------------------------------------------------------
 */

/* After each message, as the node looks whether a list is to be published now. */
static int tell_walls(struct drive_pipe *p, int64_t now_ns, struct error *why)
{
    int64_t stamp_ns;
    const Anlos__WallList *walls =
        p->finding ? finding_list(p->finding, now_ns, &stamp_ns) : NULL;

    if (!walls)
        return 0;
    int err = steady_walls(p->steady, walls, stamp_ns, why);
    if (!err)
        err = tracking_walls(p->tracker, walls, stamp_ns, why);
    return err || !p->detector ? err : tracking_walls(p->detector, walls, stamp_ns, why);
}

static int tell_ego(struct drive_pipe *p, int64_t until_ns, struct error *why)
{
    Anlos__EgoMotion m;
    int err = 0;

    for (; !err && p->ego_ns <= until_ns; p->ego_ns += DRIVE_EGO_NS) {
        drive_world_ego(&p->world, p->ego_ns, &m);
        dsp_ego(p->dsp, &m, p->ego_ns);
        steady_ego(p->steady, &m, p->ego_ns);
        tracking_ego(p->tracker, &m, p->ego_ns);
        if (p->detector)
            tracking_ego(p->detector, &m, p->ego_ns);
        if (p->finding)
            finding_ego(p->finding, &m, p->ego_ns);
        err = tell_walls(p, p->ego_ns, why);
    }
    return err;
}

/* What the vehicle says of its walls. */
static int tell_given(struct drive_pipe *p, int64_t until_ns, struct error *why)
{
    struct drive_walls given;
    int err = 0;

    if (!p->finding || p->launch->wall.from != WALL_FROM_TOPIC)
        return 0;
    for (; !err && p->given_ns <= until_ns; p->given_ns += DRIVE_WALL_NS) {
        drive_world_wall(&p->world, p->given_ns, &given);
        err = finding_given(p->finding, &given.list, p->given_ns, why);
        if (!err)
            err = tell_walls(p, p->given_ns, why);
    }
    return err;
}

static int make_lists(struct drive_pipe *p, struct drive_image *out, struct error *why)
{
    Anlos__Volume volume;

    steady_image(p->steady, &volume);
    int64_t stamp_ns = steady_capture_ns(p->steady);
    int err = tracking_volume(p->tracker, &volume, stamp_ns, &out->tracks, why);
    if (!err && p->detector)
        err = tracking_volume(p->detector, &volume, stamp_ns, &out->detections, why);
    out->t_s = drive_world_s(stamp_ns);
    out->out_s = out->t_s + p->ping_s;
    return err;
}

/* In the order of a replay (nodes/rt/replay_order.h): the image of a ping comes before
 * the walls that were heard in it.  *due: there is an image, whose lists are in out. */
static int take_ping(struct drive_pipe *p, enum pass pass, bool *due,
                     struct drive_image *out, struct error *why)
{
    struct dsp_output dsp;
    Anlos__Ping ping;
    int64_t stamp_ns;
    char note[128];

    *due = false;
    int err = drive_world_ping(&p->world, pass, &ping, &stamp_ns);
    if (err)
        return error_say(why, err, "sound of the drive: %s", strerror(-err));
    int64_t end_ns = stamp_ns + llround(1e9 * p->ping_s);
    err = tell_ego(p, end_ns, why);
    if (!err)
        err = tell_given(p, end_ns, why);
    if (err)
        return err;
    dsp_ping(p->dsp, &ping, stamp_ns, &dsp);
    if (dsp.has_traces)
        *due = steady_traces(p->steady, &dsp.traces, stamp_ns, note, sizeof note);
    if (*due)
        err = make_lists(p, out, why);
    if (!err && p->finding)
        finding_ping(p->finding, &ping, stamp_ns, end_ns);
    return err ? err : tell_walls(p, end_ns, why);
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
        err = create_steps(p, threads, why);
    if (!err)
        err = tell_survey(p, why);
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
    while (!err && !due)
        err = take_ping(p, PASS_SCENE, &due, out, why);
    if (!err)
        return 0;
    detections_free(out->tracks);
    detections_free(out->detections);
    *out = (struct drive_image){.tracks = NULL};
    return err;
}

void drive_pipe_clear(struct drive_pipe *p)
{
    finding_destroy(p->finding);
    tracking_destroy(p->tracker);
    tracking_destroy(p->detector);
    steady_destroy(p->steady);
    dsp_destroy(p->dsp);
    drive_world_clear(&p->world);
}
