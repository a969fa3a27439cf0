/* SPDX-License-Identifier: MIT */
#include "recon/coherent/fk.h"

#include <math.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/coherent/fk_plan.h"
#include "recon/coherent/phasor.h"

#define LANES 8
typedef float lanes __attribute__((vector_size(4 * LANES), aligned(4), may_alias));

/* -- one trace's spectrum, its time origin in the middle of the trace -------------------
 */

struct migration { /* what the workers share */
    struct fk *fk;
    const float complex *gather;
    const float *weight;
    float *intensity;
};

/* Into the blocks of spectrum [block][iy][ix][FK_BLOCK]. */
static void store_spectrum(const struct fk *m, const fftwf_complex *transform, size_t ix,
                           size_t iy)
{
    long n = (long)m->nt_fft;
    for (size_t q = 0; q < m->n_f; q++) {
        long from = ((m->first_bin + (long)q) % n + n) % n;
        float c = m->centring[2 * q], s = m->centring[2 * q + 1];
        size_t block = q / FK_X_BLOCK * m->y.lines + iy;
        float *out = m->spectrum + (block * m->x.lines + ix) * FK_BLOCK +
                     q % FK_X_BLOCK * 2;
        out[0] = transform[from][0] * c - transform[from][1] * s;
        out[1] = transform[from][0] * s + transform[from][1] * c;
    }
}

static void transform_line(void *ctx, size_t ix, size_t thread)
{
    struct migration *g = ctx;
    struct fk *m = g->fk;
    fftwf_complex *buffer = m->scratch[thread].trace;
    for (size_t iy = 0; iy < m->y.lines; iy++) {
        if (ix < m->x_range[iy][0] || ix >= m->x_range[iy][1])
            continue;
        size_t cell = ix * m->y.lines + iy;
        const float *trace = (const float *)(g->gather + cell * m->trace.n_samples);
        memset(buffer, 0, m->nt_fft * sizeof *buffer);
        for (size_t n = 0; n < m->trace.n_samples; n++) {
            buffer[n][0] = g->weight[cell] * trace[2 * n];
            buffer[n][1] = g->weight[cell] * trace[2 * n + 1];
        }
        fftwf_execute_dft(m->time_plan, buffer, m->scratch[thread].trace_spectrum);
        store_spectrum(m, m->scratch[thread].trace_spectrum, ix, iy);
    }
}

/* -- sums over lines --------------------------------------------------------------------
 */

/* From the sums with cosine and sine, the waves exp(-i k b) and exp(+i k b), interleaved:
 * re im of one, re im of the other, for each value in turn. */
VECTOR_INLINE void split(const lanes *cosine, const lanes *sine, lanes *out)
{
    lanes c = *cosine, d = *sine;
    lanes turned = __builtin_shufflevector(d, d, 1, 0, 3, 2, 5, 4, 7, 6) *
                   (lanes){1, -1, 1, -1, 1, -1, 1, -1};
    lanes plus = c + turned, minus = c - turned;
    out[0] = __builtin_shufflevector(plus, minus, 0, 1, 8, 9, 2, 3, 10, 11);
    out[1] = __builtin_shufflevector(plus, minus, 4, 5, 12, 13, 6, 7, 14, 15);
}

/* The waves of one block, lines [n_lines][FK_BLOCK], at +-k: out[2 FK_BLOCK].  All sums
 * stay in registers. */
VECTOR_INLINE void sum_block(const float *block, size_t n_lines, const float *cosine,
                             const float *sine, lanes *out)
{
    lanes c0 = {0}, c1 = {0}, c2 = {0}, c3 = {0}, s0 = {0}, s1 = {0}, s2 = {0}, s3 = {0};
    for (size_t b = 0; b < n_lines; b++) {
        const lanes *x = (const lanes *)(block + b * FK_BLOCK);
        c0 += cosine[b] * x[0];
        c1 += cosine[b] * x[1];
        c2 += cosine[b] * x[2];
        c3 += cosine[b] * x[3];
        s0 += sine[b] * x[0];
        s1 += sine[b] * x[1];
        s2 += sine[b] * x[2];
        s3 += sine[b] * x[3];
    }
    split(&c0, &s0, out);
    split(&c1, &s1, out + 2);
    split(&c2, &s2, out + 4);
    split(&c3, &s3, out + 6);
}

