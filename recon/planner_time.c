#include "recon/planner_time.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

/* ns on one core of the machine they were measured on. */
#define COMPRESS_NS      1.3e4 /* a trace */
#define STACK_NS         7.0   /* a sample of a trace, moved out */
#define DIP_NS           30.0  /* a sample of a trace, by its dip */
#define FAST_NS          30.0  /* a voxel */
#define WAVE_NS          300.0 /* a cube of the shortest wave, whatever the steps */
#define SCAN_NS          0.48  /* a pair of trace and voxel, steps dividing the stage's */
#define ANY_NS           1.4   /* elsewhere */
#define INCOHERENT_NS    0.25  /* a pair, on coarse slabs */
#define ITERATIVE_NS     120.0 /* a voxel and iteration */
#define ITERATIVE_ROUNDS 30.0
#define COARSE_VOXELS    7.0 /* of the image, to one of the probe's */

double planner_compress_s(size_t n_pings, size_t n_microphones, size_t n_threads)
{
    return 1e-9 * COMPRESS_NS * (double)(n_pings * n_microphones) / (double)n_threads;
}

/* Cubes of the band's shortest wave in what f-k migration works on, which is no smaller
 * than the aperture. */
static double count_waves(const struct trace_set *s, const struct grid *g)
{
    double low[3], high[3], wave_m = s->geometry->sound_speed_m_s / s->band_hz[1];
    double waves = 1.0;
    geometry_aperture(s->geometry, low, high);
    for (int a = 0; a < 3; a++) {
        double extent_m = g->step_m[a] * (double)g->n[a];
        waves *= fmax(extent_m, a < 2 ? high[a] - low[a] : 0.0) / wave_m;
    }
    return waves;
}

double planner_probe_s(const struct trace_set *set, const struct grid *grid,
                       size_t n_threads)
{
    double traces = (double)(set->geometry->n_positions * trace_set_pairs(set));
    double ns = STACK_NS * traces * (double)set->format.n_samples +
                FAST_NS * (double)grid_size(grid) / COARSE_VOXELS +
                WAVE_NS * count_waves(set, grid);
    return 1e-9 * ns / (double)n_threads;
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
        ns += traces * voxels * INCOHERENT_NS;
    else
        ns += voxels * FAST_NS + WAVE_NS * count_waves(set, grid);
    if (dip)
        ns += DIP_NS * samples;
    if (!strcmp(method, "iterative"))
        ns += voxels * ITERATIVE_NS * ITERATIVE_ROUNDS;
    return 1e-9 * ns / (double)n_threads;
}
