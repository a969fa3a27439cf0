/* SPDX-License-Identifier: MIT */
/* The stages by themselves.  Each handle holds its stage, the configuration that it
 * borrows from, and what it needs of the survey. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/api/api.h"

/* What all creates begin with: room, configuration, survey.  The handles begin with the
 * configuration. */
static void *begin(void *out, size_t size, const struct anlos_config *cfg,
                   const struct anlos_survey *survey, int *code, struct anlos_error *why)
{
    void *nothing = NULL;

    *code = api_there(out, "out", why);
    if (*code)
        return NULL;
    memcpy(out, &nothing, sizeof nothing);
    *code = api_survey(survey, why);
    if (*code)
        return NULL;
    struct api_config *handle = calloc(1, size);
    if (!handle) {
        *code = api_fail(why, ANLOS_NO_MEMORY, "out of memory");
        return NULL;
    }
    *code = api_configure(handle, cfg, why);
    if (*code) {
        free(handle);
        return NULL;
    }
    return handle;
}

/* -- compressor -------------------------------------------------------------------------
 */

struct anlos_compressor {
    struct api_config cfg;
    struct api_pings pings;
    struct frontend *inside;
};

int anlos_compressor_create(struct anlos_compressor **out, const struct anlos_config *cfg,
                            const struct anlos_survey *survey, struct anlos_error *why)
{
    struct error inside = {""};
    int code;
    struct anlos_compressor *c = begin(out, sizeof *c, cfg, survey, &code, why);

    if (!c)
        return code;
    code = api_pings_survey(&c->pings, &survey->inside, why);
    api_lock();
    int err = code ? 0 : frontend_create(&c->inside, &c->cfg.inside.frontend);
    if (!code && !err)
        err = frontend_survey(c->inside, &survey->inside, &inside);
    api_unlock();
    if (err)
        code = api_fail_inside(why, err, &inside, "compressor");
    if (code)
        anlos_compressor_destroy(c);
    else
        *out = c;
    return code;
}

void anlos_compressor_destroy(struct anlos_compressor *c)
{
    if (!c)
        return;
    api_lock();
    frontend_destroy(c->inside);
    api_unlock();
    api_pings_forget(&c->pings);
    free(c);
}

static void give_traces(struct anlos_traces *out, const struct traces *t)
{
    *out = (struct anlos_traces){.size = sizeof *out,
                                 .survey = t->survey_id,
                                 .capture_ns = t->capture_ns,
                                 .scan = t->scan,
                                 .frame = t->frame,
                                 .position = t->position,
                                 .speaker = t->speaker,
                                 .down = t->down,
                                 .background_subtracted = t->background_subtracted,
                                 .blanked = t->blanked,
                                 .clipped_samples = t->clipped_samples,
                                 .n_microphones = t->n_microphones,
                                 .n_samples = t->format.n_samples,
                                 .t0_s = t->format.t0_s,
                                 .rate_hz = t->format.rate_hz,
                                 .carrier_hz = t->format.carrier_hz,
                                 .samples = (const float *)(const void *)t->samples,
                                 .masked = t->masked};
}

int anlos_compressor_ping(struct anlos_compressor *c, const struct anlos_ping *ping,
                          struct anlos_traces *out, struct anlos_error *why)
{
    struct frontend_output front;
    struct anlos_traces own;
    struct ping inside;
    int64_t now_ns;
    int code = api_there(c, "compressor", why);

    if (!code) /* before anything is counted */
        code = API_TAKE(&own, out, "struct anlos_traces", why);
    if (!code)
        code = api_pings_take(&c->pings, &c->cfg, ping, &inside, &now_ns, why);
    if (code)
        return code;
    frontend_ping(c->inside, &inside, &front);
    if (front.outcome == FRONTEND_KEPT)
        return 0;
    if (front.outcome != FRONTEND_TRACES)
        return api_fail_ping(&front, why);
    give_traces(&own, &front.traces);
    code = API_GIVE(out, &own, "struct anlos_traces", why);
    return code ? code : 1;
}

