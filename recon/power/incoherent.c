/* SPDX-License-Identifier: MIT */
/* recon/power/incoherent.c -- `--method incoherent`: back-projection of power, for
 * arrays whose elements stand where nobody knows to better than a wavelength.
 *
 * Each trace is squared, multiplied by its squared range and filtered by the negative
 * second derivative of a Gaussian, as in filtered back-projection of spherical means
 * (Xu and Wang 2005: over a plane of measurements the second derivative undoes the blur):
 * what each echo smears over the voxels that it could come from cancels where they do
 * not agree.  Each voxel sums all traces at its delay, a midpoint counting once however
 * many pairs share it; what stays below 0 is none.  The Gaussian is as wide as positions
 * may be wrong.  Mirrors are imaged in another way, see below. */
#include "recon/power/incoherent.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/coherent/colocated.h"
#include "recon/imaging/fold.h"
#include "recon/imaging/method.h"
#include "recon/imaging/resample.h"
#include "recon/planning/scattering.h"

#define FINE 2

/* Some depths of the image.  Power changes slowly sideways, the more so the farther away:
 * it is imaged on fewer voxels and interpolated. */
struct slab {
    struct grid grid;
    size_t first_plane, n_planes; /* of the image */
    struct resample *resample;    /* NULL: grid is the image's own */
    size_t stride;                /* scan: voxels between two stage positions */
};

struct incoherent {
    struct geometry geometry;
    struct trace_format in;
    struct grid grid; /* of the image */
    struct pool *pool;
    size_t first;  /* samples of a trace before the gate */
    float *gain;   /* [in.n_samples]: squared range, faded in and out; 0 first */
    float *filter; /* [FINE][taps] */
    size_t n_taps;
    float *power;   /* [n_traces][in.n_samples], as added */
    bool *live;     /* [n_traces]: added, not masked */
    uint32_t *cell; /* [n_traces]: its midpoint */
    uint32_t *fold; /* [n_cells]: live traces of it */
    size_t n_cells;

    /* Filtered traces, FINE samples for each of the input, lie in groups of `lanes`:
     * [group][n_stored][lanes].  Of an array that a stage carries along x in steps of
     * whole voxels a group is a pair and its lanes the stage positions; else each trace
     * is a group. */
    bool scan;
    size_t lanes, n_groups, n_stored; /* the first sample and the last two are 0 */
    float *stored;
    float **scratch; /* [threads][in.n_samples + taps][lanes] */
    void *sweeps;    /* of the imaging part */

    struct mirror *mirror; /* NULL: cannot be told */
    struct slab *slabs;
    size_t n_slabs;
    float *coarse; /* image of one slab */

    const struct slab *slab; /* being imaged */
    float *image;            /* to here, negative values too */
};

static size_t pairs_of(const struct incoherent *b)
{
    return b->geometry.n_speakers * b->geometry.n_microphones;
}

static size_t n_elements(const struct incoherent *b)
{
    return b->geometry.n_speakers + b->geometry.n_microphones;
}

static double rate_hz_of(const struct incoherent *b)
{
    return b->in.rate_hz * FINE;
}

/* -- mirrors ----------------------------------------------------------------------------
 */

/* Mirrors that face the array answer each pair from the one place between speaker and
 * microphone, which back-projection would spread over all voxels at that distance: they
 * stand where they are in the stack of all offsets (Lindell 2019, 3.2), as `--method
 * paper` makes it. */
struct mirror {
    struct colocated *colocated; /* tells mirrors */
    struct scattering_config scattering;
    float *power, *scratch;
    struct imager *stack; /* images them */
};

static void mirror_destroy(struct mirror *m)
{
    if (!m)
        return;
    colocated_destroy(m->colocated);
    imager_destroy(m->stack);
    free(m->power);
    free(m->scratch);
    free(m);
}

static int plan_scattering(struct mirror *m)
{
    struct colocated_lattice l;
    colocated_lattice(m->colocated, &l);
    m->scattering = (struct scattering_config){
        l.nx, l.ny, l.pitch_x_m, l.pitch_y_m, l.n_ranges, l.range_m, l.range_step_m};
    m->power = malloc(l.nx * l.ny * l.n_ranges * sizeof *m->power);
    m->scratch = malloc(2 * l.nx * l.ny * sizeof *m->scratch);
    return m->power && m->scratch ? 0 : -ENOMEM;
}

