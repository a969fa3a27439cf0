/* dsp/taper.h -- fades the ends of a recording, so that a sound that its beginning or its
 * end cuts off is not compressed to sidelobes all over the gate: what is left of a chirp
 * is a band with a steep edge, and the fade, which takes in (length / rate) x (Hz a
 * second) of that band, makes the edge soft (raised cosine; Harris 1978). */
#ifndef ANLOS_DSP_TAPER_H
#define ANLOS_DSP_TAPER_H

#include <stddef.h>

/* out[n] = x[n], faded in over the first `head` samples and out over the last `tail`;
 * where they meet, both count.  out may be x. */
void taper_ends(const float *x, size_t n, size_t head, size_t tail, float *out);

#endif