int anlos_compressor_ego(struct anlos_compressor *c, double speed_m_s,
                         double yaw_rate_rad_s, int64_t capture_ns,
                         struct anlos_error *why)
{
    struct ego_motion motion;
    int code = api_there(c, "compressor", why);

    if (!code)
        code = api_motion(&motion, speed_m_s, yaw_rate_rad_s, capture_ns, why);
    if (!code)
        frontend_ego(c->inside, &motion, capture_ns);
    return code;
}

/* -- imager -----------------------------------------------------------------------------
 */

struct anlos_imager {
    struct api_config cfg;
    struct survey survey;
    struct scan_imager *inside;
};

int anlos_imager_create(struct anlos_imager **out, const struct anlos_config *cfg,
                        const struct anlos_survey *survey, struct anlos_error *why)
{
    struct error inside = {""};
    int code;
    struct anlos_imager *m = begin(out, sizeof *m, cfg, survey, &code, why);

    if (!m)
        return code;
    api_lock();
    int err = survey_copy(&m->survey, &survey->inside);
    if (!err)
        err = scan_imager_create(&m->inside, &m->cfg.inside.scan);
    if (!err)
        err = scan_imager_survey(m->inside, &survey->inside, &inside);
    api_unlock();
    if (err) {
        code = api_fail_inside(why, err, &inside, "imager");
        anlos_imager_destroy(m);
        return code;
    }
    *out = m;
    return 0;
}

void anlos_imager_destroy(struct anlos_imager *m)
{
    if (!m)
        return;
    api_lock();
    scan_imager_destroy(m->inside);
    api_unlock();
    survey_clear(&m->survey);
    free(m);
}

static int fail_format(struct anlos_error *why)
{
    return api_fail(
        why, ANLOS_INVALID,
        "traces that do not fit the survey: expected those of a compressor of "
        "the same survey and configuration");
}

int anlos_imager_add(struct anlos_imager *m, const struct anlos_traces *traces,
                     struct anlos_error *why)
{
    struct traces inside;
    int code = api_there(m, "imager", why);

    if (!code)
        code = api_traces(&inside, traces, &m->survey, scan_imager_survey_id(m->inside),
                          NULL, why);
    if (code)
        return code;
    if (scan_imager_traces(m->inside, &inside))
        return fail_format(why);
    return scan_imager_is_complete(m->inside);
}

int anlos_imager_image(struct anlos_imager *m, struct anlos_image *out,
                       struct anlos_error *why)
{
    struct anlos_image own;
    struct volume volume;
    int code = api_there(m, "imager", why);

    if (!code)
        code = API_TAKE(&own, out, "struct anlos_image", why);
    if (!code && !scan_imager_pings(m->inside))
        code = api_fail(why, ANLOS_NOT_READY, "an image before there are traces");
    if (code)
        return code;
    int err = scan_imager_image(m->inside, !scan_imager_is_complete(m->inside), &volume);
    if (err)
        return api_fail_inside(why, err, NULL, "image");
    api_image(&own, &volume);
    return API_GIVE(out, &own, "struct anlos_image", why);
}

/* -- static array -----------------------------------------------------------------------
 */

struct anlos_static_array {
    struct api_config cfg;
    struct survey survey;
    struct static_array *inside;
    bool *unmasked; /* [n_microphones], all false */
    bool has_pings;
};

int anlos_static_array_create(struct anlos_static_array **out,
                              const struct anlos_config *cfg,
                              const struct anlos_survey *survey, struct anlos_error *why)
{
    struct error inside = {""};
    int code;
    struct anlos_static_array *a = begin(out, sizeof *a, cfg, survey, &code, why);

    if (!a)
        return code;
    a->unmasked = calloc(survey->inside.n_microphones, sizeof *a->unmasked);
    api_lock();
    int err = a->unmasked ? survey_copy(&a->survey, &survey->inside) : -ENOMEM;
    if (!err)
        err = static_array_create(&a->inside, &a->cfg.inside.array);
    if (!err)
        err = static_array_survey(a->inside, &survey->inside, &inside);
    api_unlock();
    if (err) {
        code = api_fail_inside(why, err, &inside, "static array");
        anlos_static_array_destroy(a);
        return code;
    }
    *out = a;
    return 0;
}

