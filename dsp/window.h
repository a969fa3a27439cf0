/* SPDX-License-Identifier: MIT */
/* dsp/window.h -- weights over a band or a slot, and soft ends of a recording. */
#ifndef ANLOS_DSP_WINDOW_H
#define ANLOS_DSP_WINDOW_H

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

#endif
