/* SPDX-License-Identifier: MIT */
#include "recon/coherent/zero_offset.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/lane_fft.h"
#include "dsp/vector.h"
#include "recon/coherent/dmo.h"
#include "recon/coherent/midpoint.h"
#include "recon/coherent/stretch.h"
#include "recon/imaging/fold.h"
#include "recon/imaging/method.h"

#define MIN_SAMPLES 16 /* of an image, at least */

/* An input is what one offset contributes to one line of midpoints in y; it has a trace
 * for each line in x.  Inputs are sorted by the x part of their offset. */
struct zero_offset_plan {
    struct zero_offset_lattice lattice;
    size_t n_offsets;  /* different (hx, hy) */
    double *half_m[3]; /* [n_offsets]: x, y, their length */
    size_t n_x_parts;  /* different hx; 1 when dip in x is left out */
    double *x_part_m;  /* [n_x_parts] */
    bool dip_in_x;     /* hx matters */
    size_t n_inputs;
    uint32_t *offset, *line; /* [n_inputs] */
    size_t *part_end;        /* [n_x_parts]: inputs before this */
    uint32_t *input, *x;     /* [position][pair] */
};

#define POINT LANE_FFT_POINT /* floats of 16 complex numbers: re, then im */

struct zero_offset_scratch { /* one a thread */
    float *samples;          /* [n_in][POINT]: 0 where no midpoint stands */
    float *finished;         /* [n_out][POINT] */
    float *plane;            /* [n_x_parts * ny][groups][POINT] */
    float *turned;           /* [n_x_parts * nx][turned_groups][POINT] */
    float *imaged;           /* [nx][turned_groups][POINT] */
};

struct zero_offset {
    struct zero_offset_plan plan;
    struct pool *pool;
    bool power;
    bool packed;    /* every float is a power, also those where im stands */
    size_t n_pairs; /* of a position */
    size_t n_microphones, n_in, n_out, n_rows;
    size_t floats;        /* of a stored sample: 1 or 2 */
    size_t groups;        /* points of a line of midpoints in x */
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
    struct zero_offset_scratch *scratch;
    float *out; /* of zero_offset_stack */
};

/* Of midpoints, x and y. */
static inline const size_t *zero_offset_lines(const struct zero_offset *c)
{
    return c->plan.lattice.n;
}

#define SAME_M       1e-3 /* half-offsets closer than this are one */
#define UNEVEN       0.05 /* of a pitch, that a line may be off the lattice */
#define MAX_LINES    4096
#define MAX_INPUTS   65536
#define SINE_MAX     0.5 /* of the dips that must be right: 30 degrees */
#define X_NEGLIGIBLE 0.1 /* of a sample: what dip in x may be off by when left out */
#define CROSS_MAX    1.0 /* of a sample: see recon/coherent/dmo.h */

/* -- which trace goes where: the lattice ------------------------------------------------
 */

/* The evenly spaced lines, gaps filled, on which all given ones stand; also the number of
 * each. */
static int fit_axis(struct zero_offset_lattice *l, int axis, const double *lines,
                    size_t n, uint32_t *number)
{
    double gap = INFINITY;
    for (size_t i = 1; i < n; i++)
        gap = fmin(gap, lines[i] - lines[i - 1]);
    double across = lines[n - 1] - lines[0];
    double steps = n > 1 ? rint(across / gap) : 0.0;
    if (!(steps < MAX_LINES))
        return -ENOTSUP;
    l->first_m[axis] = lines[0];
    l->n[axis] = (size_t)steps + 1;
    l->pitch_m[axis] = n > 1 ? across / steps : 0.0;
    for (size_t i = 0; i < n; i++) {
        double at = n > 1 ? (lines[i] - lines[0]) / l->pitch_m[axis] : 0.0;
        number[i] = (uint32_t)lrint(at);
        if (fabs(at - rint(at)) > UNEVEN)
            return -ENOTSUP;
    }
    return 0;
}

/* -- offsets ----------------------------------------------------------------------------
 */

static double half_offset(const struct geometry *g, size_t pair, int axis)
{
    return 0.5 * fabs(g->speakers_m[pair / g->n_microphones][axis] -
                      g->microphones_m[pair % g->n_microphones][axis]);
}

