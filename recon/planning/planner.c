/* SPDX-License-Identifier: MIT */
#include "recon/planning/planner.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "recon/imaging/coarse.h"
#include "recon/planning/coherence.h"
#include "recon/planning/moveout_error.h"
#include "recon/power/incoherent.h"

/* With positions uncertain by sigma, waves shorter than so many sigma blur more than they
 * sharpen.  Measured on letters at sigma 5 and 8 mm. */
#define LEAST_WAVE 5.0

#define SHARPEST_M  0.0034 /* elements off by more spoil the shortest waves */
#define FINE        0.7
#define LEAST_STEPS 0.4    /* of a point's width: coarser, and positions suffer */
#define LEAST_DEPTH 0.0625 /* of its depth: steps finer than this tell nothing */
#define POWER_STEPS 1.5    /* times the whole image's are harmless where phase is lost */
#define NEARLY      0.99   /* errors this near to each other are the same */
#define MOST_VOXELS 16e6   /* of steps finer than the whole image's */
#define FAR_OFF     1.1    /* times the error of what was chosen */
#define CERTAIN     0.92   /* of the budget: times are not predicted better */

/* Of `iterative`.  Measured on letters: after 10 their IoU is within 0.01 of what it is
 * in the end, more only bring the residual down. */
#define LEAST_ITERATIONS 10
#define MOST_ITERATIONS  200
#define USUAL_ITERATIONS 30 /* that it takes to converge, of all depths */

/* Exponent of `fast` (recon/coherent/fk.h) where it is used.  Measured: a third off the
 * error of points aside, a sixth off that of letters, 2 dB more sidelobes; a point
 * straight ahead is read half as wrong again between voxels. */
#define SHARPEN 2.5

#define GOAL 0.0055 /* of a point's width: an error that is small enough */

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

static const double coarser[] = {0.5, FINE, 1.0, 1.2, 1.5, 2.0};
static const double deeper[] = {1.0, 0.5, 0.25};
static const double tops[] = {1.0, 0.8, 0.7}; /* of the band's top: waves are the cube */
static const size_t strides[] = {1, 2, 4};

struct planning {
    const struct planner_config *cfg;
    struct plan *plan;
    double goal_m; /* an error that is small enough */
};

/* -- how wrong an image will be ---------------------------------------------------------
 */

/* Standard deviation of a small object's position across the line of sight, the worst of
 * the strong ones; the root of the sum of squares of
 *
 *   noise     width / sqrt(8 ln 4 SNR)            (Cramer-Rao, the image's own SNR)
 *   elements  sigma R sqrt(12 / N) / D            (N elements over an aperture D)
 *   moveout   `fast` without dip moveout: moveout_error.h; an image that falls
 *             apart: width / 4; with it, of every second or fourth speaker, what these
 *             add, times rms phase / 0.2 rad, 1 at most   (measured at 0.75 to 2.8 m)
 *   steps     0.17 step^3 / width^2               (peak between voxels; measured)
 *   planes    tilt x step in depth / sqrt(12)     (peak between planes: probe.h)
 *   power     `incoherent`: 0.03 of its width     (measured)
 *
 * and, where something has a shape,
 *
 *   edges     0.04 width, times what the pairs' aperture is smaller for, and the cube of
 *             what the mean frequency is lower for; `iterative`: three quarters of it
 *             (measured)
 *
 * That is sharpened; if not, moveout and planes count 1.5 times, edges 1.2, and steps, of
 * a point by `fast`, 0.75 (measured, over shifts of the grid).  Mirrors answer straight
 * ahead: moveout and planes do not count for them, and half for other shapes (measured).
 * Where nothing is known of the scene it may hold points or such shapes, and neither
 * error is to be many times what it need be: their geometric mean, a point's with 0.03
 * width, so that what is small enough weighs no more. */

static double square(double x)
{
    return x * x;
}

/* The strongest object, or what is assumed. */
static const struct probe_object *object_of(const struct probe *probe)
{
    return probe->n_objects ? &probe->objects[0] : &probe->typical;
}