/* *out NULL: midpoints that form no lattice tell nothing.  0, -EINVAL, -ENOMEM. */
static int mirror_create(struct mirror **out, const struct imager_config *cfg)
{
    struct imager_options options;
    struct imager_config stack = *cfg;
    const char *why;
    struct mirror *m = calloc(1, sizeof *m);
    *out = NULL;
    if (!m)
        return -ENOMEM;
    imager_options_default(&options);
    options.lightcone = 0;
    stack.method = "paper";
    stack.options = &options;
    int err = imager_create(&m->stack, &stack, &why);
    if (!err)
        err = colocated_create(&m->colocated, cfg, &why);
    if (!err)
        err = plan_scattering(m);
    if (err) {
        mirror_destroy(m);
        return err == -ENOTSUP ? 0 : err;
    }
    *out = m;
    return 0;
}

static void mirror_add(struct mirror *m, size_t position, size_t speaker,
                       const float complex *traces, const bool *masked)
{
    colocated_add(m->colocated, position, speaker, traces, masked);
    imager_add(m->stack, position, speaker, traces, masked);
}

/* false: this is no mirror, or the pool has stopped. */
static bool mirror_image(struct mirror *m, float *intensity)
{
    struct scattering s;
    colocated_power(m->colocated, m->power);
    scattering_measure(&m->scattering, m->power, m->scratch, &s);
    if (!scattering_is_specular(&s))
        return false;
    return !imager_image(m->stack, intensity);
}

static void mirror_reset(struct mirror *m)
{
    colocated_reset(m->colocated);
    imager_reset(m->stack);
}

/* -- slabs ------------------------------------------------------------------------------
 */

#define DEEPER    1.4    /* a slab ends where it is so many times as far as it begins */
#define FINENESS  0.0085 /* voxels over distance: a sixth of a point's width there */
#define WORTH     1.3    /* times the image's own steps; else those are used */
#define MAX_SLABS 64

/* The step that goes into the stage's, if it has one along x: for the fast way. */
static double divide_pitch(const struct geometry *g, double step_m)
{
    if (g->n_positions < 2 || fabs(g->stage_axis[0] - 1.0) > 1e-9)
        return step_m;
    double pitch_m =
        fabs(g->stage_positions_m[g->n_positions - 1] - g->stage_positions_m[0]) /
        (double)(g->n_positions - 1);
    return pitch_m > 0.0 ? pitch_m / ceil(pitch_m / step_m - 1e-6) : step_m;
}

/* One voxel around the image on either side, for the interpolation. */
static void coarsen(struct grid *g, int axis, double step_m)
{
    double across_m = g->step_m[axis] * (double)(g->n[axis] - 1);
    g->n[axis] = (size_t)ceil(across_m / step_m - 1e-6) + 3;
    g->origin_m[axis] -= step_m;
    g->step_m[axis] = step_m;
}

static void choose_grid(const struct geometry *g, const struct grid *image,
                        struct slab *slab, double distance_m)
{
    struct grid *part = &slab->grid;
    struct grid own = *image;
    own.n[2] = slab->n_planes;
    own.origin_m[2] += image->step_m[2] * (double)slab->first_plane;
    *part = own;
    if (g->pings_m)
        return;
    for (int axis = 0; axis < 2; axis++) {
        double step_m = FINENESS * distance_m;
        if (axis == 0)
            step_m = divide_pitch(g, step_m);
        if (step_m > WORTH * image->step_m[axis] && image->n[axis] > 4)
            coarsen(part, axis, step_m);
    }
    if (part->n[0] == own.n[0] && part->n[1] == own.n[1])
        *part = own;
}

/* The slab that begins with this plane. */
static void choose_slab(const struct geometry *g, const struct grid *image, size_t plane,
                        bool last, struct slab *slab)
{
    double low[3], high[3];
    geometry_aperture(g, low, high);
    double at_m = image->origin_m[2] + image->step_m[2] * (double)plane;
    double distance_m = fmax(at_m - 0.5 * (low[2] + high[2]), 0.1);
    double planes = ceil((DEEPER - 1.0) * distance_m / image->step_m[2]);
    size_t left = image->n[2] - plane;
    slab->first_plane = plane;
    slab->n_planes = planes < (double)left && !last ? (size_t)planes : left;
    choose_grid(g, image, slab, distance_m);
}

double incoherent_voxels(const struct geometry *g, const struct grid *image, bool *scan)
{
    double voxels = 0.0;
    size_t n = 0;
    *scan = g->n_positions >= VECTOR_LANES;
    for (size_t z = 0; z < image->n[2]; n++) {
        struct slab slab;
        choose_slab(g, image, z, n + 1 == MAX_SLABS, &slab);
        voxels += (double)grid_size(&slab.grid);
        *scan = *scan && geometry_stage_stride(g, slab.grid.step_m[0]);
        z += slab.n_planes;
    }
    return voxels;
}

