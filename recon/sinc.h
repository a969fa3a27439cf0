/* recon/sinc.h -- short band-limited interpolation: Kaiser-windowed sinc weights. */
#ifndef ANLOS_RECON_SINC_H
#define ANLOS_RECON_SINC_H

#include <stddef.h>

/* Weights of the n_taps samples around a point between samples n_taps/2 - 1 and n_taps/2,
 * `fraction` (0..1) past the former.  n_taps even, 2..16.  For a signal that fills
 * `occupancy` (0..1) of the sampled band the error is about
 * -(8 + 2.285 * n_taps * 2 pi * (1 - occupancy)) dB (Kaiser 1974). */
void sinc_weights(size_t n_taps, double occupancy, double fraction, double *out);

#endif
