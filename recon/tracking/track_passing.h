/* SPDX-License-Identifier: MIT */
/* recon/tracking/track_passing.h -- the middle and the velocity of a long body that
 * passes.
 *
 * A body is heard where its surface faces the array by way of its mirror: a car that
 * comes near at its front corner, one that goes away at its rear one, and in between at
 * a glint that runs along its flank from the one to the other.  What is heard is slower
 * than the body, by its length over the way that it is heard on: a car of 4 m/s by a
 * third, a bicycle by a sixth.  So where the bright spot is on the body follows from the
 * direction that it is heard in (of a box with rounded corners, here), and a filter of
 * its own, beside that of what is heard, knows the middle, once for each kind of body.
 * Which kind it is shows when it goes by: the spot on a car runs along its flank, and as
 * one on a bicycle that fits badly; where nothing runs, it fits badly as a car.
 * (That what reflects of a body depends on its aspect: Hammarstrand, Lundgren and
 * Svensson 2012, "Adaptive radar sensor model for tracking structured extended objects",
 * IEEE Trans. AES 48(3).)
 *
 * Private to recon/tracking/track*.c. */
#ifndef ANLOS_RECON_TRACKING_TRACK_PASSING_H
#define ANLOS_RECON_TRACKING_TRACK_PASSING_H

#include <stdbool.h>
#include <stddef.h>

#include "recon/tracking/track_filter.h"

enum { TRACK_AS_BICYCLE, TRACK_AS_CAR, TRACK_PASSING };

struct track;
struct tracker;
struct track_scan;

struct track_passing {
    bool begun;
    struct track_filter as[TRACK_PASSING]; /* of the middle, over ground */
    double fits_car;             /* than as a bicycle: logarithm of how much better */
    double unfit[TRACK_PASSING]; /* looks, since one fitted */
};

/* Where the bright spot of a body is from its middle, m, over ground: u along its way,
 * sight away from the array, both of length 1.  Who goes no faster than somebody runs may
 * be one who does, and short. */
void track_passing_spot(int as, double speed_m_s, const double u[2],
                        const double sight[2], double out[2]);

/* After dt_s >= 0: the power density of the acceleration of who walks, and more that is
 * not known of the vehicle's. */
void track_passing_predict(struct track *k, double dt_s, double psd_m2_s3,
                           double lost_psd_m2_s3);

/* How well a detection of the scan, which is in t->positions, fits as the spot of a car;
 * INFINITY: it does not pass.  What may be a bicycle is not looked for in images with
 * what stands in them, where much would fit; nor do its spots tell there what it is. */
struct track_match track_passing_match(const struct tracker *t, const struct track *k,
                                       const struct track_scan *scan, size_t detection,
                                       double fresh);

/* After a look, which its other filters have taken, with a covariance that is `doubt` >=
 * 1 times as large as usual; for as long as it is fast, or a car. */
void track_passing_update(const struct tracker *t, const struct track_scan *scan,
                          struct track *k, double fresh, double doubt);

/* As which of both its spots have fitted; neither, as long as that is open. */
bool track_passing_fits_car(const struct track *k);
bool track_passing_fits_bicycle(const struct track *k);

/* What it is told by; NULL: what is heard.  No spot is faster than its body for long: of
 * a car it is the faster one of both. */
const struct track_filter *track_passing_told(const struct track *k);

#endif