/* rows [n_kx][n_f / 8][y lines][FK_BLOCK]: the sums over x for +kx and -kx, frequency by
 * frequency, of several kx while a block is in the cache. */
VECTOR_CLONES
static void sum_over_x(const struct fk *m, const struct fk_wave *waves, size_t n_kx,
                       struct fk_scratch *s)
{
    size_t n_blocks = m->n_f / FK_X_BLOCK, one = m->y.lines * FK_BLOCK;
    for (size_t k = 0; k < n_blocks; k++) {
        for (size_t iy = 0; iy < m->y.lines; iy++) {
            size_t first = m->x_range[iy][0], n = m->x_range[iy][1] - first;
            const float *block = m->spectrum +
                                 ((k * m->y.lines + iy) * m->x.lines + first) * FK_BLOCK;
            for (size_t w = 0; w < n_kx; w++) {
                lanes sums[2 * FK_BLOCK / LANES];
                size_t at = waves[w].kx * m->x.lines + first;
                if (k < waves[w].first_bin / FK_X_BLOCK)
                    continue;
                sum_block(block, n, m->x.cosine + at, m->x.sine + at, sums);
                float *row = s->rows + 2 * (w * n_blocks + k) * one + iy * FK_BLOCK;
                memcpy(row, sums, FK_BLOCK * sizeof *row);
                memcpy(row + one, sums + FK_BLOCK / LANES, FK_BLOCK * sizeof *row);
            }
        }
    }
}

/* quads [FK_GROUP][n_f][8]: the plane waves (+kx +ky) (+kx -ky) (-kx +ky) (-kx -ky) of
 * n_ky wavenumbers from ky on. */
VECTOR_CLONES
static void sum_over_y(const struct fk *m, const float *rows, size_t ky, size_t n_ky,
                       size_t q_low, struct fk_scratch *s)
{
    for (size_t k = q_low / FK_Y_BLOCK; k < m->n_f / FK_Y_BLOCK; k++)
        for (size_t g = 0; g < n_ky; g++)
            sum_block(rows + k * m->y.lines * FK_BLOCK, m->y.lines,
                      m->y.cosine + (ky + g) * m->y.lines,
                      m->y.sine + (ky + g) * m->y.lines,
                      (lanes *)(s->quads + (g * m->n_f + k * FK_Y_BLOCK) * 8));
}

/* -- Stolt's map ------------------------------------------------------------------------
 */

struct column {    /* where the four plane waves of a quad go: rows of the two planes */
    float *row[4]; /* NULL: a wave that another of the four already is */
};

static double lowest_frequency(const struct fk *m, double k_lateral)
{
    return m->c * k_lateral / (4.0 * M_PI * m->sine_max);
}

/* First spectrum bin that a lateral wavenumber needs. */
static size_t lowest_bin(const struct fk *m, double k_lateral)
{
    double at = (lowest_frequency(m, k_lateral) - m->f0_hz) / m->df_hz - FK_TAPS;
    return at > 0.0 ? (size_t)fmin(at, (double)(m->n_f - 1)) : 0;
}

/* Depth wavenumber, as an index from kz_first, of a frequency; 0 where it is evanescent.
 */
static double depth_index(const struct fk *m, double f_hz, double k_lateral2)
{
    double k = 4.0 * M_PI * f_hz / m->c;
    double kz = sqrt(fmax(k * k - k_lateral2, 0.0));
    return fmax(kz / m->dkz - (double)m->kz_first, 0.0);
}