/* Across the line of sight, the larger one that is resolved; 0: none. */
static double width_m_of(const struct probe_object *o)
{
    double most_m = 0.0;
    for (int a = 0; a < 2; a++)
        if (isfinite(o->width_m[a]))
            most_m = fmax(most_m, o->width_m[a]);
    return most_m;
}

/* Something mirror-like and larger than a point. */
static bool sees_shape(const struct probe *probe)
{
    const struct probe_object *o = &probe->objects[0];
    return probe->n_objects && o->extent_m > MIRROR * width_m_of(o);
}

/* Of its step in depth, times that of the whole image. */
static double depth_step(const struct planner_candidate *c)
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
        w *= pow(hz / band_hz[1], SHARPEN);
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
    bool rounder = is_blunt(c) && !strcmp(c->method, "fast") && !sees_shape(cfg->probe);
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
    double plane_m = depth_step(c) * cfg->grid->step_m[2];
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
    double shape = ahead + square(in_widths * width_m_of(o)), point = ahead + slant;
    if (sees_shape(cfg->probe))
        return sqrt(shape + (cfg->probe->specular ? 0.0 : OF_EDGES * slant));
    if (cfg->probe->n_objects)
        return sqrt(point);
    return sqrt(sqrt(shape * (point + square(UNKNOWN * width_m_of(o)))));
}

static double worst_m(const struct planner_config *cfg, const struct planner_candidate *c,
                      double in_widths, bool elements)
{
    const struct probe *probe = cfg->probe;
    double most_m = object_error_m(cfg, c, object_of(probe), in_widths, elements);
    for (size_t i = 1; i < probe->n_objects; i++)
        if (probe->objects[i].level_db > probe->snr_db - STRONG_DB)
            most_m = fmax(
                most_m, object_error_m(cfg, c, &probe->objects[i], in_widths, elements));
    return most_m;
}

/* Fills in error_m and own_m. */
static void estimate_error(const struct planner_config *cfg, struct planner_candidate *c)
{
    double in_widths = edges(cfg, c);
    c->error_m = worst_m(cfg, c, in_widths, true);
    c->own_m = worst_m(cfg, c, in_widths, false);
}

/* -- how long a step takes --------------------------------------------------------------
 */

/* ns on one core of the machine they were measured on, in memory that is used for the
 * first time. */
#define COHERENCE_NS  16.0  /* a sample of a trace */
#define COMPRESS_NS   8.0e3 /* a trace */
#define PLACES_NS     1.2e3 /* a pair, on one thread: what the geometry says of places */
#define STACK_NS      4.5   /* a sample of a trace, moved out */
#define DIP_NS        9.0   /* a sample of a trace, by its dip */
#define DIP_PLAN_NS   160.0 /* a sample of a midpoint's trace, of all the chirp's band */
#define FAST_NS       20.0  /* a voxel */
#define LATERAL_NS    18.0  /* a shortest wave of depth, at a wavenumber along x */
#define DEPTH_NS      2.2   /* a step of it there */
#define WAVE_NS       750.0 /* a cube of the shortest wave, times the steepest sine^2 */
#define SCAN_NS       0.48  /* a pair of trace and voxel, steps dividing the stage's */
#define ANY_NS        1.4   /* elsewhere */
#define INCOHERENT_NS 0.35  /* a pair, on coarse slabs; of other steps ANY_NS */
#define FILTER_NS     20.0  /* a sample of a trace, of power */
#define MIRROR_NS     25.0  /* a sample of a trace, from power to the image */
#define ITERATIVE_NS  120.0 /* a voxel and iteration */

#define WIDER      2.4 /* f-k migration: its period, times the image's width */
#define DEEPER     1.15
#define LEAST_SINE 0.5 /* of the steepest waves */

double planner_compress_s(size_t n_pings, size_t n_microphones, size_t n_threads)
{
    return 1e-9 * COMPRESS_NS * (double)(n_pings * n_microphones) / (double)n_threads;
}

