/* SPDX-License-Identifier: MIT */
/* anlos/pipeline.h -- all stages in one: pings to images, hidden objects and tracks.
 *
 * For each ping: which microphones are fit, pulse compression, background subtracted
 * (anlos's front end); a scan's traces to its image by one of the methods, or a static
 * array's newest pings to an image each round or each ping; objects in it, mirrored back
 * at the walls that are known, tracked where the array is static.  The same code, in the
 * same order, as the processes of anlos run: one recording gives the same objects here,
 * by `anlos recon --bag` and in a vehicle.
 *
 *   anlos_config_init(&cfg);
 *   anlos_pipeline_create(&p, &cfg, survey, &why);
 *   for each ping
 *       if ((news = anlos_pipeline_ping(p, &ping, &why)) < 0) ...
 *       else if (news & ANLOS_NEW_OBJECTS) ...
 *   anlos_pipeline_destroy(p);
 *
 * What is fed is copied or used up before a call returns.  What is asked for is copied,
 * but for an image's intensity.  One thread at a time; it works on as many as it was
 * created with. */
#ifndef ANLOS_PIPELINE_H
#define ANLOS_PIPELINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <anlos/config.h>
#include <anlos/error.h>
#include <anlos/image.h>
#include <anlos/objects.h>
#include <anlos/ping.h>
#include <anlos/survey.h>
#include <anlos/walls.h>

ANLOS_BEGIN

struct anlos_pipeline; /* opaque */

/* Checks both and plans; keeps neither.  survey may be NULL: anlos_pipeline_survey says
 * it later.  ANLOS_INVALID, ANLOS_UNSUPPORTED, ANLOS_NO_MEMORY, ANLOS_NO_THREADS,
 * ANLOS_CANCELED.  Some 0.1 s for the paper's scan. */
ANLOS_API int anlos_pipeline_create(struct anlos_pipeline **out,
                                    const struct anlos_config *cfg,
                                    const struct anlos_survey *survey,
                                    struct anlos_error *why);

/* Of NULL: nothing. */
ANLOS_API void anlos_pipeline_destroy(struct anlos_pipeline *p);

/* Another one from now on: what was heard is forgotten.  After an error none is known. */
ANLOS_API int anlos_pipeline_survey(struct anlos_pipeline *p,
                                    const struct anlos_survey *survey,
                                    struct anlos_error *why);

/* -- in ---------------------------------------------------------------------------------
 */

enum anlos_news { /* bits */
                  ANLOS_NEW_IMAGE = 1,
                  ANLOS_NEW_OBJECTS = 2, /* a list, which may be empty */
                  ANLOS_NEW_WALLS = 4,
                  ANLOS_NEW_NOTE =
                      8 /* something that a person should know: anlos_pipeline_note */
};

/* Returns news, or ANLOS_INVALID (a ping of another survey or shape), ANLOS_NOT_READY (no
 * survey, or no background of this ping was recorded), ANLOS_STALE (its image is older
 * than the one before), ANLOS_CANCELED (its image was stopped; the ping is in, and
 * anlos_pipeline_finish images again). */
ANLOS_API int anlos_pipeline_ping(struct anlos_pipeline *p, const struct anlos_ping *ping,
                                  struct anlos_error *why);

/* A scan has ended: one that lacks pings gets its image, of those that are in.  News. */
ANLOS_API int anlos_pipeline_finish(struct anlos_pipeline *p, struct anlos_error *why);

/* How the vehicle moves at a time: speed of its origin forward, yaw rate to the left.
 * From the first of these on silence means that it is not known. */
ANLOS_API int anlos_pipeline_ego(struct anlos_pipeline *p, double speed_m_s,
                                 double yaw_rate_rad_s, int64_t capture_ns,
                                 struct anlos_error *why);

/* Of the air around; of use where none is measured with a ping. */
ANLOS_API int anlos_pipeline_air(struct anlos_pipeline *p, double temperature_c,
                                 struct anlos_error *why);

/* All the walls [n <= 8] that are known at a time; none: n = 0.  In the array's frame, in
 * the order of being sure; with ANLOS_WALLS_GIVEN in the vehicle's.  ANLOS_INVALID also
 * where they are heard.  News. */
ANLOS_API int anlos_pipeline_walls(struct anlos_pipeline *p,
                                   const struct anlos_wall *walls, size_t n,
                                   int64_t capture_ns, struct anlos_error *why);

/* -- out --------------------------------------------------------------------------------
 */

/* out->size is set.  The newest image; its intensity is good until the next ping.
 * ANLOS_NOT_READY: there is none yet. */
ANLOS_API int anlos_pipeline_image(const struct anlos_pipeline *p,
                                   struct anlos_image *out, struct anlos_error *why);

/* The newest list: detections of a scan, tracks of a static array.  ANLOS_NOT_READY. */
ANLOS_API int anlos_pipeline_list(const struct anlos_pipeline *p, struct anlos_list *out,
                                  struct anlos_error *why);

/* Number i of it, out->size set.  ANLOS_INVALID: there are not so many. */
ANLOS_API int anlos_pipeline_object(const struct anlos_pipeline *p, size_t i,
                                    struct anlos_object *out, struct anlos_error *why);

/* Of the list's areas number i, out->size set.  ANLOS_INVALID: there are not so many. */
ANLOS_API int anlos_pipeline_area(const struct anlos_pipeline *p, size_t i,
                                  struct anlos_area *out, struct anlos_error *why);

/* How many walls images and tracks go by, and each of them in the array's frame, the
 * surest first. */
ANLOS_API size_t anlos_pipeline_n_walls(const struct anlos_pipeline *p);
ANLOS_API int anlos_pipeline_wall(const struct anlos_pipeline *p, size_t i,
                                  struct anlos_wall *out, struct anlos_error *why);

/* The newest note; "" when there is none. */
ANLOS_API const char *anlos_pipeline_note(const struct anlos_pipeline *p);

/* Counts since it was created. */
struct anlos_health {
    size_t size;      /* sizeof(struct anlos_health) */
    uint64_t pings;   /* that were used */
    uint64_t refused; /* that were not: an error was returned */
    uint64_t blanked; /* that a sound from outside drowned */
    uint64_t unfit;   /* whose traces did not fit the image */
    uint64_t images, lists, wall_lists;
    uint64_t late_images; /* older than the one before: not tracked */
    uint64_t crowded;     /* objects for which there was no room */
    uint64_t clipped_samples, not_finite_samples;
    size_t microphones;              /* of the newest ping, */
    size_t silent, damaged, clipped; /* and so many of them are */
    double sound_speed_m_s;          /* that is worked with; 0: no survey */
};
ANLOS_API int anlos_pipeline_health(const struct anlos_pipeline *p,
                                    struct anlos_health *out, struct anlos_error *why);

ANLOS_END

#endif
