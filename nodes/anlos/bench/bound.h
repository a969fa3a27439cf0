/* nodes/anlos/bench/bound.h -- how exactly the place of one point can be known at all:
 * the Cramer-Rao bound (Kay 1993, Fundamentals of Statistical Signal Processing:
 * Estimation Theory, Eq. 3.31 and example 3.13).
 *
 * Pair p hears a_p s(t - tau_p(x)) in white noise of variance sigma^2 a sample, with
 * tau_p = (|x - speaker| + |x - microphone|) / c.  The Fisher information of x is
 *
 *   J = 1/sigma^2 sum over p and samples of (d/dx)(d/dx)'
 *     = sum over p of SNR_p (2 pi)^2 f2 g_p g_p',   g_p = grad tau_p
 *
 * where SNR_p = a_p^2 sum s^2 / sigma^2 (Kay's 2 E / N0) and f2 the mean of f^2 over the
 * energy of s: about 0, for the phase is known, not about the carrier.  Of a chirp from
 * f0 to f1 f2 = (f0^2 + f0 f1 + f1^2) / 3.  The amplitude's derivative, s itself, is
 * orthogonal to s', so not to know it costs nothing.
 *
 * The peak of an intensity does not know the phase of the scatterer either.  A common
 * unknown phase takes  b b' / c  away from J, with
 *
 *   b = sum SNR_p (2 pi)^2 f1 g_p,  c = sum SNR_p (2 pi)^2,   f1 = mean of f
 *
 * (Schur complement).  Across, where g_p averages out over the aperture, nothing changes;
 * in depth the width of the band about its middle remains: f2 - f1^2. */
#ifndef ANLOS_NODES_ANLOS_BENCH_BOUND_H
#define ANLOS_NODES_ANLOS_BENCH_BOUND_H

#include <stdbool.h>

#include "recon/geometry.h"

struct bench_bound {
    double lateral_m, depth_m; /* rms: sqrt of the traces' parts xx + yy, and zz */
};

/* snr [n_positions][n_speakers][n_microphones].  0, -EDOM (J is singular). */
int bench_bound(struct bench_bound *out, const struct geometry *g, const double at_m[3],
                const double band_hz[2], bool phase_known, const double *snr);

#endif
