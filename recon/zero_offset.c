#include "recon/zero_offset.h"

#define FFTW_NO_Complex /* fftwf_complex is float[2], also beside <complex.h> */
#include <errno.h>
#include <fftw3.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/zero_offset_plan.h"
#include "recon/dmo.h"
#include "recon/stretch.h"

#define BINS 8 /* of log frequency that one item of work stacks */
#define TILE 16

struct scratch {          /* one a thread */
    float *samples;       /* [n_in or n_out][lanes] */
    float *rows, *others; /* [n_rows][lanes] */
    float *plane;         /* [n_x_parts][ny][lanes] */
    float *turned;        /* [n_x_parts * nx][turned_lanes] */
    float *imaged;        /* [nx][turned_lanes] */
};

struct zero_offset {
    struct zero_offset_plan plan;
    struct pool *pool;
    bool power;
    bool packed;    /* a lane is a power: two midpoints in x are one complex number */
    size_t n_pairs; /* of a position */
    size_t n_microphones, n_in, n_out, n_rows;
    size_t floats;       /* of a stored sample: 1 or 2 */
    size_t lanes;        /* of a row of midpoints in x */
    size_t turned_lanes; /* of a row of midpoints in y */
    size_t pitch;        /* of spectra */
    struct stretch *stretch;
    struct dmo **along_y; /* [n_x_parts] */
    struct dmo *along_x;  /* NULL: not needed */
    fftwf_plan forward, backward;
    pthread_mutex_t *locks; /* [nx] */
    float *traces;          /* [n_inputs][nx][n_in][floats] */
    uint32_t *fold;         /* [nx][ny] traces of a midpoint */
    float *spectra;         /* [n_inputs][pitch]: rows */
    float *stacked;         /* [n_rows][ny][lanes] */
    struct scratch *scratch;
    float *out; /* of zero_offset_stack */
};

static size_t padded(size_t floats)
{
    return (floats + VECTOR_LANES - 1) / VECTOR_LANES * VECTOR_LANES;
}

static const size_t *lines(const struct zero_offset *c)
{
    return c->plan.lattice.n;
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
        .lanes = c->lanes,
    };
    int err = stretch_create(&c->stretch, &stretch);
    if (!err)
        c->n_rows = stretch_rows(c->stretch);
    return err;
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
            .lanes = c->lanes,
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
            .lanes = c->turned_lanes,
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
        w[q] = stretch_frequency(c->stretch, q);
    int err = create_along_y(c, w);
    if (!err && c->plan.dip_in_x)
        err = create_along_x(c, w);
    free(w);
    return err;
}

static float *rows_alloc(size_t n, size_t lanes)
{
    float *rows = fftwf_malloc(n * lanes * sizeof *rows);
    if (rows)
        memset(rows, 0, n * lanes * sizeof *rows);
    return rows;
}

static int scratch_create(struct scratch *s, const struct zero_offset *c)
{
    size_t nx = lines(c)[0], ny = lines(c)[1], parts = c->plan.n_x_parts;
    s->samples = rows_alloc(c->n_in > c->n_out ? c->n_in : c->n_out, c->lanes);
    s->rows = rows_alloc(c->n_rows, c->lanes);
    s->others = rows_alloc(c->n_rows, c->lanes);
    s->plane = rows_alloc(parts * ny, c->lanes);
    s->turned = rows_alloc(parts * nx, c->turned_lanes);
    s->imaged = rows_alloc(nx, c->turned_lanes);
    return s->samples && s->rows && s->others && s->plane && s->turned && s->imaged
               ? 0
               : -ENOMEM;
}

static void scratch_clear(struct scratch *s)
{
    fftwf_free(s->samples);
    fftwf_free(s->rows);
    fftwf_free(s->others);
    fftwf_free(s->plane);
    fftwf_free(s->turned);
    fftwf_free(s->imaged);
}