/* ns of f-k migration, which works on no less than the aperture, on twice the image's
 * width and down to the range of its farthest corner (recon/coherent/fk.c). */
static double migrate_ns(const struct trace_set *s, const struct grid *g)
{
    double wave_m = s->geometry->sound_speed_m_s / s->band_hz[1];
    double low[3], high[3], wide_m[2];
    geometry_aperture(s->geometry, low, high);
    for (int a = 0; a < 2; a++)
        wide_m[a] = fmax(g->step_m[a] * (double)g->n[a], high[a] - low[a]);
    double depth_m = g->step_m[2] * (double)g->n[2], far_m = g->origin_m[2] + depth_m;
    double range_m = hypot(far_m, hypot(wide_m[0], wide_m[1]));
    double deep = DEEPER * (range_m - g->origin_m[2]) / wave_m;
    double across_m = fmax(wide_m[0], wide_m[1]);
    double sine = fmax(across_m / hypot(across_m, far_m - 0.5 * depth_m), LEAST_SINE);
    double along_x = WIDER * fmin((double)g->n[0], 4.0 * sine * wide_m[0] / wave_m);
    return FAST_NS * (double)grid_size(g) +
           WAVE_NS * sine * sine * deep * wide_m[0] * wide_m[1] / (wave_m * wave_m) +
           along_x * (double)g->n[1] * deep *
               (LATERAL_NS + DEPTH_NS * wave_m / g->step_m[2]);
}

double planner_probe_s(const struct trace_set *set, const struct grid *grid,
                       size_t stride, size_t n_threads)
{
    double traces = (double)(set->geometry->n_positions * trace_set_pairs(set));
    const struct imager_config wanted = trace_set_imager(set, grid, NULL);
    struct trace_set low = *set;
    struct imager_config look;
    coarse_view(&wanted, &look);
    memcpy(low.band_hz, look.band_hz, sizeof low.band_hz);
    double ns = STACK_NS * traces / (double)stride * (double)set->format.n_samples +
                migrate_ns(&low, &look.grid);
    return 1e-9 * (PLACES_NS * traces + ns / (double)n_threads);
}

double planner_coherence_s(const struct trace_set *set, size_t stride, size_t n_threads)
{
    size_t n = set->geometry->n_positions;
    double positions = (double)(n < COHERENCE_POSITIONS ? n : COHERENCE_POSITIONS);
    double traces = positions * (double)trace_set_pairs(set) / (double)stride;
    return 1e-9 * COHERENCE_NS * traces * (double)set->format.n_samples /
           (double)n_threads;
}

/* Of every pair, heard or not. */
static double incoherent_ns(const struct trace_set *set, const struct grid *grid)
{
    bool scan;
    double traces = (double)(set->geometry->n_positions * trace_set_pairs(set));
    double voxels = incoherent_voxels(set->geometry, grid, &scan);
    return traces * (FILTER_NS * (double)set->format.n_samples +
                     voxels * (scan ? INCOHERENT_NS : ANY_NS));
}

double planner_mirror_s(const struct trace_set *set, size_t n_threads)
{
    double traces = (double)(set->geometry->n_positions * trace_set_pairs(set));
    return 1e-9 * MIRROR_NS * traces * (double)set->format.n_samples / (double)n_threads;
}

/* What dip moveout takes before the first trace, whatever the speakers: the paper's array
 * has a midpoint for each position and sum of two elements' places.  As many frequencies
 * as wavenumbers: the square of the band's top, in that of the rate. */
static double dip_plan_ns(const struct trace_set *set)
{
    const struct geometry *g = set->geometry;
    double midpoints = (double)(g->n_positions * (g->n_speakers + g->n_microphones - 1));
    double top = set->band_hz[1] / (0.5 * set->format.rate_hz + set->band_hz[0]);
    return DIP_PLAN_NS * midpoints * (double)set->format.n_samples * top * top;
}

