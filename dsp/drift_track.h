/* dsp/drift_track.h -- the air's stretch from ping to ping: a random walk, observed by
 * each ping's measurement (scalar Kalman filter; Kalman 1960).  A ping in which the
 * background is faint takes its stretch from those before it, and the first one from 0.
 */
#ifndef ANLOS_DSP_DRIFT_TRACK_H
#define ANLOS_DSP_DRIFT_TRACK_H

#include "dsp/drift.h"

struct drift_track {
    double stretch, variance;
};

/* The stretch of the air of another hour is unknown to 0.2%, 1.2 K. */
void drift_track_start(struct drift_track *t);

/* The best estimate after the next ping, within DRIFT_MAX_STRETCH. */
double drift_track_update(struct drift_track *t, const struct drift_measurement *m);

#endif
