/* SPDX-License-Identifier: MIT */
#include "recon/detection/objects.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/detection/beyond.h"
#include "recon/detection/clean.h"
#include "recon/detection/lobes.h"
#include "recon/detection/multipath.h"
#include "recon/detection/peak.h"
#include "recon/mount.h"
#include "recon/processing.h"

#define CLUSTER_WIDTHS 3.0  /* of a point, that pings around objects keep apart */
#define HEIGHT_LEAST_M 0.01 /* of an array that tells heights */

/* Of what echoes on the ground, where heights are not told.  Sound comes back from a
 * walker's trunk, thighs and shanks (Bradley and Sabatier 2010, J. Acoust. Soc. Am. 128,
 * EL248), 0.1 to 1.4 m high; half a stature is 0.76 m (women, 5th percentile) to 0.93 m
 * (men, 95th; Huston, Principles of Biomechanics, 2009), of children 0.5 m and more.  A
 * cyclist is as high, a car's side ends below, and what is upright and smooth mirrors at
 * the array's own height.  With an array at 0.4 m, echoes from 0.4 to 1.1 m are taken up
 * to 10 cm too near or 2 cm too far at 2 m, 3 and 1 cm at 6 m; the standard deviation
 * that follows from these numbers is 17 cm and 5 cm. */
#define HEIGHT_M       0.8
#define HEIGHT_SIGMA_M 0.5

/* out = r c r^T */
static void turn_covariance(const double r[3][3], const double c[6], double out[6])
{
    static const int at[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};

    for (int a = 0; a < 3; a++) {
        for (int b = a; b < 3; b++) {
            double sum = 0.0;
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++)
                    sum += r[a][i] * c[at[i][j]] * r[b][j];
            out[at[a][b]] = sum;
        }
    }
}

/* The box around an imaged object becomes the box, along the axes of its position's
 * frame, around that box mirrored and turned.  wall: NULL if none mirrored it. */
static void turn_extent(const struct wall *wall, const double r[3][3],
                        const double extent[3], double out[3])
{
    for (int b = 0; b < 3; b++) {
        out[b] = 0.0;
        for (int a = 0; a < 3; a++) {
            double side = r[b][a]; /* of r (1 - 2 n n^T) */
            for (int i = 0; wall && i < 3; i++)
                side -= 2.0 * r[b][i] * wall->normal[i] * wall->normal[a];
            out[b] += fabs(side) * extent[a];
        }
    }
}

/* From the lowest to the highest place of an element; without it heights are not told. */
static double array_height_m(const struct survey *s)
{
    double low = INFINITY, high = -INFINITY;

    for (size_t i = 0; !s->pings_m && i < s->n_speakers; i++) {
        low = fmin(low, s->speakers_m[i][1]);
        high = fmax(high, s->speakers_m[i][1]);
    }
    for (size_t i = 0; !s->pings_m && i < s->n_microphones; i++) {
        low = fmin(low, s->microphones_m[i][1]);
        high = fmax(high, s->microphones_m[i][1]);
    }
    double travel = 0.0;
    for (size_t i = 0; !s->pings_m && i < s->n_positions; i++)
        travel = fmax(travel, fabs((s->stage_positions_m[i] - s->stage_positions_m[0]) *
                                   s->stage_axis[1]));
    for (size_t i = 0; s->pings_m && i < s->n_positions; i++)
        for (int e = 0; e < 2; e++) {
            low = fmin(low, s->pings_m[i][e][1]);
            high = fmax(high, s->pings_m[i][e][1]);
        }
    return low <= high ? high - low + travel : INFINITY;
}

static void array_centre(const struct survey *s, double out[3])
{
    size_t middle = s->n_positions / 2;

    for (int a = 0; a < 3; a++) {
        out[a] = s->n_positions ? s->stage_positions_m[middle] * s->stage_axis[a] : 0.0;
        for (size_t i = 0; i < s->n_speakers; i++)
            out[a] += 0.5 * s->speakers_m[i][a] / (double)s->n_speakers;
        for (size_t i = 0; i < s->n_microphones; i++)
            out[a] += 0.5 * s->microphones_m[i][a] / (double)s->n_microphones;
        if (s->pings_m)
            out[a] = 0.5 * (s->pings_m[middle][0][a] + s->pings_m[middle][1][a]);
    }
}

/* Where the image does not tell a height, what it tells of the rest is meant for the
 * height that is assumed; where it seems to, it is that of the array. */
static void assume_height(double c[6])
{
    double assumed_m2 = HEIGHT_SIGMA_M * HEIGHT_SIGMA_M;

    if (c[3] > assumed_m2) { /* as the image has x and z for each height */
        double gain = assumed_m2 / c[3], xy = c[1], yz = c[4];
        double less = (1.0 - gain) / c[3];
        c[0] -= less * xy * xy;
        c[2] -= less * xy * yz;
        c[5] -= less * yz * yz;
        c[1] = gain * xy;
        c[4] = gain * yz;
        c[3] = assumed_m2;
    } else {
        c[1] = c[4] = 0.0;
        c[3] = assumed_m2;
    }
}