double planner_image_s(const struct trace_set *set, const struct grid *grid,
                       const char *method, bool dip, size_t stride, size_t n_threads)
{
    double voxels = (double)grid_size(grid);
    double traces = (double)(set->geometry->n_positions * trace_set_pairs(set)) /
                    (double)stride;
    double samples = traces * (double)set->format.n_samples;
    double ns = STACK_NS * samples;
    if (!strcmp(method, "backprojection"))
        ns += traces * voxels *
              (geometry_stage_stride(set->geometry, grid->step_m[0]) ? SCAN_NS : ANY_NS);
    else if (!strcmp(method, "incoherent"))
        ns += incoherent_ns(set, grid);
    else
        ns += migrate_ns(set, grid);
    if (dip)
        ns += DIP_NS * samples + dip_plan_ns(set);
    return 1e-9 * ns / (double)n_threads;
}

double planner_iteration_s(const struct grid *grid, size_t n_threads)
{
    return 1e-9 * ITERATIVE_NS * (double)grid_size(grid) / (double)n_threads;
}

/* -- what an image is of ----------------------------------------------------------------
 */

static bool positions_are_lost(const struct probe *p)
{
    return p->coherence.element_m > PLANNER_INCOHERENT_M;
}

static double reliable_hz(const struct planning *p)
{
    const struct trace_set *s = p->cfg->set;
    double sigma_m = p->cfg->probe->coherence.element_m;
    if (!(sigma_m > 0.0) || positions_are_lost(p->cfg->probe))
        return s->band_hz[1];
    double top_hz = s->geometry->sound_speed_m_s / (LEAST_WAVE * sigma_m);
    return fmin(s->band_hz[1], fmax(top_hz, 2.0 * s->band_hz[0]));
}

/* Planes of the whole image between the probe's depths, with its steps made coarser, or
 * finer. */
static void plan_grid(const struct planning *p, const struct planner_candidate *c,
                      struct grid *out)
{
    const struct grid *whole = p->cfg->grid;
    const double *depth_m = p->cfg->probe->depth_m;
    *out = *whole;
    if (p->cfg->keep_grid)
        return;
    double step_m = whole->step_m[2];
    double first = fmax(floor((depth_m[0] - whole->origin_m[2]) / step_m), 0.0);
    double last =
        fmin(ceil((depth_m[1] - whole->origin_m[2]) / step_m), (double)(whole->n[2] - 1));
    out->origin_m[2] += first * step_m;
    out->n[2] = (size_t)fmax(last - first, 0.0) + 1;
    for (int a = 0; a < 3; a++) {
        double extent_m = out->step_m[a] * (double)(out->n[a] - 1);
        out->step_m[a] *= a == 2 ? depth_step(c) : c->coarser;
        out->n[a] = (size_t)floor(extent_m / out->step_m[a] + 1e-6) + 1;
    }
}

static double time_s(const struct planning *p, const struct planner_candidate *c)
{
    const struct planner_config *cfg = p->cfg;
    struct grid grid;
    struct trace_set set = *cfg->set;
    set.band_hz[1] = c->top_hz;
    plan_grid(p, c, &grid);
    double s =
        positions_are_lost(cfg->probe) && cfg->probe->specular
            ? planner_mirror_s(&set, cfg->n_threads)
            : planner_image_s(&set, &grid, c->method, c->dip, c->stride, cfg->n_threads);
    size_t n = c->iterations < USUAL_ITERATIONS ? c->iterations : USUAL_ITERATIONS;
    s += (double)n * planner_iteration_s(&grid, cfg->n_threads);
    return cfg->compress_s / (double)c->stride + cfg->slowness * s;
}

/* That the budget has time for. */
static size_t count_iterations(const struct planning *p, struct planner_candidate c)
{
    struct grid grid;
    c.iterations = 0;
    plan_grid(p, &c, &grid);
    double each_s = p->cfg->slowness * planner_iteration_s(&grid, p->cfg->n_threads);
    double n = floor((CERTAIN * p->cfg->budget_s - time_s(p, &c)) / each_s);
    return (size_t)fmin(fmax(n, LEAST_ITERATIONS), MOST_ITERATIONS);
}

