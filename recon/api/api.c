/* SPDX-License-Identifier: MIT */
#include "recon/api/api.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define LATEST_NS (INT64_MAX / 4) /* differences and sums of stamps do not overflow */

/* -- version ----------------------------------------------------------------------------
 */

const char *anlos_version(void)
{
    return ANLOS_VERSION;
}

uint32_t anlos_version_number(void)
{
    return ANLOS_VERSION_NUMBER;
}

/* -- errors -----------------------------------------------------------------------------
 */

const char *anlos_code_text(int code)
{
    switch (code) {
    case ANLOS_OK:
        return "no error";
    case ANLOS_INVALID:
        return "invalid argument";
    case ANLOS_VERSION_MISMATCH:
        return "headers and library do not go together";
    case ANLOS_NO_MEMORY:
        return "out of memory";
    case ANLOS_UNSUPPORTED:
        return "not supported";
    case ANLOS_NOT_READY:
        return "not ready";
    case ANLOS_STALE:
        return "too old";
    case ANLOS_NO_THREADS:
        return "no threads left";
    case ANLOS_CANCELED:
        return "stopped";
    default:
        return "failed";
    }
}

int api_fail(struct anlos_error *why, int code, const char *format, ...)
{
    if (why) {
        va_list args;
        va_start(args, format);
        vsnprintf(why->text, sizeof why->text, format, args);
        va_end(args);
        why->code = code;
    }
    return code;
}

static int code_of(int err)
{
    static const struct {
        int err, code;
    } codes[] = {{-EINVAL, ANLOS_INVALID},    {-ERANGE, ANLOS_INVALID},
                 {-EFBIG, ANLOS_INVALID},     {-ENOENT, ANLOS_INVALID},
                 {-ENOMEM, ANLOS_NO_MEMORY},  {-ENOTSUP, ANLOS_UNSUPPORTED},
                 {-EAGAIN, ANLOS_NO_THREADS}, {-ESTALE, ANLOS_STALE},
                 {-ECANCELED, ANLOS_CANCELED}};

    for (size_t i = 0; i < sizeof codes / sizeof *codes; i++)
        if (codes[i].err == err)
            return codes[i].code;
    return ANLOS_FAILED;
}

int api_fail_inside(struct anlos_error *why, int err, const struct error *inside,
                    const char *doing)
{
    int code = code_of(err);

    if (inside && inside->text[0])
        return api_fail(why, code, "%.*s", (int)sizeof why->text - 1, inside->text);
    return api_fail(why, code, "%s: %s", doing, anlos_code_text(code));
}

/* -- arguments --------------------------------------------------------------------------
 */

int api_there(const void *argument, const char *name, struct anlos_error *why)
{
    return argument ? 0 : api_fail(why, ANLOS_INVALID, "%s is NULL", name);
}

int api_finite(const double *x, size_t n, const char *name, struct anlos_error *why)
{
    for (size_t i = 0; i < n; i++)
        if (!isfinite(x[i]))
            return api_fail(why, ANLOS_INVALID,
                            "%s: number %zu is %g, expected a finite one", name, i, x[i]);
    return 0;
}

int api_stamp(int64_t stamp_ns, const char *name, struct anlos_error *why)
{
    if (stamp_ns >= 0 && stamp_ns < LATEST_NS)
        return 0;
    return api_fail(why, ANLOS_INVALID,
                    "%s is %lld, expected nanoseconds from 0 to under %lld", name,
                    (long long)stamp_ns, (long long)LATEST_NS);
}

static int check_size(size_t given, size_t least, size_t most, const char *name,
                      struct anlos_error *why)
{
    if (given >= least && given <= most)
        return 0;
    return api_fail(why, ANLOS_INVALID,
                    "%s: its size is %zu, and libanlos %s knows %zu to %zu; set it with "
                    ".size = sizeof, and compile against the headers of this library",
                    name, given, ANLOS_VERSION, least, most);
}

int api_take(void *out, size_t size, size_t least, const void *in, const char *name,
             struct anlos_error *why)
{
    size_t given;
    int code = api_there(in, name, why);

