/* SPDX-License-Identifier: MIT */
/* dsp/window.h -- weights over a band or a slot and the pulse that they leave, and soft
 * ends of a recording. */
#ifndef ANLOS_DSP_WINDOW_H
#define ANLOS_DSP_WINDOW_H

#include <math.h>
#include <stddef.h>

enum window { WINDOW_RECTANGULAR, WINDOW_HANN, WINDOW_HAMMING };

/* Weight at x in 0..1 across the extent, 1 at most; 0 outside of it. */
double window_weight(enum window w, double x);

/* Fades the ends of a recording, so that a sound that its beginning or its end cuts off
 * is not compressed to sidelobes all over the gate: what is left of a chirp is a band
 * with a steep edge, and the fade, which takes in (length / rate) x (Hz a second) of that
 * band, makes the edge soft (raised cosine; Harris 1978).  out[n] = x[n], faded in over
 * the first `head` samples and out over the last `tail`; where they meet, both count. out
 * may be x. */
void taper_ends(const float *x, size_t n, size_t head, size_t tail, float *out);

#define HANN_VARIANCE 0.0326727 /* of a window of width 1: 1 / 12 - 1 / (2 pi^2) */

/* The pulse whose spectrum is a Hann window over a band of width 1, as compression leaves
 * it, at a time x: sinc(x) / (1 - x^2). */
static inline double window_hann_pulse(double x)
{
    double y = M_PI * x;
    if (fabs(x) < 1e-6)
        return 1.0;
    if (fabs(fabs(x) - 1.0) < 1e-6)
        return 0.5;
    return sin(y) / (y * (1.0 - x * x));
}

#endif
