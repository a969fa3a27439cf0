#include "recon/fk.h"

#include <math.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/fk_plan.h"

#define CHUNK 64 /* floats that are summed over all lines before the next */

/* -- one trace's spectrum, its time origin in the middle of the trace -------------------
 */

struct migration { /* what the workers share */
    struct fk *fk;
    const float complex *gather;
    const float *weight;
    float *intensity;
};

static void store_spectrum(const struct fk *m, const fftwf_complex *transform, float *out)
{
    double offset_s = m->trace.t0_s - m->centre_s;
    for (size_t q = 0; q < m->n_f; q++) {
        long bin = m->first_bin + (long)q;
        size_t from = (size_t)((bin + (long)m->nt_fft) % (long)m->nt_fft);
        double phase = -2.0 * M_PI * (double)bin * m->df_hz * offset_s;
        float c = (float)cos(phase), s = (float)sin(phase);
        out[2 * q] = transform[from][0] * c - transform[from][1] * s;
        out[2 * q + 1] = transform[from][0] * s + transform[from][1] * c;
    }
}

static void transform_line(void *ctx, size_t ix, size_t thread)
{
    struct migration *g = ctx;
    struct fk *m = g->fk;
    fftwf_complex *buffer = m->scratch[thread].trace;
    for (size_t iy = 0; iy < m->y.lines; iy++) {
        size_t cell = ix * m->y.lines + iy;
        const float *trace = (const float *)(g->gather + cell * m->trace.n_samples);
        memset(buffer, 0, m->nt_fft * sizeof *buffer);
        for (size_t n = 0; n < m->trace.n_samples; n++) {
            buffer[n][0] = g->weight[cell] * trace[2 * n];
            buffer[n][1] = g->weight[cell] * trace[2 * n + 1];
        }
        fftwf_execute_dft(m->time_plan, buffer, buffer);
        store_spectrum(m, buffer, m->spectrum + cell * m->n_f * 2);
    }
}

/* -- sums over lines --------------------------------------------------------------------
 */

/* sums[0], sums[1] [size] = sum over b of cosine[b], sine[b] times lines[b * stride + .]
 */
VECTOR_CLONES
static void sum_lines(const float *lines, size_t stride, size_t n_lines,
                      const float *cosine, const float *sine, size_t size,
                      float *restrict sum_c, float *restrict sum_s)
{
    for (size_t at = 0; at < size; at += CHUNK) {
        float c[CHUNK] = {0}, s[CHUNK] = {0};
        size_t n = size - at < CHUNK ? size - at : CHUNK;
        if (n == CHUNK) {
            for (size_t b = 0; b < n_lines; b++) {
                const float *x = lines + b * stride + at;
                for (size_t l = 0; l < CHUNK; l++) {
                    c[l] += cosine[b] * x[l];
                    s[l] += sine[b] * x[l];
                }
            }
        } else {
            for (size_t b = 0; b < n_lines; b++) {
                const float *x = lines + b * stride + at;
                for (size_t l = 0; l < n; l++) {
                    c[l] += cosine[b] * x[l];
                    s[l] += sine[b] * x[l];
                }
            }
        }
        memcpy(sum_c + at, c, n * sizeof *c);
        memcpy(sum_s + at, s, n * sizeof *s);
    }
}

/* rows [y lines][n_f][4]: the sums over x for +kx and -kx, exp(-+i kx x). */
VECTOR_CLONES
static void sum_over_x(const struct fk *m, size_t kx, size_t q_low, struct fk_scratch *s)
{
    size_t span = (m->n_f - q_low) * 2;
    size_t stride = m->y.lines * m->n_f * 2;
    const float *cosine = m->x.cosine + kx * m->x.lines;
    const float *sine = m->x.sine + kx * m->x.lines;
    float *c = s->sums, *d = s->sums + m->n_f * 4;
    for (size_t iy = 0; iy < m->y.lines; iy++) {
        sum_lines(m->spectrum + (iy * m->n_f + q_low) * 2, stride, m->x.lines, cosine,
                  sine, span, c, d);
        float *row = s->rows + (iy * m->n_f + q_low) * 4;
        for (size_t q = 0; q < span / 2; q++) {
            row[4 * q] = c[2 * q] + d[2 * q + 1];
            row[4 * q + 1] = c[2 * q + 1] - d[2 * q];
            row[4 * q + 2] = c[2 * q] - d[2 * q + 1];
            row[4 * q + 3] = c[2 * q + 1] + d[2 * q];
        }
    }
}

