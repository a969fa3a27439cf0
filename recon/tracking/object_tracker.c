/* SPDX-License-Identifier: MIT */
#include "recon/tracking/object_tracker.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/processing.h"
#include "recon/tracking/several_ways.h"
#include "recon/tracking/sidelobes.h"
#include "recon/tracking/sight.h"
#include "recon/tracking/timing.h"

#define LATEST_NS   (INT64_MAX / 2) /* differences of stamps do not overflow */
#define AT_WALL_M   0.25 /* what is imaged so close behind a wall is the wall */
#define SAME_GATE_M 1e-3

/* A lost wall is forgotten when another stands about where it stood, when nothing has
 * come by way of it for as long as a wall is kept unseen, or in the end. */
#define LOST_S      60.0
#define SAME_WALL_M 0.5
#define SAME_COSINE 0.97

/* A background has of what was there for k of its n rounds a k-th of n, and leaves that
 * as a hole: of 28 dB over what is around, the most that is seen, during a fifth of it.
 * For images that do not tell by single pings how bright it was there. */
#define REMAINS_DB     14.0
#define OVER_LATELY_DB 5.0
#define PROVEN         0.95

/* What came so far is something that moves, also when it stands. */
#define TRAVELLED_M 0.6
#define HELD_M      0.6              /* about its middle: all of a person */
#define KNOWN_S     0.5              /* unseen for longer, he may be elsewhere */
#define SEEN_S      3.0              /* straight: he may be out of sight again */
#define IMAGES_MAX  (5 * TRACKS_MAX) /* of what is tracked, by two walls and straight */

_Static_assert(OBJECTS_MAX <= TRACK_DETECTIONS && TRACKS_MAX <= OBJECTS_MAX, "");

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

/* What the newest detection of a track told besides its place, and how loud and far it
 * was when the array saw it straight. */
struct memory {
    double level_db, straight_db, straight_m;
    int64_t seen_ns; /* 0: never */
    struct shape_guess shape;
    bool behind_no_wall, in_free_view;
};

struct object_tracker {
    struct object_tracker_config cfg;
    struct detector detector;
    struct tracker *tracker;
    struct memory memory[TRACK_ID_MAX + 1]; /* by id */
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
    double places_m[TRACKS_MAX][3]; /* where they are in this one, vehicle frame */
    struct sidelobe_source sources[IMAGES_MAX]; /* as they are imaged in it */
    size_t n_sources;
};

void object_tracker_config_default(struct object_tracker_config *cfg, bool is_static)
{
    *cfg = (struct object_tracker_config){
        .detector = {.threshold_db = 12.0,
                     .min_existence = 0.5,
                     .cfar = is_static ? CFAR_ORDERED : CFAR_OFF,
                     .false_alarm_rate = 1e-4},
        .mode = OBJECT_TRACKER_AUTO,
        .clutter = 0.2,
        .look_s = 0.2,
        .walls_s = 3.0,
        .sidelobe_db = 4.0};
    track_config_default(&cfg->track);
}

