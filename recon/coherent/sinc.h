/* SPDX-License-Identifier: MIT */
/* recon/coherent/sinc.h -- short band-limited interpolation: Kaiser-windowed sinc
 * weights. */
#ifndef ANLOS_RECON_COHERENT_SINC_H
#define ANLOS_RECON_COHERENT_SINC_H

#include <stddef.h>

/* Weights of the n_taps samples around a point between samples n_taps/2 - 1 and n_taps/2,
 * `fraction` (0..1) past the former.  n_taps even, 2..16.  The window suits a signal
 * that fills `occupancy` (0..1) of the sampled band; all images of its spectrum together
 * stay about 10 dB above Kaiser's -(8 + 2.285 * n_taps * 2 pi * (1 - occupancy)) dB. */
void sinc_weights(size_t n_taps, double occupancy, double fraction, double *out);

#endif
