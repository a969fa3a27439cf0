/* SPDX-License-Identifier: MIT */
#include "recon/pipeline.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct pipeline {
    struct pipeline_config cfg;
    struct frontend *frontend;
    struct static_array *array; /* or NULL, and */
    struct scan_imager *scan;
    struct object_tracker *tracker;
    struct wall_finder *finder; /* or NULL */
    uint64_t survey_id;
    struct frontend_output front;
    struct volume volume;
    struct object_list objects;
    bool has_image;     /* of the pings of a scan that are in */
    int64_t taken_ns;   /* when the newest of them came in */
    struct walls walls; /* the newest list, its stamp and its number */
    int64_t walls_ns;
    uint64_t wall_lists;
};

void pipeline_config_default(struct pipeline_config *cfg, bool is_static)
{
    *cfg =
        (struct pipeline_config){.frontend = {.window = WINDOW_HANN,
                                              .compression = COMPRESSION_MATCHED_FILTER,
                                              .background = BACKGROUND_NONE,
                                              .background_s = 10.0},
                                 .is_static = is_static,
                                 .array = {.threads = 1, .sum = FRAMES_POWER},
                                 .scan = {.method = "fast", .threads = 1}};
    cfg->array.compression = cfg->scan.compression = cfg->frontend.compression;
    object_tracker_config_default(&cfg->tracker, is_static);
    wall_finder_config_default(&cfg->walls);
}

int pipeline_create(struct pipeline **out, const struct pipeline_config *cfg)
{
    struct pipeline *p = calloc(1, sizeof *p);

    if (!p)
        return -ENOMEM;
    p->cfg = *cfg;
    p->cfg.array.compression = p->cfg.scan.compression = cfg->frontend.compression;
    p->cfg.frontend.hears_walls = cfg->finds_walls &&
                                  cfg->walls.map.from == WALL_FROM_ECHOES;
    p->cfg.frontend.wall_reach_m = cfg->walls.listener.reach_m;
    int err = frontend_create(&p->frontend, &p->cfg.frontend);
    if (!err)
        err = cfg->is_static ? static_array_create(&p->array, &p->cfg.array)
                             : scan_imager_create(&p->scan, &p->cfg.scan);
    if (!err)
        err = object_tracker_create(&p->tracker, &p->cfg.tracker);
    if (!err && cfg->finds_walls)
        err = wall_finder_create(&p->finder, &p->cfg.walls);
    if (err)
        pipeline_destroy(p);
    else
        *out = p;
    return err;
}

void pipeline_destroy(struct pipeline *p)
{
    if (!p)
        return;
    frontend_destroy(p->frontend);
    static_array_destroy(p->array);
    scan_imager_destroy(p->scan);
    object_tracker_destroy(p->tracker);
    wall_finder_destroy(p->finder);
    free(p);
}

static void forget(struct pipeline *p)
{
    p->survey_id = 0;
    p->has_image = false;
    frontend_forget(p->frontend);
    if (p->array)
        static_array_forget(p->array);
    else
        scan_imager_forget(p->scan);
}

static int plan(struct pipeline *p, const struct survey *survey, struct error *why)
{
    int err = frontend_survey(p->frontend, survey, why);

    if (!err)
        err = p->array ? static_array_survey(p->array, survey, why)
                       : scan_imager_survey(p->scan, survey, why);
    if (err)
        return err;
    err = object_tracker_survey(p->tracker, survey);
    if (err)
        return error_say(why, err, "survey: %s", strerror(-err));
    return p->finder ? wall_finder_survey(p->finder, survey, why) : 0;
}

int pipeline_survey(struct pipeline *p, const struct survey *survey, struct error *why)
{
    uint64_t id = survey_id(survey);

    if (p->survey_id == id)
        return 0;
    forget(p);
    int err = plan(p, survey, why);
    if (err)
        forget(p);
    else
        p->survey_id = id;
    return err;
}

uint64_t pipeline_survey_id(const struct pipeline *p)
{
    return p->survey_id;
}

static void did(const struct pipeline *p, enum pipeline_stage stage)
{
    if (p->cfg.did)
        p->cfg.did(p->cfg.ctx, stage);
}

/* -- walls ------------------------------------------------------------------------------
 */

static int know_walls(struct pipeline *p, const struct walls *walls, int64_t stamp_ns,
                      struct error *why)
{
    if (object_tracker_walls(p->tracker, walls, stamp_ns))
        return error_say(why, -EINVAL, "walls with a stamp that is none");
    if (p->array)
        static_array_walls(p->array, walls, stamp_ns);
    p->walls = *walls;
    p->walls_ns = stamp_ns;
    p->wall_lists++;
    return 0;
}

/* After all that comes in. */
static int find_walls(struct pipeline *p, int64_t now_ns, struct error *why)
{
    int64_t stamp_ns;
    const struct walls *walls = p->finder ? wall_finder_list(p->finder, now_ns, &stamp_ns)
                                          : NULL;

    return walls ? know_walls(p, walls, stamp_ns, why) : 0;
}

