/* SPDX-License-Identifier: MIT */
/* dsp/chirp.h -- the linear FM replica (Lindell 2019, Eq. 5). */
#ifndef ANLOS_DSP_CHIRP_H
#define ANLOS_DSP_CHIRP_H

#include <stdbool.h>
#include <stddef.h>

struct chirp {
    double start_hz, stop_hz;
    double duration_s;
    bool sine; /* else it starts as a cosine */
};

/* Samples of one chirp at a rate, to the nearest. */
size_t chirp_length(const struct chirp *c, double sample_rate_hz);

/* Phase at a time after the start, in rad; a real chirp is the cosine of it. */
double chirp_phase_rad(const struct chirp *c, double t_s);

/* out[chirp_length]: amplitude 1; phase kept in double. */
void chirp_generate(const struct chirp *c, double sample_rate_hz, float *out);

/* The overtone that a distorting speaker adds to a chirp: while the
 * chirp is at f the overtone is at order x f.  It is a chirp of its own that starts with
 * the first one, and a matched filter for it finds it at the same delay (as Farina, AES
 * 108 (2000), does with logarithmic sweeps).  Later echoes of a rising chirp are lower
 * than itself, so they never cross its overtones. */

/* The part of it below highest_hz, in whole samples.  0, -ERANGE: that is less than a
 * tenth of the chirp, or the chirp falls. */
int harmonic_chirp(const struct chirp *c, unsigned order, double highest_hz,
                   double sample_rate_hz, struct chirp *out);

#endif