/* -- ways to go -------------------------------------------------------------------------
 */

/* The whole image's steps suit its middle; what is nearer is narrower. */
static bool supports_finer(const struct planning *p)
{
    const double *step_m = p->cfg->grid->step_m;
    const struct probe_object *o = &p->cfg->probe->objects[0];
    return !p->cfg->keep_grid && p->cfg->probe->n_objects &&
           (step_m[0] > LEAST_STEPS * o->width_m[0] ||
            step_m[1] > LEAST_STEPS * o->width_m[1]);
}

/* May steps be so many times those of the whole image? */
static bool may_step(const struct planning *p, double factor)
{
    bool finite = isfinite(p->cfg->budget_s), asked = p->cfg->error_m > 0.0;
    if (factor == 1.0 || p->cfg->keep_grid)
        return factor == 1.0;
    return factor > 1.0 ? finite || asked
                        : asked || ((factor != FINE || finite) && supports_finer(p));
}

/* May planes stand so many times as near to each other? */
static bool may_deepen(const struct planning *p, const struct planner_candidate *c)
{
    const struct planner_config *cfg = p->cfg;
    struct grid grid;
    if (c->deeper == 1.0 || cfg->keep_grid)
        return c->deeper == 1.0;
    plan_grid(p, c, &grid);
    return grid.step_m[2] >= LEAST_DEPTH * object_of(cfg->probe)->width_m[2] &&
           (double)grid_size(&grid) <= MOST_VOXELS;
}

static void add(const struct planning *p, struct planner_candidate c)
{
    struct plan *plan = p->plan;
    if (plan->n_candidates == PLANNER_CANDIDATES || !may_deepen(p, &c))
        return;
    c.time_s = time_s(p, &c);
    estimate_error(p->cfg, &c);
    plan->candidates[plan->n_candidates++] = c;
}

/* Sharpened or not is a question where it is known what there is. */
static void list_sharpness(const struct planning *p, struct planner_candidate c)
{
    const struct probe *probe = p->cfg->probe;
    bool stands = !(probe->coherence.element_m > SHARPEST_M);
    c.sharpen = SHARPEN;
    if (stands)
        add(p, c);
    c.sharpen = 0.0;
    if (!stands || probe->n_objects)
        add(p, c);
}

static void list_fast(const struct planning *p, struct planner_candidate c)
{
    for (size_t d = 0; d < 2 * sizeof deeper / sizeof *deeper; d++) {
        c.deeper = deeper[d / 2];
        c.dip = d % 2;
        if (!c.dip || !p->cfg->probe->uneven)
            list_sharpness(p, c);
    }
}

/* The top of the band is left out where time presses, rather than steps made coarser. */
static void list_bands(const struct planning *p, struct planner_candidate c)
{
    double top_hz = c.top_hz, low_hz = p->cfg->set->band_hz[0];
    bool pressed = isfinite(p->cfg->budget_s) && c.coarser >= 1.0 &&
                   reliable_hz(p) >= top_hz;
    for (size_t t = 0; t < sizeof tops / sizeof *tops; t++) {
        c.top_hz = tops[t] * top_hz;
        if (t == 0 || (pressed && c.top_hz > 2.0 * low_hz))
            list_fast(p, c);
    }
}

static void list_at(const struct planning *p, double factor, size_t stride)
{
    const struct probe *probe = p->cfg->probe;
    bool stacked = probe->imaged && !positions_are_lost(probe);
    struct planner_candidate any = {.method = "backprojection",
                                    .coarser = factor,
                                    .deeper = 1.0,
                                    .top_hz = p->cfg->set->band_hz[1],
                                    .stride = stride};
    if (factor != FINE)
        add(p, any);
    any.method = "fast";
    if (stacked)
        list_bands(p, any);
    any.method = "iterative";
    if (stacked && stride == 1 && isfinite(p->cfg->budget_s) && factor == 1.0 &&
        sees_shape(probe)) {
        any.iterations = count_iterations(p, any);
        add(p, any);
    }
}

