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

#endif
