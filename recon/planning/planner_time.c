/* SPDX-License-Identifier: MIT */
#include "recon/planning/planner_time.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "recon/imaging/coarse.h"
#include "recon/planning/coherence.h"
#include "recon/planning/probe.h"
#include "recon/power/incoherent.h"

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
