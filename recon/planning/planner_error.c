/* SPDX-License-Identifier: MIT */
#include "recon/planning/planner_error.h"

#include <math.h>
#include <string.h>

#include "recon/planning/moveout_error.h"

#define DIP_FAILS     0.2  /* rad of phase, rms: dip moveout of fewer speakers */
#define STRONG_DB     10.0 /* below the strongest: what the error is stated for */
#define POWER_WIDER   2.4  /* times: a point in an image of power */
#define POWER         0.03
#define BETWEEN       0.17 /* voxels */
#define EDGE          0.04
#define SHARPENED     0.75 /* times: `iterative` */
#define BLUNT_BETWEEN 0.75 /* times: not sharpened */
#define BLUNT_ASIDE   1.5
#define BLUNT_EDGE    1.2
#define UNKNOWN       0.03 /* of a width: of no point more exact than this is made much */
#define MEAN_STEPS    64
#define OF_EDGES      0.25 /* times: of what a point is beside itself, squared */
#define MIRROR        3.0  /* times a point's width: a shape */

static double square(double x)
{
    return x * x;
}

const struct probe_object *planner_object(const struct probe *probe)
{
    return probe->n_objects ? &probe->objects[0] : &probe->typical;
}

double planner_width_m(const struct probe_object *o)
{
    double most_m = 0.0;
    for (int a = 0; a < 2; a++)
        if (isfinite(o->width_m[a]))
            most_m = fmax(most_m, o->width_m[a]);
    return most_m;
}

bool planner_sees_shape(const struct probe *probe)
{
    const struct probe_object *o = &probe->objects[0];
    return probe->n_objects && o->extent_m > MIRROR * planner_width_m(o);
}

double planner_depth_step(const struct planner_candidate *c)
{
    return fmax(c->coarser, 1.0) * c->deeper;
}

/* Lateral, from places of elements that are off. */
static double element_error_m(const struct planner_config *cfg, double range_m,
                              size_t stride)
{
    const struct geometry *g = cfg->set->geometry;
    double low[3], high[3], sigma_m = cfg->probe->coherence.element_m;
    geometry_aperture(g, low, high);
    double aperture_m = fmax(high[1] - low[1], high[0] - low[0]);
    double n = (double)(g->n_speakers / stride + g->n_microphones);
    if (!(sigma_m > 0.0) || !(aperture_m > 0.0))
        return 0.0;
    return sigma_m * range_m * sqrt(12.0 / n) / aperture_m;
}

/* How many times narrower the midpoints of every n-th speaker stand. */
static double narrowing(const struct geometry *g, size_t stride)
{
    double most = 1.0, low[3], high[3];
    if (g->pings_m || !g->n_speakers)
        return most;
    geometry_aperture(g, low, high);
    for (int a = 0; a < 2; a++) {
        double all[2] = {INFINITY, -INFINITY}, some[2] = {INFINITY, -INFINITY};
        for (size_t j = 0; j < g->n_speakers; j++) {
            double at = g->speakers_m[j][a];
            all[0] = fmin(all[0], at);
            all[1] = fmax(all[1], at);
            some[0] = j % stride ? some[0] : fmin(some[0], at);
            some[1] = j % stride ? some[1] : fmax(some[1], at);
        }
        double lost = 0.5 * (all[1] - all[0] - (some[1] - some[0]));
        if (high[a] - low[a] > lost)
            most = fmax(most, (high[a] - low[a]) / (high[a] - low[a] - lost));
    }
    return most;
}

static bool is_stacked(const struct planner_candidate *c)
{
    return !strcmp(c->method, "fast") || !strcmp(c->method, "iterative");
}

/* Neither `fast` sharpened nor `iterative`. */
static bool is_blunt(const struct planner_candidate *c)
{
    return !(c->sharpen > 0.0) && strcmp(c->method, "iterative") != 0;
}

/* Of Hann's window over the band, as far as it is imaged, and sharpened. */
static double mean_hz(const double band_hz[2], double top_hz)
{
    double sum = 0.0, weight = 0.0;
    for (int i = 0; i < MEAN_STEPS; i++) {
        double x = (i + 0.5) / MEAN_STEPS;
        double hz = band_hz[0] + x * (band_hz[1] - band_hz[0]);
        double w = hz <= top_hz ? 0.5 - 0.5 * cos(2.0 * M_PI * x) : 0.0;
        w *= pow(hz / band_hz[1], PLANNER_SHARPEN);
        sum += w * hz;
        weight += w;
    }
    return sum / weight;
}