    if (code)
        return code;
    memcpy(&given, in, sizeof given);
    code = check_size(given, least, size, name, why);
    if (code)
        return code;
    memset(out, 0, size);
    memcpy(out, in, given);
    return 0;
}

int api_give(void *out, size_t least, const void *from, size_t size, const char *name,
             struct anlos_error *why)
{
    size_t given;
    int code = api_there(out, name, why);

    if (code)
        return code;
    memcpy(&given, out, sizeof given);
    code = check_size(given, least, size, name, why);
    if (code)
        return code;
    memcpy(out, from, given);
    memcpy(out, &given, sizeof given);
    return 0;
}

/* -- FFTW's planner, which is one for the whole process ---------------------------------
 */

static pthread_mutex_t planner = PTHREAD_MUTEX_INITIALIZER;

void api_lock(void)
{
    pthread_mutex_lock(&planner);
}

void api_unlock(void)
{
    pthread_mutex_unlock(&planner);
}

/* -- structures of inside ---------------------------------------------------------------
 */

void api_image(struct anlos_image *out, const struct volume *v)
{
    *out = (struct anlos_image){.size = sizeof *out,
                                .survey = v->survey_id,
                                .capture_ns = v->capture_ns,
                                .scan = v->scan,
                                .frame = v->frame,
                                .intensity = v->intensity,
                                .method = v->method,
                                .sound_speed_m_s = v->sound_speed_m_s,
                                .preview = v->preview,
                                .pings_used = v->pings_used,
                                .pings_expected = v->pings_expected,
                                .pings_blanked = v->pings_blanked,
                                .microphones_masked = v->microphones_masked,
                                .clipped_samples = v->clipped_samples,
                                .standing_left = v->standing_left,
                                .standing_taken = v->standing_taken,
                                .newest = v->newest};
    memcpy(out->newest_origin_m, v->blocks.origin_m, sizeof out->newest_origin_m);
    memcpy(out->newest_step_m, v->blocks.step_m, sizeof out->newest_step_m);
    memcpy(out->newest_n, v->blocks.n, sizeof out->newest_n);
    if (v->around.intensity) {
        const struct surroundings_view *a = &v->around;
        out->coarse = a->intensity;
        memcpy(out->coarse_origin_m, a->grid.origin_m, sizeof out->coarse_origin_m);
        memcpy(out->coarse_step_m, a->grid.step_m, sizeof out->coarse_step_m);
        memcpy(out->coarse_n, a->grid.n, sizeof out->coarse_n);
        out->beyond = a->n_spots ? a->spots[0] : NULL;
        out->n_beyond = a->n_spots;
    }
    out->movers = v->n_movers ? v->movers->at_m : NULL;
    out->n_movers = v->n_movers;
    out->ambiguous = v->n_ambiguous ? v->ambiguous->at_m : NULL;
    out->n_ambiguous = v->n_ambiguous;
    out->courses = v->n_courses ? v->courses->mover.at_m : NULL;
    out->n_courses = v->n_courses;
    memcpy(out->origin_m, v->grid.origin_m, sizeof out->origin_m);
    memcpy(out->step_m, v->grid.step_m, sizeof out->step_m);
    memcpy(out->n, v->grid.n, sizeof out->n);
}

void api_list(struct anlos_list *out, const struct object_list *l, int64_t capture_ns)
{
    *out = (struct anlos_list){.size = sizeof *out,
                               .n = l->n,
                               .capture_ns = capture_ns,
                               .scan = l->scan,
                               .frame = l->frame,
                               .counter = l->counter,
                               .preview = l->preview,
                               .mirrored = l->mirrored,
                               .in_vehicle_frame = l->in_vehicle_frame,
                               .tracked = l->tracked,
                               .ego_unknown = l->ego_unknown,
                               .n_areas = l->view.n};
}

static int shape_of(enum shape shape)
{
    static const int shapes[] = {[SHAPE_UNKNOWN] = ANLOS_SHAPE_UNKNOWN,
                                 [SHAPE_POINT] = ANLOS_POINT,
                                 [SHAPE_PLATE] = ANLOS_PLATE,
                                 [SHAPE_EXTENDED] = ANLOS_EXTENDED};
    return shapes[shape];
}

