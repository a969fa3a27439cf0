/* SPDX-License-Identifier: MIT */
/* nodes/array/places.h -- an element that was knocked stands where it is heard to stand.
 */
#ifndef ANLOS_NODES_ARRAY_PLACES_H
#define ANLOS_NODES_ARRAY_PLACES_H

#include "dsp/error.h"
#include "msgs/health.pb-c.h"
#include "recon/survey.h"

/* Moves it in the survey, of the same array as the measured one.  0, or -EINVAL with an
 * error (no such element, no number, more than SURVEY_SAME_M from its measured place):
 * the survey is as it was then. */
int places_correct(struct survey *s, const struct survey *measured,
                   const Anlos__MovedElement *m, struct error *why);

#endif
