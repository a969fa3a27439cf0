/* SPDX-License-Identifier: MIT */
#include "recon/pipeline.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "dsp/error.h"
#include "recon/api/api.h"
#include "recon/processing.h"

struct anlos_pipeline {
    struct pipeline *inside;
    struct api_config cfg;
    struct api_pings pings;
    struct anlos_image image; /* size 0: none */
    struct api_objects objects;
    uint64_t wall_lists; /* of which news was told */
    char note[512];
    struct anlos_health health;
};

/* -- life -------------------------------------------------------------------------------
 */

int anlos_pipeline_create(struct anlos_pipeline **out, const struct anlos_config *cfg,
                          const struct anlos_survey *survey, struct anlos_error *why)
{
    int code = api_there(out, "out", why);

    if (code)
        return code;
    *out = NULL;
    struct anlos_pipeline *p = calloc(1, sizeof *p);
    if (!p)
        return api_fail(why, ANLOS_NO_MEMORY, "pipeline: out of memory");
    code = api_configure(&p->cfg, cfg, why);
    if (!code) {
        int err = pipeline_create(&p->inside, &p->cfg.inside);
        if (err)
            code = api_fail_inside(why, err, NULL, "pipeline");
    }
    if (!code && survey)
        code = anlos_pipeline_survey(p, survey, why);
    if (code)
        anlos_pipeline_destroy(p);
    else
        *out = p;
    return code;
}

static void forget(struct anlos_pipeline *p)
{
    api_pings_forget(&p->pings);
    p->image.size = 0;
    p->objects.there = false;
}

void anlos_pipeline_destroy(struct anlos_pipeline *p)
{
    if (!p)
        return;
    api_lock();
    pipeline_destroy(p->inside);
    api_unlock();
    forget(p);
    free(p);
}

static int plan(struct anlos_pipeline *p, const struct survey *survey,
                struct anlos_error *why)
{
    struct error inside = {""};
    int code = api_pings_survey(&p->pings, survey, why);

    if (code)
        return code;
    api_lock();
    int err = pipeline_survey(p->inside, survey, &inside);
    api_unlock();
    return err ? api_fail_inside(why, err, &inside, "survey") : 0;
}

int anlos_pipeline_survey(struct anlos_pipeline *p, const struct anlos_survey *survey,
                          struct anlos_error *why)
{
    int code = api_there(p, "pipeline", why);

    if (!code)
        code = api_survey(survey, why);
    if (code || anlos_survey_id(survey) == p->pings.survey_id)
        return code;
    forget(p);
    code = plan(p, &survey->inside, why);
    if (code)
        forget(p);
    return code;
}

/* -- pings ------------------------------------------------------------------------------
 */

static void add_note(struct anlos_pipeline *p, const char *text)
{
    if (text[0])
        text_add(p->note, sizeof p->note, "; ", "%s", text);
}

static void count_front(struct anlos_pipeline *p, const struct frontend_output *front)
{
    p->health.microphones = front->faults.n;
    p->health.silent = front->faults.silent;
    p->health.damaged = front->faults.damaged;
    p->health.clipped = front->faults.clipped;
    if (front->outcome == FRONTEND_TRACES && front->traces.blanked) {
        p->health.blanked++;
        add_note(p, "a sound from outside drowned a ping, which is blanked");
    }
}

static int wall_news(struct anlos_pipeline *p)
{
    uint64_t lists;
    int64_t stamp_ns;

    pipeline_known_walls(p->inside, &stamp_ns, &lists);
    int news = lists != p->wall_lists ? ANLOS_NEW_WALLS : 0;
    p->health.wall_lists += lists - p->wall_lists;
    p->wall_lists = lists;
    return news;
}