static int multipath_of(enum multipath multipath)
{
    static const int ways[] = {[MULTIPATH_NONE] = ANLOS_DIRECT,
                               [MULTIPATH_PAIR] = ANLOS_PAIR,
                               [MULTIPATH_FACE] = ANLOS_FACE,
                               [MULTIPATH_SHADOW] = ANLOS_SHADOW};
    return ways[multipath];
}

static void api_track(struct anlos_object *out, const struct object *o)
{
    static const int states[] = {[TRACK_NEW] = ANLOS_NEW,
                                 [TRACK_MEASURED] = ANLOS_MEASURED,
                                 [TRACK_PREDICTED] = ANLOS_PREDICTED,
                                 [TRACK_DELETED] = ANLOS_DELETED};
    static const int motions[] = {[TRACK_MOTION_UNKNOWN] = ANLOS_MOTION_UNKNOWN,
                                  [TRACK_STANDING] = ANLOS_STANDING,
                                  [TRACK_MOVING] = ANLOS_MOVING};

    out->tracked = true;
    out->state = states[o->state];
    out->motion = motions[o->motion];
    out->age_s = o->age_s;
    out->unseen_s = o->unseen_s;
    memcpy(out->velocity_m_s, o->velocity_m_s, sizeof out->velocity_m_s);
    memcpy(out->velocity_m2_s2, o->velocity_m2_s2, sizeof out->velocity_m2_s2);
}

void api_object(struct anlos_object *out, const struct object *o)
{
    const struct placement *p = &o->place;

    *out = (struct anlos_object){.size = sizeof *out,
                                 .id = o->id,
                                 .placed = o->placed,
                                 .wall = p->wall,
                                 .height_assumed = p->height_assumed,
                                 .behind_no_wall = p->behind_no_wall,
                                 .in_free_view = p->in_free_view,
                                 .existence = o->existence,
                                 .level_db = o->level_db,
                                 .shape = shape_of(o->shape.shape),
                                 .shape_probability = o->shape.probability,
                                 .multipath = multipath_of(o->multipath),
                                 .of = {o->of[0], o->of[1]},
                                 .at_border = o->at_border};
    memcpy(out->position_m, p->position_m, sizeof out->position_m);
    memcpy(out->covariance_m2, p->covariance_m2, sizeof out->covariance_m2);
    memcpy(out->extent_m, p->extent_m, sizeof out->extent_m);
    memcpy(out->virtual_m, o->virtual_m, sizeof out->virtual_m);
    if (o->tracked)
        api_track(out, o);
}

void api_wall(struct anlos_wall *out, const struct walls *walls, size_t i)
{
    static const int origins[] = {[WALL_CONFIGURED] = ANLOS_WALL_CONFIGURED,
                                  [WALL_GIVEN] = ANLOS_WALL_GIVEN,
                                  [WALL_ESTIMATED] = ANLOS_WALL_ESTIMATED};
    const struct wall_gate *w = &walls->list[i];

    *out = (struct anlos_wall){.size = sizeof *out,
                               .id = w->id,
                               .distance_m = w->plane.distance_m,
                               .gate_m = {w->gate_m[0], w->gate_m[1]},
                               .existence = walls->existence[i],
                               .unseen_s = walls->unseen_s[i],
                               .origin = origins[walls->origin[i]]};
    memcpy(out->normal, w->plane.normal, sizeof out->normal);
    memcpy(out->covariance, w->plane.covariance, sizeof out->covariance);
    memcpy(out->ends_m, w->plane.ends_m, sizeof out->ends_m);
}

static int take_wall(struct walls *out, size_t i, const struct anlos_wall *w,
                     struct anlos_error *why)
{
    bool ungated = w->gate_m[0] == 0.0 && w->gate_m[1] == 0.0;

