/* recon/lane_fft.h -- complex Fourier transforms of 16 signals side by side, each in one
 * lane of a register, for convolutions of zero-padded signals: the second half of the
 * input counts as zero and is not read, the second half of the result is not made, and
 * the spectrum stays in the order in which the butterflies leave it (radix 4, Gentleman
 * and Sande 1966 forward, Cooley and Tukey 1965 back).
 *
 * Signals are [n][re, im][16] floats.  For VECTOR_CLONES functions. */
#ifndef ANLOS_RECON_LANE_FFT_H
#define ANLOS_RECON_LANE_FFT_H

#include <stddef.h>
#include <stdint.h>

#include "dsp/vector.h"

#define LANE_FFT_POINT (2 * VECTOR_LANES) /* floats of one point of all signals */

struct lane_fft {
    size_t n, leaf;   /* n = leaf * 4^stages; leaf 1, 2 or 3 */
    float *twiddles;  /* stage by stage [quarter][3][re, im] */
    uint32_t *number; /* [n]: the frequency 0..n-1 at each place of the spectrum */
};

/* The smallest length from `least` on that there is: 4^k times 1, 2 or 3, at least 4. */
size_t lane_fft_size(size_t least);

/* n: one that lane_fft_size gives.  0, -EINVAL, -ENOMEM. */
int lane_fft_create(struct lane_fft **out, size_t n);
void lane_fft_destroy(struct lane_fft *f);

/* The 16 floats at an address; no function, because vectors are no arguments. */
#define LANES_AT(address) (*(vector16 *)(address))

/* The first stage: both inputs of the upper half are zero. */
VECTOR_INLINE void lane_fft_first(float *x, size_t quarter, const float *w)
{
    for (size_t j = 0; j < quarter; j++, w += 6) {
        float *p[4];
        for (size_t r = 0; r < 4; r++)
            p[r] = x + (j + r * quarter) * LANE_FFT_POINT;
        vector16 ar = LANES_AT(p[0]), ai = LANES_AT(p[0] + VECTOR_LANES);
        vector16 br = LANES_AT(p[1]), bi = LANES_AT(p[1] + VECTOR_LANES);
        vector16 r1 = ar + bi, i1 = ai - br, r2 = ar - br, i2 = ai - bi;
        vector16 r3 = ar - bi, i3 = ai + br;
        LANES_AT(p[0]) = ar + br;
        LANES_AT(p[0] + VECTOR_LANES) = ai + bi;
        LANES_AT(p[1]) = r1 * w[0] - i1 * w[1];
        LANES_AT(p[1] + VECTOR_LANES) = r1 * w[1] + i1 * w[0];
        LANES_AT(p[2]) = r2 * w[2] - i2 * w[3];
        LANES_AT(p[2] + VECTOR_LANES) = r2 * w[3] + i2 * w[2];
        LANES_AT(p[3]) = r3 * w[4] - i3 * w[5];
        LANES_AT(p[3] + VECTOR_LANES) = r3 * w[5] + i3 * w[4];
    }
}

VECTOR_INLINE void lane_fft_split(float *x, size_t quarter, const float *w)
{
    for (size_t j = 0; j < quarter; j++, w += 6) {
        float *p[4];
        for (size_t r = 0; r < 4; r++)
            p[r] = x + (j + r * quarter) * LANE_FFT_POINT;
        vector16 ar = LANES_AT(p[0]), ai = LANES_AT(p[0] + VECTOR_LANES);
        vector16 br = LANES_AT(p[1]), bi = LANES_AT(p[1] + VECTOR_LANES);
        vector16 cr = LANES_AT(p[2]), ci = LANES_AT(p[2] + VECTOR_LANES);
        vector16 dr = LANES_AT(p[3]), di = LANES_AT(p[3] + VECTOR_LANES);
        vector16 er = ar + cr, ei = ai + ci, fr = ar - cr, fi = ai - ci;
        vector16 gr = br + dr, gi = bi + di, hr = bi - di, hi = dr - br;
        vector16 r1 = fr + hr, i1 = fi + hi, r2 = er - gr, i2 = ei - gi;
        vector16 r3 = fr - hr, i3 = fi - hi;
        LANES_AT(p[0]) = er + gr;
        LANES_AT(p[0] + VECTOR_LANES) = ei + gi;
        LANES_AT(p[1]) = r1 * w[0] - i1 * w[1];
        LANES_AT(p[1] + VECTOR_LANES) = r1 * w[1] + i1 * w[0];
        LANES_AT(p[2]) = r2 * w[2] - i2 * w[3];
        LANES_AT(p[2] + VECTOR_LANES) = r2 * w[3] + i2 * w[2];
        LANES_AT(p[3]) = r3 * w[4] - i3 * w[5];
        LANES_AT(p[3] + VECTOR_LANES) = r3 * w[5] + i3 * w[4];
    }
}

