/* SPDX-License-Identifier: MIT */
/* dsp/lane_fft.h -- complex Fourier transforms of 16 signals side by side, each in one
 * lane of a register, for convolutions of zero-padded signals: the second half of the
 * input counts as zero and is not read, the second half of the result is not made, and
 * the spectrum stays in the order in which the butterflies leave it (radix 4, Gentleman
 * and Sande 1966 forward, Cooley and Tukey 1965 back).
 *
 * Signals are [n][re, im][16] floats.  For VECTOR_CLONES functions. */
#ifndef ANLOS_DSP_LANE_FFT_H
#define ANLOS_DSP_LANE_FFT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/vector.h"

#define LANE_FFT_POINT (2 * VECTOR_LANES) /* floats of one point of all signals */

struct lane_fft {
    size_t n, leaf;   /* n = leaf * 4^stages; leaf 1, 2, 3 or 5 */
    float *twiddles;  /* stage by stage [quarter][3][re, im] */
    uint32_t *number; /* [n]: the frequency 0..n-1 at each place of the spectrum */
};

/* The smallest length from `least` on that there is: 4^k times 1, 2 or 3, at least 4. */
size_t lane_fft_size(size_t least);

/* Whether there is a transform of n points: those, and 4^k times 5. */
bool lane_fft_transforms(size_t n);

/* n: one that lane_fft_transforms.  0, -EINVAL, -ENOMEM. */
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
        VECTOR_LOOP
        for (size_t v = 0; v < VECTOR_LANES; v++) {
            float ar = p[0][v], ai = p[0][VECTOR_LANES + v];
            float br = p[1][v], bi = p[1][VECTOR_LANES + v];
            float r1 = ar + bi, i1 = ai - br, r2 = ar - br, i2 = ai - bi;
            float r3 = ar - bi, i3 = ai + br;
            p[0][v] = ar + br;
            p[0][VECTOR_LANES + v] = ai + bi;
            p[1][v] = r1 * w[0] - i1 * w[1];
            p[1][VECTOR_LANES + v] = r1 * w[1] + i1 * w[0];
            p[2][v] = r2 * w[2] - i2 * w[3];
            p[2][VECTOR_LANES + v] = r2 * w[3] + i2 * w[2];
            p[3][v] = r3 * w[4] - i3 * w[5];
            p[3][VECTOR_LANES + v] = r3 * w[5] + i3 * w[4];
        }
    }
}

VECTOR_INLINE void lane_fft_split(float *x, size_t quarter, const float *w)
{
    for (size_t j = 0; j < quarter; j++, w += 6) {
        float *p[4];
        for (size_t r = 0; r < 4; r++)
            p[r] = x + (j + r * quarter) * LANE_FFT_POINT;
        VECTOR_LOOP
        for (size_t v = 0; v < VECTOR_LANES; v++) {
            float ar = p[0][v], ai = p[0][VECTOR_LANES + v];
            float br = p[1][v], bi = p[1][VECTOR_LANES + v];
            float cr = p[2][v], ci = p[2][VECTOR_LANES + v];
            float dr = p[3][v], di = p[3][VECTOR_LANES + v];
            float er = ar + cr, ei = ai + ci, fr = ar - cr, fi = ai - ci;
            float gr = br + dr, gi = bi + di, hr = bi - di, hi = dr - br;
            float r1 = fr + hr, i1 = fi + hi, r2 = er - gr, i2 = ei - gi;
            float r3 = fr - hr, i3 = fi - hi;
            p[0][v] = er + gr;
            p[0][VECTOR_LANES + v] = ei + gi;
            p[1][v] = r1 * w[0] - i1 * w[1];
            p[1][VECTOR_LANES + v] = r1 * w[1] + i1 * w[0];
            p[2][v] = r2 * w[2] - i2 * w[3];
            p[2][VECTOR_LANES + v] = r2 * w[3] + i2 * w[2];
            p[3][v] = r3 * w[4] - i3 * w[5];
            p[3][VECTOR_LANES + v] = r3 * w[5] + i3 * w[4];
        }
    }
}

/* lane_fft_split of four points: nothing is to be turned. */
VECTOR_INLINE void lane_fft_four(float *x)
{
    float *p[4];
    for (size_t r = 0; r < 4; r++)
        p[r] = x + r * LANE_FFT_POINT;
    VECTOR_LOOP
    for (size_t v = 0; v < VECTOR_LANES; v++) {
        float ar = p[0][v], ai = p[0][VECTOR_LANES + v];
        float br = p[1][v], bi = p[1][VECTOR_LANES + v];
        float cr = p[2][v], ci = p[2][VECTOR_LANES + v];
        float dr = p[3][v], di = p[3][VECTOR_LANES + v];
        float er = ar + cr, ei = ai + ci, fr = ar - cr, fi = ai - ci;
        float gr = br + dr, gi = bi + di, hr = bi - di, hi = dr - br;
        p[0][v] = er + gr;
        p[0][VECTOR_LANES + v] = ei + gi;
        p[1][v] = fr + hr;
        p[1][VECTOR_LANES + v] = fi + hi;
        p[2][v] = er - gr;
        p[2][VECTOR_LANES + v] = ei - gi;
        p[3][v] = fr - hr;
        p[3][VECTOR_LANES + v] = fi - hi;
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
        VECTOR_LOOP
        for (size_t v = 0; v < VECTOR_LANES; v++) {
            float ar = p[0][v], ai = p[0][VECTOR_LANES + v];
            float xr = p[1][v], xi = p[1][VECTOR_LANES + v];
            float br = xr * w[0] + xi * w[1], bi = xi * w[0] - xr * w[1];
            xr = p[2][v], xi = p[2][VECTOR_LANES + v];
            float cr = xr * w[2] + xi * w[3], ci = xi * w[2] - xr * w[3];
            xr = p[3][v], xi = p[3][VECTOR_LANES + v];
            float dr = xr * w[4] + xi * w[5], di = xi * w[4] - xr * w[5];
            float er = ar + cr, ei = ai + ci, fr = ar - cr, fi = ai - ci;
            float gr = br + dr, gi = bi + di, hr = di - bi, hi = br - dr;
            p[0][v] = er + gr;
            p[0][VECTOR_LANES + v] = ei + gi;
            p[1][v] = fr + hr;
            p[1][VECTOR_LANES + v] = fi + hi;
            if (!half) {
                p[2][v] = er - gr;
                p[2][VECTOR_LANES + v] = ei - gi;
                p[3][v] = fr - hr;
                p[3][VECTOR_LANES + v] = fi - hi;
            }
        }
    }
}

