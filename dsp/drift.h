/* SPDX-License-Identifier: MIT */
/* dsp/drift.h -- coherent background subtraction when the air has changed since the
 * background was recorded.
 *
 * Sound that is slower by 0.1%, 0.6 K, brings every echo later by 0.1% of its delay t:
 * the background is subtracted after its time axis was stretched so (dsp/timescale.h).
 * The stretch of a ping is the one unknown of all its microphones.  It is found where the
 * stretched background fits the scene best: over a grid from correlations of short
 * blocks, which no wrapped phase can mislead, then by Gauss-Newton steps on
 * sum w |scene - stretched background|^2.  A block's weight w is what the background
 * explains there over what is left there, so that the hidden objects' echoes count little
 * where they are loud, and noise counts little where the background is silent.
 *
 * What leaks into the gate from sound outside of it does not move so: of a next emission
 * that the ping cuts off some -60 to -90 dB (dsp/pulse_compress.h).  Where that is as
 * loud as the background's echoes no stretch fits, and pings must hold the next emission
 * whole.
 *
 * There is no factor of amplitude: the absorption of air changes too little (ISO 9613-1:
 * what 0.6 K leaves of an echo is -56 dB at 3 m of path, 5% of relative humidity -45 dB).
 */
#ifndef ANLOS_DSP_DRIFT_H
#define ANLOS_DSP_DRIFT_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "dsp/interpolator.h"
#include "dsp/pulse_compress.h"

#define DRIFT_MAX_STRETCH 0.005 /* 2.9 K; beyond it none is looked for */

struct drift_config {
    struct trace_format format;
    double band_hz[2]; /* of the traces, oversampled by 1.8 or more */
    size_t n_channels;
};

struct drift_measurement {
    double stretch;  /* echoes come at t (1 + stretch) */
    double variance; /* INFINITY: nothing of the background is heard in the scene */
};

struct drift;

/* Plans and allocates.  One instance a thread: it owns scratch.
 * 0, -EINVAL, -ENOMEM. */
int drift_create(struct drift **out, const struct drift_config *cfg);

/* background, scene: [n_channels][n_samples] of the same ping; masked[n_channels] are not
 * looked at (NULL: none).  Depends on nothing but its arguments. */
void drift_measure(struct drift *d, const float complex *background,
                   const float complex *scene, const bool *masked,
                   struct drift_measurement *out);

/* scene -= stretched background.  The 3 or 4 samples and the shift at the ends of the
 * gate whose background lies beyond it become 0.  Without a noticeable stretch (residual
 * below -60 dB) it subtracts sample by sample, and all samples stay: true when it did
 * stretch. */
bool drift_subtract(struct drift *d, double stretch, const float complex *background,
                    float complex *scene);
void drift_destroy(struct drift *d);

/* Where about the stretch lies: the largest sum over blocks of the correlation of scene
 * and stretched background, inside of a block by one delay for all its samples.  All
 * lags' correlations are taken once; each stretch then costs an interpolation of each
 * block. */

#define DRIFT_BLOCK 32 /* samples */

struct drift_search;

/* Real and imaginary parts of the channels of a ping, apart; each points to sample 0 of
 * channel 0, the next channel comes `stride` later. */
struct drift_planes {
    size_t n_channels, stride;
    float *background_re, *background_im, *scene_re, *scene_im;
};

/* Keeps the interpolator.  highest_hz: of the band.  0, -EINVAL, -ENOMEM. */
int drift_search_create(struct drift_search **out, const struct trace_format *format,
                        double highest_hz, double max_stretch,
                        const struct interpolator *ip);

/* Zeros that the planes need on either side of a channel's samples. */
size_t drift_search_padding(const struct drift_search *ds);

/* The best stretch of the grid, which is fine enough for Gauss-Newton steps from there.
 */
double drift_search_best(struct drift_search *ds, const struct drift_planes *planes);
void drift_search_destroy(struct drift_search *ds);

/* The air's stretch from ping to ping: a random walk, observed by each ping's measurement
 * (scalar Kalman filter; Kalman 1960).  A ping in which the background is faint takes its
 * stretch from those before it, and the first one from 0. */

struct drift_track {
    double stretch, variance;
};

/* The stretch of the air of another hour is unknown to 0.2%, 1.2 K. */
void drift_track_start(struct drift_track *t);

/* The best estimate after the next ping, within DRIFT_MAX_STRETCH. */
double drift_track_update(struct drift_track *t, const struct drift_measurement *m);

#endif