    if (!(w->existence >= 0.0 && w->existence <= 1.0) ||
        !(w->unseen_s >= 0.0 && isfinite(w->unseen_s)))
        return api_fail(
            why, ANLOS_INVALID,
            "wall %zu: existence %g and unseen_s %g, expected 0 to 1 and 0 or "
            "more",
            i, w->existence, w->unseen_s);
    if (w->origin < ANLOS_WALL_CONFIGURED || w->origin > ANLOS_WALL_ESTIMATED)
        return api_fail(why, ANLOS_INVALID, "wall %zu: origin is %d, expected %d to %d",
                        i, w->origin, ANLOS_WALL_CONFIGURED, ANLOS_WALL_ESTIMATED);
    out->list[i] = (struct wall_gate){
        .id = w->id,
        .plane = {.distance_m = w->distance_m},
        .gate_m = {w->gate_m[0], ungated ? WALLS_FAR_M : w->gate_m[1]}};
    memcpy(out->list[i].plane.normal, w->normal, sizeof w->normal);
    memcpy(out->list[i].plane.covariance, w->covariance, sizeof w->covariance);
    memcpy(out->list[i].plane.ends_m, w->ends_m, sizeof w->ends_m);
    out->existence[i] = w->existence;
    out->unseen_s[i] = w->unseen_s;
    out->origin[i] = w->origin == ANLOS_WALL_CONFIGURED ? WALL_CONFIGURED
                     : w->origin == ANLOS_WALL_GIVEN    ? WALL_GIVEN
                                                        : WALL_ESTIMATED;
    return 0;
}

int api_walls(struct walls *out, const struct anlos_wall *walls, size_t n,
              struct anlos_error *why)
{
    struct error inside = {""};
    int code = n ? api_there(walls, "walls", why) : 0;

    *out = (struct walls){.n = n};
    if (!code && n > WALLS_MAX)
        code =
            api_fail(why, ANLOS_INVALID, "%zu walls, expected at most %d", n, WALLS_MAX);
    for (size_t i = 0; !code && i < n; i++) {
        const char *at = (const char *)walls + i * walls->size;
        struct anlos_wall w;
        code = API_TAKE(&w, at, "struct anlos_wall", why);
        if (!code)
            code = take_wall(out, i, &w, why);
    }
    if (code)
        return code;
    int err = walls_check(out, &inside);
    if (err)
        return api_fail_inside(why, err, &inside, "walls");
    walls_normalise(out);
    return 0;
}

/* -- what stages hand on ----------------------------------------------------------------
 */

static int check_there(const struct api_objects *o, struct anlos_error *why)
{
    return o->there ? 0
                    : api_fail(why, ANLOS_NOT_READY,
                               "there is no list of objects yet: one comes with each "
                               "image");
}

int api_objects_list(const struct api_objects *o, struct anlos_list *out,
                     struct anlos_error *why)
{
    struct anlos_list own;
    int code = check_there(o, why);

    if (code)
        return code;
    api_list(&own, &o->list, o->capture_ns);
    return API_GIVE(out, &own, "struct anlos_list", why);
}

int api_objects_at(const struct api_objects *o, size_t i, struct anlos_object *out,
                   struct anlos_error *why)
{
    struct anlos_object own;
    int code = check_there(o, why);

    if (!code && i >= o->list.n)
        code = api_fail(why, ANLOS_INVALID, "object %zu of %zu, counted from 0", i,
                        o->list.n);
    if (code)
        return code;
    api_object(&own, &o->list.objects[i]);
    return API_GIVE(out, &own, "struct anlos_object", why);
}

_Static_assert(sizeof((struct view_area){0}.corners_m) ==
                   sizeof((struct anlos_area){0}.corners_m),
               "");

int api_objects_area(const struct api_objects *o, size_t i, struct anlos_area *out,
                     struct anlos_error *why)
{
    struct anlos_area own;
    int code = check_there(o, why);

    if (!code && i >= o->list.view.n)
        code = api_fail(why, ANLOS_INVALID, "area %zu of %zu, counted from 0", i,
                        o->list.view.n);
    if (code)
        return code;
    const struct view_area *a = &o->list.view.areas[i];
    own = (struct anlos_area){.size = sizeof own, .wall = a->wall, .n_corners = a->n};
    memcpy(own.corners_m, a->corners_m, sizeof own.corners_m);
    return API_GIVE(out, &own, "struct anlos_area", why);
}