void anlos_static_array_destroy(struct anlos_static_array *a)
{
    if (!a)
        return;
    api_lock();
    static_array_destroy(a->inside);
    api_unlock();
    survey_clear(&a->survey);
    free(a->unmasked);
    free(a);
}

int anlos_static_array_ego(struct anlos_static_array *a, double speed_m_s,
                           double yaw_rate_rad_s, int64_t capture_ns,
                           struct anlos_error *why)
{
    struct ego_motion motion;
    int code = api_there(a, "static array", why);

    if (!code)
        code = api_motion(&motion, speed_m_s, yaw_rate_rad_s, capture_ns, why);
    if (!code)
        static_array_ego(a->inside, &motion, capture_ns);
    return code;
}

int anlos_static_array_walls(struct anlos_static_array *a, const struct anlos_wall *walls,
                             size_t n, int64_t capture_ns, struct anlos_error *why)
{
    struct walls inside;
    int code = api_there(a, "static array", why);

    if (!code)
        code = api_walls(&inside, walls, n, why);
    if (!code)
        code = api_stamp(capture_ns, "capture_ns of walls", why);
    if (!code)
        static_array_walls(a->inside, &inside, capture_ns);
    return code;
}

int anlos_static_array_add(struct anlos_static_array *a,
                           const struct anlos_traces *traces, struct anlos_error *why)
{
    struct traces inside;
    char note[128];
    int code = api_there(a, "static array", why);

    if (!code)
        code = api_traces(&inside, traces, &a->survey, static_array_survey_id(a->inside),
                          a->unmasked, why);
    if (code)
        return code;
    uint64_t unfit = static_array_counts(a->inside)->unfit;
    bool due = static_array_traces(a->inside, &inside, note, sizeof note);
    if (static_array_counts(a->inside)->unfit != unfit)
        return fail_format(why);
    a->has_pings = true;
    return due;
}

int anlos_static_array_image(struct anlos_static_array *a, struct anlos_image *out,
                             struct anlos_error *why)
{
    struct anlos_image own;
    struct volume volume;
    int code = api_there(a, "static array", why);

    if (!code)
        code = API_TAKE(&own, out, "struct anlos_image", why);
    if (!code && !a->has_pings)
        code = api_fail(why, ANLOS_NOT_READY, "an image before there are traces");
    if (code)
        return code;
    static_array_image(a->inside, &volume);
    api_image(&own, &volume);
    return API_GIVE(out, &own, "struct anlos_image", why);
}

/* -- wall finder ------------------------------------------------------------------------
 */

struct anlos_wall_finder {
    struct api_config cfg;
    struct api_pings pings;
    struct wall_finder *inside;
    struct walls walls; /* the newest list */
    int64_t walls_ns;
};

int anlos_wall_finder_create(struct anlos_wall_finder **out,
                             const struct anlos_config *cfg,
                             const struct anlos_survey *survey, struct anlos_error *why)
{
    struct error inside = {""};
    int code;
    struct anlos_wall_finder *f = begin(out, sizeof *f, cfg, survey, &code, why);

    if (!f)
        return code;
    if (!f->cfg.inside.finds_walls)
        f->cfg.inside.walls.map.from = WALL_FROM_SURVEY;
    f->cfg.inside.walls.takes_pings = true;
    code = api_pings_survey(&f->pings, &survey->inside, why);
    api_lock();
    int err = code ? 0 : wall_finder_create(&f->inside, &f->cfg.inside.walls);
    if (!code && !err)
        err = wall_finder_survey(f->inside, &survey->inside, &inside);
    api_unlock();
    if (err)
        code = api_fail_inside(why, err, &inside, "wall finder");
    if (code)
        anlos_wall_finder_destroy(f);
    else
        *out = f;
    return code;
}