int pipeline_walls(struct pipeline *p, const struct walls *walls, int64_t capture_ns,
                   struct error *why)
{
    int err = p->finder ? 0 : walls_check(walls, why);

    return err || p->finder ? err : know_walls(p, walls, capture_ns, why);
}

int pipeline_given(struct pipeline *p, const struct walls *given, int64_t capture_ns,
                   int64_t now_ns, struct error *why)
{
    struct error ignored = {""};

    if (!p->finder || p->cfg.walls.map.from != WALL_FROM_TOPIC)
        return 0;
    int err = wall_finder_given(p->finder, given, capture_ns, why);
    int late = find_walls(p, now_ns, err ? &ignored : why);
    return err ? err : late;
}

const struct walls *pipeline_known_walls(const struct pipeline *p, int64_t *stamp_ns,
                                         uint64_t *lists)
{
    *stamp_ns = p->walls_ns;
    *lists = p->wall_lists;
    return p->wall_lists ? &p->walls : NULL;
}

/* -- motion, air ------------------------------------------------------------------------
 */

int pipeline_ego(struct pipeline *p, const struct ego_motion *motion, int64_t capture_ns,
                 int64_t now_ns, struct error *why)
{
    frontend_ego(p->frontend, motion, capture_ns);
    if (p->array)
        static_array_ego(p->array, motion, capture_ns);
    object_tracker_ego(p->tracker, motion, capture_ns);
    if (p->finder)
        wall_finder_ego(p->finder, motion, capture_ns);
    return find_walls(p, now_ns, why);
}

void pipeline_temperature(struct pipeline *p, double temperature_c)
{
    frontend_temperature(p->frontend, temperature_c);
}

/* -- pings to images to objects ---------------------------------------------------------
 */

static int make_image(struct pipeline *p, struct pipeline_output *out, struct error *why)
{
    if (p->array)
        static_array_image(p->array, &p->volume);
    else if (scan_imager_image(p->scan, false, &p->volume))
        return error_say(why, -ECANCELED, "stopped while imaging");
    did(p, PIPELINE_IMAGE);
    p->has_image = true;
    out->image = &p->volume;
    out->taken_ns = p->taken_ns;
    int err = object_tracker_volume(p->tracker, &p->volume, &p->objects, why);
    if (!err)
        out->objects = &p->objects;
    did(p, PIPELINE_DETECT);
    return err;
}

/* Into the image; is one due? */
static bool stack(struct pipeline *p, const struct traces *traces, int64_t now_ns,
                  struct pipeline_output *out)
{
    if (p->array) {
        p->taken_ns = now_ns;
        return static_array_traces(p->array, traces, out->note, sizeof out->note);
    }
    int err = scan_imager_traces(p->scan, traces);
    if (!err)
        p->taken_ns = now_ns;
    out->unfit = err != 0;
    if (err == -EINVAL)
        strcpy(out->note, "traces that do not fit the survey cannot be used");
    if (!scan_imager_is_complete(p->scan))
        p->has_image = false;
    return scan_imager_is_complete(p->scan) && !p->has_image;
}

static int image_ping(struct pipeline *p, const struct ping *ping, int64_t now_ns,
                      struct pipeline_output *out, struct error *why)
{
    frontend_ping(p->frontend, ping, &p->front);
    did(p, PIPELINE_COMPRESS);
    out->front = &p->front;
    if (p->front.outcome != FRONTEND_TRACES)
        return 0;
    bool due = stack(p, &p->front.traces, now_ns, out);
    did(p, PIPELINE_STACK);
    return due ? make_image(p, out, why) : 0;
}

int pipeline_ping(struct pipeline *p, const struct ping *ping, int64_t now_ns,
                  struct pipeline_output *out, struct error *why)
{
    struct error late = {""};

    *out = (struct pipeline_output){.front = NULL};
    int err = image_ping(p, ping, now_ns, out, why);
    if (p->finder && p->front.has_returns)
        wall_finder_returns(p->finder, &p->front.returns, now_ns);
    if (find_walls(p, now_ns, &late) && !out->note[0])
        snprintf(out->note, sizeof out->note, "%.*s", (int)sizeof out->note - 1,
                 late.text);
    return err;
}

int pipeline_finish(struct pipeline *p, struct pipeline_output *out, struct error *why)
{
    *out = (struct pipeline_output){.front = NULL};
    if (p->array || p->has_image || !scan_imager_pings(p->scan))
        return 0;
    return make_image(p, out, why);
}

/* -- what does the work -----------------------------------------------------------------
 */

const struct air *pipeline_air(const struct pipeline *p)
{
    return frontend_air(p->frontend);
}

const struct object_tracker *pipeline_tracker(const struct pipeline *p)
{
    return p->tracker;
}

struct wall_finder *pipeline_finder(struct pipeline *p)
{
    return p->finder;
}
