/* SPDX-License-Identifier: MIT */
/* anlos/ego.h -- how a vehicle moved in the plane, so that what was heard at one time can
 * be said in its frame of another.  Vehicle frame: x forward, y left, z up.  Speed and
 * yaw rate that stay as they are make an arc of a circle, taken exactly (Thrun, Burgard
 * and Fox 2005, "Probabilistic Robotics", section 5.3).
 *
 * It remembers the newest 256 motions.  One thread at a time. */
#ifndef ANLOS_EGO_H
#define ANLOS_EGO_H

#include <stdint.h>

#include <anlos/error.h>

ANLOS_BEGIN

struct anlos_ego; /* opaque */

ANLOS_API int anlos_ego_create(struct anlos_ego **out, struct anlos_error *why);
ANLOS_API void anlos_ego_destroy(struct anlos_ego *e);

/* Of the vehicle's origin, forward and to the left.  ANLOS_STALE: not later than the
 * newest. */
ANLOS_API int anlos_ego_add(struct anlos_ego *e, double speed_m_s, double yaw_rate_rad_s,
                            int64_t capture_ns, struct anlos_error *why);

/* Between two motions it goes straight from one to the other; it is known up to 0.1 s
 * after the newest.  ANLOS_NOT_READY: not at that time. */
ANLOS_API int anlos_ego_at(const struct anlos_ego *e, int64_t at_ns, double *speed_m_s,
                           double *yaw_rate_rad_s, struct anlos_error *why);

/* Where a point that stands still at from_m, in the frame of from_ns, is in the frame of
 * to_ns, which may be earlier.  ANLOS_NOT_READY: not known all the way. */
ANLOS_API int anlos_ego_point(const struct anlos_ego *e, int64_t from_ns, int64_t to_ns,
                              const double from_m[3], double to_m[3],
                              struct anlos_error *why);

ANLOS_END

#endif
