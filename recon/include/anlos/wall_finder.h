/* SPDX-License-Identifier: MIT */
/* anlos/wall_finder.h -- the walls that mirror sound: heard in the array's own first
 * returns, or given by the vehicle, and followed over time.
 *
 * One thread at a time. */
#ifndef ANLOS_WALL_FINDER_H
#define ANLOS_WALL_FINDER_H

#include <anlos/config.h>
#include <anlos/ping.h>
#include <anlos/survey.h>
#include <anlos/walls.h>

ANLOS_BEGIN

struct anlos_wall_finder; /* opaque */

/* Of the configuration: walls, reach_m, lost_s.  ANLOS_INVALID also of a survey whose
 * speakers cannot be told apart. */
ANLOS_API int anlos_wall_finder_create(struct anlos_wall_finder **out,
                                       const struct anlos_config *cfg,
                                       const struct anlos_survey *survey,
                                       struct anlos_error *why);
ANLOS_API void anlos_wall_finder_destroy(struct anlos_wall_finder *f);

/* Each returns 1 when there is a new list of walls, at most ten a second, else 0. */
ANLOS_API int anlos_wall_finder_ping(struct anlos_wall_finder *f,
                                     const struct anlos_ping *ping,
                                     struct anlos_error *why);
ANLOS_API int anlos_wall_finder_ego(struct anlos_wall_finder *f, double speed_m_s,
                                    double yaw_rate_rad_s, int64_t capture_ns,
                                    struct anlos_error *why);

/* All walls that the vehicle knows, in its frame; with ANLOS_WALLS_GIVEN. */
ANLOS_API int anlos_wall_finder_given(struct anlos_wall_finder *f,
                                      const struct anlos_wall *walls, size_t n,
                                      int64_t capture_ns, struct anlos_error *why);

/* The newest list, in the array's frame at *capture_ns (which may be NULL), the surest
 * first; and each wall of it, out->size set. */
ANLOS_API size_t anlos_wall_finder_n_walls(const struct anlos_wall_finder *f,
                                           int64_t *capture_ns);
ANLOS_API int anlos_wall_finder_wall(const struct anlos_wall_finder *f, size_t i,
                                     struct anlos_wall *out, struct anlos_error *why);

ANLOS_END

#endif
