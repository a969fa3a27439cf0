/* SPDX-License-Identifier: MIT */
/* recon/detection/multipath.h -- which objects of an image are echoes of others by two
 * bounces or more.  Imaging takes each echo for one that came straight back; one that
 * went from the array to P, on to B and home is imaged half its way off, in the mean of
 * both directions, and is as sharp and as bright as an object.
 *
 * Seen from the middle of the aperture a place has a range R and a direction u (its unit
 * vector).  Echoes whose speaker and microphone are much nearer to each other than to the
 * scene are imaged at
 *
 *   two bounces, P to B or back      (R_P + R_B + |PB|) / 2     (u_P + u_B) / 2
 *   P by way of a flat face, once    (R_P + R_M) / 2            (u_P + u_M) / 2
 *     and both ways: the mirror image, M
 *   P, B and P again                 R_P + |PB|                 u_P
 *   P and something unseen           beyond R_P                 u_P
 *   P by way of level ground, once or both ways: as a flat face, at some height
 *   P by way of the wall that mirrors    (R_P + R_Q) / 2        (u_P + u_Q) / 2
 *     it, and straight, through or around what hides it; Q: where P really is
 *
 * all of them beyond what makes them, but for the last.  That a place agrees with one of
 * these by chance is as likely as the agreement is close: existence becomes the posterior
 * probability of an object anywhere in the image against all these.  What is behind a
 * body is in its shadow, too. */
#ifndef ANLOS_RECON_DETECTION_MULTIPATH_H
#define ANLOS_RECON_DETECTION_MULTIPATH_H

#include <stddef.h>

#include "recon/detection/detect.h"
#include "recon/geometry.h"
#include "recon/grid.h"
#include "recon/walls/wall.h"

struct multipath_config {
    double centre_m[3]; /* of the aperture, array frame */
    double lowest_m;    /* y of the lowest pair: the ground is below */
    double volume_m3;   /* of the image */
    size_t n_plain; /* so many, the first, are held against each other only: the rest are
                     * far fainter (recon/detection/clean); 0: all are held against all */
    const struct wall *walls; /* [n_walls] that mirror it; NULL: none */
    size_t n_walls;
};

/* From geometry and grid; without walls. */
void multipath_config_fill(struct multipath_config *cfg, const struct geometry *geometry,
                           const struct grid *grid);

#define MULTIPATH_MAX 64 /* objects; more are left as they are */

/* found [n]: as detect_objects leaves them.  Lowers existence, and sets multipath of
 * those that are rather echoes of others than objects; of[] are places in found. */
void multipath_judge(const struct multipath_config *cfg, struct detection *found,
                     size_t n);

#endif
