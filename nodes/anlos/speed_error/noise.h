/* SPDX-License-Identifier: MIT */
/* nodes/anlos/speed_error/noise.h -- images of one point in much noise, again and again:
 * the point's echoes are compressed once, white noise is made at the rate of the
 * recording and compressed for each seed, and as compression is linear, any mixture of
 * the two images without a new recording. */
#ifndef ANLOS_NODES_ANLOS_SPEED_ERROR_NOISE_H
#define ANLOS_NODES_ANLOS_SPEED_ERROR_NOISE_H

#include <stdbool.h>

#include "nodes/anlos/speed_error/scene.h"
#include "recon/geometry.h"
#include "recon/processing.h"

/* How exactly the place of one point can be known at all: the Cramer-Rao bound (Kay
 * 1993, Fundamentals of Statistical Signal Processing: Estimation Theory, Eq. 3.31 and
 * example 3.13).
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

struct bench_bound {
    double lateral_m, depth_m; /* rms: sqrt of the traces' parts xx + yy, and zz */
};

/* snr [n_positions][n_speakers][n_microphones].  0, -EDOM (J is singular). */
int bench_bound(struct bench_bound *out, const struct geometry *g, const double at_m[3],
                const double band_hz[2], bool phase_known, const double *snr);

#define BENCH_TRIAL_METHODS 16

struct bench_trials;

/* scene: noiseless, without background, of one point; must outlive the trials.  limits:
 * minimum, maximum and step of x, y, z.  methods as imager_methods().  0, -ENOMEM,
 * -ENOTSUP (a method cannot), other negative errno. */
int bench_trials_create(struct bench_trials **out, const struct bench_scene *scene,
                        const double limits[3][3], const char *methods,
                        enum window window, size_t threads, struct error *why);

/* Noise of a seed, of rms 1 a sample in the recording less its background. */
void bench_trials_noise(struct bench_trials *t, uint64_t seed);

/* Of method number m: the echoes times `signal` plus the noise times `noise`; [grid].
 * Valid until the next. */
const float *bench_trials_image(struct bench_trials *t, size_t m, double signal,
                                double noise);

const struct processing *bench_trials_processing(const struct bench_trials *t);

/* Mean square of the echoes over the slots of the recording: what raw signal to noise is
 * about. */
double bench_trials_power(const struct bench_trials *t);

void bench_trials_destroy(struct bench_trials *t);

/* Position error of one point over raw signal to
 * noise, rms over many seeds, beside the Cramer-Rao bound. */

#define BENCH_NOISE_LEVELS 16

struct bench_noise {
    char methods[256]; /* that were run, as imager_methods() has them */
    size_t n_methods, n_levels, n_seeds;
    double snr_db[BENCH_NOISE_LEVELS]; /* raw: echoes over noise in the recording */
    double lateral_m[BENCH_TRIAL_METHODS][BENCH_NOISE_LEVELS];
    double depth_m[BENCH_TRIAL_METHODS][BENCH_NOISE_LEVELS];
    struct bench_bound known[BENCH_NOISE_LEVELS], unknown[BENCH_NOISE_LEVELS];
};

/* Of those of `methods` that are about where one point is in noise and take no hours.
 * What is done when a person interrupts stays (n_seeds).  0, -EINTR, other negative
 * errno. */
int bench_noise_run(struct bench_noise *out, const struct bench_scene *point,
                    const char *methods, size_t n_seeds, size_t threads,
                    struct error *why);

/* FOLDER/noise.csv.  0, negative errno. */
int bench_noise_write(const struct bench_noise *b, const char *folder, struct error *why);

#endif