void anlos_wall_finder_destroy(struct anlos_wall_finder *f)
{
    if (!f)
        return;
    api_lock();
    wall_finder_destroy(f->inside);
    api_unlock();
    api_pings_forget(&f->pings);
    free(f);
}

/* Is there a new list? */
static int follow(struct anlos_wall_finder *f, int64_t now_ns)
{
    const struct walls *walls = wall_finder_list(f->inside, now_ns, &f->walls_ns);

    if (walls)
        f->walls = *walls;
    return walls != NULL;
}

int anlos_wall_finder_ping(struct anlos_wall_finder *f, const struct anlos_ping *ping,
                           struct anlos_error *why)
{
    struct ping inside;
    int64_t now_ns;
    int code = api_there(f, "wall finder", why);

    if (!code)
        code = api_pings_take(&f->pings, &f->cfg, ping, &inside, &now_ns, why);
    if (code)
        return code;
    wall_finder_ping(f->inside, &inside, now_ns);
    return follow(f, now_ns);
}

int anlos_wall_finder_ego(struct anlos_wall_finder *f, double speed_m_s,
                          double yaw_rate_rad_s, int64_t capture_ns,
                          struct anlos_error *why)
{
    struct ego_motion motion;
    int code = api_there(f, "wall finder", why);

    if (!code)
        code = api_motion(&motion, speed_m_s, yaw_rate_rad_s, capture_ns, why);
    if (code)
        return code;
    wall_finder_ego(f->inside, &motion, capture_ns);
    return follow(f, capture_ns);
}

int anlos_wall_finder_given(struct anlos_wall_finder *f, const struct anlos_wall *walls,
                            size_t n, int64_t capture_ns, struct anlos_error *why)
{
    struct walls inside;
    struct error said = {""};
    int code = api_there(f, "wall finder", why);

    if (!code)
        code = api_walls(&inside, walls, n, why);
    if (!code)
        code = api_stamp(capture_ns, "capture_ns of walls", why);
    if (!code && f->cfg.inside.walls.map.from != WALL_FROM_TOPIC)
        code = api_fail(why, ANLOS_INVALID,
                        "walls that are given, but the configuration does not say "
                        "ANLOS_WALLS_GIVEN");
    if (code)
        return code;
    int err = wall_finder_given(f->inside, &inside, capture_ns, &said);
    return err ? api_fail_inside(why, err, &said, "walls") : follow(f, capture_ns);
}

size_t anlos_wall_finder_n_walls(const struct anlos_wall_finder *f, int64_t *capture_ns)
{
    if (capture_ns)
        *capture_ns = f ? f->walls_ns : 0;
    return f ? f->walls.n : 0;
}

int anlos_wall_finder_wall(const struct anlos_wall_finder *f, size_t i,
                           struct anlos_wall *out, struct anlos_error *why)
{
    struct anlos_wall own;
    int code = api_there(f, "wall finder", why);

    if (!code && i >= f->walls.n)
        code = api_fail(why, ANLOS_INVALID, "wall %zu of %zu, counted from 0", i,
                        f->walls.n);
    if (code)
        return code;
    api_wall(&own, &f->walls, i);
    return API_GIVE(out, &own, "struct anlos_wall", why);
}

/* -- detector ---------------------------------------------------------------------------
 */

struct anlos_detector {
    struct api_config cfg;
    struct detector inside;
    struct api_objects objects;
};

int anlos_detector_create(struct anlos_detector **out, const struct anlos_config *cfg,
                          const struct anlos_survey *survey, struct anlos_error *why)
{
    int code;
    struct anlos_detector *d = begin(out, sizeof *d, cfg, survey, &code, why);

    if (!d)
        return code;
    detector_init(&d->inside, &d->cfg.inside.tracker.detector);
    int err = detector_survey(&d->inside, &survey->inside);
    if (err) {
        anlos_detector_destroy(d);
        return api_fail_inside(why, err, NULL, "detector");
    }
    *out = d;
    return 0;
}

void anlos_detector_destroy(struct anlos_detector *d)
{
    if (!d)
        return;
    detector_clear(&d->inside);
    free(d);
}

