/* SPDX-License-Identifier: MIT */
/* recon/tracking/track_filter.h -- the Kalman filter of one track: position and velocity
 * over ground in the plane, nearly constant velocity (white noise acceleration,
 * Bar-Shalom, Li and Kirubarajan 2001, "Estimation with Applications to Tracking and
 * Navigation", section 6.2.2), and a height of its own that stays.
 *
 * An image shows its objects as they were some time before its stamp (its pings are of
 * several instants, and recon/static_array/range_doppler.h), so
 *
 *   measured = position + lag velocity + noise.
 *
 * Where its velocity was measured as well, by the phases of pings, that counts once the
 * position has, unless it is none that the track could have (one of 1000).  One that may
 * be wrong counts as much as it is likely to be right, by the filter too, and what is
 * left open by that is in the covariance (probabilistic data association of one
 * measurement, Bar-Shalom and Tse 1975). */
#ifndef ANLOS_RECON_TRACKING_TRACK_FILTER_H
#define ANLOS_RECON_TRACKING_TRACK_FILTER_H

#include <stdbool.h>

struct track_filter {
    double state[4]; /* x, y in m, vx, vy in m/s */
    double covariance[4][4];
    double height_m, height_m2;
};

struct track_position { /* a measured one, in the frame of the filter */
    double at_m[2], covariance_m2[2][2];
    double walker_m2[2][2]; /* covariance of somebody who walks: without his height, and
                               with the limb or shoulder that glints just then */
    double middle_m[2];     /* from there, the middle of all that was seen */
    double lag_s;           /* of the measured instant after the stamp; below 0: before */
    double height_m, height_m2;
    bool height_assumed;   /* the same prior each time: not averaged */
    bool has_velocity;     /* was measured, too, */
    double velocity_doubt; /* and is wrong with this probability: then it may be any */
    double velocity_fresh; /* what part of that was not told before, 0..1 */
    double velocity_m_s[2], velocity_m2_s2[2][2];
};

/* Velocity is 0 +- speed_m_s on each axis until a second position comes, or it is
 * measured. */
void track_filter_start(struct track_filter *f, const struct track_position *p,
                        double speed_m_s);

/* psd_m2_s3: power density of the acceleration on each axis; dt_s >= 0. */
void track_filter_predict(struct track_filter *f, double dt_s, double psd_m2_s3);

/* Its covariance is so many times as large. */
void track_position_doubt(struct track_position *p, double times);

/* The same thing measured once more, by errors of their own: *p becomes the mean of both,
 * each by how sure it is, as of somebody who walks; so does its velocity, unless one may
 * be wrong.  Heights and lag stay.  false: the places differ by more than gate2
 * (Mahalanobis, squared), *p stays what it was. */
bool track_position_join(struct track_position *p, const struct track_position *other,
                         double gate2);

struct track_match {
    double distance2; /* Mahalanobis, squared, with the height where it is measured */
    double density;   /* of the measured position in the plane, 1/m^2 */
};
struct track_match track_filter_match(const struct track_filter *f,
                                      const struct track_position *p);
void track_filter_update(struct track_filter *f, const struct track_position *p);

/* v' C^-1 v of a symmetric, positive definite C. */
double track_filter_distance2(const double v[2], const double c[2][2]);

#endif
