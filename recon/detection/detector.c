/* SPDX-License-Identifier: MIT */
#include "recon/detection/detector.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/detection/detect_learn.h"
#include "recon/detection/peak.h"
#include "recon/imaging/imager.h"
#include "recon/tracking/sidelobes.h"
#include "recon/tracking/timing.h"

void detector_init(struct detector *d, const struct detector_config *cfg)
{
    *d = (struct detector){.cfg = *cfg};
}

static void forget_cells(struct detector *d)
{
    for (int i = 0; i < 2; i++) {
        cfar_destroy(d->cells[i]);
        d->cells[i] = NULL;
    }
    cfar_map_destroy(d->map);
    occupancy_destroy(d->occupied);
    d->occupied = NULL;
    free(d->held);
    free(d->known);
    d->map = NULL;
    d->held = d->known = NULL;
}

int detector_survey(struct detector *d, const struct survey *survey)
{
    struct survey fresh;
    uint64_t id = survey_id(survey);

    if (d->has_survey && d->survey_id == id)
        return 0;
    int err = survey_copy(&fresh, survey);
    if (err) {
        survey_clear(&fresh);
        return err;
    }
    survey_clear(&d->survey);
    forget_cells(d);
    d->survey = fresh;
    d->survey_id = id;
    d->has_survey = true;
    return 0;
}

/* What stands does not go with one stroke: a background begins with few pings. */
static void settle(struct detector *d, const struct volume *volume)
{
    if (volume->standing_left)
        d->stood_ns = volume->capture_ns;
    double since_s = 1e-9 * (double)(volume->capture_ns - d->stood_ns);
    d->settling = d->stood_ns && since_s >= 0.0 &&
                  since_s < DETECTOR_SETTLES * timing_round_s(&d->survey);
}

/* What was learnt of the noise stays while the grid does. */
static int find_cells(struct detector *d, const struct volume *volume,
                      struct detect_config *cfg)
{
    const struct grid *grid = &volume->grid;
    int err = 0;

    if (d->cfg.cfar == CFAR_OFF)
        return 0;
    if (d->map && memcmp(&d->cells_grid, grid, sizeof *grid))
        forget_cells(d);
    if (!d->map) {
        struct detect_config resolved = *cfg;
        objects_resolution(&resolved, &d->survey, grid);
        for (int i = 0; !err && i < 2; i++)
            err = detect_cfar(&d->cells[i], d->cfg.cfar, d->cfg.false_alarm_rate, grid,
                              resolved.resolution_m);
        if (!err)
            err = cfar_map_create(&d->map, grid_size(grid));
        d->held = calloc(grid_size(grid), sizeof *d->held);
        d->known = calloc(grid_size(grid), sizeof *d->known);
        if (!err && (!d->held || !d->known))
            err = -ENOMEM;
        d->cells_grid = *grid;
        if (err)
            forget_cells(d);
    }
    cfg->cfar = d->cells[d->settling];
    cfg->map = d->map;
    cfg->known = d->known;
    return err;
}

/* A ping that shows what stands, or nothing, tells of nobody who comes. */
static int follow_pings(struct detector *d, const struct volume *volume)
{
    const struct grid *blocks = &volume->blocks;
    struct sidelobe_array array;

    if (volume->standing_left && d->occupied)
        occupancy_reset(d->occupied);
    if (!volume->newest || d->cfg.cfar == CFAR_OFF)
        return 0;
    if (d->occupied && memcmp(&d->blocks, blocks, sizeof *blocks)) {
        occupancy_destroy(d->occupied);
        d->occupied = NULL;
    }
    sidelobe_array_measure(&array, &d->survey);
    int err = d->occupied ? 0 : occupancy_create(&d->occupied, blocks, &array);
    d->blocks = *blocks;
    if (!err)
        occupancy_step(d->occupied, volume->newest, volume->capture_ns);
    return err;
}

/* Images whose pings overlap say the same again: one for each round of the speakers is
 * learnt from, once a round is whole. */
static bool learns(struct detector *d, const struct volume *volume)
{
    bool whole = volume->pings_used >= volume->pings_expected ||
                 (d->frame && volume->frame != d->frame);
    bool fresh = !volume->frame || (whole && volume->frame != d->learnt_frame);

    d->frame = volume->frame;
    if (fresh)
        d->learnt_frame = volume->frame;
    return fresh;
}