/* What came of a ping, or of a scan's end. */
static int take_output(struct anlos_pipeline *p, const struct pipeline_output *out)
{
    int news = 0;

    add_note(p, out->note);
    p->health.unfit += out->unfit;
    if (out->image) {
        api_image(&p->image, out->image);
        p->health.images++;
        news |= ANLOS_NEW_IMAGE;
    }
    if (out->objects) {
        p->objects.list = *out->objects;
        p->objects.capture_ns = out->image->capture_ns;
        p->objects.there = true;
        p->health.lists++;
        news |= ANLOS_NEW_OBJECTS;
    }
    return news | wall_news(p) | (p->note[0] ? ANLOS_NEW_NOTE : 0);
}

static int feed(struct anlos_pipeline *p, const struct ping *ping, int64_t now_ns,
                struct anlos_error *why)
{
    struct pipeline_output out;
    struct error inside = {""};
    int err = pipeline_ping(p->inside, ping, now_ns, &out, &inside);

    count_front(p, out.front);
    add_note(p, out.front->note);
    int news = take_output(p, &out);
    if (out.front->outcome != FRONTEND_TRACES && out.front->outcome != FRONTEND_KEPT) {
        p->health.refused++;
        return api_fail_ping(out.front, why);
    }
    p->health.pings++;
    return err ? api_fail_inside(why, err, &inside, "objects") : news;
}

int anlos_pipeline_ping(struct anlos_pipeline *p, const struct anlos_ping *ping,
                        struct anlos_error *why)
{
    struct ping inside;
    int64_t now_ns;
    int code = api_there(p, "pipeline", why);

    if (code)
        return code;
    p->note[0] = 0;
    code = api_pings_take(&p->pings, &p->cfg, ping, &inside, &now_ns, why);
    if (!code)
        return feed(p, &inside, now_ns, why);
    p->health.refused++;
    return code;
}

int anlos_pipeline_finish(struct anlos_pipeline *p, struct anlos_error *why)
{
    struct pipeline_output out;
    struct error inside = {""};
    int code = api_there(p, "pipeline", why);

    if (code)
        return code;
    if (!p->pings.survey_id)
        return api_fail(why, ANLOS_NOT_READY, "a scan's end before there is a survey");
    p->note[0] = 0;
    int err = pipeline_finish(p->inside, &out, &inside);
    int news = take_output(p, &out);
    return err ? api_fail_inside(why, err, &inside, "objects") : news;
}

/* -- motion, air, walls -----------------------------------------------------------------
 */

int anlos_pipeline_ego(struct anlos_pipeline *p, double speed_m_s, double yaw_rate_rad_s,
                       int64_t capture_ns, struct anlos_error *why)
{
    struct ego_motion motion;
    struct error inside = {""};
    int code = api_there(p, "pipeline", why);

    if (!code)
        code = api_motion(&motion, speed_m_s, yaw_rate_rad_s, capture_ns, why);
    if (code)
        return code;
    p->note[0] = 0;
    int err = pipeline_ego(p->inside, &motion, capture_ns, capture_ns, &inside);
    int news = wall_news(p);
    return err ? api_fail_inside(why, err, &inside, "ego motion") : news;
}

int anlos_pipeline_air(struct anlos_pipeline *p, double temperature_c,
                       struct anlos_error *why)
{
    int code = api_there(p, "pipeline", why);

    if (code)
        return code;
    if (!(temperature_c >= -60.0 && temperature_c <= 80.0))
        return api_fail(why, ANLOS_INVALID, "air of %g C, expected -60 to 80",
                        temperature_c);
    pipeline_temperature(p->inside, temperature_c);
    return 0;
}