int api_motion(struct ego_motion *out, double speed_m_s, double yaw_rate_rad_s,
               int64_t capture_ns, struct anlos_error *why)
{
    *out = (struct ego_motion){speed_m_s, yaw_rate_rad_s};
    if (!ego_motion_is_plausible(out))
        return api_fail(why, ANLOS_INVALID,
                        "a vehicle with %g m/s and %g rad/s, expected up to %g and %g",
                        speed_m_s, yaw_rate_rad_s, EGO_FASTEST_M_S, EGO_FASTEST_RAD_S);
    return api_stamp(capture_ns, "capture_ns of ego motion", why);
}

/* 2^28 voxels at most along an axis, as grid_from_limits has it. */
static int take_grid(struct grid *out, const double origin_m[3], const double step_m[3],
                     const size_t n[3], const char *what, struct anlos_error *why)
{
    int code = api_finite(origin_m, 3, "origin of an image", why);

    for (int a = 0; !code && a < 3; a++)
        if (n[a] < 1 || n[a] > (size_t)1 << 28 || !(step_m[a] > 0.0) ||
            !isfinite(step_m[a]))
            code = api_fail(why, ANLOS_INVALID,
                            "an image of %zu %s of %g m along %c, expected 1 or more of "
                            "over 0",
                            n[a], what, step_m[a], "xyz"[a]);
    memcpy(out->origin_m, origin_m, sizeof out->origin_m);
    memcpy(out->step_m, step_m, sizeof out->step_m);
    memcpy(out->n, n, sizeof out->n);
    return code;
}

static int take_around(struct surroundings_view *out, const struct anlos_image *v,
                       struct anlos_error *why)
{
    size_t n = v->n_beyond;
    int code = 0;

    *out = (struct surroundings_view){
        .intensity = v->coarse, .n_spots = n, .spots = (const float(*)[4])v->beyond};
    if (v->coarse)
        code = take_grid(&out->grid, v->coarse_origin_m, v->coarse_step_m, v->coarse_n,
                         "coarse voxels", why);
    if (!code && n > SURROUNDINGS_SPOTS)
        code = api_fail(why, ANLOS_INVALID,
                        "beyond of an image: %zu places, expected %d at most", n,
                        SURROUNDINGS_SPOTS);
    if (!code && n)
        code = api_there(v->beyond, "beyond of an image", why);
    for (size_t i = 0; !code && i < 4 * n; i++)
        if (!isfinite(v->beyond[i]) || (i % 4 == 3 && v->beyond[i] < 0.0f))
            code = api_fail(why, ANLOS_INVALID, "beyond of an image: place %zu is none",
                            i / 4);
    return code;
}

static int take_rows(const float *rows, size_t n, const char *what,
                     struct anlos_error *why)
{
    if (n > VOLUME_MOVERS)
        return api_fail(why, ANLOS_INVALID, "%s: %zu, expected %d at most", what, n,
                        VOLUME_MOVERS);
    return n ? api_there(rows, what, why) : 0;
}

static int take_movers(const float *rows, size_t n, const char *what,
                       struct anlos_error *why)
{
    const struct volume_mover *movers = (const void *)rows;
    int code = take_rows(rows, n, what, why);

    for (size_t i = 0; !code && i < n; i++)
        if (!volume_mover_is_sound(&movers[i]))
            code = api_fail(why, ANLOS_INVALID, "%s: %zu is none", what, i);
    return code;
}

static int take_courses(const float *rows, size_t n, struct anlos_error *why)
{
    const struct volume_course *courses = (const void *)rows;
    int code = take_rows(rows, n, "courses of an image", why);

    for (size_t i = 0; !code && i < n; i++)
        if (!volume_course_is_sound(&courses[i]))
            code = api_fail(why, ANLOS_INVALID, "courses of an image: %zu is none", i);
    return code;
}

int api_volume(struct volume *out, const struct anlos_image *given, uint64_t id,
               struct anlos_error *why)
{
    struct anlos_image v;
    int code = API_TAKE(&v, given, "struct anlos_image", why);
    struct grid grid, blocks = {.n = {0}};
    struct surroundings_view around;

