#include "dsp/band_loops.h"

VECTOR_CLONES
void band_rows_fold(float *signal, size_t n_rows, size_t m)
{
    for (size_t j = 1; j < n_rows / 2; j++) {
        float *restrict a = signal + j * m, *restrict b = signal + (n_rows - j) * m;
        for (size_t i = 0; i < m; i++) {
            float difference = a[i] - b[i];
            b[i] += a[i];
            a[i] = difference;
        }
    }
}

/* The sums of a whole block at once, here and below, so that none waits for the last. */
VECTOR_CLONES
void band_rows_mix(float *restrict out, const float *restrict signal, size_t half,
                   const float *restrict root, const float *restrict twiddle, size_t m)
{
    for (size_t i = 0; i < m; i += BAND_BLOCK) {
        const float *tr = twiddle + i, *ti = twiddle + m + i;
        float *y = out + 2 * i;
        float re[BAND_BLOCK] = {0}, im[BAND_BLOCK] = {0};

        for (size_t r = 0; r < half; r++) {
            const float *a = signal + r * m + i, *b = signal + (half + r) * m + i;
            for (size_t v = 0; v < BAND_BLOCK; v++) {
                re[v] += root[r] * a[v];
                im[v] += root[half + r] * b[v];
            }
        }
        for (size_t v = 0; v < BAND_BLOCK; v++) {
            y[2 * v] = re[v] * tr[v] - im[v] * ti[v];
            y[2 * v + 1] = re[v] * ti[v] + im[v] * tr[v];
        }
    }
}

VECTOR_CLONES
void band_bins_multiply(float *restrict y, const float *restrict x,
                        const float *restrict h, size_t n)
{
    for (size_t k = 0; k < n; k++) {
        float re = x[2 * k], im = x[2 * k + 1];
        y[2 * k] = re * h[2 * k] - im * h[2 * k + 1];
        y[2 * k + 1] = re * h[2 * k + 1] + im * h[2 * k];
    }
}

VECTOR_CLONES
void band_bins_multiply_mirrored(float *restrict y, const float *restrict x,
                                 const float *restrict h, size_t n)
{
    for (size_t k = 0; k < n; k++) {
        const float *z = x - 2 * k;
        float re = z[0], im = -z[1];
        y[2 * k] = re * h[2 * k] - im * h[2 * k + 1];
        y[2 * k + 1] = re * h[2 * k + 1] + im * h[2 * k];
    }
}

VECTOR_CLONES
void band_block_combine(float *restrict y, const float *restrict v, size_t n_streams,
                        size_t stride, const float *restrict step,
                        const float *restrict shift, size_t n_table)
{
    const float *sr = step, *si = step + n_table, *hr = shift, *hi = shift + n_table;
    float re[BAND_BLOCK] = {0}, im[BAND_BLOCK] = {0};

    for (size_t s = n_streams; s-- > 0;) {
        const float *x = v + 2 * s * stride;
        for (size_t i = 0; i < BAND_BLOCK; i++) {
            float turned = re[i] * sr[i] - im[i] * si[i];
            im[i] = re[i] * si[i] + im[i] * sr[i] + x[2 * i + 1];
            re[i] = turned + x[2 * i];
        }
    }
    for (size_t i = 0; i < BAND_BLOCK; i++) {
        y[2 * i] = re[i] * hr[i] - im[i] * hi[i];
        y[2 * i + 1] = re[i] * hi[i] + im[i] * hr[i];
    }
}
