/* SPDX-License-Identifier: MIT */
/* recon/ego.h -- how a vehicle moves in the plane, so that what it heard or saw at one
 * instant can be said in its frame of another.  Vehicle frame: x forward, y to the left,
 * z up.  Speed and yaw rate that stay as they are make an arc of a circle, taken exactly
 * (Thrun, Burgard and Fox 2005, "Probabilistic Robotics", section 5.3). */
#ifndef ANLOS_RECON_EGO_H
#define ANLOS_RECON_EGO_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define EGO_MAX_AGE_NS    100000000 /* motion that is older is not known */
#define EGO_PATH_MOTIONS  256       /* 5 s of a message every 20 ms */
#define EGO_FASTEST_M_S   100.0     /* a vehicle; what says more is not believed */
#define EGO_FASTEST_RAD_S 10.0

struct ego_motion {
    double speed_m_s;      /* of the vehicle's origin, forward */
    double yaw_rate_rad_s; /* positive: to the left */
};

/* Finite, and not faster than a vehicle. */
bool ego_motion_is_plausible(const struct ego_motion *m);

struct ego_step {            /* from an earlier instant to a later one, or back: */
    double dx_m, dy_m, dyaw; /* the later frame in the earlier one; radian */
};

/* Speed and yaw rate held for dt_s, which may be negative. */
void ego_motion_step(const struct ego_motion *m, double dt_s, struct ego_step *out);

/* a, then b. */
void ego_step_join(const struct ego_step *a, const struct ego_step *b,
                   struct ego_step *out);

/* Where a point that stands still at `from` in the earlier frame is in the later one, and
 * how a direction or velocity over ground turns.  May be the same array. */
void ego_step_point(const struct ego_step *s, const double from[3], double to[3]);
void ego_step_turn(const struct ego_step *s, const double from[3], double to[3]);

/* The newest motions, as they were measured.  {0} is an empty one. */
struct ego_path {
    size_t n, newest;                   /* motions held; index of the newest */
    int64_t stamp_ns[EGO_PATH_MOTIONS]; /* rings */
    struct ego_motion motion[EGO_PATH_MOTIONS];
};

/* 0, or -EINVAL: not later than the newest, or not plausible; the path stays as it was.
 */
int ego_path_add(struct ego_path *p, int64_t stamp_ns, const struct ego_motion *m);

/* Between two stamps the motion goes straight from one to the other, after the newest it
 * stays as it is.  It is known where the last stamp is at most EGO_MAX_AGE_NS ago: not
 * before the oldest, nor in the rest of a longer gap.  0, or -ENODATA: not known; *out is
 * standstill. */
int ego_path_at(const struct ego_path *p, int64_t at_ns, struct ego_motion *out);

/* From one instant to another, also back in time.  0, or -ENODATA: not known all the way;
 * *out is no motion.  Of changing motion each part between two stamps counts as its mean:
 * the third order of their distance is what is missing. */
int ego_path_between(const struct ego_path *p, int64_t from_ns, int64_t to_ns,
                     struct ego_step *out);

#endif