/* Power alone: what is so wide suffers little from coarser steps.  Fewer speakers save
 * nothing there, and mirrors are told by all of them. */
static void list_incoherent(const struct planning *p)
{
    const struct planner_config *cfg = p->cfg;
    struct planner_candidate c = {.method = "incoherent",
                                  .coarser = 1.0,
                                  .deeper = 1.0,
                                  .top_hz = cfg->set->band_hz[1],
                                  .stride = cfg->least_stride};
    add(p, c);
    c.coarser = POWER_STEPS;
    if (isfinite(cfg->budget_s) && !cfg->probe->specular && !cfg->keep_grid)
        add(p, c);
}

/* Fewer pairs only where time presses. */
static void list(const struct planning *p)
{
    const struct planner_config *cfg = p->cfg;
    if (positions_are_lost(cfg->probe)) {
        list_incoherent(p);
        return;
    }
    for (size_t f = 0; f < sizeof coarser / sizeof *coarser; f++) {
        if (!may_step(p, coarser[f]))
            continue;
        for (size_t s = 0; s < sizeof strides / sizeof *strides; s++) {
            bool pressed = isfinite(cfg->budget_s) &&
                           strides[s] <= cfg->set->geometry->n_speakers;
            if (strides[s] == cfg->least_stride ||
                (pressed && strides[s] > cfg->least_stride))
                list_at(p, coarser[f], strides[s]);
        }
    }
}

/* -- the choice -------------------------------------------------------------------------
 */

static bool is_exact(const struct planning *p, const struct planner_candidate *c)
{
    return (p->cfg->error_m > 0.0 ? c->error_m : c->own_m) <= p->goal_m;
}

static bool is_affordable(const struct planning *p, const struct planner_candidate *c)
{
    return c->time_s <= CERTAIN * p->cfg->budget_s;
}

/* Of two that are as exact as each other: where no error was asked for, a budget is there
 * to be spent, on what the error does not tell (sidelobes, what is faint). */
static bool is_cheaper(const struct planning *p, const struct planner_candidate *a,
                       const struct planner_candidate *b)
{
    bool asked = p->cfg->error_m > 0.0;
    if (!asked && a->top_hz != b->top_hz)
        return a->top_hz > b->top_hz;
    if (!asked && a->stride != b->stride)
        return a->stride < b->stride;
    return a->time_s != b->time_s ? a->time_s < b->time_s : a->own_m < b->own_m;
}

/* Is a to be preferred to b?  What fits the budget comes first.  Of that the cheapest
 * that is exact enough, and else the most exact; errors that are nearly the same count as
 * such. */
static bool is_better(const struct planning *p, const struct planner_candidate *a,
                      const struct planner_candidate *b)
{
    if (is_affordable(p, a) != is_affordable(p, b))
        return is_affordable(p, a);
    if (!is_affordable(p, a))
        return a->time_s < b->time_s;
    if (is_exact(p, a) && is_exact(p, b))
        return is_cheaper(p, a, b);
    if (is_exact(p, a) != is_exact(p, b))
        return is_exact(p, a);
    if (fmin(a->own_m, b->own_m) < NEARLY * fmax(a->own_m, b->own_m))
        return a->own_m < b->own_m;
    return is_cheaper(p, a, b);
}

/* -- why it was chosen, and why not the others ------------------------------------------
 */

static void say(char text[PLANNER_WORDS], const char *format, ...)
    __attribute__((format(printf, 2, 3)));

static void say(char text[PLANNER_WORDS], const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(text, PLANNER_WORDS, format, args);
    va_end(args);
}