static void keep(struct api_objects *o, const struct volume *volume)
{
    o->capture_ns = volume->capture_ns;
    o->there = true;
}

int anlos_detector_image(struct anlos_detector *d, const struct anlos_image *image,
                         const struct anlos_wall *walls, size_t n,
                         struct anlos_error *why)
{
    struct error inside = {""};
    struct volume volume;
    struct walls known;
    int code = api_there(d, "detector", why);

    if (!code)
        code = api_volume(&volume, image, d->inside.survey_id, why);
    if (!code && (walls || n))
        code = api_walls(&known, walls, n, why);
    if (code)
        return code;
    d->objects.there = false;
    int err = detector_volume(&d->inside, &volume, walls ? &known : NULL,
                              &d->objects.list, &inside);
    if (err)
        return api_fail_inside(why, err, &inside, "detector");
    keep(&d->objects, &volume);
    return 0;
}

int anlos_detector_list(const struct anlos_detector *d, struct anlos_list *out,
                        struct anlos_error *why)
{
    int code = api_there(d, "detector", why);

    return code ? code : api_objects_list(&d->objects, out, why);
}

int anlos_detector_object(const struct anlos_detector *d, size_t i,
                          struct anlos_object *out, struct anlos_error *why)
{
    int code = api_there(d, "detector", why);

    return code ? code : api_objects_at(&d->objects, i, out, why);
}

int anlos_detector_area(const struct anlos_detector *d, size_t i, struct anlos_area *out,
                        struct anlos_error *why)
{
    int code = api_there(d, "detector", why);

    return code ? code : api_objects_area(&d->objects, i, out, why);
}

/* -- tracker ----------------------------------------------------------------------------
 */

struct anlos_tracker {
    struct api_config cfg;
    struct object_tracker *inside;
    struct api_objects objects;
};

int anlos_tracker_create(struct anlos_tracker **out, const struct anlos_config *cfg,
                         const struct anlos_survey *survey, struct anlos_error *why)
{
    int code;
    struct anlos_tracker *t = begin(out, sizeof *t, cfg, survey, &code, why);

    if (!t)
        return code;
    t->cfg.inside.tracker.mode = OBJECT_TRACKER_TRACKS;
    int err = object_tracker_create(&t->inside, &t->cfg.inside.tracker);
    if (!err)
        err = object_tracker_survey(t->inside, &survey->inside);
    if (err) {
        anlos_tracker_destroy(t);
        return api_fail_inside(why, err, NULL, "tracker");
    }
    *out = t;
    return 0;
}

void anlos_tracker_destroy(struct anlos_tracker *t)
{
    if (!t)
        return;
    object_tracker_destroy(t->inside);
    free(t);
}

int anlos_tracker_ego(struct anlos_tracker *t, double speed_m_s, double yaw_rate_rad_s,
                      int64_t capture_ns, struct anlos_error *why)
{
    struct ego_motion motion;
    int code = api_there(t, "tracker", why);

    if (!code)
        code = api_motion(&motion, speed_m_s, yaw_rate_rad_s, capture_ns, why);
    if (!code)
        object_tracker_ego(t->inside, &motion, capture_ns);
    return code;
}

int anlos_tracker_walls(struct anlos_tracker *t, const struct anlos_wall *walls, size_t n,
                        int64_t capture_ns, struct anlos_error *why)
{
    struct walls inside;
    int code = api_there(t, "tracker", why);

    if (!code)
        code = api_walls(&inside, walls, n, why);
    if (!code)
        code = api_stamp(capture_ns, "capture_ns of walls", why);
    if (code)
        return code;
    int err = object_tracker_walls(t->inside, &inside, capture_ns);
    return err ? api_fail_inside(why, err, NULL, "walls") : 0;
}

int anlos_tracker_image(struct anlos_tracker *t, const struct anlos_image *image,
                        struct anlos_error *why)
{
    struct error inside = {""};
    struct volume volume;
    int code = api_there(t, "tracker", why);