static bool is_image(const struct grid *grid, const float *intensity)
{
    if (!intensity)
        return false;
    for (size_t i = 0; i < grid_size(grid); i++)
        if (!(intensity[i] >= 0.0f && intensity[i] <= FLT_MAX))
            return false;
    return true;
}

/* -- what moves by itself ---------------------------------------------------------------
 */

#define MOVER_M 0.4 /* from an object: of it */
/* Deviations of where one is: a course is looked for in steps. */
#define MOVER_ACROSS_M 0.1
#define MOVER_ALONG_M  0.04

static struct object *object_near(struct object_list *list, const struct volume_mover *m)
{
    struct object *nearest = NULL;
    double nearest_m = MOVER_M;

    for (size_t i = 0; i < list->n; i++) {
        const double *o = list->objects[i].virtual_m;
        double far_m = hypot(o[0] - (double)m->at_m[0], o[2] - (double)m->at_m[2]);
        if (far_m < nearest_m) {
            nearest = &list->objects[i];
            nearest_m = far_m;
        }
    }
    return nearest;
}

/* Of those that stand alone: of such an image's at 12 times the median half are somebody,
 * at 30 nine of ten (599 of them in 15 drives of another simulator). */
static double mover_existence(double power)
{
    return 1.0 / (1.0 + pow(12.0 / power, 2.5));
}

static struct object *add_mover(const struct detector *d,
                                const struct volume_mover *mover,
                                const struct walls *walls, struct object_list *out)
{
    double x_m = (double)mover->at_m[0], z_m = (double)mover->at_m[2];
    double angle_rad = atan2(x_m, z_m), sine = sin(angle_rad), cosine = cos(angle_rad);
    double across2 = MOVER_ACROSS_M * MOVER_ACROSS_M;
    double along2 = MOVER_ALONG_M * MOVER_ALONG_M;
    struct detection one = {
        .position_m = {x_m, (double)mover->at_m[1], z_m},
        .middle_m = {x_m, (double)mover->at_m[1], z_m},
        .covariance_m2 = {across2 * cosine * cosine + along2 * sine * sine, 0.0,
                          (along2 - across2) * sine * cosine,
                          PEAK_UNKNOWN_M * PEAK_UNKNOWN_M, 0.0,
                          across2 * sine * sine + along2 * cosine * cosine},
        .level_db = 10.0 * log10((double)mover->power),
        .existence = mover_existence((double)mover->power),
        .lately = -1.0};

    objects_add(out, &d->survey, walls, &one);
    return &out->objects[out->n - 1];
}

static void take_course(struct object *o, const struct volume_mover *mover, bool moves,
                        double doubt)
{
    o->has_course = true;
    o->moves = moves;
    o->course_doubt = doubt;
    o->course_power = (double)mover->power;
    o->course_m_s[0] = (double)mover->velocity_m_s[0];
    o->course_m_s[1] = (double)mover->velocity_m_s[2];
}

/* Beside what stands, what moves is an object even where it does not stand out. */
static void take_movers(const struct detector *d, const struct volume_mover *movers,
                        size_t n, bool moves, const struct walls *walls,
                        struct object_list *out)
{
    for (size_t i = 0; i < n; i++) {
        const struct volume_mover *mover = &movers[i];
        struct object *o = object_near(out, mover);
        if (!o && out->n < OBJECTS_MAX)
            o = add_mover(d, mover, walls, out);
        bool surer = o && o->has_course &&
                     (o->moves > moves || o->course_power >= (double)mover->power);
        if (!o || surer)
            continue;
        take_course(o, mover, moves, 0.0);
    }
}

static void take_courses(const struct volume *volume, struct object_list *out)
{
    for (size_t i = 0; i < volume->n_courses; i++) {
        const struct volume_course *c = &volume->courses[i];
        struct object *o = object_near(out, &c->mover);
        if (!o || (o->has_course && o->course_power >= (double)c->mover.power))
            continue;
        take_course(o, &c->mover, false, 1.0 - (double)c->sure);
    }
}

/* -- volumes ----------------------------------------------------------------------------
 */