/* For depth wavenumbers low..high-1: the spectrum bin before, the weights between bins,
 * and the phase that puts the grid's first plane at 0, with the gain. */
VECTOR_CLONES
static void plan_map(const struct fk *m, double k_lateral2, size_t low, size_t high,
                     struct fk_scratch *s)
{
    double f_scale = m->c / (4.0 * M_PI), depth_turns = m->depth_m / (2.0 * M_PI);
    double per_hz = 1.0 / m->df_hz, highest = (double)(m->n_f - FK_TAPS / 2 - 1);
    for (size_t z = low; z < high; z++) {
        double kz = (double)(m->kz_first + (long)z) * m->dkz;
        double f = f_scale * sqrt(k_lateral2 + kz * kz);
        double at = (f - m->f0_hz) * per_hz;
        at = at < FK_TAPS / 2 - 1 ? FK_TAPS / 2 - 1 : at;
        at = at > highest ? highest : at;
        int below = (int)at;
        s->bin[z] = below - (FK_TAPS / 2 - 1);
        /* Downwards: to read all frequencies half a step too low turns each echo by what
         * is the same over the whole image but for 3 mrad from one end of the trace to
         * the other, and of the image the magnitude is left. */
        s->fraction[z] = (int)((at - below) * FK_FRACTIONS);
        double turns = kz * depth_turns - f * m->centre_s;
        float gain = m->gain[z], re, im;
        phasor((float)(turns - rint(turns)), &re, &im);
        s->phase_re[z] = gain * re;
        s->phase_im[z] = gain * im;
    }
}

static inline void add_wave(float *row, size_t z, float re, float im)
{
    row[2 * z] += re;
    row[2 * z + 1] += im;
}

/* Adds the map of quads onto depth wavenumbers.  Quads hold four plane waves side by
 * side, as re, im pairs: LANES floats. */
VECTOR_CLONES
static void map_quad(const struct fk *m, const float *quads, size_t low, size_t high,
                     const struct fk_scratch *s, const struct column *to)
{
    for (size_t z = low; z < high; z++) {
        const float *w = m->weights + (size_t)s->fraction[z] * FK_TAPS;
        const lanes *x = (const lanes *)(quads + 8 * (size_t)s->bin[z]);
        lanes sum = w[0] * x[0];
        for (int q = 1; q < FK_TAPS; q++)
            sum += w[q] * x[q];
        float c = s->phase_re[z], d = s->phase_im[z];
        lanes turned = __builtin_shufflevector(sum, sum, 1, 0, 3, 2, 5, 4, 7, 6);
        lanes y = sum * c + turned * (lanes){-d, d, -d, d, -d, d, -d, d};
        add_wave(to->row[0], z, y[0], y[1]);
        if (to->row[1])
            add_wave(to->row[1], z, y[2], y[3]);
        if (to->row[2])
            add_wave(to->row[2], z, y[4], y[5]);
        if (to->row[3])
            add_wave(to->row[3], z, y[6], y[7]);
    }
}

/* One quad: which depth wavenumbers its frequencies reach, and their map. */
static void migrate_quad(const struct fk *m, double k_lateral2, const float *quads,
                         struct fk_scratch *s, const struct column *to)
{
    double f_low = fmax(lowest_frequency(m, sqrt(k_lateral2)),
                        m->f0_hz + (FK_TAPS / 2 - 1) * m->df_hz);
    double f_high = m->f0_hz + (double)(m->n_f - FK_TAPS / 2 - 1) * m->df_hz;
    size_t low = (size_t)ceil(depth_index(m, f_low, k_lateral2));
    size_t high = (size_t)floor(depth_index(m, f_high, k_lateral2)) + 1;
    if (high > m->n_kz)
        high = m->n_kz;
    if (low >= high)
        return;
    plan_map(m, k_lateral2, low, high, s);
    map_quad(m, quads, low, high, s, to);
}

