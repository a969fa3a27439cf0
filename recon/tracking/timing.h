/* SPDX-License-Identifier: MIT */
/* recon/tracking/timing.h -- of which instants an image tells, and how much of it is
 * news.
 */
#ifndef ANLOS_RECON_TRACKING_TIMING_H
#define ANLOS_RECON_TRACKING_TIMING_H

#include <stddef.h>

#include "recon/survey.h"
#include "recon/volume.h"

/* Of the pings of an image in the mean, at its stamp: when some got lost it is older than
 * as many in a row. */
double timing_age_s(const struct survey *s, const struct volume *v);

/* From an image's stamp to the instant at which it shows something at a range: the mean
 * of its pings, which began up to the stamp, the chirp
 * (recon/static_array/range_doppler.h), and the way there. */
double timing_lag_s(const struct survey *s, const struct volume *v, double range_m);

/* How much of an image tells what the one dt_s before did not, 0..1: the part of its
 * pings that is new, and no more than dt_s of look_s, for so long sidelobes, and the
 * bright spots of what moves, stay as they are. */
double timing_fresh(const struct survey *s, const struct volume *v, double dt_s,
                    double look_s);

/* From one ping of a speaker to its next. */
double timing_round_s(const struct survey *s);

#endif