int detector_volume(struct detector *d, const struct volume *volume,
                    const struct walls *walls, struct object_list *out, struct error *why)
{
    const struct grid *grid = &volume->grid;
    struct detect_config cfg;

    if (!d->has_survey || volume->survey_id != d->survey_id)
        return error_say(why, -EAGAIN, "the survey of a volume is not known yet");
    if (!is_image(grid, volume->intensity) ||
        (volume->newest && !is_image(&volume->blocks, volume->newest)) ||
        (volume->around.intensity &&
         !is_image(&volume->around.grid, volume->around.intensity)))
        return error_say(why, -EINVAL,
                         "a volume without a grid or with intensities that "
                         "are not numbers");
    detect_config_default(&cfg);
    cfg.threshold_db = d->cfg.threshold_db;
    cfg.learns = learns(d, volume) && !volume->pings_blanked;
    cfg.followed = volume->frame != 0;
    cfg.multipath = !cfg.followed;
    cfg.around = volume->around.intensity ? &volume->around : NULL;
    detect_config_method(&cfg, volume->method, grid);
    settle(d, volume);
    int err = find_cells(d, volume, &cfg);
    if (!err)
        err = follow_pings(d, volume);
    cfg.occupied = d->occupied;
    if (!err && cfg.cfar && cfg.learns && !d->settling)
        err = detect_learn(d->cells[1], grid, volume->intensity, d->known);
    if (err == -EINVAL)
        return error_say(why, err,
                         "false_alarm_rate: a volume that is too small to compare a "
                         "voxel with those around it; expected a larger one, or no "
                         "rate");
    if (!err)
        err = objects_find(out, &d->survey, walls, &cfg, d->cfg.min_existence, grid,
                           volume->intensity);
    if (err)
        return error_say(why, err, "not enough memory to detect objects");
    take_movers(d, volume->movers, volume->n_movers, true, walls, out);
    take_movers(d, volume->ambiguous, volume->n_ambiguous, false, walls, out);
    take_courses(volume, out);
    out->scan = volume->scan;
    out->frame = volume->frame;
    out->preview = volume->preview;
    out->counter = d->counter++;
    return 0;
}

static void hold_one(const struct grid *g, const double at_m[3], double held_m, bool *out)
{
    size_t v = 0;

    for (size_t z = 0; z < g->n[2]; z++) {
        double along_m = g->origin_m[2] + g->step_m[2] * (double)z - at_m[2];
        double aside2 = held_m * held_m - along_m * along_m;
        if (!(aside2 > 0.0)) {
            v += g->n[0] * g->n[1];
            continue;
        }
        for (size_t y = 0; y < g->n[1]; y++)
            for (size_t x = 0; x < g->n[0]; x++, v++) {
                double aside_m = g->origin_m[0] + g->step_m[0] * (double)x - at_m[0];
                out[v] |= aside_m * aside_m < aside2;
            }
    }
}

static void hold(const struct grid *g, const double (*held)[3], size_t n, double held_m,
                 bool *out)
{
    memset(out, 0, grid_size(g) * sizeof *out);
    for (size_t i = 0; i < n; i++)
        hold_one(g, held[i], held_m, out);
}

void detector_know(struct detector *d, const double (*known)[3], size_t n, double known_m)
{
    if (d->map)
        hold(&d->cells_grid, known, n, known_m, d->known);
}

void detector_learn(struct detector *d, const struct volume *volume,
                    const double (*held)[3], size_t n, double held_m)
{
    const struct grid *grid = &volume->grid;

    if (!d->map || !volume->intensity || memcmp(&d->cells_grid, grid, sizeof *grid))
        return;
    hold(grid, held, n, held_m, d->held);
    cfar_map_learn(d->map, volume->intensity, d->held, volume->capture_ns);
    if (d->occupied && volume->newest)
        occupancy_learn(d->occupied, held, n, held_m);
}

void detector_forget(struct detector *d)
{
    if (d->map)
        cfar_map_reset(d->map);
    if (d->occupied)
        occupancy_reset(d->occupied);
}

void detector_clear(struct detector *d)
{
    forget_cells(d);
    survey_clear(&d->survey);
    d->has_survey = false;
}
