/* SPDX-License-Identifier: MIT */
/* recon/tracking/track_outline.h -- how large what a track follows is, and where its
 * middle is.
 *
 * Sound comes back from the front of a body, on the side that faces the array by way of
 * its mirror: the middle of a person lies a hand's breadth behind what is heard of him.
 * (Of a cylinder of radius r that scatters as Lambert's law says, what comes back is
 * heard 0.85 r before its axis; legs and arms have theirs beside the trunk's.)  How far
 * is not the same for all bodies, and from look to look it is: no filter averages it.
 *
 * A car shows a flank that is as thin as a bicycle, and bright where it mirrors only: the
 * rest of it is behind that, on both sides.  As long as no more of it was heard than a
 * bicycle has, and its spots fit one (track_passing.h), it is taken for one, and the car
 * that it may be, behind the corner that is heard, is in its covariance.  There the glint
 * stays while the car drives on, or slides along with a part of its speed, and tells
 * neither where along the flank it is nor how fast that goes: what is left behind faster
 * than anything brakes has a flank's uncertainty.  It is told where it is heard all the
 * same, for the rear of a bicycle that goes out of sight looks like that too.
 *
 * What is faster than a walker is as long as a bicycle at least.  Where its middle is
 * follows from the direction that it is heard in (track_passing.h); where that is not
 * known, the rest of it is behind what is heard.  The side of a car that is not heard is
 * on the far side of it.
 *
 * Private to recon/tracking/track*.c. */
#ifndef ANLOS_RECON_TRACKING_TRACK_OUTLINE_H
#define ANLOS_RECON_TRACKING_TRACK_OUTLINE_H

#include <stdbool.h>

struct track;
struct track_filter;

struct track_outline {
    /* What was heard of it, of a car with its far side, from the filter's place: along
     * its velocity, and across to the left. */
    double low_m[2], high_m[2];
    double heard_m[2], middle_m[2]; /* over ground, from the same: the middle of what is
                                       heard, and of all there is of it */
    double longest_m;               /* of it that was heard at once */
    double unheard_m;               /* of its length, behind that */
    double travelled_m;             /* since it is fast */
    double fastest_m_s;             /* that it was known to go, and by how much it may */
    double slowed_m_s;              /* have slowed down since */
    bool fast, car;                 /* or was */
    bool longer;                    /* than a person */
    double followed_s;
    bool glint; /* it was left behind as no bicycle is */
    bool begun;
};

/* Unit vector along a filter's velocity, over ground. */
void track_outline_heading(const struct track_filter *f, double u[2]);

/* Faster than persons walk, with a velocity that is known well enough to compare it. */
bool track_outline_is_fast(const struct track *k);

/* A vector over ground in the frame of the unit vector u, and back. */
void track_outline_turn_in(const double u[2], const double v[2], double out[2]);
void track_outline_turn_out(const double u[2], const double v[2], double out[2]);

/* No faster than a person, by what is known so far. */
bool track_outline_is_slow(const struct track *k);

/* Neither faster nor longer than a person, and that is well known. */
bool track_outline_may_walk(const struct track *k);

/* After a look; of a vehicle that has turned by yaw over ground. */
void track_outline_update(struct track *k, double yaw);

/* Until the next look. */
void track_outline_predict(struct track *k, double dt_s);

/* Along the axes of that vehicle. */
void track_outline_size(const struct track *k, double yaw, double size_m[2]);

/* Adds how well the middle is known, beside the filter, to a covariance over ground. */
void track_outline_uncertain(const struct track *k, double covariance_m2[2][2]);

/* The same of its velocity. */
void track_outline_uncertain_velocity(const struct track *k,
                                      double covariance_m2_s2[2][2]);

#endif
