#include "nodes/track/tracking.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"
#include "nodes/rt/launchfile_track.h"
#include "nodes/rt/objects.h"
#include "nodes/rt/volume_grid.h"
#include "recon/walls.h"
#include "nodes/track/candidates.h"
#include "nodes/track/ghosts.h"
#include "nodes/track/listing.h"
#include "nodes/track/timing.h"

#define LATEST_NS    (INT64_MAX / 2) /* differences of stamps do not overflow */
#define YOUNG_ROUNDS 7.0
#define WALLS_S      3.0 /* as wall.lost_s of a launch file */

/* A lost wall is forgotten when another stands about where it stood, when nothing has
 * come by way of it for as long as a wall is kept unseen, or in the end. */
#define LOST_S      60.0
#define SAME_WALL_M 0.5
#define SAME_COSINE 0.97

/* A background has of what was there for k of its n rounds a k-th of n, and leaves that
 * as a hole: of 28 dB over what is around, the most that is seen, during a fifth of it.
 */
#define REMAINS_DB 14.0

/* What came so far is something that moves, also when it stands. */
#define TRAVELLED_M 0.6
#define HELD_M      0.6 /* about its middle: all of a person */

_Static_assert(OBJECTS_MAX <= TRACK_DETECTIONS, "");

struct travel {     /* of a track that has a name */
    double at_m[2]; /* where it began, vehicle frame */
    bool far;
};

/* Walls that are not told of any more, at the stamp of the walls.  Sound may go on to
 * come by way of them: as if by way of another one, it would be somebody elsewhere. */
struct lost_walls {
    struct walls walls;
    int64_t lost_ns[WALLS_MAX], used_ns[WALLS_MAX]; /* by what is imaged, last */
};

struct tracking {
    struct tracking_config cfg;
    struct detector detector;
    struct tracker *tracker;
    struct listing listing;
    struct ego_path ego;
    struct walls walls; /* of the topic, at a stamp */
    int64_t walls_ns;
    bool has_walls;
    struct lost_walls lost;
    int64_t stamp_ns; /* of the newest image; 0: none */
    int64_t young_ns; /* when its background began; 0: it is not known */
    struct track_detection detections[TRACK_DETECTIONS];
    struct track_report reports[TRACKS_MAX]; /* of the newest image */
    size_t n_reports;
    struct travel travels[TRACK_ID_MAX + 1];
    struct ghost_source sources[TRACKS_MAX]; /* the same, as they are in this one */
};