/* A line array tells how far along it a thing is, and how far from it: what is higher or
 * lower is imaged behind its place.  height: of what is heard, over the array.  Returns
 * the variance of its depth by that. */
static double come_down(const struct survey *s, const double centre[3],
                        double position[3])
{
    double height_m = HEIGHT_M - s->mount_origin_m[2] - centre[1];
    double height2 = height_m * height_m + HEIGHT_SIGMA_M * HEIGHT_SIGMA_M;
    double from_m = position[2] - centre[2];

    if (from_m * from_m <= 2.0 * height2)
        return 0.0;
    double depth_m = sqrt(from_m * from_m - height2);
    double sigma_m = HEIGHT_SIGMA_M * sqrt(height2) / depth_m;
    position[2] = centre[2] + depth_m;
    return sigma_m * sigma_m;
}

/* What is imaged just behind a wall may have come down before it: nothing is there. */
static void keep_behind(const struct wall *w, double position[3])
{
    double away = w->distance_m < 0.0 ? -1.0 : 1.0, behind_m = -w->distance_m;

    for (int a = 0; a < 3; a++)
        behind_m += w->normal[a] * position[a];
    for (int a = 0; a < 3 && away * behind_m < 0.0; a++)
        position[a] -= behind_m * w->normal[a];
}

/* As it is by way of a wall, of which the own error is no part of it. */
static void mirror_height(const struct wall *wall, double height[6])
{
    struct wall exact = *wall;

    memset(exact.covariance, 0, sizeof exact.covariance);
    wall_mirror_covariance(&exact, (const double[3]){0.0, 0.0, 0.0}, height, height);
}

static void place_by(struct placement *out, const struct survey *s,
                     const struct walls *walls, const struct detection *d, size_t at)
{
    double position[3], covariance[6], height[6] = {0.0}, centre[3], r[3][3], t[3];
    memcpy(position, d->position_m, sizeof position);
    memcpy(covariance, d->covariance_m2, sizeof covariance);
    bool height_assumed = array_height_m(s) < HEIGHT_LEAST_M;
    if (height_assumed)
        assume_height(covariance);
    array_centre(s, centre);
    if (s->has_mount && height_assumed)
        height[5] = come_down(s, centre, position);
    covariance[5] += height[5];
    const struct wall *wall = at < walls->n ? &walls->list[at].plane : NULL;
    *out = (struct placement){.wall = wall ? walls->list[at].id : 0,
                              .height_assumed = height_assumed,
                              .behind_no_wall = walls->n && !wall};
    if (wall) {
        keep_behind(wall, position);
        wall_mirror_covariance(wall, position, covariance, covariance);
        mirror_height(wall, height);
        wall_mirror(wall, position, position);
    }
    out->in_free_view = walls_in_free_view(walls, position);
    mount_survey_axes(s, r, t);
    survey_to_vehicle(s, position, out->position_m);
    turn_covariance((const double(*)[3])r, covariance, out->covariance_m2);
    turn_covariance((const double(*)[3])r, height, out->height_m2);
    turn_extent(wall, (const double(*)[3])r, d->extent_m, out->extent_m);
}

void objects_place(struct placement *out, const struct survey *s,
                   const struct walls *walls, const struct detection *d)
{
    double centre[3];

    array_centre(s, centre);
    place_by(out, s, walls, d,
             wall_that_mirrored(walls->list, walls->n, centre, d->position_m));
}

void objects_place_by(struct object *o, const struct survey *s, const struct walls *walls,
                      size_t wall)
{
    struct detection d = {.existence = o->existence};

    memcpy(d.position_m, o->virtual_m, sizeof d.position_m);
    memcpy(d.covariance_m2, o->covariance_m2, sizeof d.covariance_m2);
    memcpy(d.extent_m, o->extent_m, sizeof d.extent_m);
    place_by(&o->place, s, walls, &d, wall);
}

static struct object object_of(uint32_t id, const struct survey *s,
                               const struct walls *walls, const struct detection *d)
{
    struct object o = {
        .id = id,
        .placed = true,
        .virtual_m = {d->position_m[0], d->position_m[1], d->position_m[2]},
        .middle_m = {d->middle_m[0], d->middle_m[1], d->middle_m[2]},
        .existence = d->existence,
        .lately = d->lately,
        .proven = d->proven,
        .level_db = d->level_db,
        .shape = d->shape,
        .at_border = d->at_border,
        .multipath = d->multipath};

    memcpy(o.covariance_m2, d->covariance_m2, sizeof o.covariance_m2);
    memcpy(o.extent_m, d->extent_m, sizeof o.extent_m);
    objects_place(&o.place, s, walls, d);
    for (int i = 0; d->multipath && i < 2; i++)
        o.of[i] = (uint32_t)d->of[i] + 1;
    if (o.place.height_assumed)
        o.at_border &= ~(PEAK_BORDER(1, 0) | PEAK_BORDER(1, 1));
    return o;
}