static int slabs_create(struct incoherent *b)
{
    size_t largest = 0;
    int err = 0;
    b->slabs = calloc(MAX_SLABS, sizeof *b->slabs);
    if (!b->slabs)
        return -ENOMEM;
    for (size_t z = 0; !err && z < b->grid.n[2]; b->n_slabs++) {
        struct slab *slab = &b->slabs[b->n_slabs];
        choose_slab(&b->geometry, &b->grid, z, b->n_slabs + 1 == MAX_SLABS, slab);
        z += slab->n_planes;
        struct grid part = b->grid;
        part.n[2] = slab->n_planes;
        part.origin_m[2] = slab->grid.origin_m[2];
        if (slab->grid.n[0] == part.n[0] && slab->grid.n[1] == part.n[1])
            continue;
        err =
            resample_create(&slab->resample, &slab->grid, &part, RESAMPLE_CUBIC, b->pool);
        size_t size = grid_size(&slab->grid);
        largest = size > largest ? size : largest;
    }
    if (!err && largest && !(b->coarse = malloc(largest * sizeof *b->coarse)))
        err = -ENOMEM;
    return err;
}

static void slabs_destroy(struct incoherent *b)
{
    for (size_t i = 0; i < b->n_slabs; i++)
        resample_destroy(b->slabs[i].resample);
    free(b->slabs);
    free(b->coarse);
}

/* -- all voxels of a slab, for any geometry: voxels in the lanes ------------------------
 */

#define BLOCK 256 /* voxels: their delays to all elements stay in the cache */

struct sweep {             /* one a thread */
    float voxel[3][BLOCK]; /* m */
    float sum[BLOCK];
    float *delay; /* [elements][BLOCK] in stored samples */
};

static int any_create(struct incoherent *b)
{
    struct sweep *sweeps = calloc(pool_threads(b->pool), sizeof *sweeps);
    b->sweeps = sweeps;
    for (size_t t = 0; sweeps && t < pool_threads(b->pool); t++)
        if (!(sweeps[t].delay = malloc(n_elements(b) * BLOCK * sizeof(float))))
            return -ENOMEM;
    return sweeps ? 0 : -ENOMEM;
}

static void any_destroy(struct incoherent *b)
{
    struct sweep *sweeps = b->sweeps;
    for (size_t t = 0; sweeps && t < pool_threads(b->pool); t++)
        free(sweeps[t].delay);
    free(sweeps);
}

/* Half of the origin of time goes to each of a pair's two elements. */
VECTOR_CLONES
static void element_delays(const struct incoherent *b, const double at[3],
                           const float (*restrict voxel)[BLOCK], float *restrict delay)
{
    float per_m = (float)(rate_hz_of(b) / b->geometry.sound_speed_m_s);
    float start = (float)(0.5 * (1.0 - b->in.t0_s * rate_hz_of(b)));
    float x = (float)at[0], y = (float)at[1], z = (float)at[2];
    for (size_t v = 0; v < BLOCK; v++) {
        float dx = voxel[0][v] - x, dy = voxel[1][v] - y, dz = voxel[2][v] - z;
        delay[v] = start + per_m * sqrtf(dx * dx + dy * dy + dz * dz);
    }
}

VECTOR_CLONES
static void add_trace(const float *restrict trace, float last, const float *restrict a,
                      const float *restrict b, float *restrict sum)
{
    for (size_t v = 0; v < BLOCK; v++) {
        float at = a[v] + b[v];
        at = at > 0.0f ? at : 0.0f;
        at = at < last ? at : last;
        int sample = (int)at;
        float x = trace[sample], y = trace[sample + 1];
        sum[v] += x + (at - (float)sample) * (y - x);
    }
}

/* Adds all traces of one position. */
static void add_position(const struct incoherent *b, struct sweep *s, size_t k)
{
    const struct geometry *g = &b->geometry;
    float last = (float)(b->n_stored - 2);
    for (size_t e = 0; e < n_elements(b); e++) {
        double at[3];
        if (e < g->n_speakers)
            geometry_speaker(g, k, e, at);
        else
            geometry_microphone(g, k, 0, e - g->n_speakers, at);
        element_delays(b, at, s->voxel, s->delay + e * BLOCK);
    }
    for (size_t pair = 0; pair < pairs_of(b); pair++) {
        size_t trace = k * pairs_of(b) + pair;
        if (b->live[trace])
            add_trace(b->stored + trace * b->n_stored, last,
                      s->delay + pair / g->n_microphones * BLOCK,
                      s->delay + (g->n_speakers + pair % g->n_microphones) * BLOCK,
                      s->sum);
    }
}