/* How many times longer waves are in the mean when the top of the band is left out. */
static double longer(const struct planner_config *cfg, const struct planner_candidate *c)
{
    const double *band_hz = cfg->set->band_hz;
    return c->top_hz < band_hz[1]
               ? mean_hz(band_hz, band_hz[1]) / mean_hz(band_hz, c->top_hz)
               : 1.0;
}

/* Along one axis, squared: of what is straight ahead. */
static double along(const struct planner_config *cfg, const struct planner_candidate *c,
                    const struct probe_object *o, int a)
{
    double step_m = c->coarser * cfg->grid->step_m[a];
    double width_m = o->width_m[a];
    double sum = square(o->noise_m[a]) * (double)c->stride;
    if (!strcmp(c->method, "incoherent")) {
        width_m *= POWER_WIDER;
        sum += square(POWER * width_m);
    }
    bool rounder = is_blunt(c) && !strcmp(c->method, "fast") &&
                   !planner_sees_shape(cfg->probe);
    double between = rounder ? BLUNT_BETWEEN * BETWEEN : BETWEEN;
    return sum + square(between * step_m * square(step_m / width_m));
}

/* By how much moveout images it beside itself.  Of fewer speakers there are few pairs of
 * each offset, and dip moveout, which wants lines of them, leaves the more of what these
 * speakers add the more it has to move. */
static double beside_m(const struct planner_candidate *c, const struct probe_object *o,
                       int a)
{
    double fewer_m = c->stride == 1   ? 0.0
                     : c->stride == 2 ? o->fewer_m[0][a]
                                      : o->fewer_m[1][a];
    return c->dip ? fmin(o->moveout_rad / DIP_FAILS, 1.0) * fewer_m
                  : o->moveout_m[a] + fewer_m;
}

/* What comes to it where echoes come from aside. */
static double aside(const struct planner_config *cfg, const struct planner_candidate *c,
                    const struct probe_object *o, int a)
{
    double plane_m = planner_depth_step(c) * cfg->grid->step_m[2];
    double sum = square(o->tilt[a] * plane_m) / 12.0;
    if (is_stacked(c)) {
        sum += square(beside_m(c, o, a));
        if (!c->dip && o->moveout_rad > MOVEOUT_FALLS_APART)
            sum += square(0.25 * o->width_m[a]);
    }
    return is_blunt(c) ? square(BLUNT_ASIDE) * sum : sum;
}

/* Of the edges of a shape, in widths of a point. */
static double edges(const struct planner_config *cfg, const struct planner_candidate *c)
{
    double sharper = !strcmp(c->method, "iterative") ? SHARPENED
                     : is_blunt(c)                   ? BLUNT_EDGE
                                                     : 1.0;
    return EDGE * sharper * pow(longer(cfg, c), 3.0) *
           narrowing(cfg->set->geometry, c->stride);
}

static double object_error_m(const struct planner_config *cfg,
                             const struct planner_candidate *c,
                             const struct probe_object *o, double in_widths,
                             bool elements)
{
    double ahead = elements ? square(element_error_m(cfg, o->position_m[2], c->stride))
                            : 0.0;
    double slant = 0.0;
    for (int a = 0; a < 2; a++) {
        if (!isfinite(o->width_m[a]))
            continue;
        ahead += along(cfg, c, o, a);
        slant += aside(cfg, c, o, a);
    }
    double shape = ahead + square(in_widths * planner_width_m(o)), point = ahead + slant;
    if (planner_sees_shape(cfg->probe))
        return sqrt(shape + (cfg->probe->specular ? 0.0 : OF_EDGES * slant));
    if (cfg->probe->n_objects)
        return sqrt(point);
    return sqrt(sqrt(shape * (point + square(UNKNOWN * planner_width_m(o)))));
}

static double worst_m(const struct planner_config *cfg, const struct planner_candidate *c,
                      double in_widths, bool elements)
{
    const struct probe *probe = cfg->probe;
    double most_m = object_error_m(cfg, c, planner_object(probe), in_widths, elements);
    for (size_t i = 1; i < probe->n_objects; i++)
        if (probe->objects[i].level_db > probe->snr_db - STRONG_DB)
            most_m = fmax(
                most_m, object_error_m(cfg, c, &probe->objects[i], in_widths, elements));
    return most_m;
}

void planner_estimate_error(const struct planner_config *cfg, struct planner_candidate *c)
{
    double in_widths = edges(cfg, c);
    c->error_m = worst_m(cfg, c, in_widths, true);
    c->own_m = worst_m(cfg, c, in_widths, false);
}