static fftwf_plan plan_rows(const struct zero_offset *c, int direction)
{
    int n = (int)c->n_rows, many = (int)(c->lanes / 2);
    fftwf_complex *in = (fftwf_complex *)c->scratch[0].rows;
    fftwf_complex *out = (fftwf_complex *)c->scratch[0].others;
    return fftwf_plan_many_dft(1, &n, many, in, NULL, many, 1, out, NULL, many, 1,
                               direction, FFTW_ESTIMATE);
}

static int allocate(struct zero_offset *c)
{
    size_t nx = lines(c)[0], ny = lines(c)[1];
    c->pitch = (c->n_rows + 1) * c->lanes; /* inputs of a bin in different cache sets */
    c->traces = calloc(c->plan.n_inputs * nx * c->n_in, c->floats * sizeof *c->traces);
    c->fold = calloc(nx * ny, sizeof *c->fold);
    c->spectra = fftwf_malloc(c->plan.n_inputs * c->pitch * sizeof *c->spectra);
    c->stacked = fftwf_malloc(c->n_rows * ny * c->lanes * sizeof *c->stacked);
    c->scratch = calloc(pool_threads(c->pool), sizeof *c->scratch);
    c->locks = malloc(nx * sizeof *c->locks);
    for (size_t x = 0; c->locks && x < nx; x++)
        pthread_mutex_init(&c->locks[x], NULL);
    if (!c->traces || !c->fold || !c->spectra || !c->stacked || !c->scratch || !c->locks)
        return -ENOMEM;
    int err = 0;
    for (size_t t = 0; !err && t < pool_threads(c->pool); t++)
        err = scratch_create(&c->scratch[t], c);
    if (err)
        return err;
    c->forward = plan_rows(c, FFTW_FORWARD);
    c->backward = plan_rows(c, FFTW_BACKWARD);
    return c->forward && c->backward ? 0 : -ENOMEM;
}