static void image_block(void *ctx, size_t item, size_t thread)
{
    struct incoherent *b = ctx;
    struct sweep *s = (struct sweep *)b->sweeps + thread;
    const struct grid *g = &b->slab->grid;
    size_t first = item * BLOCK, all = grid_size(g);
    size_t n = all - first < BLOCK ? all - first : BLOCK;
    for (size_t v = 0; v < BLOCK; v++) {
        size_t at[3];
        grid_place(g, first + (v < n ? v : n - 1), at);
        for (int a = 0; a < 3; a++)
            s->voxel[a][v] = (float)(g->origin_m[a] + g->step_m[a] * (double)at[a]);
        s->sum[v] = 0.0f;
    }
    for (size_t k = 0; k < b->geometry.n_positions; k++)
        add_position(b, s, k);
    for (size_t v = 0; v < n; v++)
        b->image[first + v] = s->sum[v];
}

static void any_image(struct incoherent *b)
{
    pool_run(b->pool, (grid_size(&b->slab->grid) + BLOCK - 1) / BLOCK, image_block, b);
}

/* -- all voxels of a slab, for a scan: stage positions in the lanes ---------------------
 */

/* See recon/coherent/backprojection.c for why stage positions lie in the lanes.  Power
 * needs no phases, so that one sum a lane passes all pairs without leaving its register.
 */

#define ROWS       8  /* depths that are imaged together */
#define SCAN_BLOCK 16 /* differences that are planned together */
#define TOGETHER   4  /* differences summed together */

struct scan_sweep { /* one a thread */
    size_t n_d;     /* differences of x between voxel and stage */
    size_t n_sum;   /* voxels of one remainder, with the lanes' overhang on both sides */
    float *delay;   /* [ROWS][elements][n_d] in stored samples */
    float *sum;     /* [ROWS][stride][n_sum]: voxels of one remainder lie side by side */
    int *sample;    /* [pairs][SCAN_BLOCK]: which samples a block reads */
    float *beyond;  /* [pairs][SCAN_BLOCK]: and how far past them */
};

/* Does the geometry fit the slab?  Sets its stride. */
static bool scan_fits(const struct incoherent *b, struct slab *slab)
{
    slab->stride = geometry_stage_stride(&b->geometry, slab->grid.step_m[0]);
    return slab->stride && b->geometry.n_positions >= VECTOR_LANES;
}

static size_t differences(const struct incoherent *b, const struct slab *slab)
{
    return slab->grid.n[0] + (b->lanes - 1) * slab->stride;
}

/* Voxels of one remainder, with the lanes' overhang on both sides. */
static size_t sums(const struct incoherent *b, const struct slab *slab)
{
    return (slab->grid.n[0] + slab->stride - 1) / slab->stride + 2 * b->lanes +
           VECTOR_LANES;
}

static int sweep_create(struct scan_sweep *s, const struct incoherent *b)
{
    size_t n_d = 0, n_sum = 0;
    for (size_t i = 0; i < b->n_slabs; i++) {
        size_t d = differences(b, &b->slabs[i]);
        size_t n = sums(b, &b->slabs[i]) * b->slabs[i].stride;
        n_d = d > n_d ? d : n_d;
        n_sum = n > n_sum ? n : n_sum;
    }
    s->delay = malloc(ROWS * n_elements(b) * n_d * sizeof *s->delay);
    s->sum = malloc(ROWS * n_sum * sizeof *s->sum);
    s->sample = calloc(pairs_of(b) * SCAN_BLOCK, sizeof *s->sample);
    s->beyond = calloc(pairs_of(b) * SCAN_BLOCK, sizeof *s->beyond);
    return s->delay && s->sum && s->sample && s->beyond ? 0 : -ENOMEM;
}

/* 0, -ENOMEM; what there is then is still to be destroyed. */
static int scan_create(struct incoherent *b)
{
    struct scan_sweep *sweeps = calloc(pool_threads(b->pool), sizeof *sweeps);
    if (!sweeps)
        return -ENOMEM;
    b->sweeps = sweeps;
    int err = 0;
    for (size_t t = 0; !err && t < pool_threads(b->pool); t++)
        err = sweep_create(&sweeps[t], b);
    return err;
}

static void scan_destroy(struct incoherent *b)
{
    struct scan_sweep *sweeps = b->sweeps;
    for (size_t t = 0; sweeps && t < pool_threads(b->pool); t++) {
        free(sweeps[t].delay);
        free(sweeps[t].sum);
        free(sweeps[t].sample);
        free(sweeps[t].beyond);
    }
    free(sweeps);
}

