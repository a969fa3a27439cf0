#include "recon/zero_offset.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/dmo.h"
#include "recon/lane_fft.h"
#include "recon/stretch.h"
#include "recon/zero_offset_plan.h"

#define POINT LANE_FFT_POINT /* floats of 16 complex numbers: 16 re, 16 im */
#define BINS  8              /* of log frequency that one item of work stacks */
#define TILE  16

struct scratch {    /* one a thread */
    float *samples; /* [n_in or n_out][POINT] */
    float *plane;   /* [n_x_parts * ny][groups][POINT] */
    float *turned;  /* [n_x_parts * nx][turned_groups][POINT] */
    float *imaged;  /* [nx][turned_groups][POINT] */
};

struct zero_offset {
    struct zero_offset_plan plan;
    struct pool *pool;
    bool power;
    bool packed;    /* every float is a power, also those where im stands */
    size_t n_pairs; /* of a position */
    size_t n_microphones, n_in, n_out, n_rows;
    size_t floats;        /* of a stored sample: 1 or 2 */
    size_t groups;        /* POINTs of a line of midpoints in x */
    size_t turned_groups; /* of a line in y */
    size_t pitch;         /* floats from group to group of spectra */
    struct stretch *stretch;
    struct lane_fft *fft;
    struct dmo **along_y;   /* [n_x_parts] */
    struct dmo *along_x;    /* NULL: not needed */
    pthread_mutex_t *locks; /* [nx] */
    float *traces;          /* [n_inputs][nx][n_in][floats] */
    uint32_t *fold;         /* [nx][ny] traces of a midpoint */
    float *spectra;         /* [n_inputs][groups][pitch]: [n_rows][POINT] */
    float *stacked;         /* [ny][groups][pitch] */
    struct scratch *scratch;
    float *out; /* of zero_offset_stack */
};

static const size_t *lines(const struct zero_offset *c)
{
    return c->plan.lattice.n;
}

/* Where the power of a midpoint, or the real part of its trace, stands in its line. */
static size_t place(size_t line, bool packed)
{
    return packed ? line : line / VECTOR_LANES * POINT + line % VECTOR_LANES;
}

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
            .n_lines = lines(c)[1],
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
    size_t nx = lines(c)[0], n = c->plan.n_x_parts * nx;
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

static int scratch_create(struct scratch *s, const struct zero_offset *c)
{
    size_t nx = lines(c)[0], ny = lines(c)[1], parts = c->plan.n_x_parts;
    s->samples = points_alloc(c->n_in > c->n_out ? c->n_in : c->n_out);
    s->plane = points_alloc(parts * ny * c->groups);
    s->turned = points_alloc(parts * nx * c->turned_groups);
    s->imaged = points_alloc(nx * c->turned_groups);
    return s->samples && s->plane && s->turned && s->imaged ? 0 : -ENOMEM;
}

static void scratch_clear(struct scratch *s)
{
    free(s->samples);
    free(s->plane);
    free(s->turned);
    free(s->imaged);
}

