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
                 {-EAGAIN, ANLOS_NO_THREADS}, {-ESTALE, ANLOS_STALE}};

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
                                .standing_taken = v->standing_taken};
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
                               .ego_unknown = l->ego_unknown};
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