/* Lines of half-offsets along an axis and each pair's place on them. */
static size_t sort_axis(const struct geometry *g, int axis, double *values,
                        uint32_t *place)
{
    size_t n_pairs = g->n_speakers * g->n_microphones;
    for (size_t q = 0; q < n_pairs; q++)
        values[q] = half_offset(g, q, axis);
    size_t n = lines_merge(values, n_pairs, SAME_M);
    for (size_t q = 0; q < n_pairs; q++)
        place[q] = lines_nearest(values, n, half_offset(g, q, axis));
    return n;
}

/* What follows from a half-offset h and slopes up to SINE_MAX at the earliest time; what
 * is nearer than the pair is long needs other methods anyway. */
static double dip_shift_s(double hx, double hy, double c, double first_s)
{
    double t = fmax(first_s, 4.0 * hypot(hx, hy) / c);
    return 2.0 * hx * hy * SINE_MAX * SINE_MAX / (c * c * t);
}

struct keys { /* while inputs are numbered */
    size_t n_pairs, n_hx, n_hy;
    double *hx, *hy;
    uint32_t *pair_hx, *pair_hy; /* [pair] */
    uint32_t *number;            /* [n_hx][n_hy][ny]: 1 + input; 0: none */
    uint32_t *offset;            /* [n_hx][n_hy]: 1 + offset; 0: none */
};

static void keys_clear(struct keys *k)
{
    free(k->hx);
    free(k->hy);
    free(k->pair_hx);
    free(k->pair_hy);
    free(k->number);
    free(k->offset);
}

static int keys_create(struct keys *k, const struct geometry *g, size_t ny)
{
    k->n_pairs = g->n_speakers * g->n_microphones;
    k->hx = malloc(k->n_pairs * sizeof *k->hx);
    k->hy = malloc(k->n_pairs * sizeof *k->hy);
    k->pair_hx = malloc(k->n_pairs * sizeof *k->pair_hx);
    k->pair_hy = malloc(k->n_pairs * sizeof *k->pair_hy);
    if (!k->hx || !k->hy || !k->pair_hx || !k->pair_hy)
        return -ENOMEM;
    k->n_hx = sort_axis(g, 0, k->hx, k->pair_hx);
    k->n_hy = sort_axis(g, 1, k->hy, k->pair_hy);
    k->number = calloc(k->n_hx * k->n_hy * ny, sizeof *k->number);
    k->offset = calloc(k->n_hx * k->n_hy, sizeof *k->offset);
    return k->number && k->offset ? 0 : -ENOMEM;
}

static size_t key_of(const struct keys *k, size_t pair)
{
    return k->pair_hx[pair] * k->n_hy + k->pair_hy[pair];
}

/* Numbers what occurs, in the order of the keys: hx first. */
static void number_keys(struct zero_offset_plan *p, const struct keys *k,
                        const uint32_t *y, size_t n)
{
    size_t ny = p->lattice.n[1], n_keys = k->n_hx * k->n_hy;
    for (size_t q = 0; q < n; q++) {
        k->number[key_of(k, q % k->n_pairs) * ny + y[q]] = 1;
        k->offset[key_of(k, q % k->n_pairs)] = 1;
    }
    for (size_t i = 0; i < n_keys; i++)
        if (k->offset[i])
            k->offset[i] = (uint32_t)++p->n_offsets;
    for (size_t i = 0; i < n_keys * ny; i++)
        if (k->number[i])
            k->number[i] = (uint32_t)++p->n_inputs;
}

static int list_offsets(struct zero_offset_plan *p, const struct keys *k)
{
    for (int a = 0; a < 3; a++)
        if (!(p->half_m[a] = malloc(p->n_offsets * sizeof(double))))
            return -ENOMEM;
    for (size_t i = 0; i < k->n_hx * k->n_hy; i++) {
        if (!k->offset[i])
            continue;
        size_t o = k->offset[i] - 1;
        p->half_m[0][o] = k->hx[i / k->n_hy];
        p->half_m[1][o] = k->hy[i % k->n_hy];
        p->half_m[2][o] = hypot(p->half_m[0][o], p->half_m[1][o]);
    }
    return 0;
}