static int allocate(struct zero_offset *c)
{
    size_t nx = lines(c)[0], ny = lines(c)[1];
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
        c->groups = groups_of(lines(c)[0], c->packed);
        c->turned_groups = groups_of(lines(c)[1], false);
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
    for (size_t x = 0; c->locks && x < lines(c)[0]; x++)
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

static void add_powers(size_t n, const float *restrict z, float *restrict sum)
{
    for (size_t q = 0; q < n; q++)
        sum[q] += z[2 * q] * z[2 * q] + z[2 * q + 1] * z[2 * q + 1];
}

static void add_floats(size_t n, const float *restrict z, float *restrict sum)
{
    for (size_t q = 0; q < n; q++)
        sum[q] += z[q];
}

void zero_offset_add(struct zero_offset *c, size_t position, size_t speaker,
                     const float complex *traces, const bool *masked)
{
    size_t nx = lines(c)[0], ny = lines(c)[1];
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
    size_t nx = lines(c)[0], ny = lines(c)[1];
    memset(c->traces, 0, c->plan.n_inputs * nx * c->n_in * c->floats * sizeof *c->traces);
    memset(c->fold, 0, nx * ny * sizeof *c->fold);
}

/* -- stack ------------------------------------------------------------------------------
 */

/* A part of a line of midpoints in x, side by side. */
static void lay_side_by_side(const struct zero_offset *c, size_t input, size_t group,
                             float *restrict out)
{
    size_t nx = lines(c)[0], ny = lines(c)[1], n_floats = c->n_in * c->floats;
    size_t n = c->packed ? POINT : VECTOR_LANES, first = group * n;
    size_t end = nx < first + n ? nx : first + n;
    for (size_t start = 0; start < n_floats; start += TILE) {
        size_t floats = n_floats - start < TILE ? n_floats - start : TILE;
        for (size_t x = first; x < end; x++) {
            uint32_t fold = c->fold[x * ny + c->plan.line[input]];
            float weight = fold ? 1.0f / (float)fold : 0.0f;
            const float *from = c->traces + (input * nx + x) * n_floats + start;
            float *to = out + start / c->floats * POINT + x - first;
            if (c->power)
                for (size_t q = 0; q < floats; q++)
                    to[q * POINT] = weight * from[q];
            else
                for (size_t q = 0; q < floats; q++)
                    to[q / 2 * POINT + q % 2 * VECTOR_LANES] = weight * from[q];
        }
    }
}

/* Whole transforms, of signals without a half that is known to be zero. */
VECTOR_CLONES
static void transform_forward(const struct lane_fft *f, float *x)
{
    const float *w = f->twiddles;
    for (size_t block = f->n; block > f->leaf; block /= 4) {
        for (size_t at = 0; at < f->n; at += block)
            lane_fft_split(x + at * POINT, block / 4, w);
        w += 6 * (block / 4);
    }
    for (size_t at = 0; f->leaf > 1 && at < f->n; at += f->leaf)
        lane_fft_leaf(x + at * POINT, f->leaf, -1.0f);
}

VECTOR_CLONES
static void transform_backward(const struct lane_fft *f, float *x)
{
    const float *w = f->twiddles + 2 * (f->n - f->leaf);
    for (size_t at = 0; f->leaf > 1 && at < f->n; at += f->leaf)
        lane_fft_leaf(x + at * POINT, f->leaf, 1.0f);
    for (size_t block = 4 * f->leaf; block <= f->n; block *= 4) {
        w -= 6 * (block / 4);
        for (size_t at = 0; at < f->n; at += block)
            lane_fft_join(x + at * POINT, block / 4, w, 0);
    }
}

static void transform_input(void *ctx, size_t item, size_t thread)
{
    struct zero_offset *c = ctx;
    struct scratch *s = &c->scratch[thread];
    size_t input = item / c->groups, group = item % c->groups;
    float *rows = c->spectra + item * c->pitch;
    lay_side_by_side(c, input, group, s->samples);
    stretch_in(c->stretch, c->plan.offset[input], s->samples, rows);
    transform_forward(c->fft, rows);
}

/* Dip moveout along x: rows and lanes change places around it. */
static void stack_along_x(const struct zero_offset *c, size_t bin, struct scratch *s)
{
    size_t nx = lines(c)[0], ny = lines(c)[1], row = c->groups * POINT;
    size_t turned = c->turned_groups * POINT;
    for (size_t q = 0; q < c->plan.n_x_parts * nx; q++) {
        const float *from = s->plane + q / nx * ny * row + place(q % nx, false);
        for (size_t y = 0; y < ny; y++) {
            float *to = s->turned + q * turned + place(y, false);
            to[0] = from[y * row];
            to[VECTOR_LANES] = from[y * row + VECTOR_LANES];
        }
    }
    for (size_t g = 0; g < c->turned_groups; g++)
        dmo_stack(c->along_x, bin, s->turned + g * POINT, turned, s->imaged + g * POINT,
                  turned);
    for (size_t q = 0; q < nx * ny; q++) {
        size_t x = q / ny, y = q % ny;
        const float *from = s->imaged + x * turned + place(y, false);
        float *to = c->stacked + (y * c->groups + x / VECTOR_LANES) * c->pitch +
                    bin * POINT + x % VECTOR_LANES;
        to[0] = from[0];
        to[VECTOR_LANES] = from[VECTOR_LANES];
    }
}

static void stack_bin(const struct zero_offset *c, size_t bin, struct scratch *s)
{
    size_t ny = lines(c)[1], first = 0;
    for (size_t part = 0; part < c->plan.n_x_parts; part++) {
        for (size_t g = 0; g < c->groups; g++) {
            const float *in = c->spectra + (first * c->groups + g) * c->pitch +
                              bin * POINT;
            float *direct = c->stacked + g * c->pitch + bin * POINT;
            float *plane = s->plane + (part * ny * c->groups + g) * POINT;
            dmo_stack(c->along_y[part], bin, in, c->groups * c->pitch,
                      c->along_x ? plane : direct,
                      c->groups * (c->along_x ? POINT : c->pitch));
        }
        first = c->plan.part_end[part];
    }
    if (c->along_x)
        stack_along_x(c, bin, s);
}

static void stack_bins(void *ctx, size_t item, size_t thread)
{
    struct zero_offset *c = ctx;
    for (size_t bin = item * BINS; bin < c->n_rows && bin < (item + 1) * BINS; bin++)
        stack_bin(c, bin, &c->scratch[thread]);
}

static void finish_group(void *ctx, size_t item, size_t thread)
{
    struct zero_offset *c = ctx;
    struct scratch *s = &c->scratch[thread];
    size_t nx = lines(c)[0], y = item / c->groups;
    size_t n = c->packed ? POINT : VECTOR_LANES, first = item % c->groups * n;
    float scale = 1.0f / (float)c->n_rows;
    float *rows = c->stacked + item * c->pitch;
    transform_backward(c->fft, rows);
    stretch_out(c->stretch, rows, s->samples);
    for (size_t x = first; x < nx && x < first + n; x++) {
        float *to = c->out + (y * nx + x) * c->n_out * c->floats;
        const float *from = s->samples + x - first;
        for (size_t q = 0; q < c->n_out; q++, from += POINT, to += c->floats) {
            to[0] = scale * from[0];
            if (!c->power)
                to[1] = scale * from[VECTOR_LANES];
        }
    }
}

void zero_offset_stack(struct zero_offset *c, float *out)
{
    c->out = out;
    pool_run(c->pool, c->plan.n_inputs * c->groups, transform_input, c);
    pool_run(c->pool, (c->n_rows + BINS - 1) / BINS, stack_bins, c);
    pool_run(c->pool, lines(c)[1] * c->groups, finish_group, c);
}
