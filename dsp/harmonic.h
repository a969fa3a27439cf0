/* dsp/harmonic.h -- the overtone that a distorting speaker adds to a chirp: while the
 * chirp is at f the overtone is at order x f.  It is a chirp of its own that starts with
 * the first one, and a matched filter for it finds it at the same delay (as Farina, AES
 * 108 (2000), does with logarithmic sweeps).  Later echoes of a rising chirp are lower
 * than itself, so they never cross its overtones. */
#ifndef ANLOS_DSP_HARMONIC_H
#define ANLOS_DSP_HARMONIC_H

#include "dsp/chirp.h"

/* The part of it below highest_hz, in whole samples.  0, -ERANGE: that is less than a
 * tenth of the chirp, or the chirp falls. */
int harmonic_chirp(const struct chirp *c, unsigned order, double highest_hz,
                   double sample_rate_hz, struct chirp *out);

#endif
