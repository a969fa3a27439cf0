/* SPDX-License-Identifier: MIT */
/* tests/recon/reference.h -- echoes of points and their images in closed form and double
 * precision, sharing nothing with recon/.  A chirp compressed with a Hann window over
 * the band f1..f2 (width B, middle fm) has the analytic echo of delay d
 *   p(t - d) exp(2 pi i fm (t - d)),   p(t) = sinc(B t) / (1 - (B t)^2). */
#ifndef ANLOS_TESTS_RECON_REFERENCE_H
#define ANLOS_TESTS_RECON_REFERENCE_H

#include <complex.h>
#include <stddef.h>

#include "dsp/pulse_compress.h"

struct scatterer {
    double at_m[3];
    double gain;
};

double reference_distance(const double a[3], const double b[3]);

/* p(t), 1 at 0. */
double reference_pulse(const double band_hz[2], double t_s);

/* Baseband echo of gain 1 at one time. */
double complex reference_echo(const double band_hz[2], double carrier_hz, double delay_s,
                              double t_s);

/* out[f->n_samples] = the trace of one pair; amplitudes gain / (r_s r_m). */
void reference_trace(const struct trace_format *f, const double band_hz[2],
                     double sound_speed_m_s, const double speaker[3],
                     const double microphone[3], const struct scatterer *points,
                     size_t n_points, float complex *out);

/* What an exact migration of co-located traces shows at a voxel, with plane waves
 * weighted by kz^gain_power.  For gain_power 1 (Stolt) the integral over plane waves
 * exp(i (kx x + ky y + kz z)) with the measure dkx dky kz dkz = dkx dky k dk is
 *   sum over midpoints of  z / r^2  integral of  k (i / r + k) S(k) exp(i k r) dk,
 * k = 4 pi f / c (Weyl's integral, differentiated), here with the spectrum S of points of
 * which each gives gain / r_s, at midpoints x[nx] times y[ny] in the plane z = plane_z_m.
 * Another power adds (k z / r)^(gain_power - 1), by stationary phase. */
double complex reference_migrated(const double band_hz[2], double sound_speed_m_s,
                                  const double *x_m, size_t nx, const double *y_m,
                                  size_t ny, double plane_z_m, double gain_power,
                                  const struct scatterer *points, size_t n_points,
                                  const double voxel[3]);

/* Uniform in 0..1, never 0; *state is any number at first.  (Steele 2014, splitmix.) */
double reference_random(unsigned long long *state);

#endif
