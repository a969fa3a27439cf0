/* SPDX-License-Identifier: MIT */
/* anlos/detector.h -- an image to the hidden objects in it, where they really are: local
 * maxima above the noise, by a threshold or by the cells around them (CFAR, Rohling
 * 1983), mirrored back at the walls.  Each list stands for itself; anlos/tracker.h
 * follows them.
 *
 * One thread at a time. */
#ifndef ANLOS_DETECTOR_H
#define ANLOS_DETECTOR_H

#include <anlos/config.h>
#include <anlos/image.h>
#include <anlos/objects.h>
#include <anlos/survey.h>
#include <anlos/walls.h>

ANLOS_BEGIN

struct anlos_detector; /* opaque */

/* Of the configuration: threshold_db, min_existence, false_alarm_rate. */
ANLOS_API int anlos_detector_create(struct anlos_detector **out,
                                    const struct anlos_config *cfg,
                                    const struct anlos_survey *survey,
                                    struct anlos_error *why);
ANLOS_API void anlos_detector_destroy(struct anlos_detector *d);

/* walls [n] in the array's frame; NULL: the survey's.  Intensities are finite, >= 0. */
ANLOS_API int anlos_detector_image(struct anlos_detector *d,
                                   const struct anlos_image *image,
                                   const struct anlos_wall *walls, size_t n,
                                   struct anlos_error *why);

/* As anlos_pipeline_list, anlos_pipeline_object and anlos_pipeline_area. */
ANLOS_API int anlos_detector_list(const struct anlos_detector *d, struct anlos_list *out,
                                  struct anlos_error *why);
ANLOS_API int anlos_detector_object(const struct anlos_detector *d, size_t i,
                                    struct anlos_object *out, struct anlos_error *why);
ANLOS_API int anlos_detector_area(const struct anlos_detector *d, size_t i,
                                  struct anlos_area *out, struct anlos_error *why);

ANLOS_END

#endif