int anlos_pipeline_walls(struct anlos_pipeline *p, const struct anlos_wall *walls,
                         size_t n, int64_t capture_ns, struct anlos_error *why)
{
    struct walls inside;
    struct error said = {""};
    int code = api_there(p, "pipeline", why);

    if (!code)
        code = api_walls(&inside, walls, n, why);
    if (!code)
        code = api_stamp(capture_ns, "capture_ns of walls", why);
    if (code)
        return code;
    bool finds = p->cfg.inside.finds_walls;
    if (finds && p->cfg.inside.walls.map.from == WALL_FROM_ECHOES)
        return api_fail(why, ANLOS_INVALID,
                        "walls, but the configuration says that they are heard; expected "
                        "ANLOS_WALLS_GIVEN or ANLOS_WALLS_SURVEY");
    p->note[0] = 0;
    int err = finds ? pipeline_given(p->inside, &inside, capture_ns, capture_ns, &said)
                    : pipeline_walls(p->inside, &inside, capture_ns, &said);
    int news = wall_news(p);
    return err ? api_fail_inside(why, err, &said, "walls") : news;
}

/* -- out --------------------------------------------------------------------------------
 */

int anlos_pipeline_image(const struct anlos_pipeline *p, struct anlos_image *out,
                         struct anlos_error *why)
{
    int code = api_there(p, "pipeline", why);

    if (code)
        return code;
    if (!p->image.size)
        return api_fail(why, ANLOS_NOT_READY,
                        "there is no image yet: feed pings until one is news, or say "
                        "anlos_pipeline_finish");
    return API_GIVE(out, &p->image, "struct anlos_image", why);
}

int anlos_pipeline_list(const struct anlos_pipeline *p, struct anlos_list *out,
                        struct anlos_error *why)
{
    int code = api_there(p, "pipeline", why);

    return code ? code : api_objects_list(&p->objects, out, why);
}

int anlos_pipeline_object(const struct anlos_pipeline *p, size_t i,
                          struct anlos_object *out, struct anlos_error *why)
{
    int code = api_there(p, "pipeline", why);

    return code ? code : api_objects_at(&p->objects, i, out, why);
}

int anlos_pipeline_area(const struct anlos_pipeline *p, size_t i, struct anlos_area *out,
                        struct anlos_error *why)
{
    int code = api_there(p, "pipeline", why);

    return code ? code : api_objects_area(&p->objects, i, out, why);
}

/* Before somebody has told of them they are the survey's. */
static void known_walls(const struct anlos_pipeline *p, struct walls *out)
{
    uint64_t lists;
    int64_t stamp_ns;
    const struct walls *known = pipeline_known_walls(p->inside, &stamp_ns, &lists);

    if (known)
        *out = *known;
    else
        walls_from_survey(out, &p->pings.survey);
}

size_t anlos_pipeline_n_walls(const struct anlos_pipeline *p)
{
    struct walls known = {.n = 0};

    if (p && p->pings.survey_id)
        known_walls(p, &known);
    return known.n;
}

int anlos_pipeline_wall(const struct anlos_pipeline *p, size_t i, struct anlos_wall *out,
                        struct anlos_error *why)
{
    struct anlos_wall own;
    struct walls known;
    size_t n = anlos_pipeline_n_walls(p);
    int code = api_there(p, "pipeline", why);

    if (!code && i >= n)
        code = api_fail(why, ANLOS_INVALID, "wall %zu of %zu, counted from 0", i, n);
    if (code)
        return code;
    known_walls(p, &known);
    api_wall(&own, &known, i);
    return API_GIVE(out, &own, "struct anlos_wall", why);
}

const char *anlos_pipeline_note(const struct anlos_pipeline *p)
{
    return p ? p->note : "";
}

int anlos_pipeline_health(const struct anlos_pipeline *p, struct anlos_health *out,
                          struct anlos_error *why)
{
    int code = api_there(p, "pipeline", why);

    if (code)
        return code;
    struct track_counts counts = object_tracker_counts(pipeline_tracker(p->inside));
    struct anlos_health own = p->health;
    own.size = sizeof own;
    own.clipped_samples = p->pings.clipped_samples;
    own.not_finite_samples = p->pings.not_finite_samples;
    own.late_images = counts.late;
    own.crowded = counts.crowded;
    own.sound_speed_m_s = p->pings.survey_id ? p->pings.survey.sound_speed_m_s : 0.0;
    return API_GIVE(out, &own, "struct anlos_health", why);
}