/* Difference d stands for x_voxel - x_stage = x0 + d * step. */
VECTOR_CLONES
static void scan_delays(const struct incoherent *b, double x0_m, double beside2_m2,
                        size_t n, float *restrict delay)
{
    float per_m = (float)(rate_hz_of(b) / b->geometry.sound_speed_m_s);
    float start = (float)(0.5 * (1.0 - b->in.t0_s * rate_hz_of(b)));
    float x0 = (float)x0_m, step = (float)b->slab->grid.step_m[0],
          beside2 = (float)beside2_m2;
    for (size_t d = 0; d < n; d++) {
        float dx = x0 + step * (float)(int)d;
        delay[d] = start + per_m * sqrtf(dx * dx + beside2);
    }
}

static void row_start(const struct incoherent *b, const struct scan_sweep *s, size_t row,
                      double y_m, double z_m)
{
    const struct geometry *g = &b->geometry;
    double back_m = (double)((b->lanes - 1) * b->slab->stride) * b->slab->grid.step_m[0];
    for (size_t e = 0; e < n_elements(b); e++) {
        const double *at = e < g->n_speakers ? g->speakers_m[e]
                                             : g->microphones_m[e - g->n_speakers];
        double x0_m = b->slab->grid.origin_m[0] - back_m -
                      b->geometry.stage_positions_m[0] - at[0];
        double dy = y_m - at[1], dz = z_m - at[2];
        scan_delays(b, x0_m, dy * dy + dz * dz, s->n_d,
                    s->delay + (row * n_elements(b) + e) * s->n_d);
    }
    memset(s->sum + row * b->slab->stride * s->n_sum, 0,
           b->slab->stride * s->n_sum * sizeof *s->sum);
}

/* Which samples all pairs read for the differences first..first + n - 1. */
VECTOR_CLONES
static void plan_block(const struct incoherent *b, const float *delay, size_t n_d,
                       size_t first, size_t n, int *restrict sample,
                       float *restrict beyond)
{
    size_t n_m = b->geometry.n_microphones;
    float last = (float)(b->n_stored - 2);
    for (size_t pair = 0; pair < pairs_of(b); pair++) {
        const float *s = delay + pair / n_m * n_d + first;
        const float *m = delay + (b->geometry.n_speakers + pair % n_m) * n_d + first;
        for (size_t d = 0; d < n; d++) {
            float at = s[d] + m[d];
            at = at > 0.0f ? at : 0.0f;
            at = at < last ? at : last;
            int whole = (int)at;
            sample[pair * SCAN_BLOCK + d] = whole;
            beyond[pair * SCAN_BLOCK + d] = at - (float)whole;
        }
    }
}

/* Stage positions whose voxel for difference d lies on the grid: first..end-1. */
static void lane_range(const struct incoherent *b, size_t d, size_t *first, size_t *end)
{
    long back = (long)((b->lanes - 1) * b->slab->stride), stride = (long)b->slab->stride;
    long voxel = (long)d - back; /* of lane 0 */
    long low = voxel >= 0 ? 0 : (-voxel + stride - 1) / stride;
    long high = ((long)b->slab->grid.n[0] - 1 - voxel) / stride + 1;
    *first = (size_t)low;
    *end = high < (long)b->lanes ? (size_t)high : b->lanes;
}

/* sum [TOGETHER][16]: of 16 lanes over all pairs, for neighbouring differences, which
 * read neighbouring samples. */
VECTOR_CLONES
static void sum_pairs(const struct incoherent *b, const float *stored, const int *sample,
                      const float *beyond, float *restrict sum)
{
    size_t pairs = pairs_of(b), pitch = b->n_stored * b->lanes;
    float part[TOGETHER][VECTOR_LANES] = {{0}};
    for (size_t pair = 0; pair < pairs; pair++, stored += pitch) {
#pragma GCC unroll 4 /* all TOGETHER: their sums become registers */
        for (size_t d = 0; d < TOGETHER; d++) {
            const float *x = stored + (size_t)sample[pair * SCAN_BLOCK + d] * b->lanes;
            float f = beyond[pair * SCAN_BLOCK + d];
            for (size_t v = 0; v < VECTOR_LANES; v++) {
                part[d][v] += (1.0f - f) * x[v];
                part[d][v] += f * x[b->lanes + v];
            }
        }
    }
    memcpy(sum, part, sizeof part);
}

