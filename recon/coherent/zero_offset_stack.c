/* recon/coherent/zero_offset_stack.c -- from powers or traces, sorted, to their stack:
 * normal moveout and log-stretch, transform over log time, dip moveout along y and, where
 * it matters, x, and back. */
#include "dsp/vector.h"
#include "recon/coherent/zero_offset_plan.h"

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