    if (!code)
        code = api_volume(&volume, image, object_tracker_survey_id(t->inside), why);
    if (code)
        return code;
    t->objects.there = false;
    int err = object_tracker_volume(t->inside, &volume, &t->objects.list, &inside);
    if (err)
        return api_fail_inside(why, err, &inside, "tracker");
    keep(&t->objects, &volume);
    return 0;
}

int anlos_tracker_list(const struct anlos_tracker *t, struct anlos_list *out,
                       struct anlos_error *why)
{
    int code = api_there(t, "tracker", why);

    return code ? code : api_objects_list(&t->objects, out, why);
}

int anlos_tracker_object(const struct anlos_tracker *t, size_t i,
                         struct anlos_object *out, struct anlos_error *why)
{
    int code = api_there(t, "tracker", why);

    return code ? code : api_objects_at(&t->objects, i, out, why);
}

int anlos_tracker_area(const struct anlos_tracker *t, size_t i, struct anlos_area *out,
                       struct anlos_error *why)
{
    int code = api_there(t, "tracker", why);

    return code ? code : api_objects_area(&t->objects, i, out, why);
}

/* -- ego motion -------------------------------------------------------------------------
 */

struct anlos_ego {
    struct ego_path inside;
};

int anlos_ego_create(struct anlos_ego **out, struct anlos_error *why)
{
    int code = api_there(out, "out", why);

    if (code)
        return code;
    *out = calloc(1, sizeof **out);
    return *out ? 0 : api_fail(why, ANLOS_NO_MEMORY, "ego motion: out of memory");
}

void anlos_ego_destroy(struct anlos_ego *e)
{
    free(e);
}

int anlos_ego_add(struct anlos_ego *e, double speed_m_s, double yaw_rate_rad_s,
                  int64_t capture_ns, struct anlos_error *why)
{
    struct ego_motion motion;
    int code = api_there(e, "ego motion", why);

    if (!code)
        code = api_motion(&motion, speed_m_s, yaw_rate_rad_s, capture_ns, why);
    if (code)
        return code;
    if (ego_path_add(&e->inside, capture_ns, &motion))
        return api_fail(why, ANLOS_STALE,
                        "ego motion of %lld ns, which is not later than the newest",
                        (long long)capture_ns);
    return 0;
}

int anlos_ego_at(const struct anlos_ego *e, int64_t at_ns, double *speed_m_s,
                 double *yaw_rate_rad_s, struct anlos_error *why)
{
    struct ego_motion motion;
    int code = api_there(e, "ego motion", why);

    if (!code)
        code = api_there(speed_m_s, "speed_m_s", why);
    if (!code)
        code = api_there(yaw_rate_rad_s, "yaw_rate_rad_s", why);
    if (!code)
        code = api_stamp(at_ns, "at_ns", why);
    if (code)
        return code;
    if (ego_path_at(&e->inside, at_ns, &motion))
        return api_fail(why, ANLOS_NOT_READY, "ego motion is not known at %lld ns",
                        (long long)at_ns);
    *speed_m_s = motion.speed_m_s;
    *yaw_rate_rad_s = motion.yaw_rate_rad_s;
    return 0;
}

int anlos_ego_point(const struct anlos_ego *e, int64_t from_ns, int64_t to_ns,
                    const double from_m[3], double to_m[3], struct anlos_error *why)
{
    struct ego_step step;
    int code = api_there(e, "ego motion", why);

    if (!code)
        code = api_there(from_m, "from_m", why);
    if (!code)
        code = api_there(to_m, "to_m", why);
    if (!code)
        code = api_finite(from_m, 3, "from_m", why);
    if (!code)
        code = api_stamp(from_ns, "from_ns", why);
    if (!code)
        code = api_stamp(to_ns, "to_ns", why);
    if (code)
        return code;
    if (ego_path_between(&e->inside, from_ns, to_ns, &step))
        return api_fail(why, ANLOS_NOT_READY,
                        "ego motion is not known all the way from %lld to %lld ns",
                        (long long)from_ns, (long long)to_ns);
    ego_step_point(&step, from_m, to_m);
    return 0;
}
