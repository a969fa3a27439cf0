#include "dsp/band_loops.h"

/* Planar to interleaved. */
#define INTERLEAVE_LOW(a, b)                                                             \
    __builtin_shufflevector(a, b, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23)
#define INTERLEAVE_HIGH(a, b)                                                            \
    __builtin_shufflevector(a, b, 8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30,  \
                            15, 31)
/* And back. */
#define EVENS(a, b)                                                                      \
    __builtin_shufflevector(a, b, 0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, \
                            30)
#define ODDS(a, b)                                                                       \
    __builtin_shufflevector(a, b, 1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, \
                            31)

/* z * w of planar vectors, interleaved into y[2]. */
#define STORE_PRODUCT(y, zr, zi, wr, wi)                                                 \
    do {                                                                                 \
        vector16 pr_ = (zr) * (wr) - (zi) * (wi), pi_ = (zr) * (wi) + (zi) * (wr);       \
        (y)[0] = INTERLEAVE_LOW(pr_, pi_);                                               \
        (y)[1] = INTERLEAVE_HIGH(pr_, pi_);                                              \
    } while (0)

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

/* Two vectors at a time, here and below, so that one sum need not wait for the other. */
VECTOR_CLONES
void band_rows_mix(float *restrict out, const float *restrict signal, size_t half,
                   const float *restrict root, const float *restrict twiddle, size_t m)
{
    for (size_t i = 0; i < m; i += BAND_BLOCK) {
        const vector16 *tr = (const vector16 *)(twiddle + i);
        const vector16 *ti = (const vector16 *)(twiddle + m + i);
        vector16 *y = (vector16 *)(out + 2 * i);
        vector16 re0 = {0}, im0 = {0}, re1 = {0}, im1 = {0};

        for (size_t r = 0; r < half; r++) {
            const vector16 *a = (const vector16 *)(signal + r * m + i);
            const vector16 *b = (const vector16 *)(signal + (half + r) * m + i);
            re0 += root[r] * a[0];
            re1 += root[r] * a[1];
            im0 += root[half + r] * b[0];
            im1 += root[half + r] * b[1];
        }
        STORE_PRODUCT(y, re0, im0, tr[0], ti[0]);
        STORE_PRODUCT(y + 2, re1, im1, tr[1], ti[1]);
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
    const vector16 *sr = (const vector16 *)step, *si = (const vector16 *)(step + n_table);
    const vector16 *hr = (const vector16 *)shift;
    const vector16 *hi = (const vector16 *)(shift + n_table);
    vector16 sr0 = sr[0], si0 = si[0], sr1 = sr[1], si1 = si[1];
    vector16 re0 = {0}, im0 = {0}, re1 = {0}, im1 = {0};
    vector16 *out = (vector16 *)y;

    for (size_t s = n_streams; s-- > 0;) {
        const vector16 *x = (const vector16 *)(v + 2 * s * stride);
        vector16 t0 = re0 * sr0 - im0 * si0, t1 = re1 * sr1 - im1 * si1;
        im0 = re0 * si0 + im0 * sr0 + ODDS(x[0], x[1]);
        im1 = re1 * si1 + im1 * sr1 + ODDS(x[2], x[3]);
        re0 = t0 + EVENS(x[0], x[1]);
        re1 = t1 + EVENS(x[2], x[3]);
    }
    STORE_PRODUCT(out, re0, im0, hr[0], hi[0]);
    STORE_PRODUCT(out + 2, re1, im1, hr[1], hi[1]);
}
