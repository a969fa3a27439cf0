/* SPDX-License-Identifier: MIT */
/* recon/planning/point_image.h -- the image that a survey will give of one point, before
 * anything is recorded: the echoes of all its pings, on a stage that does not stop with
 * every frequency from where its speaker and microphone are then, imaged by `fast`, or by
 * back-projection where the geometry does not suit it. */
#ifndef ANLOS_RECON_PLANNING_POINT_IMAGE_H
#define ANLOS_RECON_PLANNING_POINT_IMAGE_H

#include "dsp/error.h"
#include "recon/survey.h"

struct pool;

/* Widths of the point's image, across and in depth: what lies farther off is a sidelobe.
 */
#define POINT_LOBE  3.0
#define POINT_DEPTH 4.5

struct point_image {
    double beside_m[3]; /* where it is imaged less where it is */
    double width_m[3];  /* -6 dB */
    double sidelobe_db; /* the strongest, below the point */
    double traces;      /* how many equal ones would have as little noise */
};

/* at_m: array frame, as imaged.  The sidelobes are sought in the survey's volume, or in
 * the aperture grown by half a metre, to twice POINT_DEPTH before and behind the
 * point.  0, -EINVAL (the error says what is wrong with the place or the survey),
 * -ENOMEM. */
int point_image(struct point_image *out, const struct survey *s, const double at_m[3],
                struct pool *pool, struct error *why);

#endif
