#include "recon/coherent/zero_offset.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/coherent/zero_offset_plan.h"

/* Louder than this is no echo, and its square would be no number. */
#define LOUDEST 1e13f

static size_t groups_of(size_t n, bool packed)
{
    size_t in_group = packed ? POINT : VECTOR_LANES;
    return (n + in_group - 1) / in_group;
}

/* -- create -----------------------------------------------------------------------------
 */

static int create_stretch(struct zero_offset *c, const struct zero_offset_config *cfg)
{
    struct stretch_config stretch = {
        .sound_speed_m_s = cfg->geometry->sound_speed_m_s,
        .power = cfg->power,
        .band_hz = {cfg->band_hz[0], cfg->band_hz[1]},
        .in = cfg->in,
        .out = cfg->out,
        .mute_s = cfg->mute_s,
        .n_offsets = c->plan.n_offsets,
        .half_offset_m = c->plan.half_m[2],
    };
    int err = stretch_create(&c->stretch, &stretch);
    if (err)
        return err;
    c->n_rows = stretch_rows(c->stretch);
    return lane_fft_create(&c->fft, c->n_rows);
}

/* One axis of midpoints without extent has no dip either: any pitch will do. */
static double pitch_of(const struct zero_offset *c, int axis)
{
    return c->plan.lattice.n[axis] > 1 ? c->plan.lattice.pitch_m[axis] : 1.0;
}

static int create_along_y(struct zero_offset *c, const double *w)
{
    const struct zero_offset_plan *p = &c->plan;
    int err = 0;
    c->along_y = calloc(p->n_x_parts, sizeof *c->along_y);
    if (!c->along_y)
        return -ENOMEM;
    for (size_t part = 0; !err && part < p->n_x_parts; part++) {
        size_t first = part ? p->part_end[part - 1] : 0;
        struct dmo_config dmo = {
            .n_lines = zero_offset_lines(c)[1],
            .pitch_m = pitch_of(c, 1),
            .n_offsets = p->n_offsets,
            .half_offset_m = p->half_m[1],
            .n_inputs = p->part_end[part] - first,
            .offset = p->offset + first,
            .line = p->line + first,
            .n_bins = c->n_rows,
            .w = w,
            .pool = c->pool,
        };
        err = dmo_create(&c->along_y[part], &dmo);
    }
    return err;
}

static int create_along_x(struct zero_offset *c, const double *w)
{
    size_t nx = zero_offset_lines(c)[0], n = c->plan.n_x_parts * nx;
    uint32_t *part = malloc(n * sizeof *part), *line = malloc(n * sizeof *line);
    int err = -ENOMEM;
    if (part && line) {
        for (size_t q = 0; q < n; q++) {
            part[q] = (uint32_t)(q / nx);
            line[q] = (uint32_t)(q % nx);
        }
        struct dmo_config dmo = {
            .n_lines = nx,
            .pitch_m = pitch_of(c, 0),
            .n_offsets = c->plan.n_x_parts,
            .half_offset_m = c->plan.x_part_m,
            .n_inputs = n,
            .offset = part,
            .line = line,
            .n_bins = c->n_rows,
            .w = w,
            .pool = c->pool,
        };
        err = dmo_create(&c->along_x, &dmo);
    }
    free(part);
    free(line);
    return err;
}

static int create_dmo(struct zero_offset *c)
{
    double *w = malloc(c->n_rows * sizeof *w);
    if (!w)
        return -ENOMEM;
    for (size_t q = 0; q < c->n_rows; q++)
        w[q] = stretch_frequency(c->stretch, c->fft->number[q]);
    int err = create_along_y(c, w);
    if (!err && c->plan.dip_in_x)
        err = create_along_x(c, w);
    free(w);
    return err;
}

static float *points_alloc(size_t n)
{
    float *points = aligned_alloc(64, n * POINT * sizeof *points);
    if (points)
        memset(points, 0, n * POINT * sizeof *points);
    return points;
}

static int scratch_create(struct zero_offset_scratch *s, const struct zero_offset *c)
{
    size_t nx = zero_offset_lines(c)[0], ny = zero_offset_lines(c)[1],
           parts = c->plan.n_x_parts;
    s->samples = points_alloc(c->n_in);
    s->finished = points_alloc(c->n_out);
    s->plane = points_alloc(parts * ny * c->groups);
    s->turned = points_alloc(parts * nx * c->turned_groups);
    s->imaged = points_alloc(nx * c->turned_groups);
    return s->samples && s->finished && s->plane && s->turned && s->imaged ? 0 : -ENOMEM;
}

static void scratch_clear(struct zero_offset_scratch *s)
{
    free(s->samples);
    free(s->finished);
    free(s->plane);
    free(s->turned);
    free(s->imaged);
}