int zero_offset_create(struct zero_offset **out, const struct zero_offset_config *cfg,
                       const char **why)
{
    struct zero_offset *c = calloc(1, sizeof *c);
    if (!c)
        return -ENOMEM;
    double first_s = fmax(fmax(cfg->out.t0_s, cfg->mute_s), 1.0 / cfg->in.rate_hz);
    double sample_s = cfg->power ? 0.5 / (cfg->band_hz[1] - cfg->band_hz[0])
                                 : 0.1 / cfg->band_hz[1];
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
        c->lanes = padded(lines(c)[0] * (c->packed ? 1 : 2));
        c->turned_lanes = padded(lines(c)[1] * 2);
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
    fftwf_destroy_plan(c->forward);
    fftwf_destroy_plan(c->backward);
    for (size_t t = 0; c->scratch && t < pool_threads(c->pool); t++)
        scratch_clear(&c->scratch[t]);
    free(c->scratch);
    for (size_t x = 0; c->locks && x < lines(c)[0]; x++)
        pthread_mutex_destroy(&c->locks[x]);
    free(c->locks);
    free(c->traces);
    free(c->fold);
    fftwf_free(c->spectra);
    fftwf_free(c->stacked);
    for (size_t part = 0; c->along_y && part < c->plan.n_x_parts; part++)
        dmo_destroy(c->along_y[part]);
    free(c->along_y);
    dmo_destroy(c->along_x);
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

/* One line of midpoints in x, side by side in the lanes. */
static void lay_side_by_side(const struct zero_offset *c, size_t input,
                             float *restrict out)
{
    size_t nx = lines(c)[0], ny = lines(c)[1], step = c->packed ? 1 : 2;
    for (size_t start = 0; start < c->n_in; start += TILE) {
        size_t n = c->n_in - start < TILE ? c->n_in - start : TILE;
        for (size_t x = 0; x < nx; x++) {
            uint32_t fold = c->fold[x * ny + c->plan.line[input]];
            float weight = fold ? 1.0f / (float)fold : 0.0f;
            const float *from = c->traces +
                                ((input * nx + x) * c->n_in + start) * c->floats;
            float *to = out + start * c->lanes + x * step;
            for (size_t q = 0; q < n; q++)
                for (size_t f = 0; f < c->floats; f++)
                    to[q * c->lanes + f] = weight * from[q * c->floats + f];
        }
    }
}

static void transform_input(void *ctx, size_t input, size_t thread)
{
    struct zero_offset *c = ctx;
    struct scratch *s = &c->scratch[thread];
    lay_side_by_side(c, input, s->samples);
    stretch_in(c->stretch, c->plan.offset[input], s->samples, s->rows);
    fftwf_execute_dft(c->forward, (fftwf_complex *)s->rows,
                      (fftwf_complex *)(c->spectra + input * c->pitch));
}

/* Dip moveout along x: the lanes hold x, so rows and lanes change places around it. */
static void stack_along_x(const struct zero_offset *c, size_t bin, struct scratch *s,
                          float *out)
{
    size_t nx = lines(c)[0], ny = lines(c)[1];
    for (size_t row = 0; row < c->plan.n_x_parts * nx; row++) {
        const float *from = s->plane + row / nx * ny * c->lanes + 2 * (row % nx);
        float *to = s->turned + row * c->turned_lanes;
        for (size_t y = 0; y < ny; y++) {
            to[2 * y] = from[y * c->lanes];
            to[2 * y + 1] = from[y * c->lanes + 1];
        }
    }
    dmo_stack(c->along_x, bin, s->turned, c->turned_lanes, s->imaged);
    for (size_t y = 0; y < ny; y++) {
        for (size_t x = 0; x < nx; x++) {
            const float *from = s->imaged + x * c->turned_lanes + 2 * y;
            out[y * c->lanes + 2 * x] = from[0];
            out[y * c->lanes + 2 * x + 1] = from[1];
        }
    }
}

static void stack_bin(struct zero_offset *c, size_t bin, struct scratch *s)
{
    size_t ny = lines(c)[1], first = 0;
    float *out = c->stacked + bin * ny * c->lanes;
    for (size_t part = 0; part < c->plan.n_x_parts; part++) {
        float *plane = c->along_x ? s->plane + part * ny * c->lanes : out;
        dmo_stack(c->along_y[part], bin, c->spectra + first * c->pitch + bin * c->lanes,
                  c->pitch, plane);
        first = c->plan.part_end[part];
    }
    if (c->along_x)
        stack_along_x(c, bin, s, out);
}

static void stack_bins(void *ctx, size_t item, size_t thread)
{
    struct zero_offset *c = ctx;
    for (size_t bin = item * BINS; bin < c->n_rows && bin < (item + 1) * BINS; bin++)
        stack_bin(c, bin, &c->scratch[thread]);
}

static void finish_line(void *ctx, size_t y, size_t thread)
{
    struct zero_offset *c = ctx;
    struct scratch *s = &c->scratch[thread];
    size_t nx = lines(c)[0], ny = lines(c)[1], step = c->packed ? 1 : 2;
    float scale = 1.0f / (float)c->n_rows;
    for (size_t bin = 0; bin < c->n_rows; bin++)
        memcpy(s->rows + bin * c->lanes, c->stacked + (bin * ny + y) * c->lanes,
               c->lanes * sizeof *s->rows);
    fftwf_execute_dft(c->backward, (fftwf_complex *)s->rows, (fftwf_complex *)s->others);
    stretch_out(c->stretch, s->others, s->samples);
    for (size_t x = 0; x < nx; x++) {
        float *to = c->out + (y * nx + x) * c->n_out * c->floats;
        const float *from = s->samples + x * step;
        for (size_t q = 0; q < c->n_out; q++)
            for (size_t f = 0; f < c->floats; f++)
                to[q * c->floats + f] = scale * from[q * c->lanes + f];
    }
}

void zero_offset_stack(struct zero_offset *c, float *out)
{
    c->out = out;
    pool_run(c->pool, c->plan.n_inputs, transform_input, c);
    pool_run(c->pool, (c->n_rows + BINS - 1) / BINS, stack_bins, c);
    pool_run(c->pool, lines(c)[1], finish_line, c);
}