/* quads [n_f][8]: the plane waves (+kx +ky) (+kx -ky) (-kx +ky) (-kx -ky). */
VECTOR_CLONES
static void sum_over_y(const struct fk *m, size_t ky, size_t q_low, struct fk_scratch *s)
{
    size_t span = (m->n_f - q_low) * 4;
    float *c = s->sums, *d = s->sums + m->n_f * 4;
    sum_lines(s->rows + q_low * 4, m->n_f * 4, m->y.lines, m->y.cosine + ky * m->y.lines,
              m->y.sine + ky * m->y.lines, span, c, d);
    float *quad = s->quads + q_low * 8;
    for (size_t q = 0; q < span; q += 4) {
        for (size_t x = 0; x < 4; x += 2) {
            quad[2 * q + 2 * x] = c[q + x] + d[q + x + 1];
            quad[2 * q + 2 * x + 1] = c[q + x + 1] - d[q + x];
            quad[2 * q + 2 * x + 2] = c[q + x] - d[q + x + 1];
            quad[2 * q + 2 * x + 3] = c[q + x + 1] + d[q + x];
        }
    }
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

/* Adds the map of quads onto depth wavenumbers; k_lateral2 = kx^2 + ky^2. */
VECTOR_CLONES
static void map_quad(const struct fk *m, double k_lateral2, const float *quads,
                     const struct column *to)
{
    double f_low = fmax(lowest_frequency(m, sqrt(k_lateral2)), m->f0_hz);
    double f_scale = m->c / (4.0 * M_PI);
    double k_low = f_low / f_scale;
    double kz_low = sqrt(fmax(k_low * k_low - k_lateral2, 0.0));
    long first = (long)ceil(kz_low / m->dkz);
    if (first < m->kz_first)
        first = m->kz_first;
    for (size_t z = (size_t)(first - m->kz_first); z < m->n_kz; z++) {
        double kz = (double)(m->kz_first + (long)z) * m->dkz;
        double k = sqrt(k_lateral2 + kz * kz);
        double f = f_scale * k;
        double at = (f - m->f0_hz) / m->df_hz;
        long below = (long)at;
        if (below + FK_TAPS / 2 >= (long)m->n_f)
            break;
        if (below < FK_TAPS / 2 - 1)
            continue;
        const float *w = m->weights +
                         (size_t)((at - (double)below) * FK_FRACTIONS + 0.5) * FK_TAPS;
        const float *x = quads + 8 * (below - (FK_TAPS / 2 - 1));
        float sum[8] = {0};
        for (int q = 0; q < FK_TAPS; q++)
            for (int l = 0; l < 8; l++)
                sum[l] += w[q] * x[8 * q + l];
        double turns = kz * m->depth_m / (2.0 * M_PI) - f * m->centre_s;
        float phase = (float)(2.0 * M_PI * (turns - rint(turns)));
        float gain = (float)kz;
        float c = gain * cosf(phase), s = gain * sinf(phase);
        for (int l = 0; l < 4; l++) {
            if (!to->row[l])
                continue;
            to->row[l][2 * z] += sum[2 * l] * c - sum[2 * l + 1] * s;
            to->row[l][2 * z + 1] += sum[2 * l] * s + sum[2 * l + 1] * c;
        }
    }
}

static void map_row(struct fk *m, size_t kx, size_t fold, struct fk_scratch *s)
{
    double x2 = (double)kx * m->x.dk * (double)kx * m->x.dk;
    double limit = 4.0 * M_PI * (m->f0_hz + (double)m->n_f * m->df_hz) / m->c *
                   m->sine_max;
    size_t plane_size = m->y.n * m->n_kz;
    /* The planes hold the folded wavenumbers +fold and -fold. */
    size_t plus = kx % m->x.n == fold ? 0 : 1;
    size_t minus = fold == (m->x.n - fold) % m->x.n ? plus : 1 - plus;
    sum_over_x(m, kx, lowest_bin(m, sqrt(x2)), s);
    for (size_t ky = 0; ky <= m->y.k_max; ky++) {
        double k2 = x2 + (double)ky * m->y.dk * (double)ky * m->y.dk;
        if (k2 > limit * limit)
            break;
        size_t up = ky % m->y.n, down = (m->y.n - up) % m->y.n;
        fftwf_complex *p = s->plane + plus * plane_size,
                      *q = s->plane + minus * plane_size;
        struct column to = {{(float *)(p + up * m->n_kz), (float *)(p + down * m->n_kz),
                             (float *)(q + up * m->n_kz), (float *)(q + down * m->n_kz)}};
        if (ky == 0)
            to.row[1] = to.row[3] = NULL;
        if (kx == 0)
            to.row[2] = to.row[3] = NULL;
        sum_over_y(m, ky, lowest_bin(m, sqrt(k2)), s);
        map_quad(m, k2, s->quads, &to);
    }
}

/* -- back to space ----------------------------------------------------------------------
 */

/* One plane of folded kx: over ky, then over kz, into half[kx]. */
static void plane_to_space(struct fk *m, fftwf_complex *plane, size_t kx,
                           struct fk_scratch *s)
{
    const size_t *n = m->grid.n;
    fftwf_execute_dft(m->y_plan, plane, plane);
    for (size_t y = 0; y < n[1]; y++) {
        memset(s->column, 0, m->nz_fft * sizeof *s->column);
        size_t at = (size_t)m->kz_first % m->nz_fft;
        for (size_t z = 0; z < m->n_kz; z++) {
            s->column[at][0] += plane[y * m->n_kz + z][0];
            s->column[at][1] += plane[y * m->n_kz + z][1];
            at = at + 1 == m->nz_fft ? 0 : at + 1;
        }
        fftwf_execute_dft(m->z_plan, s->column, s->column);
        memcpy(m->half + (kx * n[1] + y) * n[2], s->column, n[2] * sizeof *s->column);
    }
}

/* All wavenumbers that fold onto +-fold, and their transform over y and z. */
static void image_fold(void *ctx, size_t fold, size_t thread)
{
    struct migration *g = ctx;
    struct fk *m = g->fk;
    struct fk_scratch *s = &m->scratch[thread];
    size_t mirrored = (m->x.n - fold) % m->x.n;
    memset(s->plane, 0, 2 * m->y.n * m->n_kz * sizeof *s->plane);
    for (size_t kx = 0; kx <= m->x.k_max; kx++)
        if (kx % m->x.n == fold || kx % m->x.n == mirrored)
            map_row(m, kx, fold, s);
    plane_to_space(m, s->plane, fold, s);
    if (mirrored != fold)
        plane_to_space(m, s->plane + m->y.n * m->n_kz, mirrored, s);
}

static void image_row(void *ctx, size_t y, size_t thread)
{
    struct migration *g = ctx;
    struct fk *m = g->fk;
    const size_t *n = m->grid.n;
    fftwf_complex *line = m->scratch[thread].line;
    double cells = (double)(m->x.lines * m->y.lines);
    float scale = (float)(1.0 / (cells * cells));
    fftwf_execute_dft(m->x_plan, m->half + y * n[2], line);
    for (size_t z = 0; z < n[2]; z++) {
        const fftwf_complex *from = line + z * m->x.n;
        float *to = g->intensity + (z * n[1] + y) * n[0];
        for (size_t x = 0; x < n[0]; x++)
            to[x] = scale * (from[x][0] * from[x][0] + from[x][1] * from[x][1]);
    }
}

void fk_migrate(struct fk *m, const float complex *gather, const float *weight,
                float *intensity)
{
    struct migration g = {m, gather, weight, intensity};
    pool_run(m->pool, m->x.lines, transform_line, &g);
    pool_run(m->pool, m->x.n / 2 + 1, image_fold, &g);
    pool_run(m->pool, m->grid.n[1], image_row, &g);
}