/* Lane k of difference d belongs to voxel d - (lanes - 1) * stride + k * stride. */
static void sum_block(const struct incoherent *b, struct scan_sweep *s, size_t row,
                      size_t first, size_t n)
{
    float *rows = s->sum + row * b->slab->stride * s->n_sum,
          part[TOGETHER * VECTOR_LANES];
    plan_block(b, s->delay + row * n_elements(b) * s->n_d, s->n_d, first, n, s->sample,
               s->beyond);
    for (size_t d = 0; d < n; d += TOGETHER) {
        size_t together = n - d < TOGETHER ? n - d : TOGETHER, low = b->lanes, high = 0;
        for (size_t e = 0; e < together; e++) {
            size_t from, end;
            lane_range(b, first + d + e, &from, &end);
            low = from < low ? from : low;
            high = end > high ? end : high;
        }
        for (size_t k = low - low % VECTOR_LANES; k < high; k += VECTOR_LANES) {
            sum_pairs(b, b->stored + k, s->sample + d, s->beyond + d, part);
            for (size_t e = 0; e < together; e++) {
                size_t voxel = first + d + e + b->slab->stride;
                float *to = rows + voxel % b->slab->stride * s->n_sum +
                            voxel / b->slab->stride + k;
                for (size_t l = 0; l < VECTOR_LANES; l++)
                    to[l] += part[e * VECTOR_LANES + l];
            }
        }
    }
}

static void row_finish(const struct incoherent *b, const struct scan_sweep *s, size_t row,
                       size_t y, size_t z)
{
    const struct grid *g = &b->slab->grid;
    const float *sum = s->sum + row * b->slab->stride * s->n_sum;
    float *out = b->image + (z * g->n[1] + y) * g->n[0];
    for (size_t x = 0; x < g->n[0]; x++) {
        size_t voxel = x + b->slab->stride * b->lanes;
        out[x] = sum[voxel % b->slab->stride * s->n_sum + voxel / b->slab->stride];
    }
}

static void image_rows(void *ctx, size_t item, size_t thread)
{
    struct incoherent *b = ctx;
    struct scan_sweep *s = (struct scan_sweep *)b->sweeps + thread;
    const struct grid *g = &b->slab->grid;
    size_t y = item % g->n[1], z = item / g->n[1] * ROWS;
    size_t n_rows = g->n[2] - z < ROWS ? g->n[2] - z : ROWS;
    s->n_d = differences(b, b->slab);
    s->n_sum = sums(b, b->slab);
    for (size_t r = 0; r < n_rows; r++)
        row_start(b, s, r, g->origin_m[1] + g->step_m[1] * (double)y,
                  g->origin_m[2] + g->step_m[2] * (double)(z + r));
    for (size_t d = 0; d < s->n_d; d += SCAN_BLOCK)
        for (size_t r = 0; r < n_rows; r++)
            sum_block(b, s, r, d, s->n_d - d < SCAN_BLOCK ? s->n_d - d : SCAN_BLOCK);
    for (size_t r = 0; r < n_rows; r++)
        row_finish(b, s, r, y, z + r);
}

static void scan_image(struct incoherent *b)
{
    size_t slabs = (b->slab->grid.n[2] + ROWS - 1) / ROWS;
    pool_run(b->pool, slabs * b->slab->grid.n[1], image_rows, b);
}

/* -- create -----------------------------------------------------------------------------
 */

#define FADE       16 /* samples over which the ends of a trace fade */
#define LANE_BLOCK 16
#define LOUDEST    1e26f /* power; louder is no echo, and no number when summed */
#define REACH      4.0   /* of the filter, in standard deviations */

/* Of the filter, in path.  Measured: 5 mm is sharper where positions are right, 15 mm is
 * no better where they are wrong by 10 mm. */
#define SIGMA_M 0.008

static size_t n_traces(const struct incoherent *b)
{
    return pairs_of(b) * b->geometry.n_positions;
}

static void incoherent_destroy(void *state)
{
    struct incoherent *b = state;
    if (!b)
        return;
    if (b->scan)
        scan_destroy(b);
    else
        any_destroy(b);
    slabs_destroy(b);
    for (size_t t = 0; b->scratch && t < pool_threads(b->pool); t++)
        free(b->scratch[t]);
    free(b->scratch);
    free(b->gain);
    free(b->filter);
    free(b->power);
    free(b->live);
    free(b->cell);
    free(b->fold);
    free(b->stored);
    mirror_destroy(b->mirror);
    geometry_clear(&b->geometry);
    free(b);
}

static double smooth(double x) /* 0 to 1 */
{
    return x <= 0.0 ? 0.0 : x >= 1.0 ? 1.0 : 0.5 - 0.5 * cos(M_PI * x);
}