static int list_inputs(struct zero_offset_plan *p, const struct keys *k,
                       const uint32_t *y, size_t n)
{
    size_t ny = p->lattice.n[1];
    p->offset = malloc(p->n_inputs * sizeof *p->offset);
    p->line = malloc(p->n_inputs * sizeof *p->line);
    p->input = malloc(n * sizeof *p->input);
    if (!p->offset || !p->line || !p->input)
        return -ENOMEM;
    for (size_t i = 0; i < k->n_hx * k->n_hy * ny; i++) {
        if (!k->number[i])
            continue;
        p->offset[k->number[i] - 1] = k->offset[i / ny] - 1;
        p->line[k->number[i] - 1] = (uint32_t)(i % ny);
    }
    for (size_t q = 0; q < n; q++)
        p->input[q] = k->number[key_of(k, q % k->n_pairs) * ny + y[q]] - 1;
    return 0;
}

/* -- parts of the offsets along x -------------------------------------------------------
 */

static int sort_parts(struct zero_offset_plan *p)
{
    p->x_part_m = malloc(p->n_offsets * sizeof *p->x_part_m);
    p->part_end = malloc(p->n_offsets * sizeof *p->part_end);
    if (!p->x_part_m || !p->part_end)
        return -ENOMEM;
    p->n_x_parts = 0;
    for (size_t q = 0; q < p->n_inputs; q++) {
        double hx = p->dip_in_x ? p->half_m[0][p->offset[q]] : 0.0;
        if (!p->n_x_parts || p->x_part_m[p->n_x_parts - 1] != hx)
            p->x_part_m[p->n_x_parts++] = hx;
        p->part_end[p->n_x_parts - 1] = q + 1;
    }
    return 0;
}

static int check_offsets(struct zero_offset_plan *p, const struct geometry *g,
                         double first_s, double sample_s, const char **why)
{
    for (size_t o = 0; o < p->n_offsets; o++) {
        double hx = p->half_m[0][o], hy = p->half_m[1][o], c = g->sound_speed_m_s;
        if (dip_shift_s(hx, hx, c, first_s) > X_NEGLIGIBLE * sample_s)
            p->dip_in_x = true;
        if (dip_shift_s(hx, hy, c, first_s) > CROSS_MAX * sample_s) {
            *why = "pairs that lie far apart along x or along y, not both";
            return -ENOTSUP;
        }
    }
    return 0;
}

static int plan_lattice(struct zero_offset_plan *p, const struct midpoints *m, size_t n,
                        uint32_t *y, const char **why)
{
    uint32_t *number = malloc((m->nx > m->ny ? m->nx : m->ny) * sizeof *number);
    p->x = malloc(n * sizeof *p->x);
    int err = number && p->x ? 0 : -ENOMEM;
    if (!err)
        err = fit_axis(&p->lattice, 0, m->x_m, m->nx, number);
    for (size_t q = 0; !err && q < n; q++)
        p->x[q] = number[m->ix[q]];
    if (!err)
        err = fit_axis(&p->lattice, 1, m->y_m, m->ny, number);
    for (size_t q = 0; !err && q < n; q++)
        y[q] = number[m->iy[q]];
    if (err == -ENOTSUP)
        *why = "midpoints on evenly spaced lines of x and y";
    p->lattice.plane_z_m = m->plane_z_m;
    free(number);
    return err;
}

/* sample_s: what event times may be off by a fraction of; first_s: the earliest.
 * 0, -ENOTSUP (*why), -ENOMEM; clear also after a failure. */
static int zero_offset_plan(struct zero_offset_plan *p, const struct geometry *g,
                            double first_s, double sample_s, const char **why)
{
    struct midpoints *m = NULL;
    struct keys keys = {0};
    memset(p, 0, sizeof *p);
    int err = midpoints_create(&m, g, why);
    if (err)
        return err;
    size_t n = g->n_positions * m->n_pairs;
    uint32_t *y = malloc(n * sizeof *y);
    err = y ? plan_lattice(p, m, n, y, why) : -ENOMEM;
    if (!err)
        err = keys_create(&keys, g, p->lattice.n[1]);
    if (!err) {
        number_keys(p, &keys, y, n);
        if (p->n_inputs > MAX_INPUTS) {
            *why = "fewer different offsets";
            err = -ENOTSUP;
        }
    }
    if (!err)
        err = list_offsets(p, &keys);
    if (!err)
        err = list_inputs(p, &keys, y, n);
    if (!err)
        err = check_offsets(p, g, first_s, sample_s, why);
    if (!err)
        err = sort_parts(p);
    keys_clear(&keys);
    free(y);
    midpoints_destroy(m);
    return err;
}