static void explain_others(const struct planning *p, const struct planner_candidate *best)
{
    for (size_t i = 0; i < p->plan->n_candidates; i++) {
        struct planner_candidate *c = &p->plan->candidates[i];
        if (c == best)
            continue;
        if (!is_affordable(p, c))
            say(c->why_not, "takes %.1f ms, %.1f are left", 1e3 * c->time_s,
                1e3 * fmax(p->cfg->budget_s, 0.0));
        else if (p->cfg->error_m > 0.0 && !is_exact(p, c))
            say(c->why_not, "error %.2f cm, %.2f are allowed", 100.0 * c->error_m,
                100.0 * p->goal_m);
        else if (c->time_s > best->time_s)
            say(c->why_not, "takes %.1f times as long as what was chosen",
                c->time_s / fmax(best->time_s, 1e-9));
        else
            say(c->why_not, "error %.2f cm against %.2f", 100.0 * c->error_m,
                100.0 * best->error_m);
    }
}

/* Is plain `fast` of the same steps too far off for what there is? */
static bool needs_dip(const struct planning *p, const struct planner_candidate *best)
{
    for (size_t i = 0; i < p->plan->n_candidates; i++) {
        const struct planner_candidate *c = &p->plan->candidates[i];
        if (!strcmp(c->method, "fast") && !c->dip && c->coarser == best->coarser &&
            c->deeper == best->deeper && c->stride == best->stride &&
            c->top_hz == best->top_hz && c->sharpen == best->sharpen)
            return c->error_m > fmax(p->goal_m, FAR_OFF * best->error_m);
    }
    return false;
}

static void explain_moderate(const struct planning *p,
                             const struct planner_candidate *best)
{
    char *because = p->plan->because;
    if (!strcmp(best->method, "iterative"))
        say(because, "something extended, and time to sharpen it");
    else if (needs_dip(p, best))
        say(because,
            "targets are near or far aside: moveout without dip does not suffice");
    else if (p->cfg->error_m > 0.0)
        say(because, "the cheapest that is exact to %.2f cm", 100.0 * p->goal_m);
    else if (isfinite(p->cfg->budget_s))
        say(because, "the least error of what fits the budget");
    else
        say(because, "the cheapest: no other is more exact by much");
}

/* Fills in why_not of all but the best, and because. */
static void explain(const struct planning *p, const struct planner_candidate *best)
{
    const struct probe *probe = p->cfg->probe;
    char *because = p->plan->because;
    explain_others(p, best);
    if (probe->coherence.element_m > PLANNER_INCOHERENT_M)
        say(because, "element positions are uncertain by %.1f mm: phase says nothing",
            1e3 * probe->coherence.element_m);
    else if (!is_affordable(p, best))
        say(because, "nothing fits the budget: the cheapest of all");
    else if (!probe->imaged)
        say(because, "fast needs midpoints on a lattice before the image");
    else if (p->cfg->error_m > 0.0 && !is_exact(p, best))
        say(because, "no way is exact to %.2f cm: the best of %s", 100.0 * p->goal_m,
            isfinite(p->cfg->budget_s) ? "those that fit the budget" : "all");
    else
        explain_moderate(p, best);
}

/* -- the plan ---------------------------------------------------------------------------
 */

static void take(const struct planning *p, const struct planner_candidate *best)
{
    struct plan *out = p->plan;
    out->method = best->method;
    out->dip = best->dip;
    out->sharpen = best->sharpen;
    out->stride = best->stride;
    out->iterations = best->iterations;
    out->time_s = best->time_s;
    out->error_m = best->error_m;
    out->reliable_hz = reliable_hz(p);
    out->band_hz[0] = p->cfg->set->band_hz[0];
    out->band_hz[1] = fmin(best->top_hz, out->reliable_hz);
    plan_grid(p, best, &out->grid);
}

void planner_decide(struct plan *out, const struct planner_config *cfg)
{
    struct planning p = {.cfg = cfg, .plan = out};
    const struct probe_object *o = object_of(cfg->probe);
    memset(out, 0, sizeof *out);
    p.goal_m = cfg->error_m > 0.0 ? cfg->error_m : GOAL * width_m_of(o);
    list(&p);
    const struct planner_candidate *best = &out->candidates[0];
    for (size_t i = 1; i < out->n_candidates; i++)
        if (is_better(&p, &out->candidates[i], best))
            best = &out->candidates[i];
    take(&p, best);
    explain(&p, best);
}