static int plan_gain(struct incoherent *b, double near_m)
{
    size_t n = b->in.n_samples;
    double c = b->geometry.sound_speed_m_s;
    double first = (2.0 * near_m / c - b->in.t0_s) * b->in.rate_hz;
    b->first = first > 0.0 ? (size_t)ceil(fmin(first, (double)n)) : 0;
    b->gain = malloc(n * sizeof *b->gain);
    if (!b->gain)
        return -ENOMEM;
    for (size_t q = 0; q < n; q++) {
        double range_m = 0.5 * c * (b->in.t0_s + (double)q / b->in.rate_hz);
        double edge = fmin((double)q - (double)b->first, (double)(n - 1 - q)) + 1.0;
        b->gain[q] = (float)(range_m * range_m * smooth(edge / (FADE + 1)));
    }
    return 0;
}

/* The negative second derivative of a Gaussian between samples, of no mean: what is even
 * over time is no echo. */
static int plan_filter(struct incoherent *b, double sigma)
{
    size_t half = (size_t)ceil(REACH * sigma);
    b->n_taps = 2 * half + 1;
    b->filter = malloc(FINE * b->n_taps * sizeof *b->filter);
    if (!b->filter)
        return -ENOMEM;
    for (size_t f = 0; f < FINE; f++) {
        double sum = 0.0, gauss = 0.0;
        for (int pass = 0; pass < 2; pass++) {
            for (size_t l = 0; l < b->n_taps; l++) {
                double x = ((double)l - (double)half - (double)f / FINE) / sigma;
                double g = exp(-0.5 * x * x), w = (1.0 - x * x) * g;
                if (pass == 0) {
                    sum += w;
                    gauss += g;
                } else {
                    b->filter[f * b->n_taps + l] = (float)((w - sum / gauss * g) / sigma);
                }
            }
        }
    }
    return 0;
}

static int allocate(struct incoherent *b)
{
    size_t n = n_traces(b), samples = b->in.n_samples + b->n_taps;
    b->n_groups = b->scan ? pairs_of(b) : n;
    b->n_stored = b->in.n_samples * FINE + 3;
    b->power = calloc(n * b->in.n_samples, sizeof *b->power);
    b->live = calloc(n, sizeof *b->live);
    b->cell = malloc(n * sizeof *b->cell);
    b->stored = calloc(b->n_groups * b->n_stored, b->lanes * sizeof *b->stored);
    b->scratch = calloc(pool_threads(b->pool), sizeof *b->scratch);
    if (!b->power || !b->live || !b->cell || !b->stored || !b->scratch)
        return -ENOMEM;
    for (size_t t = 0; t < pool_threads(b->pool); t++)
        if (!(b->scratch[t] = calloc(samples * b->lanes, sizeof **b->scratch)))
            return -ENOMEM;
    int err = fold_number(&b->geometry, b->cell, &b->n_cells);
    if (err)
        return err;
    b->fold = malloc(b->n_cells * sizeof *b->fold);
    if (!b->fold)
        return -ENOMEM;
    return b->scan ? scan_create(b) : any_create(b);
}

static int incoherent_create(void **state, const struct imager_config *cfg,
                             const char **why)
{
    (void)why;
    struct incoherent *b = calloc(1, sizeof *b);
    if (!b)
        return -ENOMEM;
    b->in = cfg->format;
    b->grid = cfg->grid;
    b->pool = cfg->pool;
    int err = geometry_copy(&b->geometry, cfg->geometry);
    if (!err)
        err = plan_gain(b, cfg->gate_m[0]);
    if (!err) {
        double samples_per_m = b->in.rate_hz / cfg->geometry->sound_speed_m_s;
        err = plan_filter(b, SIGMA_M * samples_per_m);
    }
    if (!err)
        err = slabs_create(b);
    if (!err) {
        b->scan = true;
        for (size_t i = 0; i < b->n_slabs; i++)
            b->scan = scan_fits(b, &b->slabs[i]) && b->scan;
        b->lanes = b->scan ? (b->geometry.n_positions + LANE_BLOCK - 1) / LANE_BLOCK *
                                 LANE_BLOCK
                           : 1;
        err = allocate(b);
    }
    if (!err)
        err = mirror_create(&b->mirror, cfg);
    if (err) {
        incoherent_destroy(b);
        return err;
    }
    *state = b;
    return 0;
}

/* -- add --------------------------------------------------------------------------------
 */