/* The rows of the two planes that hold folded wavenumbers +-(kx, ky). */
static struct column find_rows(const struct fk *m, size_t kx, size_t ky, size_t fold,
                               const struct fk_scratch *s)
{
    size_t plus = kx % m->x.n == fold ? 0 : 1;
    size_t minus = fold == (m->x.n - fold) % m->x.n ? plus : 1 - plus;
    size_t up = ky % m->y.n, down = (m->y.n - up) % m->y.n;
    fftwf_complex *p = s->plane + plus * m->y.n * m->n_kz;
    fftwf_complex *q = s->plane + minus * m->y.n * m->n_kz;
    struct column to = {{(float *)(p + up * m->n_kz), (float *)(p + down * m->n_kz),
                         (float *)(q + up * m->n_kz), (float *)(q + down * m->n_kz)}};
    if (ky == 0)
        to.row[1] = to.row[3] = NULL;
    if (kx == 0)
        to.row[2] = to.row[3] = NULL;
    return to;
}

/* All plane waves of +-kx into the planes, from rows [n_f / 8][y lines][FK_BLOCK]. */
static void map_row(struct fk *m, struct fk_wave wave, const float *rows,
                    struct fk_scratch *s)
{
    double limit = 4.0 * M_PI * (m->f0_hz + (double)m->n_f * m->df_hz) / m->c *
                   m->sine_max;
    double x2 = (double)wave.kx * m->x.dk * (double)wave.kx * m->x.dk;
    double y_limit = sqrt(fmax(limit * limit - x2, 0.0)) / m->y.dk;
    size_t n_ky = (size_t)fmin(floor(y_limit), (double)m->y.k_max) + 1;
    for (size_t ky = 0; ky < n_ky; ky += FK_GROUP) {
        size_t n = n_ky - ky < FK_GROUP ? n_ky - ky : FK_GROUP;
        double y = (double)ky * m->y.dk;
        sum_over_y(m, rows, ky, n, lowest_bin(m, sqrt(x2 + y * y)), s);
        for (size_t g = 0; g < n; g++) {
            struct column to = find_rows(m, wave.kx, ky + g, wave.fold, s);
            y = (double)(ky + g) * m->y.dk;
            migrate_quad(m, x2 + y * y, s->quads + g * m->n_f * 8, s, &to);
        }
    }
}

/* -- back to space ----------------------------------------------------------------------
 */

/* The wavenumbers of half: those from 0 up, then those from below 0. */
static size_t upward(const struct fk *m)
{
    return m->x.kept < m->x.n ? m->x.k_max + 1 : m->x.n;
}

/* One plane of folded kx: over ky, then over kz, into half. */
static void plane_to_space(struct fk *m, fftwf_complex *plane, size_t kx,
                           struct fk_scratch *s)
{
    const size_t *n = m->grid.n;
    size_t row = kx < upward(m) ? kx : kx + m->x.kept - m->x.n;
    fftwf_execute_dft(m->y_plan, plane, s->plane_image);
    for (size_t y = 0; y < n[1]; y++) {
        memset(s->column, 0, m->nz_fft * sizeof *s->column);
        size_t at = (size_t)m->kz_first % m->nz_fft;
        for (size_t z = 0; z < m->n_kz; z++) {
            s->column[at][0] += s->plane_image[y * m->n_kz + z][0];
            s->column[at][1] += s->plane_image[y * m->n_kz + z][1];
            at = at + 1 == m->nz_fft ? 0 : at + 1;
        }
        fftwf_execute_dft(m->z_plan, s->column, s->column_image);
        memcpy(m->half + (row * n[1] + y) * n[2], s->column_image,
               n[2] * sizeof *s->column_image);
    }
}

/* The wavenumbers that fold onto +-first, then those of the next fold; returns how many.
 */
