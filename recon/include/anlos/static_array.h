/* SPDX-License-Identifier: MIT */
/* anlos/static_array.h -- a static array's newest pings to an image for every round of
 * its speakers or every ping (a sliding aperture in time), from where the elements stood
 * when the vehicle moves.  What cannot have come from behind a wall is muted.
 *
 * One thread at a time; it works on as many as the configuration says. */
#ifndef ANLOS_STATIC_ARRAY_H
#define ANLOS_STATIC_ARRAY_H

#include <anlos/compressor.h>
#include <anlos/image.h>
#include <anlos/walls.h>

ANLOS_BEGIN

struct anlos_static_array; /* opaque */

/* Of the configuration: frame_pings, image_pings, every_ping, coherent, background,
 * threads, window and compression. */
ANLOS_API int anlos_static_array_create(struct anlos_static_array **out,
                                        const struct anlos_config *cfg,
                                        const struct anlos_survey *survey,
                                        struct anlos_error *why);
ANLOS_API void anlos_static_array_destroy(struct anlos_static_array *a);

/* As anlos_pipeline_ego; and the walls at a time, in the array's frame. */
ANLOS_API int anlos_static_array_ego(struct anlos_static_array *a, double speed_m_s,
                                     double yaw_rate_rad_s, int64_t capture_ns,
                                     struct anlos_error *why);
ANLOS_API int anlos_static_array_walls(struct anlos_static_array *a,
                                       const struct anlos_wall *walls, size_t n,
                                       int64_t capture_ns, struct anlos_error *why);

/* Returns 1 when an image is due, else 0. */
ANLOS_API int anlos_static_array_add(struct anlos_static_array *a,
                                     const struct anlos_traces *traces,
                                     struct anlos_error *why);

/* Of the newest pings; out->size is set, its intensity good until the next call.
 * ANLOS_NOT_READY: there are none. */
ANLOS_API int anlos_static_array_image(struct anlos_static_array *a,
                                       struct anlos_image *out, struct anlos_error *why);

ANLOS_END

#endif
