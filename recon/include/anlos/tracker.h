/* SPDX-License-Identifier: MIT */
/* anlos/tracker.h -- image after image to objects that stay: detected, predicted,
 * assigned, confirmed and ended (IPDA: Musicki, Evans and Stankovic 1994), placed by the
 * walls that are known, over ground as the vehicle moves.
 *
 * One thread at a time. */
#ifndef ANLOS_TRACKER_H
#define ANLOS_TRACKER_H

#include <anlos/detector.h>

ANLOS_BEGIN

struct anlos_tracker; /* opaque */

/* Of the configuration: all that it says of objects, and lost_s. */
ANLOS_API int anlos_tracker_create(struct anlos_tracker **out,
                                   const struct anlos_config *cfg,
                                   const struct anlos_survey *survey,
                                   struct anlos_error *why);
ANLOS_API void anlos_tracker_destroy(struct anlos_tracker *t);

/* As anlos_pipeline_ego; and the walls at a time, in the array's frame. */
ANLOS_API int anlos_tracker_ego(struct anlos_tracker *t, double speed_m_s,
                                double yaw_rate_rad_s, int64_t capture_ns,
                                struct anlos_error *why);
ANLOS_API int anlos_tracker_walls(struct anlos_tracker *t, const struct anlos_wall *walls,
                                  size_t n, int64_t capture_ns, struct anlos_error *why);

/* At its stamp.  ANLOS_STALE: not newer than the one before. */
ANLOS_API int anlos_tracker_image(struct anlos_tracker *t,
                                  const struct anlos_image *image,
                                  struct anlos_error *why);

/* As anlos_pipeline_list, anlos_pipeline_object and anlos_pipeline_area. */
ANLOS_API int anlos_tracker_list(const struct anlos_tracker *t, struct anlos_list *out,
                                 struct anlos_error *why);
ANLOS_API int anlos_tracker_object(const struct anlos_tracker *t, size_t i,
                                   struct anlos_object *out, struct anlos_error *why);
ANLOS_API int anlos_tracker_area(const struct anlos_tracker *t, size_t i,
                                 struct anlos_area *out, struct anlos_error *why);

ANLOS_END

#endif