static size_t list_waves(const struct fk *m, size_t first, size_t end,
                         struct fk_wave *out)
{
    size_t n = 0;
    for (size_t fold = first; fold < end; fold++)
        for (size_t kx = 0; kx <= m->x.k_max; kx++)
            if (kx % m->x.n == fold || kx % m->x.n == (m->x.n - fold) % m->x.n)
                out[n++] =
                    (struct fk_wave){kx, fold, lowest_bin(m, (double)kx * m->x.dk)};
    return n;
}

/* The planes of +-fold over y and z. */
static void fold_to_space(struct fk *m, size_t fold, struct fk_scratch *s)
{
    size_t mirrored = (m->x.n - fold) % m->x.n;
    plane_to_space(m, s->plane, fold, s);
    if (mirrored != fold)
        plane_to_space(m, s->plane + m->y.n * m->n_kz, mirrored, s);
}

/* All wavenumbers of a group of folds, and their transform over y and z. */
static void image_folds(void *ctx, size_t group, size_t thread)
{
    struct migration *g = ctx;
    struct fk *m = g->fk;
    struct fk_scratch *s = &m->scratch[thread];
    size_t first = group * m->folds, last = m->x.kept / 2 + 1;
    const struct fk_wave *w = s->waves;
    size_t n =
        list_waves(m, first, last - first < m->folds ? last : first + m->folds, s->waves);
    for (size_t i = 0; i < n; i++) {
        if (i % FK_GROUP == 0)
            sum_over_x(m, w + i, n - i < FK_GROUP ? n - i : FK_GROUP, s);
        if (i == 0 || w[i].fold != w[i - 1].fold)
            memset(s->plane, 0, 2 * m->y.n * m->n_kz * sizeof *s->plane);
        map_row(m, w[i], s->rows + i % FK_GROUP * m->n_f * m->y.lines * 4, s);
        if (i + 1 == n || w[i].fold != w[i + 1].fold)
            fold_to_space(m, w[i].fold, s);
    }
}

/* line [grid nz][x.n] from rows first..end-1 of half: whole cache lines are written, and
 * rows are read along. */
static void gather_row(const struct fk *m, size_t y, size_t first, size_t end,
                       fftwf_complex *line)
{
    const size_t *n = m->grid.n;
    for (size_t kx = first; kx < end; kx += LANES) {
        size_t width = end - kx < LANES ? end - kx : LANES;
        const fftwf_complex *from = m->half + (kx * n[1] + y) * n[2];
        for (size_t z = 0; z < n[2]; z++)
            for (size_t l = 0; l < width; l++)
                memcpy(line[z * m->x.n + kx + l], from[l * n[1] * n[2] + z],
                       sizeof *line);
    }
}

static void image_row(void *ctx, size_t y, size_t thread)
{
    struct migration *g = ctx;
    struct fk *m = g->fk;
    const size_t *n = m->grid.n;
    struct fk_scratch *s = &m->scratch[thread];
    gather_row(m, y, 0, upward(m), s->line);
    gather_row(m, y, upward(m), m->x.kept, s->line + (m->x.n - m->x.kept));
    for (size_t z = 0; z < n[2]; z++) {
        fftwf_execute_dft(m->x_plan, s->line + z * m->x.n, s->line_image);
        float *to = g->intensity + (z * n[1] + y) * n[0];
        for (size_t x = 0; x < n[0]; x++) {
            float re = m->scale * s->line_image[x][0],
                  im = m->scale * s->line_image[x][1];
            to[x] = re * re + im * im;
        }
    }
}

void fk_migrate(struct fk *m, const float complex *gather, const float *weight,
                float *intensity)
{
    struct migration g = {m, gather, weight, intensity};
    pool_run(m->pool, m->x.lines, transform_line, &g);
    pool_run(m->pool, (m->x.kept / 2 + m->folds) / m->folds, image_folds, &g);
    pool_run(m->pool, m->grid.n[1], image_row, &g);
}