int object_tracker_create(struct object_tracker **out,
                          const struct object_tracker_config *cfg)
{
    struct object_tracker *t = calloc(1, sizeof *t);

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

int object_tracker_survey(struct object_tracker *t, const struct survey *survey)
{
    return detector_survey(&t->detector, survey);
}

static bool is_time(int64_t stamp_ns)
{
    return stamp_ns >= 0 && stamp_ns < LATEST_NS;
}

void object_tracker_ego(struct object_tracker *t, const struct ego_motion *motion,
                        int64_t capture_ns)
{
    if (motion && is_time(capture_ns))
        ego_path_add(&t->ego, capture_ns, motion); /* what came late tells nothing new */
}

bool object_tracker_has_survey(const struct object_tracker *t)
{
    return t->detector.has_survey;
}

uint64_t object_tracker_survey_id(const struct object_tracker *t)
{
    return t->detector.has_survey ? t->detector.survey_id : 0;
}

/* Who told of the walls tells of them no more: a vehicle that moves leaves them behind.
 */
static bool walls_are_old(const struct object_tracker *t, int64_t capture_ns)
{
    return 1e-9 * (double)(capture_ns - t->walls_ns) > t->cfg.walls_s;
}

bool object_tracker_has_wall(const struct object_tracker *t)
{
    return t->has_walls ? t->walls.n > 0 && !walls_are_old(t, t->stamp_ns)
                        : t->detector.has_survey && t->detector.survey.has_wall;
}

/* Between two stamps; false: it is not known, and taken to be what it last was. */
static bool move_between(const struct object_tracker *t, int64_t from_ns, int64_t to_ns,
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
static void place_walls(const struct object_tracker *t, int64_t capture_ns,
                        struct walls *out)
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
static void keep_lost(struct object_tracker *t, const struct walls *now, int64_t now_ns)
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
static void place_lost(const struct object_tracker *t, const struct walls *known,
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

static void note_lost(struct object_tracker *t, const struct sight *sight,
                      const struct object_list *list, int64_t capture_ns)
{
    for (size_t i = 0; i < list->n; i++) {
        size_t w = sight_lost(sight, list->objects[i].virtual_m);
        if (w < sight->lost->n)
            t->lost.used_ns[w] = capture_ns;
    }
}

int object_tracker_walls(struct object_tracker *t, const struct walls *walls,
                         int64_t capture_ns)
{
    if (!is_time(capture_ns))
        return -EINVAL;
    keep_lost(t, walls, capture_ns);
    t->walls = *walls;
    t->walls_ns = capture_ns;
    t->has_walls = true;
    return 0;
}

/* Where the array was, in the mean of an image's pings. */
static void place_array(const struct object_tracker *t, const struct sight *sight,
                        const struct volume *volume, struct track_array *out)
{
    double age_s = timing_age_s(&t->detector.survey, volume);
    struct ego_step step;
    double at_m[3], axis[3] = {sight->axes[0][0], sight->axes[1][0], sight->axes[2][0]};

    move_between(t, volume->capture_ns - llrint(1e9 * age_s), volume->capture_ns, &step);
    ego_step_point(&step, sight->origin_m, at_m);
    ego_step_turn(&step, axis, axis);
    memcpy(out->at_m, at_m, sizeof out->at_m);
    memcpy(out->axis, axis, sizeof out->axis);
}

#define VELOCITY_NS 10000000 /* before and after */

/* What rests over a line array's plane, or behind it, seems to glide along with it: its
 * velocity in the mean of an image's pings, in the array frame. */
static void find_gliding(const struct object_tracker *t, const struct sight *sight,
                         const struct volume *volume, double out_m_s[3])
{
    double age_s = timing_age_s(&t->detector.survey, volume);
    int64_t mean_ns = volume->capture_ns - llrint(1e9 * age_s);
    struct ego_step step;
    double then_m[3], way_m[3];

    move_between(t, mean_ns - VELOCITY_NS, mean_ns + VELOCITY_NS, &step);
    ego_step_point(&step, sight->origin_m, then_m);
    for (int a = 0; a < 3; a++)
        way_m[a] = sight->origin_m[a] - then_m[a];
    move_between(t, mean_ns, volume->capture_ns, &step);
    ego_step_turn(&step, way_m, way_m);
    for (int b = 0; b < 3; b++) {
        out_m_s[b] = 0.0;
        for (int a = 0; a < 3; a++)
            out_m_s[b] += 0.5e9 / VELOCITY_NS * sight->axes[a][b] * way_m[a];
    }
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

/* The power that a background may have left where it is: what single pings have shown to
 * come may be as faint as a hole, but not where somebody was as bright lately.  Where it
 * was brighter in the mean of all that time, nobody walks.  Beyond the gate it may be a
 * sidelobe of who is beside the image, too, however bright. */
static double remains(const struct object *o, bool beyond)
{
    double lately_db = o->level_db + 10.0 * log10(fmax(o->lately, 1e-9)) + OVER_LATELY_DB;

    if (beyond)
        return INFINITY;
    return pow(10.0,
               0.1 * (o->proven < PROVEN && o->lately < 1.0 ? REMAINS_DB : lately_db));
}

/* The wall's error is the same for all images: no filter takes it for noise.  It comes
 * back when tracks are listed. */
static void take_detection(const struct object_tracker *t, const struct sight *sight,
                           const struct volume *volume, const struct track_array *array,
                           const double gliding_m_s[3], const struct object *o,
                           struct track_detection *out)
{
    const struct survey *survey = &t->detector.survey;
    const double *v = o->virtual_m;
    double range_m = hypot(hypot(v[0], v[1]), v[2]), wall_m2[6];

    sight_wall_error(sight, o->place.wall, v, wall_m2);
    *out = (struct track_detection){
        .existence = o->existence,
        .proven = o->proven,
        .moves = o->moves,
        .has_course = o->has_course,
        .course_doubt = o->course_doubt,
        .mirror = o->place.wall,
        .power = pow(10.0, 0.1 * o->level_db),
        .remains = volume->standing_taken ? remains(o, range_m > survey->gate_m[1]) : 0.0,
        .height_assumed = sight->grid->n[1] == 1};
    memcpy(out->position_m, o->place.position_m, sizeof out->position_m);
    memcpy(out->extent_m, o->place.extent_m, sizeof out->extent_m);
    memcpy(out->height_m2, o->place.height_m2, sizeof out->height_m2);
    for (int i = 0; i < 6; i++)
        out->covariance_m2[i] = o->place.covariance_m2[i] - wall_m2[i];
    for (int i = 0; i < 6; i += i ? 2 : 3)
        out->covariance_m2[i] = fmax(out->covariance_m2[i], 0.0);
    out->lag_s = timing_lag_s(survey, volume, range_m);
    hear(sight, array, v, out);
    const double way_m[3] = {o->middle_m[0] - v[0], o->middle_m[1] - v[1],
                             o->middle_m[2] - v[2]};
    sight_way(sight, o->place.wall, way_m, out->middle_m);
    sight_direction(sight, o->place.wall, out->position_m, out->sight);
    const double course_m_s[3] = {o->course_m_s[0], 0.0, o->course_m_s[1]};
    sight_way(sight, o->place.wall, course_m_s, out->course_m_s);
    sight_way(sight, o->place.wall, gliding_m_s, out->gliding_m_s);
}

static bool is_behind_a_wall(const struct sight *sight, const struct object *o)
{
    return !o->place.behind_no_wall &&
           sight_lost(sight, o->virtual_m) == sight->lost->n &&
           sight_behind_m(sight, o->place.wall, o->virtual_m) > AT_WALL_M;
}

/* Of another one, or of what is tracked already.  What goes along a course of its own is
 * none: the velocity filter has looked at the lobes. */
static bool may_be_sidelobe(const struct object_tracker *t,
                            const struct sidelobe_array *array, const struct object *o,
                            const struct sidelobe_source *its,
                            const struct sidelobe_source *seen, size_t n)
{
    return !o->moves && (sidelobes_may_be(array, its, seen, n) ||
                         sidelobes_may_be(array, its, t->sources, t->n_sources));
}

static double level_of(const struct object_tracker *t, size_t report)
{
    return t->memory[t->reports[report].id].level_db;
}

static void know_track(const struct object_tracker *t, size_t report,
                       struct several_ways *known)
{
    const struct track_report *k = &t->reports[report];
    struct several_ways_body *body =
        several_ways_know(known, t->places_m[report], k->mirror.id, level_of(t, report));

    if (body)
        body->track = k->id;
}

/* Who is tracked, the loudest first. */
static void know_tracks(const struct object_tracker *t, struct several_ways *known)
{
    bool taken[TRACKS_MAX] = {false};

    for (size_t n = 0; n < t->n_reports; n++) {
        size_t next = t->n_reports;
        for (size_t i = 0; i < t->n_reports; i++)
            if (!taken[i] && (next == t->n_reports || level_of(t, i) > level_of(t, next)))
                next = i;
        taken[next] = true;
        if (t->reports[next].unseen_s < KNOWN_S)
            know_track(t, next, known);
    }
}

/* By way of which wall it is imaged; false: it is nobody. */
static bool find_wall(const struct object_tracker *t, const struct sight *sight,
                      struct several_ways *known, struct object *o)
{
    uint32_t wall = several_ways_show(known, o->virtual_m, o->place.wall, o->level_db);

    for (size_t i = 0; wall != o->place.wall && i < sight->walls->n; i++)
        if (sight->walls->list[i].id == wall)
            objects_place_by(o, &t->detector.survey, sight->walls, i);
    if (wall != SEVERAL_WAYS_NOBODY)
        several_ways_know(known, o->place.position_m, wall, o->level_db);
    return wall != SEVERAL_WAYS_NOBODY;
}

static bool was_seen(const struct object_tracker *t, unsigned track)
{
    int64_t seen_ns = t->memory[track].seen_ns;

    return seen_ns && fabs(1e-9 * (double)(t->stamp_ns - seen_ns)) < SEEN_S;
}

/* What is nobody may tell that the array sees him who makes it: an echo that goes out
 * straight is as loud as the mean of both in dB.  So it may be fainter than him straight
 * by as much as a sidelobe. */
static void note_seen(struct object_tracker *t, const struct several_ways *known,
                      const struct object *o, bool lobe, int64_t stamp_ns)
{
    double straight_m;
    const struct several_ways_body *who =
        several_ways_see(known, o->virtual_m, o->level_db, &straight_m);

    if (!who || !who->track || (lobe && !was_seen(t, who->track)))
        return;
    struct memory *m = &t->memory[who->track];
    m->seen_ns = stamp_ns;
    m->straight_db = 2.0 * o->level_db - who->level_db;
    m->straight_m = straight_m;
}

/* Brings to the front of the list, in the order they had, what is tracked: neither the
 * wall itself, nor what no wall can have mirrored, nor what may be a sidelobe or has come
 * out by one way and back by another.  Returns how many they are. */
static size_t choose_candidates(struct object_tracker *t, const struct sight *sight,
                                int64_t stamp_ns, struct object_list *list)
{
    struct sidelobe_array array = {.margin_db = t->cfg.sidelobe_db};
    struct sidelobe_source seen[OBJECTS_MAX];
    struct several_ways known;
    size_t chosen = 0;

    sidelobe_array_measure(&array, &t->detector.survey);
    several_ways_init(&known, sight, &t->detector.survey);
    know_tracks(t, &known);
    for (size_t i = 0; i < list->n; i++)
        seen[i] =
            sidelobe_source_at(list->objects[i].virtual_m, list->objects[i].level_db);
    for (size_t i = 0; i < list->n; i++) {
        struct object o = list->objects[i];
        if (!is_behind_a_wall(sight, &o))
            continue;
        bool lobe = may_be_sidelobe(t, &array, &o, &seen[i], seen, list->n);
        if (lobe || !find_wall(t, sight, &known, &o)) {
            note_seen(t, &known, &o, lobe, stamp_ns);
            continue;
        }
        memmove(list->objects + chosen + 1, list->objects + chosen,
                (i - chosen) * sizeof o);
        list->objects[chosen++] = o;
    }
    return chosen;
}

/* As loud as its track where it is imaged by the wall that it was heard by; elsewhere as
 * its way there and back is longer or shorter; itself as it was seen, and while its place
 * is predicted also where. */
static void add_sources(struct object_tracker *t, const struct several_ways *ways,
                        const struct track_report *k, const double at_m[3],
                        const struct track_mirror *own)
{
    static const struct track_mirror none = {.id = 0};
    const struct memory *m = &t->memory[k->id];
    double images_m[IMAGES_MAX][3], own_m = 0.0;
    size_t n = several_ways_images(ways, at_m, own, images_m, IMAGES_MAX - t->n_sources);

    if (k->unseen_s >= KNOWN_S && n > 1)
        n = 1;
    for (size_t i = 0; i < n; i++) {
        struct sidelobe_source *s = &t->sources[t->n_sources++];
        *s = sidelobe_source_at(images_m[i], m->level_db);
        own_m = i ? own_m : s->range_m;
        if (i)
            s->level_db -= 40.0 * log10(s->range_m / own_m);
    }
    if (was_seen(t, k->id) && t->n_sources < IMAGES_MAX) {
        sight_virtual(ways->sight, &none, at_m, images_m[0]);
        struct sidelobe_source *s = &t->sources[t->n_sources++];
        *s = sidelobe_source_at(images_m[0], m->straight_db);
        if (k->state != TRACK_MEASURED)
            s->range_m = m->straight_m;
    }
}

/* Where the tracks of the image before are in this one, dt_s later, and are imaged. */
static void place_tracks(struct object_tracker *t, const struct sight *sight,
                         const struct ego_step *ego, double dt_s)
{
    struct several_ways ways;

    several_ways_init(&ways, sight, &t->detector.survey);
    t->n_sources = 0;
    for (size_t i = 0; i < t->n_reports; i++) {
        const struct track_report *k = &t->reports[i];
        double at_m[3];
        for (int a = 0; a < 3; a++)
            at_m[a] = k->heard_m[a] + (a < 2 ? dt_s * k->velocity_m_s[a] : 0.0);
        const struct track_mirror own = track_mirror_after(ego, &k->mirror);
        ego_step_point(ego, at_m, t->places_m[i]);
        add_sources(t, &ways, k, t->places_m[i], &own);
    }
}

static double floor_m2(const struct grid *g)
{
    return g->step_m[0] * (double)g->n[0] * g->step_m[2] * (double)g->n[2];
}

/* With what stands still in it, and no wall that mirrors, an image shows what the array
 * sees directly: that hides nothing, and glides over ground once it is mirrored. */
static bool shows_hidden(const struct object_tracker *t, const struct volume *volume,
                         const struct sight *sight)
{
    return !volume->standing_left || !t->has_walls || sight->walls->n > 0;
}

/* Where a sound from outside drowned more than a quarter of an image's pings, what is
 * left is noisier than what was learnt of noise: it shows nothing, neither that something
 * is there nor that it is not. */
static bool is_blanked(const struct volume *volume)
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
 * that rests there, and after n rounds is an n-th of him.  (One that restarts after
 * each stop finds him tracked.) */
static bool shows_standing(struct object_tracker *t, const struct volume *volume)
{
    int64_t capture_ns = volume->capture_ns;
    double gap_s = 1e-9 * (double)(capture_ns - t->stamp_ns);

    if (!t->stamp_ns || fabs(gap_s) > t->cfg.track.coast_s)
        t->young_ns = volume->standing_left ? capture_ns : 0;
    double since_s = 1e-9 * (double)(capture_ns - t->young_ns);
    return volume->standing_left ||
           (t->young_ns &&
            since_s < DETECTOR_SETTLES * timing_round_s(&t->detector.survey));
}

static int follow(struct object_tracker *t, const struct volume *volume,
                  const struct sight *sight, struct object_list *list)
{
    int64_t capture_ns = volume->capture_ns;
    double dt_s = 1e-9 * (double)(capture_ns - t->stamp_ns), gliding_m_s[3];
    struct track_scan scan = {
        .stamp_ns = capture_ns,
        .detections = t->detections,
        .fresh = t->stamp_ns && dt_s > 0.0
                     ? timing_fresh(&t->detector.survey, volume, dt_s, t->cfg.look_s)
                     : 1.0,
        .span_s = 2.0 * timing_age_s(&t->detector.survey, volume),
        .clutter_m2 = t->cfg.clutter / floor_m2(sight->grid),
        .standing_left = shows_standing(t, volume),
        .settling = t->detector.settling,
        .ego_known = true,
        .stands_before = sight_stands_before,
        .shows = sight_shows,
        .context = sight};

    if (t->stamp_ns && dt_s > 0.0)
        scan.ego_known = move_between(t, t->stamp_ns, capture_ns, &scan.ego);
    double lag_s = timing_lag_s(&t->detector.survey, volume, 0.0);
    place_tracks(t, sight, &scan.ego, fmax(dt_s, 0.0) + lag_s);
    place_array(t, sight, volume, &scan.array);
    find_gliding(t, sight, volume, gliding_m_s);
    scan.n_mirrors = sight_mirrors(sight, scan.mirrors);
    if (is_blanked(volume))
        scan.shows = shows_nothing;
    else if (shows_hidden(t, volume, sight))
        scan.n = choose_candidates(t, sight, capture_ns, list);
    for (size_t i = 0; i < scan.n; i++)
        take_detection(t, sight, volume, &scan.array, gliding_m_s, &list->objects[i],
                       &t->detections[i]);
    list->ego_unknown = !scan.ego_known;
    return tracker_step(t->tracker, &scan);
}

/* What was seen to come from elsewhere, while the vehicle stood, is no remainder of what
 * stands, also when it stands there now. */
static bool has_travelled(struct object_tracker *t, const struct track_report *k,
                          bool stands)
{
    struct travel *from = &t->travels[k->id];

    if (k->state == TRACK_NEW || !stands)
        *from = (struct travel){.at_m = {k->position_m[0], k->position_m[1]}};
    from->far |= hypot(k->position_m[0] - from->at_m[0],
                       k->position_m[1] - from->at_m[1]) > TRAVELLED_M;
    return from->far;
}

/* What the background leaves is learnt from images that have one, and noise beside who is
 * tracked. */
static void learn_residue(struct object_tracker *t, const struct volume *volume,
                          const struct sight *sight)
{
    double held_m[IMAGES_MAX][3], known_m[IMAGES_MAX][3];
    size_t n = 0, n_known = 0;
    struct several_ways ways;

    several_ways_init(&ways, sight, &t->detector.survey);
    for (size_t i = 0; i < t->n_reports; i++) {
        const struct track_report *k = &t->reports[i];
        size_t more = several_ways_images(&ways, k->heard_m, &k->mirror,
                                          known_m + n_known, IMAGES_MAX - n_known);
        if (has_travelled(t, k, !volume->standing_left)) {
            memcpy(held_m[n], known_m[n_known], more * sizeof *known_m);
            n += more;
        }
        n_known += more;
    }
    detector_know(&t->detector, (const double(*)[3])known_m, n_known, HELD_M);
    if (volume->standing_left)
        detector_forget(&t->detector);
    else if (!volume->pings_blanked)
        detector_learn(&t->detector, volume, (const double(*)[3])held_m, n, HELD_M);
}

static bool is_tracked(const struct object_tracker *t, const struct volume *volume)
{
    return t->cfg.mode == OBJECT_TRACKER_AUTO ? volume->frame > 0
                                              : t->cfg.mode == OBJECT_TRACKER_TRACKS;
}

static void remember(struct memory *m, const struct object *o)
{
    m->level_db = o->level_db;
    m->shape = o->shape;
    m->behind_no_wall = o->place.behind_no_wall;
    m->in_free_view = o->place.in_free_view;
}

static struct object object_of(const struct memory *m, const struct sight *sight,
                               const struct track_report *k, bool placed)
{
    struct object o = {.id = k->id,
                       .placed = placed,
                       .place = {.wall = k->mirror.id,
                                 .behind_no_wall = m->behind_no_wall,
                                 .in_free_view = m->in_free_view},
                       .existence = k->existence * sight_existence(sight, k->mirror.id),
                       .level_db = m->level_db,
                       .shape = m->shape,
                       .tracked = true,
                       .state = k->state,
                       .motion = k->motion,
                       .age_s = k->age_s,
                       .unseen_s = k->unseen_s};

    sight_virtual(sight, &k->mirror, k->heard_m, o.virtual_m);
    memcpy(o.place.position_m, k->position_m, sizeof o.place.position_m);
    memcpy(o.place.extent_m, k->extent_m, sizeof o.place.extent_m);
    memcpy(o.velocity_m_s, k->velocity_m_s, sizeof o.velocity_m_s);
    memcpy(o.velocity_m2_s2, k->velocity_m2_s2, sizeof o.velocity_m2_s2);
    sight_wall_error(sight, k->mirror.id, o.virtual_m, o.place.covariance_m2);
    for (int i = 0; i < 6; i++)
        o.place.covariance_m2[i] += k->covariance_m2[i];
    return o;
}

/* The list of what was seen becomes that of what is tracked.  all_placed: also those are
 * listed with a position that no wall has shown. */
static void list_tracks(struct object_tracker *t, const struct sight *sight,
                        bool all_placed, struct object_list *list)
{
    for (size_t i = 0; i < t->n_reports; i++) {
        const struct track_report *k = &t->reports[i];
        if (k->detection < list->n)
            remember(&t->memory[k->id], &list->objects[k->detection]);
    }
    list->n = t->n_reports;
    list->tracked = true;
    for (size_t i = 0; i < t->n_reports; i++) {
        const struct track_report *k = &t->reports[i];
        list->objects[i] =
            object_of(&t->memory[k->id], sight, k, k->placed || all_placed);
    }
}

/* Of tracks, what lies behind a wall that is known; where nobody tells of walls, the
 * image as it is.  Of what a scan lists, also what is seen directly. */
static void find_view(const struct object_tracker *t, const struct volume *volume,
                      const struct sight *sight, struct field_of_view *out)
{
    struct wall_gate walls[2 * WALLS_MAX];
    size_t n = sight->walls->n, kept = 0;
    bool tracked = is_tracked(t, volume), direct = !tracked || (!t->has_walls && !n);

    out->n = 0;
    if (tracked && (is_blanked(volume) || !shows_hidden(t, volume, sight)))
        return;
    memcpy(walls, sight->walls->list, n * sizeof *walls);
    memcpy(walls + n, sight->lost->list, sight->lost->n * sizeof *walls);
    field_of_view_find(out, &t->detector.survey, walls, n + sight->lost->n, n,
                       sight->grid, INFINITY);
    for (size_t i = 0; i < out->n; i++)
        if (direct || out->areas[i].wall)
            out->areas[kept++] = out->areas[i];
    out->n = kept;
}

/* By way of walls that are looked at up to the gate who comes is heard from a step beyond
 * it.  What leaves is not looked for there: an image may end with the gate. */
static void reach_beyond(const struct survey *s, struct walls *walls)
{
    for (size_t i = 0; i < walls->n; i++) {
        double *far_m = &walls->list[i].gate_m[1];
        if (fabs(*far_m - s->gate_m[1]) < SAME_GATE_M)
            *far_m += PROCESSING_BEYOND_M;
    }
}

int object_tracker_volume(struct object_tracker *t, const struct volume *volume,
                          struct object_list *out, struct error *why)
{
    struct walls walls, lost, heard;
    struct sight sight;

    if (!is_time(volume->capture_ns))
        return error_say(why, -EINVAL, "an image with a stamp that is none");
    if (t->detector.has_survey) {
        place_walls(t, volume->capture_ns, &walls);
        place_lost(t, &walls, volume->capture_ns, &lost);
        heard = walls;
        if (is_tracked(t, volume))
            reach_beyond(&t->detector.survey, &heard);
    }
    int err = detector_volume(&t->detector, volume, &heard, out, why);
    if (err)
        return err;
    sight_init(&sight, &t->detector.survey, &walls, &lost, &volume->grid);
    note_lost(t, &sight, out, volume->capture_ns);
    find_view(t, volume, &sight, &out->view);
    if (!is_tracked(t, volume))
        return 0;
    err = follow(t, volume, &sight, out);
    if (err)
        return error_say(why, err, "an image that is not newer than the one before");
    t->stamp_ns = volume->capture_ns;
    t->n_reports = tracker_report(t->tracker, t->reports);
    learn_residue(t, volume, &sight);
    list_tracks(t, &sight, !t->has_walls && !walls.n, out);
    return 0;
}

struct track_counts object_tracker_counts(const struct object_tracker *t)
{
    return tracker_counts(t->tracker);
}

void object_tracker_destroy(struct object_tracker *t)
{
    if (!t)
        return;
    detector_clear(&t->detector);
    tracker_destroy(t->tracker);
    free(t);
}