static void incoherent_add(void *state, size_t position, size_t speaker,
                           const float complex *traces, const bool *masked)
{
    struct incoherent *b = state;
    size_t n_m = b->geometry.n_microphones, n = b->in.n_samples;
    if (b->mirror)
        mirror_add(b->mirror, position, speaker, traces, masked);
    for (size_t i = 0; i < n_m; i++) {
        if (masked && masked[i])
            continue;
        size_t t = position * pairs_of(b) + speaker * n_m + i;
        const float *z = (const float *)(traces + i * n);
        float *p = b->power + t * n;
        for (size_t q = b->first; q < n; q++) {
            float power = z[2 * q] * z[2 * q] + z[2 * q + 1] * z[2 * q + 1];
            p[q] = power < LOUDEST ? b->gain[q] * power : 0.0f;
        }
        b->live[t] = true;
    }
}

static void incoherent_reset(void *state)
{
    struct incoherent *b = state;
    memset(b->power, 0, n_traces(b) * b->in.n_samples * sizeof *b->power);
    memset(b->live, 0, n_traces(b) * sizeof *b->live);
    if (b->mirror)
        mirror_reset(b->mirror);
}

/* -- image ------------------------------------------------------------------------------
 */

static float weight(const struct incoherent *b, size_t trace)
{
    return b->live[trace] ? 1.0f / ((float)b->fold[b->cell[trace]] * (float)b->n_cells)
                          : 0.0f;
}

/* in [n + n_taps - 1][lanes], out [n][FINE][lanes]. */
VECTOR_CLONES
static void filter_lanes(const struct incoherent *b, size_t n, const float *restrict in,
                         float *restrict out)
{
    for (size_t q = 0; q < FINE * n; q++, out += b->lanes) {
        const float *w = b->filter + q % FINE * b->n_taps;
        const float *x = in + q / FINE * b->lanes;
        for (size_t k = 0; k < b->lanes; k += VECTOR_LANES) {
            float sum[VECTOR_LANES] = {0};
            for (size_t l = 0; l < b->n_taps; l++)
                for (size_t v = 0; v < VECTOR_LANES; v++)
                    sum[v] += w[l] * x[l * b->lanes + k + v];
            memcpy(out + k, sum, sizeof sum);
        }
    }
}

VECTOR_CLONES
static void filter_trace(const struct incoherent *b, size_t n, const float *restrict in,
                         float *restrict out)
{
    for (size_t f = 0; f < FINE; f++) {
        for (size_t q = 0; q < n; q++) {
            float sum = 0.0f;
            for (size_t l = 0; l < b->n_taps; l++)
                sum += b->filter[f * b->n_taps + l] * in[q + l];
            out[FINE * q + f] = sum;
        }
    }
}

/* Traces of a group side by side, weighed, after half a filter of zeros; then filtered.
 */
static void filter_group(void *ctx, size_t group, size_t thread)
{
    struct incoherent *b = ctx;
    size_t n = b->in.n_samples, pairs = pairs_of(b);
    float *x = b->scratch[thread] + b->n_taps / 2 * b->lanes;
    size_t n_in_group = b->scan ? b->geometry.n_positions : 1;
    for (size_t k = 0; k < n_in_group; k++) {
        size_t trace = b->scan ? k * pairs + group : group;
        const float *p = b->power + trace * n;
        float w = weight(b, trace);
        for (size_t q = 0; q < n; q++)
            x[q * b->lanes + k] = w * p[q];
    }
    float *out = b->stored + (group * b->n_stored + 1) * b->lanes;
    if (b->scan)
        filter_lanes(b, n, b->scratch[thread], out);
    else
        filter_trace(b, n, b->scratch[thread], out);
}

/* A slab's voxels, finely spaced, where they are above 0. */
static void image_slab(struct incoherent *b, const struct slab *slab, float *intensity)
{
    b->slab = slab;
    b->image = slab->resample ? b->coarse : intensity;
    if (b->scan)
        scan_image(b);
    else
        any_image(b);
    if (slab->resample)
        resample_volume(slab->resample, b->coarse, intensity);
}

static void incoherent_image(void *state, float *intensity)
{
    struct incoherent *b = state;
    if (b->mirror && mirror_image(b->mirror, intensity))
        return;
    memset(b->fold, 0, b->n_cells * sizeof *b->fold);
    for (size_t t = 0; t < n_traces(b); t++)
        b->fold[b->cell[t]] += b->live[t];
    pool_run(b->pool, b->n_groups, filter_group, b);
    for (size_t i = 0; i < b->n_slabs; i++)
        image_slab(b, &b->slabs[i],
                   intensity + b->slabs[i].first_plane * b->grid.n[0] * b->grid.n[1]);
    method_clip(b->pool, &b->grid, intensity);
}

const struct imager_method method_incoherent = {
    .name = "incoherent",
    .clips = true,
    .any_geometry = true,
    .create = incoherent_create,
    .add = incoherent_add,
    .image = incoherent_image,
    .reset = incoherent_reset,
    .destroy = incoherent_destroy,
};