void tracking_config(struct tracking_config *cfg, const struct launchfile *l)
{
    struct launch_track track = launch_track_default;

    if (l)
        track = l->track;
    *cfg =
        (struct tracking_config){.detector = {.threshold_db = track.threshold_db,
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

int tracking_create(struct tracking **out, const struct tracking_config *cfg)
{
    struct tracking *t = calloc(1, sizeof *t);

    if (!t)
        return -ENOMEM;
    t->cfg = *cfg;
    detector_init(&t->detector, &cfg->detector);
    int err = cfg->clutter > 0.0 ? tracker_create(&t->tracker, &cfg->track) : -EINVAL;
    if (err) {
        free(t);
        return err;
    }
    *out = t;
    return 0;
}

int tracking_survey(struct tracking *t, const Anlos__Survey *survey, struct error *why)
{
    return detector_survey(&t->detector, survey, why);
}

static bool is_time(int64_t stamp_ns)
{
    return stamp_ns >= 0 && stamp_ns < LATEST_NS;
}

void tracking_ego(struct tracking *t, const Anlos__EgoMotion *ego, int64_t capture_ns)
{
    const struct ego_motion motion = {ego->standstill ? 0.0 : ego->speed_m_s,
                                      ego->standstill ? 0.0 : ego->yaw_rate_rad_s};

    if (ego->valid && is_time(capture_ns))
        ego_path_add(&t->ego, capture_ns, &motion); /* what came late tells nothing new */
}

bool tracking_has_survey(const struct tracking *t)
{
    return t->detector.has_survey;
}

/* Who told of the walls tells of them no more: a vehicle that moves leaves them behind.
 */
static bool walls_are_old(const struct tracking *t, int64_t capture_ns)
{
    return 1e-9 * (double)(capture_ns - t->walls_ns) > t->cfg.walls_s;
}

bool tracking_has_wall(const struct tracking *t)
{
    return t->has_walls ? t->walls.n > 0 && !walls_are_old(t, t->stamp_ns)
                        : t->detector.has_survey && t->detector.survey.has_wall;
}

/* Between two stamps; false: it is not known, and taken to be what it last was. */
static bool move_between(const struct tracking *t, int64_t from_ns, int64_t to_ns,
                         struct ego_step *step)
{
    *step = (struct ego_step){0};
    if (!t->ego.n || !ego_path_between(&t->ego, from_ns, to_ns, step))
        return true;
    ego_motion_step(&t->ego.motion[t->ego.newest], 1e-9 * (double)(to_ns - from_ns),
                    step);
    return false;
}

/* The walls as they stand at the image's stamp. */
static void place_walls(const struct tracking *t, int64_t capture_ns, struct walls *out)
{
    struct ego_step step;

    if (!t->has_walls) {
        walls_from_survey(out, &t->detector.survey);
        return;
    }
    *out = t->walls;
    if (walls_are_old(t, capture_ns)) {
        out->n = 0;
        return;
    }
    move_between(t, t->walls_ns, capture_ns, &step);
    walls_step(out, &t->detector.survey, &step);
}

static bool is_replaced(const struct wall_gate *lost, const struct walls *by)
{
    for (size_t i = 0; i < by->n; i++) {
        struct wall a = lost->plane, b = by->list[i].plane;
        wall_face(&a);
        wall_face(&b);
        double cosine = a.normal[0] * b.normal[0] + a.normal[1] * b.normal[1] +
                        a.normal[2] * b.normal[2];
        if (by->list[i].id == lost->id ||
            (cosine > SAME_COSINE && fabs(a.distance_m - b.distance_m) < SAME_WALL_M))
            return true;
    }
    return false;
}

static void lose(struct lost_walls *l, const struct wall_gate *wall, int64_t lost_ns,
                 int64_t used_ns)
{
    if (l->walls.n == WALLS_MAX)
        return;
    l->walls.list[l->walls.n] = *wall;
    l->lost_ns[l->walls.n] = lost_ns;
    l->used_ns[l->walls.n++] = used_ns;
}

/* Walls of now are told: which others were there? */
static void keep_lost(struct tracking *t, const struct walls *now, int64_t now_ns)
{
    struct lost_walls before = t->lost;
    struct walls known = t->walls;
    struct ego_step step;

    t->lost.walls.n = 0;
    if (!t->has_walls || !t->detector.has_survey || now_ns < t->walls_ns)
        return;
    move_between(t, t->walls_ns, now_ns, &step);
    walls_step(&known, &t->detector.survey, &step);
    walls_step(&before.walls, &t->detector.survey, &step);
    for (size_t i = 0; i < before.walls.n; i++)
        if (1e-9 * (double)(now_ns - before.used_ns[i]) < t->cfg.walls_s &&
            1e-9 * (double)(now_ns - before.lost_ns[i]) < LOST_S &&
            !is_replaced(&before.walls.list[i], now))
            lose(&t->lost, &before.walls.list[i], before.lost_ns[i], before.used_ns[i]);
    for (size_t i = 0; i < known.n; i++)
        if (!is_replaced(&known.list[i], now))
            lose(&t->lost, &known.list[i], now_ns, now_ns);
}

/* The lost ones as they stand at the image's stamp.  While no wall is known nobody has a
 * place, and is not taken for another. */
static void place_lost(const struct tracking *t, const struct walls *known,
                       int64_t capture_ns, struct walls *out)
{
    struct ego_step step;

    out->n = 0;
    if (!known->n || !t->lost.walls.n)
        return;
    *out = t->lost.walls;
    move_between(t, t->walls_ns, capture_ns, &step);
    walls_step(out, &t->detector.survey, &step);
}

static void note_lost(struct tracking *t, const struct sight *sight,
                      const Anlos__DetectionList *list, int64_t capture_ns)
{
    for (size_t i = 0; i < list->n_detections; i++) {
        const Anlos__Vec3 *v = list->detections[i]->virtual_m;
        size_t w = sight_lost(sight, (const double[3]){v->x, v->y, v->z});
        if (w < sight->lost->n)
            t->lost.used_ns[w] = capture_ns;
    }
}

int tracking_walls(struct tracking *t, const Anlos__WallList *walls, int64_t capture_ns,
                   struct error *why)
{
    struct walls fresh;
    int err = walls_from_message(&fresh, walls, why);

    if (!err && !is_time(capture_ns))
        err = error_say(why, -EINVAL, "walls with a stamp that is none");
    if (err)
        return err;
    keep_lost(t, &fresh, capture_ns);
    t->walls = fresh;
    t->walls_ns = capture_ns;
    t->has_walls = true;
    return 0;
}

/* Where the array was, in the mean of an image's pings. */
static void place_array(const struct tracking *t, const struct sight *sight,
                        const Anlos__Volume *volume, int64_t capture_ns,
                        struct track_array *out)
{
    double age_s = timing_age_s(&t->detector.survey, volume->pings_used);
    struct ego_step step;
    double at_m[3], axis[3] = {sight->axes[0][0], sight->axes[1][0], sight->axes[2][0]};

    move_between(t, capture_ns - llrint(1e9 * age_s), capture_ns, &step);
    ego_step_point(&step, sight->origin_m, at_m);
    ego_step_turn(&step, axis, axis);
    memcpy(out->at_m, at_m, sizeof out->at_m);
    memcpy(out->axis, axis, sizeof out->axis);
}

/* As the array heard it from there. */
static void hear(const struct sight *sight, const struct track_array *array,
                 const double virtual_m[3], struct track_detection *out)
{
    double away_m[2];

    for (int a = 0; a < 2; a++) {
        away_m[a] = sight->origin_m[a] - array->at_m[a];
        for (int b = 0; b < 3; b++)
            away_m[a] += sight->axes[a][b] * virtual_m[b];
    }
    out->along_m = away_m[0] * array->axis[0] + away_m[1] * array->axis[1];
    out->range_m = hypot(away_m[0], away_m[1]);
}

/* The wall's error is the same for all images: no filter takes it for noise.  It comes
 * back in the listing. */
static void take_detection(const struct tracking *t, const struct sight *sight,
                           const Anlos__Volume *volume, const struct track_array *array,
                           const Anlos__Detection *m, struct track_detection *out)
{
    const double virtual_m[3] = {m->virtual_m->x, m->virtual_m->y, m->virtual_m->z};
    double wall_m2[6];

    sight_wall_error(sight, m->wall, virtual_m, wall_m2);
    *out = (struct track_detection){
        .position_m = {m->position_m->x, m->position_m->y, m->position_m->z},
        .extent_m = {m->extent_m->x, m->extent_m->y, m->extent_m->z},
        .existence = m->existence,
        .mirror = m->wall,
        .power = pow(10.0, 0.1 * m->level_db),
        .height_assumed = sight->grid->n[1] == 1};
    for (int i = 0; i < 6; i++)
        out->covariance_m2[i] = m->covariance_m2[i] - wall_m2[i];
    for (int i = 0; i < 6; i += i ? 2 : 3)
        out->covariance_m2[i] = fmax(out->covariance_m2[i], 0.0);
    out->lag_s = timing_lag_s(&t->detector.survey, volume->pings_used,
                              hypot(hypot(virtual_m[0], virtual_m[1]), virtual_m[2]));
    hear(sight, array, virtual_m, out);
    sight_direction(sight, m->wall, out->position_m, out->sight);
}

/* Where the tracks of the image before are imaged in this one, dt_s later. */
static void place_tracks(struct tracking *t, const struct sight *sight,
                         const struct ego_step *ego, double dt_s)
{
    for (size_t i = 0; i < t->n_reports; i++) {
        const struct track_report *k = &t->reports[i];
        const struct track_mirror none = {.id = 0};
        double at_m[3], virtual_m[3];
        for (int a = 0; a < 3; a++)
            at_m[a] = k->heard_m[a] + (a < 2 ? dt_s * k->velocity_m_s[a] : 0.0);
        track_mirror_point(&k->mirror, at_m, at_m);
        ego_step_point(ego, at_m, at_m);
        sight_virtual(sight, &none, at_m, virtual_m);
        t->sources[i] = ghost_source_at(virtual_m, t->listing.of[k->id].level_db);
    }
}

static double floor_m2(const struct grid *g)
{
    return g->step_m[0] * (double)g->n[0] * g->step_m[2] * (double)g->n[2];
}

/* With what stands still in it, and no wall that mirrors, an image shows what the array
 * sees directly: that hides nothing, and glides over ground once it is mirrored. */
static bool shows_hidden(const struct tracking *t, const Anlos__Volume *volume,
                         const struct sight *sight)
{
    return !volume->standing_left || !t->has_walls || sight->walls->n > 0;
}

/* Where a sound from outside drowned more than a quarter of an image's pings, what is
 * left is noisier than what was learnt of noise: it shows nothing, neither that something
 * is there nor that it is not. */
static bool is_blanked(const Anlos__Volume *volume)
{
    return 4 * volume->pings_blanked > volume->pings_expected;
}

static bool shows_nothing(const void *context, const double p_m[3])
{
    (void)context;
    (void)p_m;
    return false;
}

/* A background that has only begun has who walked by then in it, where he was: a hole
 * that rests there, and after n rounds is an n-th of him.  (One that begins anew after
 * each stop finds him tracked.) */
static bool shows_standing(struct tracking *t, const Anlos__Volume *volume,
                           int64_t capture_ns)
{
    double gap_s = 1e-9 * (double)(capture_ns - t->stamp_ns);

    if (!t->stamp_ns || fabs(gap_s) > t->cfg.track.coast_s)
        t->young_ns = volume->standing_left ? capture_ns : 0;
    double since_s = 1e-9 * (double)(capture_ns - t->young_ns);
    return volume->standing_left ||
           (t->young_ns && since_s < YOUNG_ROUNDS * timing_round_s(&t->detector.survey));
}

static int follow(struct tracking *t, const Anlos__Volume *volume,
                  const struct sight *sight, int64_t capture_ns,
                  Anlos__DetectionList *list, bool *ego_known)
{
    double dt_s = 1e-9 * (double)(capture_ns - t->stamp_ns);
    struct track_scan scan = {
        .stamp_ns = capture_ns,
        .detections = t->detections,
        .fresh = t->stamp_ns && dt_s > 0.0
                     ? timing_fresh(&t->detector.survey, volume->pings_used, dt_s,
                                    t->cfg.look_s)
                     : 1.0,
        .clutter_m2 = t->cfg.clutter / floor_m2(sight->grid),
        .standing_left = shows_standing(t, volume, capture_ns),
        .remains = volume->standing_taken ? pow(10.0, 0.1 * REMAINS_DB) : 0.0,
        .ego_known = true,
        .stands_before = sight_stands_before,
        .shows = sight_shows,
        .context = sight};

    if (t->stamp_ns && dt_s > 0.0)
        scan.ego_known = move_between(t, t->stamp_ns, capture_ns, &scan.ego);
    double lag_s = timing_lag_s(&t->detector.survey, volume->pings_used, 0.0);
    place_tracks(t, sight, &scan.ego, fmax(dt_s, 0.0) + lag_s);
    place_array(t, sight, volume, capture_ns, &scan.array);
    scan.n_mirrors = sight_mirrors(sight, scan.mirrors);
    struct ghost_array array = {.margin_db = t->cfg.sidelobe_db};
    ghost_array_measure(&array, &t->detector.survey);
    if (is_blanked(volume))
        scan.shows = shows_nothing;
    else if (shows_hidden(t, volume, sight))
        scan.n = candidates_choose(list, sight, &array, t->sources, t->n_reports);
    for (size_t i = 0; i < scan.n; i++)
        take_detection(t, sight, volume, &scan.array, list->detections[i],
                       &t->detections[i]);
    *ego_known = scan.ego_known;
    return tracker_step(t->tracker, &scan);
}

/* What was seen to come from elsewhere, while the vehicle stood, is no remainder of what
 * stands, also when it stands there now. */
static bool has_travelled(struct tracking *t, const struct track_report *k, bool stands)
{
    struct travel *from = &t->travels[k->id];

    if (k->state == TRACK_NEW || !stands)
        *from = (struct travel){.at_m = {k->position_m[0], k->position_m[1]}};
    from->far |= hypot(k->position_m[0] - from->at_m[0],
                       k->position_m[1] - from->at_m[1]) > TRAVELLED_M;
    return from->far;
}

/* What the background leaves is learnt from images that have one. */
static void learn_residue(struct tracking *t, const Anlos__Volume *volume,
                          const struct sight *sight, int64_t capture_ns)
{
    double held_m[TRACKS_MAX][3];
    size_t n = 0;

    for (size_t i = 0; i < t->n_reports; i++)
        if (has_travelled(t, &t->reports[i], !volume->standing_left))
            sight_virtual(sight, &t->reports[i].mirror, t->reports[i].heard_m,
                          held_m[n++]);
    if (volume->standing_left)
        detector_forget(&t->detector);
    else if (!volume->pings_blanked)
        detector_learn(&t->detector, volume, capture_ns, held_m, n, HELD_M);
}

static bool is_tracked(const struct tracking *t, const Anlos__Volume *volume)
{
    return t->cfg.mode == LAUNCH_TRACK_AUTO ? volume->frame > 0
                                            : t->cfg.mode == LAUNCH_TRACK_TRACKS;
}

static int make_tracks(struct tracking *t, const Anlos__Volume *volume,
                       const struct sight *sight, int64_t capture_ns,
                       Anlos__DetectionList **list, struct error *why)
{
    bool ego_known;
    int err = follow(t, volume, sight, capture_ns, *list, &ego_known);

    if (err)
        return error_say(why, err, "an image that is not newer than the one before");
    t->stamp_ns = capture_ns;
    t->n_reports = tracker_report(t->tracker, t->reports);
    learn_residue(t, volume, sight, capture_ns);
    bool as_imaged = !t->has_walls && !sight->walls->n;
    err = listing_make(&t->listing, sight, t->reports, t->n_reports, as_imaged, list);
    if (err)
        return error_say(why, err, "not enough memory to list tracks");
    (*list)->tracked = true;
    (*list)->ego_unknown = !ego_known;
    return 0;
}

int tracking_volume(struct tracking *t, const Anlos__Volume *volume, int64_t capture_ns,
                    Anlos__DetectionList **out, struct error *why)
{
    struct walls walls, lost;
    struct sight sight;
    struct grid grid;
    Anlos__DetectionList *list;

    if (!is_time(capture_ns))
        return error_say(why, -EINVAL, "an image with a stamp that is none");
    if (t->detector.has_survey) {
        place_walls(t, capture_ns, &walls);
        place_lost(t, &walls, capture_ns, &lost);
    }
    int err = detector_volume(&t->detector, volume, &walls, &list, why);
    if (err)
        return err;
    volume_grid(volume, &grid);
    sight_init(&sight, &t->detector.survey, &walls, &lost, &grid);
    note_lost(t, &sight, list, capture_ns);
    if (is_tracked(t, volume))
        err = make_tracks(t, volume, &sight, capture_ns, &list, why);
    list->frame = volume->frame;
    if (err)
        objects_free(list);
    else
        *out = list;
    return err;
}

struct track_counts tracking_counts(const struct tracking *t)
{
    return tracker_counts(t->tracker);
}

void tracking_destroy(struct tracking *t)
{
    if (!t)
        return;
    detector_clear(&t->detector);
    tracker_destroy(t->tracker);
    free(t);
}