/* The way back of lane_fft_split, 4 times as large; half: only points below 2 quarters
 * are wanted. */
VECTOR_INLINE void lane_fft_join(float *x, size_t quarter, const float *w, int half)
{
    for (size_t j = 0; j < quarter; j++, w += 6) {
        float *p[4];
        for (size_t r = 0; r < 4; r++)
            p[r] = x + (j + r * quarter) * LANE_FFT_POINT;
        vector16 ar = LANES_AT(p[0]), ai = LANES_AT(p[0] + VECTOR_LANES);
        vector16 xr = LANES_AT(p[1]), xi = LANES_AT(p[1] + VECTOR_LANES);
        vector16 br = xr * w[0] + xi * w[1], bi = xi * w[0] - xr * w[1];
        xr = LANES_AT(p[2]), xi = LANES_AT(p[2] + VECTOR_LANES);
        vector16 cr = xr * w[2] + xi * w[3], ci = xi * w[2] - xr * w[3];
        xr = LANES_AT(p[3]), xi = LANES_AT(p[3] + VECTOR_LANES);
        vector16 dr = xr * w[4] + xi * w[5], di = xi * w[4] - xr * w[5];
        vector16 er = ar + cr, ei = ai + ci, fr = ar - cr, fi = ai - ci;
        vector16 gr = br + dr, gi = bi + di, hr = di - bi, hi = br - dr;
        LANES_AT(p[0]) = er + gr;
        LANES_AT(p[0] + VECTOR_LANES) = ei + gi;
        LANES_AT(p[1]) = fr + hr;
        LANES_AT(p[1] + VECTOR_LANES) = fi + hi;
        if (half)
            continue;
        LANES_AT(p[2]) = er - gr;
        LANES_AT(p[2] + VECTOR_LANES) = ei - gi;
        LANES_AT(p[3]) = fr - hr;
        LANES_AT(p[3] + VECTOR_LANES) = fi - hi;
    }
}

/* Transforms of 2 or 3 points; their sine has the sign of the direction. */
VECTOR_INLINE void lane_fft_leaf(float *x, size_t leaf, float sign)
{
    float *y = x + LANE_FFT_POINT, *z = y + LANE_FFT_POINT;
    vector16 ar = LANES_AT(x), ai = LANES_AT(x + VECTOR_LANES);
    vector16 br = LANES_AT(y), bi = LANES_AT(y + VECTOR_LANES);
    if (leaf == 2) {
        LANES_AT(x) = ar + br;
        LANES_AT(x + VECTOR_LANES) = ai + bi;
        LANES_AT(y) = ar - br;
        LANES_AT(y + VECTOR_LANES) = ai - bi;
        return;
    }
    vector16 cr = LANES_AT(z), ci = LANES_AT(z + VECTOR_LANES);
    float s = sign * 0.86602540f;
    vector16 er = br + cr, ei = bi + ci, hr = s * (ci - bi), hi = s * (br - cr);
    vector16 fr = ar - 0.5f * er, fi = ai - 0.5f * ei;
    LANES_AT(x) = ar + er;
    LANES_AT(x + VECTOR_LANES) = ai + ei;
    LANES_AT(y) = fr + hr;
    LANES_AT(y + VECTOR_LANES) = fi + hi;
    LANES_AT(z) = fr - hr;
    LANES_AT(z + VECTOR_LANES) = fi - hi;
}

/* x[n]: the first half of the signals in, their spectrum out. */
VECTOR_INLINE void lane_fft_forward(const struct lane_fft *f, float *x)
{
    const float *w = f->twiddles;
    lane_fft_first(x, f->n / 4, w);
    w += 6 * (f->n / 4);
    for (size_t block = f->n / 4; block > f->leaf; block /= 4) {
        for (size_t at = 0; at < f->n; at += block)
            lane_fft_split(x + at * LANE_FFT_POINT, block / 4, w);
        w += 6 * (block / 4);
    }
    for (size_t at = 0; f->leaf > 1 && at < f->n; at += f->leaf)
        lane_fft_leaf(x + at * LANE_FFT_POINT, f->leaf, -1.0f);
}

/* x[n]: a spectrum in, n times the first half of the signals out. */
VECTOR_INLINE void lane_fft_backward(const struct lane_fft *f, float *x)
{
    const float *w = f->twiddles + 2 * (f->n - f->leaf);
    for (size_t at = 0; f->leaf > 1 && at < f->n; at += f->leaf)
        lane_fft_leaf(x + at * LANE_FFT_POINT, f->leaf, 1.0f);
    for (size_t block = 4 * f->leaf; block < f->n; block *= 4) {
        w -= 6 * (block / 4);
        for (size_t at = 0; at < f->n; at += block)
            lane_fft_join(x + at * LANE_FFT_POINT, block / 4, w, 0);
    }
    lane_fft_join(x, f->n / 4, f->twiddles, 1);
}

#endif