void objects_list(struct object_list *out, const struct survey *s,
                  const struct walls *walls, const struct detection *detections, size_t n)
{
    *out = (struct object_list){.mirrored = walls->n > 0,
                                .in_vehicle_frame = s->has_mount,
                                .source = s->source,
                                .temperature_c = s->temperature_c,
                                .sound_speed_m_s = s->sound_speed_m_s,
                                .n = n};
    for (size_t i = 0; i < n; i++)
        out->objects[i] = object_of((uint32_t)i + 1, s, walls, &detections[i]);
}

void objects_add(struct object_list *out, const struct survey *s,
                 const struct walls *walls, const struct detection *detection)
{
    out->objects[out->n] = object_of((uint32_t)out->n + 1, s, walls, detection);
    out->n++;
}

static size_t drop_unlikely(struct detection *found, size_t n, double min_existence)
{
    size_t kept = 0;

    for (size_t i = 0; i < n; i++)
        if (found[i].existence >= min_existence)
            found[kept++] = found[i];
    return kept;
}

static size_t count_likely(const struct detection *found, size_t n, double min_existence)
{
    size_t likely = 0;

    for (size_t i = 0; i < n; i++)
        likely += found[i].existence >= min_existence;
    return likely;
}

void objects_resolution(struct detect_config *cfg, const struct survey *s,
                        const struct grid *grid)
{
    struct geometry geometry;
    double band_hz[2] = {fmin(s->chirp_start_hz, s->chirp_stop_hz),
                         fmax(s->chirp_start_hz, s->chirp_stop_hz)};
    double middle[3];
    for (int a = 0; a < 3; a++)
        middle[a] = grid->origin_m[a] + 0.5 * (double)grid->n[a] * grid->step_m[a];

    processing_geometry(&geometry, s);
    if (geometry.pings_m) { /* a turntable sees details of one cluster's size */
        double *r = cfg->resolution_m;
        geometry_resolution_at(&geometry, band_hz, middle, r);
        cfg->cluster_m = fmin(cfg->cluster_m, CLUSTER_WIDTHS * cbrt(r[0] * r[1] * r[2]));
    } else {
        geometry_resolution(&geometry, band_hz, middle[2], cfg->resolution_m);
    }
}

static void suspect_lobes(const struct survey *s, struct detection *found, size_t n)
{
    struct geometry geometry;

    if (s->pings_m) /* seen from all sides, lobes have no one direction */
        return;
    processing_geometry(&geometry, s);
    lobes_suspect(&geometry, found, n);
}

static int judge_around(const struct survey *s, const struct detect_config *cfg,
                        struct detection *found, size_t n)
{
    struct geometry geometry;
    const struct beyond b = {.geometry = &geometry,
                             .around = cfg->around,
                             .range_db = cfg->dynamic_range_db,
                             .of_power = cfg->clipped};

    processing_geometry(&geometry, s);
    return beyond_judge(&b, found, n);
}

/* Pings around objects hear them from all sides, and have no one range. */
static void find_multipath(const struct survey *s, const struct walls *walls,
                           const struct grid *grid, struct detection *found, size_t n,
                           size_t plain)
{
    struct wall planes[WALLS_MAX];
    struct multipath_config cfg;
    struct geometry geometry;

    if (s->pings_m)
        return;
    processing_geometry(&geometry, s);
    multipath_config_fill(&cfg, &geometry, grid);
    for (; cfg.n_walls < walls->n && cfg.n_walls < WALLS_MAX; cfg.n_walls++)
        planes[cfg.n_walls] = walls->list[cfg.n_walls].plane;
    cfg.walls = planes;
    cfg.n_plain = plain;
    multipath_judge(&cfg, found, n);
}

int objects_find(struct object_list *out, const struct survey *s,
                 const struct walls *walls, const struct detect_config *cfg,
                 double min_existence, const struct grid *grid, const float *intensity)
{
    struct detection found[OBJECTS_MAX];
    struct detect_config resolved = *cfg;
    struct walls own;
    size_t n = 0;

    if (!walls) {
        walls_from_survey(&own, s);
        walls = &own;
    }
    objects_resolution(&resolved, s, grid);
    int err = detect_objects(&resolved, grid, intensity, found, OBJECTS_MAX, &n);
    if (err)
        return err;
    if (!cfg->traces && !cfg->followed)
        suspect_lobes(s, found, n);
    size_t plain = n = drop_unlikely(found, n, min_existence);
    if (cfg->clean) {
        err = clean_find(cfg->clean, &resolved, grid, intensity, found, OBJECTS_MAX, &n);
        n = drop_unlikely(found, n, min_existence);
        plain = plain < n ? plain : n;
    }
    if (err)
        return err;
    if (cfg->traces)
        lobes_judge(cfg->traces, found, n);
    if (cfg->traces && cfg->pool)
        err = beyond_judge_traces(cfg->traces, grid, cfg->dynamic_range_db, cfg->clipped,
                                  cfg->pool, found, n);
    else if (cfg->around)
        err = judge_around(s, cfg, found, n);
    if (err)
        return err;
    plain = count_likely(found, plain, min_existence);
    n = drop_unlikely(found, n, min_existence);
    if (cfg->multipath)
        find_multipath(s, walls, grid, found, n, plain);
    objects_list(out, s, walls, found, n);
    return 0;
}
