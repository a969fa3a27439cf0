/* SPDX-License-Identifier: MIT */
/* recon/power/incoherent.c -- keeps the traces' powers, filters and weighs them; see
 * incoherent.h. */
#include "recon/power/incoherent.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/coherent/colocated.h"
#include "recon/imaging/fold.h"
#include "recon/imaging/imager.h"
#include "recon/imaging/method.h"
#include "recon/planning/scattering.h"

/* -- mirrors ----------------------------------------------------------------------------
 */

/* Mirrors that face the array answer each pair from the one place between speaker and
 * microphone, which back-projection would spread over all voxels at that distance: they
 * stand where they are in the stack of all offsets (Lindell 2019, 3.2), as `--method
 * paper` makes it. */
struct incoherent_mirror {
    struct colocated *colocated; /* tells mirrors */
    struct scattering_config scattering;
    float *power, *scratch;
    struct imager *stack; /* images them */
};

static void mirror_destroy(struct incoherent_mirror *m)
{
    if (!m)
        return;
    colocated_destroy(m->colocated);
    imager_destroy(m->stack);
    free(m->power);
    free(m->scratch);
    free(m);
}

static int plan_scattering(struct incoherent_mirror *m)
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
static int mirror_create(struct incoherent_mirror **out, const struct imager_config *cfg)
{
    struct imager_options options;
    struct imager_config stack = *cfg;
    const char *why;
    struct incoherent_mirror *m = calloc(1, sizeof *m);
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

static void mirror_add(struct incoherent_mirror *m, size_t position, size_t speaker,
                       const float complex *traces, const bool *masked)
{
    colocated_add(m->colocated, position, speaker, traces, masked);
    imager_add(m->stack, position, speaker, traces, masked);
}

/* false, and nothing written: this is no mirror. */
static bool mirror_image(struct incoherent_mirror *m, float *intensity)
{
    struct scattering s;
    colocated_power(m->colocated, m->power);
    scattering_measure(&m->scattering, m->power, m->scratch, &s);
    if (!scattering_is_specular(&s))
        return false;
    imager_image(m->stack, intensity);
    return true;
}

static void mirror_reset(struct incoherent_mirror *m)
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
                        struct incoherent_slab *slab, double distance_m)
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
                        bool last, struct incoherent_slab *slab)
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
        struct incoherent_slab slab;
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
        struct incoherent_slab *slab = &b->slabs[b->n_slabs];
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

static size_t n_elements(const struct incoherent *b)
{
    return b->geometry.n_speakers + b->geometry.n_microphones;
}

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
    float per_m = (float)(incoherent_rate_hz(b) / b->geometry.sound_speed_m_s);
    float start = (float)(0.5 * (1.0 - b->in.t0_s * incoherent_rate_hz(b)));
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
    for (size_t pair = 0; pair < incoherent_pairs(b); pair++) {
        size_t trace = k * incoherent_pairs(b) + pair;
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

/* -- create -----------------------------------------------------------------------------
 */

#define FINE       INCOHERENT_FINE
#define FADE       16 /* samples over which the ends of a trace fade */
#define LANE_BLOCK 16
#define LOUDEST    1e26f /* power; louder is no echo, and no number when summed */
#define REACH      4.0   /* of the filter, in standard deviations */

/* Of the filter, in path.  Measured: 5 mm is sharper where positions are right, 15 mm is
 * no better where they are wrong by 10 mm. */
#define SIGMA_M 0.008

static size_t n_traces(const struct incoherent *b)
{
    return incoherent_pairs(b) * b->geometry.n_positions;
}

static void incoherent_destroy(void *state)
{
    struct incoherent *b = state;
    if (!b)
        return;
    if (b->scan)
        incoherent_scan_destroy(b);
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
    b->n_groups = b->scan ? incoherent_pairs(b) : n;
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
    return b->scan ? incoherent_scan_create(b) : any_create(b);
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
            b->scan = incoherent_scan_fits(b, &b->slabs[i]) && b->scan;
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
        size_t t = position * incoherent_pairs(b) + speaker * n_m + i;
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
    size_t n = b->in.n_samples, pairs = incoherent_pairs(b);
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
static void image_slab(struct incoherent *b, const struct incoherent_slab *slab,
                       float *intensity)
{
    b->slab = slab;
    b->image = slab->resample ? b->coarse : intensity;
    if (b->scan)
        incoherent_scan(b);
    else
        any_image(b);
    if (slab->resample)
        resample_volume(slab->resample, b->coarse, intensity);
}

static void clip(void *ctx, size_t plane, size_t thread)
{
    struct incoherent *b = ctx;
    size_t n = b->grid.n[0] * b->grid.n[1];
    (void)thread;
    for (size_t v = plane * n; v < (plane + 1) * n; v++)
        b->image[v] = b->image[v] > 0.0f ? b->image[v] : 0.0f;
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
    b->image = intensity;
    pool_run(b->pool, b->grid.n[2], clip, b);
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