static int allocate(struct zero_offset *c)
{
    size_t nx = zero_offset_lines(c)[0], ny = zero_offset_lines(c)[1];
    c->pitch = (c->n_rows + 1) * POINT; /* inputs of a bin in different cache sets */
    c->traces = calloc(c->plan.n_inputs * nx * c->n_in, c->floats * sizeof *c->traces);
    c->fold = calloc(nx * ny, sizeof *c->fold);
    c->spectra = points_alloc(c->plan.n_inputs * c->groups * (c->n_rows + 1));
    c->stacked = points_alloc(ny * c->groups * (c->n_rows + 1));
    c->scratch = calloc(pool_threads(c->pool), sizeof *c->scratch);
    c->locks = malloc(nx * sizeof *c->locks);
    for (size_t x = 0; c->locks && x < nx; x++)
        pthread_mutex_init(&c->locks[x], NULL);
    if (!c->traces || !c->fold || !c->spectra || !c->stacked || !c->scratch || !c->locks)
        return -ENOMEM;
    int err = 0;
    for (size_t t = 0; !err && t < pool_threads(c->pool); t++)
        err = scratch_create(&c->scratch[t], c);
    return err;
}

int zero_offset_create(struct zero_offset **out, const struct zero_offset_config *cfg,
                       const char **why)
{
    struct zero_offset *c = calloc(1, sizeof *c);
    if (!c)
        return -ENOMEM;
    double first_s = fmax(fmax(cfg->out.t0_s, cfg->mute_s), 1.0 / cfg->in.rate_hz);
    double sample_s = cfg->power ? 0.5 / (cfg->band_hz[1] - cfg->band_hz[0])
                                 : 0.5 / cfg->band_hz[1];
    c->pool = cfg->pool;
    c->power = cfg->power;
    c->floats = cfg->power ? 1 : 2;
    c->n_microphones = cfg->geometry->n_microphones;
    c->n_pairs = cfg->geometry->n_speakers * c->n_microphones;
    c->n_in = cfg->in.n_samples;
    c->n_out = cfg->out.n_samples;
    int err = zero_offset_plan(&c->plan, cfg->geometry, first_s, sample_s, why);
    if (!err) {
        c->packed = c->power && !c->plan.dip_in_x;
        c->groups = groups_of(zero_offset_lines(c)[0], c->packed);
        c->turned_groups = groups_of(zero_offset_lines(c)[1], false);
        err = create_stretch(c, cfg);
    }
    if (!err)
        err = create_dmo(c);
    if (!err)
        err = allocate(c);
    if (err) {
        zero_offset_destroy(c);
        return err;
    }
    *out = c;
    return 0;
}

void zero_offset_destroy(struct zero_offset *c)
{
    if (!c)
        return;
    for (size_t t = 0; c->scratch && t < pool_threads(c->pool); t++)
        scratch_clear(&c->scratch[t]);
    free(c->scratch);
    for (size_t x = 0; c->locks && x < zero_offset_lines(c)[0]; x++)
        pthread_mutex_destroy(&c->locks[x]);
    free(c->locks);
    free(c->traces);
    free(c->fold);
    free(c->spectra);
    free(c->stacked);
    for (size_t part = 0; c->along_y && part < c->plan.n_x_parts; part++)
        dmo_destroy(c->along_y[part]);
    free(c->along_y);
    dmo_destroy(c->along_x);
    lane_fft_destroy(c->fft);
    stretch_destroy(c->stretch);
    zero_offset_plan_clear(&c->plan);
    free(c);
}

void zero_offset_lattice(const struct zero_offset *c, struct zero_offset_lattice *out)
{
    *out = c->plan.lattice;
}

/* -- add --------------------------------------------------------------------------------
 */

/* What is no number, or too loud to be one, is left out. */
VECTOR_CLONES
static void add_powers(size_t n, const float *restrict z, float *restrict sum)
{
    for (size_t q = 0; q < n; q++) {
        float p = z[2 * q] * z[2 * q] + z[2 * q + 1] * z[2 * q + 1];
        sum[q] += p < LOUDEST * LOUDEST ? p : 0.0f;
    }
}

VECTOR_CLONES
static void add_floats(size_t n, const float *restrict z, float *restrict sum)
{
    for (size_t q = 0; q < n; q++)
        sum[q] += fabsf(z[q]) < LOUDEST ? z[q] : 0.0f;
}

void zero_offset_add(struct zero_offset *c, size_t position, size_t speaker,
                     const float complex *traces, const bool *masked)
{
    size_t nx = zero_offset_lines(c)[0], ny = zero_offset_lines(c)[1];
    for (size_t i = 0; i < c->n_microphones; i++) {
        if (masked && masked[i])
            continue;
        size_t at = position * c->n_pairs + speaker * c->n_microphones + i;
        size_t x = c->plan.x[at], input = c->plan.input[at];
        const float *z = (const float *)(traces + i * c->n_in);
        float *sum = c->traces + (input * nx + x) * c->n_in * c->floats;
        pthread_mutex_lock(&c->locks[x]);
        if (c->power)
            add_powers(c->n_in, z, sum);
        else
            add_floats(2 * c->n_in, z, sum);
        c->fold[x * ny + c->plan.line[input]]++;
        pthread_mutex_unlock(&c->locks[x]);
    }
}

void zero_offset_reset(struct zero_offset *c)
{
    size_t nx = zero_offset_lines(c)[0], ny = zero_offset_lines(c)[1];
    memset(c->traces, 0, c->plan.n_inputs * nx * c->n_in * c->floats * sizeof *c->traces);
    memset(c->fold, 0, nx * ny * sizeof *c->fold);
}