/* Five points: sums and differences of the pairs that are each other's conjugates. */
VECTOR_INLINE void lane_fft_five(float *x, float sign)
{
    const float c1 = 0.30901699f, c2 = -0.80901699f;
    const float s1 = sign * 0.95105652f, s2 = sign * 0.58778525f;
    float *p[5];
    for (size_t r = 0; r < 5; r++)
        p[r] = x + r * LANE_FFT_POINT;
    VECTOR_LOOP
    for (size_t v = 0; v < VECTOR_LANES; v++) {
        float ar = p[0][v], ai = p[0][VECTOR_LANES + v];
        float br = p[1][v], bi = p[1][VECTOR_LANES + v];
        float cr = p[2][v], ci = p[2][VECTOR_LANES + v];
        float dr = p[3][v], di = p[3][VECTOR_LANES + v];
        float er = p[4][v], ei = p[4][VECTOR_LANES + v];
        float fr = br + er, fi = bi + ei, gr = cr + dr, gi = ci + di;
        float hr = br - er, hi = bi - ei, jr = cr - dr, ji = ci - di;
        float ur = ar + c1 * fr + c2 * gr, ui = ai + c1 * fi + c2 * gi;
        float vr = -(s1 * hi + s2 * ji), vi = s1 * hr + s2 * jr;
        p[0][v] = ar + fr + gr;
        p[0][VECTOR_LANES + v] = ai + fi + gi;
        p[1][v] = ur + vr;
        p[1][VECTOR_LANES + v] = ui + vi;
        p[4][v] = ur - vr;
        p[4][VECTOR_LANES + v] = ui - vi;
        ur = ar + c2 * fr + c1 * gr, ui = ai + c2 * fi + c1 * gi;
        vr = s1 * ji - s2 * hi, vi = s2 * hr - s1 * jr;
        p[2][v] = ur + vr;
        p[2][VECTOR_LANES + v] = ui + vi;
        p[3][v] = ur - vr;
        p[3][VECTOR_LANES + v] = ui - vi;
    }
}

/* Transforms of 2, 3 or 5 points; their sine has the sign of the direction. */
VECTOR_INLINE void lane_fft_leaf(float *x, size_t leaf, float sign)
{
    if (leaf == 5) {
        lane_fft_five(x, sign);
        return;
    }
    float *y = x + LANE_FFT_POINT, *z = y + LANE_FFT_POINT;
    if (leaf == 2) {
        VECTOR_LOOP
        for (size_t v = 0; v < 2 * VECTOR_LANES; v++) {
            float a = x[v], b = y[v];
            x[v] = a + b;
            y[v] = a - b;
        }
        return;
    }
    VECTOR_LOOP
    for (size_t v = 0; v < VECTOR_LANES; v++) {
        float ar = x[v], ai = x[VECTOR_LANES + v];
        float br = y[v], bi = y[VECTOR_LANES + v];
        float cr = z[v], ci = z[VECTOR_LANES + v];
        float s = sign * 0.86602540f;
        float er = br + cr, ei = bi + ci, hr = s * (ci - bi), hi = s * (br - cr);
        float fr = ar - 0.5f * er, fi = ai - 0.5f * ei;
        x[v] = ar + er;
        x[VECTOR_LANES + v] = ai + ei;
        y[v] = fr + hr;
        y[VECTOR_LANES + v] = fi + hi;
        z[v] = fr - hr;
        z[VECTOR_LANES + v] = fi - hi;
    }
}

/* The stages below blocks of some length, and the leaves. */
VECTOR_INLINE void lane_fft_descend(const struct lane_fft *f, float *x, size_t block)
{
    const float *w = f->twiddles + 2 * (f->n - block);
    for (; block > f->leaf && block > 4; block /= 4) {
        for (size_t at = 0; at < f->n; at += block)
            lane_fft_split(x + at * LANE_FFT_POINT, block / 4, w);
        w += 6 * (block / 4);
    }
    for (size_t at = 0; f->leaf == 1 && block == 4 && at < f->n; at += 4)
        lane_fft_four(x + at * LANE_FFT_POINT);
    for (size_t at = 0; f->leaf > 1 && at < f->n; at += f->leaf)
        lane_fft_leaf(x + at * LANE_FFT_POINT, f->leaf, -1.0f);
}

/* x[n]: the whole signals in, their spectrum out. */
VECTOR_INLINE void lane_fft_whole(const struct lane_fft *f, float *x)
{
    lane_fft_descend(f, x, f->n);
}

/* x[n]: the first half of the signals in, their spectrum out. */
VECTOR_INLINE void lane_fft_forward(const struct lane_fft *f, float *x)
{
    lane_fft_first(x, f->n / 4, f->twiddles);
    lane_fft_descend(f, x, f->n / 4);
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