    if (!code)
        code = api_there(v.intensity, "intensity of an image", why);
    if (!code)
        code = api_stamp(v.capture_ns, "capture_ns of an image", why);
    if (!code && v.survey && v.survey != id)
        code = api_fail(why, ANLOS_INVALID,
                        "an image of another survey than this was created for");
    if (!code)
        code = take_grid(&grid, v.origin_m, v.step_m, v.n, "voxels", why);
    if (!code && v.newest)
        code = take_grid(&blocks, v.newest_origin_m, v.newest_step_m, v.newest_n,
                         "blocks", why);
    if (!code)
        code = take_around(&around, &v, why);
    if (!code)
        code = take_movers(v.movers, v.n_movers, "movers of an image", why);
    if (!code)
        code = take_movers(v.ambiguous, v.n_ambiguous, "ambiguous of an image", why);
    if (!code)
        code = take_courses(v.courses, v.n_courses, why);
    if (code)
        return code;
    *out = (struct volume){.survey_id = id,
                           .capture_ns = v.capture_ns,
                           .scan = v.scan,
                           .frame = v.frame,
                           .grid = grid,
                           .intensity = v.intensity,
                           .blocks = blocks,
                           .newest = v.newest,
                           .around = around,
                           .method = v.method ? v.method : "",
                           .sound_speed_m_s = v.sound_speed_m_s,
                           .preview = v.preview,
                           .pings_used = v.pings_used,
                           .pings_expected = v.pings_expected,
                           .pings_blanked = v.pings_blanked,
                           .microphones_masked = v.microphones_masked,
                           .clipped_samples = v.clipped_samples,
                           .standing_left = v.standing_left,
                           .standing_taken = v.standing_taken,
                           .movers = (const void *)v.movers,
                           .n_movers = v.n_movers,
                           .ambiguous = (const void *)v.ambiguous,
                           .n_ambiguous = v.n_ambiguous,
                           .courses = (const void *)v.courses,
                           .n_courses = v.n_courses};
    return 0;
}

int api_traces(struct traces *out, const struct anlos_traces *given,
               const struct survey *survey, uint64_t id, const bool *unmasked,
               struct anlos_error *why)
{
    struct anlos_traces t;
    int code = API_TAKE(&t, given, "struct anlos_traces", why);

    if (!code)
        code = api_there(t.samples, "samples of traces", why);
    if (!code)
        code = api_stamp(t.capture_ns, "capture_ns of traces", why);
    if (!code && t.survey && t.survey != id)
        code = api_fail(why, ANLOS_INVALID,
                        "traces of another survey than this was created for");
    if (!code && (t.n_microphones != survey->n_microphones ||
                  t.speaker >= survey->n_speakers || t.position >= survey->n_positions))
        code = api_fail(why, ANLOS_INVALID,
                        "traces of %zu microphones, speaker %u and position %u, but the "
                        "survey has %zu, %zu and %zu",
                        t.n_microphones, t.speaker, t.position, survey->n_microphones,
                        survey->n_speakers, survey->n_positions);
    if (code)
        return code;
    *out = (struct traces){.survey_id = id,
                           .capture_ns = t.capture_ns,
                           .scan = t.scan,
                           .frame = t.frame,
                           .position = t.position,
                           .speaker = t.speaker,
                           .stage_m = survey->stage_positions_m[t.position],
                           .temperature_c = NAN,
                           .down = t.down,
                           .background_subtracted = t.background_subtracted,
                           .blanked = t.blanked,
                           .clipped_samples = t.clipped_samples,
                           .n_microphones = t.n_microphones,
                           .format = {t.t0_s, t.rate_hz, t.carrier_hz, t.n_samples},
                           .samples = (const float complex *)(const void *)t.samples,
                           .masked = t.masked ? t.masked : unmasked};
    return 0;
}

int api_fail_ping(const struct frontend_output *front, struct anlos_error *why)
{
    const char *note = front->note;

    if (front->outcome == FRONTEND_LACKS_BACKGROUND)
        return api_fail(why, ANLOS_NOT_READY,
                        "%s; feed that ping with `background` set before",
                        note[0] ? note : "no background of this ping was recorded");
    return api_fail(why, ANLOS_INVALID, "%s", note[0] ? note : "this ping is of no use");
}