static void zero_offset_plan_clear(struct zero_offset_plan *p)
{
    for (int a = 0; a < 3; a++)
        free(p->half_m[a]);
    free(p->x_part_m);
    free(p->offset);
    free(p->line);
    free(p->part_end);
    free(p->input);
    free(p->x);
    memset(p, 0, sizeof *p);
}

#define BINS 8 /* of log frequency that one item of work stacks */
#define TILE 16

/* Where the power of a midpoint, or the real part of its trace, stands in its line. */
static size_t place(size_t line, bool packed)
{
    return packed ? line : line / VECTOR_LANES * POINT + line % VECTOR_LANES;
}

/* -- stack ------------------------------------------------------------------------------
 */

/* A part of a line of midpoints in x, side by side. */
static void lay_side_by_side(const struct zero_offset *c, size_t input, size_t group,
                             float *restrict out)
{
    size_t nx = zero_offset_lines(c)[0], ny = zero_offset_lines(c)[1],
           n_floats = c->n_in * c->floats;
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
    lane_fft_whole(f, x);
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
    struct zero_offset_scratch *s = &c->scratch[thread];
    size_t input = item / c->groups, group = item % c->groups;
    float *rows = c->spectra + item * c->pitch;
    lay_side_by_side(c, input, group, s->samples);
    stretch_in(c->stretch, c->plan.offset[input], s->samples, rows);
    transform_forward(c->fft, rows);
}

/* Dip moveout along x: rows and lanes change places around it. */
static void stack_along_x(const struct zero_offset *c, size_t bin,
                          struct zero_offset_scratch *s)
{
    size_t nx = zero_offset_lines(c)[0], ny = zero_offset_lines(c)[1],
           row = c->groups * POINT;
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

static void stack_bin(const struct zero_offset *c, size_t bin,
                      struct zero_offset_scratch *s)
{
    size_t ny = zero_offset_lines(c)[1], first = 0;
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
    struct zero_offset_scratch *s = &c->scratch[thread];
    size_t nx = zero_offset_lines(c)[0], y = item / c->groups;
    size_t n = c->packed ? POINT : VECTOR_LANES, first = item % c->groups * n;
    float scale = 1.0f / (float)c->n_rows;
    float *rows = c->stacked + item * c->pitch;
    transform_backward(c->fft, rows);
    stretch_out(c->stretch, rows, s->finished);
    for (size_t x = first; x < nx && x < first + n; x++) {
        float *to = c->out + (y * nx + x) * c->n_out * c->floats;
        const float *from = s->finished + x - first;
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
    pool_run(c->pool, zero_offset_lines(c)[1] * c->groups, finish_group, c);
}

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

int zero_offset_of_image(struct zero_offset **out, struct grid *volume, double *range_m,
                         const struct imager_config *cfg, const char **why)
{
    double rate_hz = 2.0 * (cfg->band_hz[1] - cfg->band_hz[0]), span_s[2];
    double half_c = 0.5 * cfg->geometry->sound_speed_m_s;
    int err = method_span(span_s, cfg, 0.0, why);
    if (err)
        return err;
    const struct zero_offset_config z = {
        .geometry = cfg->geometry,
        .in = cfg->format,
        .band_hz = {cfg->band_hz[0], cfg->band_hz[1]},
        .power = true,
        .mute_s = cfg->gate_m[0] / half_c,
        .out = {span_s[0], rate_hz, cfg->format.carrier_hz,
                method_samples(span_s, rate_hz, MIN_SAMPLES)},
        .pool = cfg->pool,
    };
    err = zero_offset_create(out, &z, why);
    if (err)
        return err;
    const struct zero_offset_lattice *l = &(*out)->plan.lattice;
    *range_m = half_c * span_s[0];
    for (int a = 0; a < 2; a++) {
        volume->origin_m[a] = l->first_m[a];
        volume->step_m[a] = l->n[a] > 1 ? l->pitch_m[a] : cfg->grid.step_m[a];
        volume->n[a] = l->n[a];
    }
    volume->origin_m[2] = l->plane_z_m + *range_m;
    volume->step_m[2] = half_c / rate_hz;
    volume->n[2] = z.out.n_samples;
    return 0;
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
