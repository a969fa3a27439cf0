/* SPDX-License-Identifier: MIT */
/* recon/frontend/displacement.h -- has a speaker or a microphone been moved since the
 * array was started, or since it was surveyed?  By when the direct sound of each speaker
 * comes to each microphone, against when it came at first; and at first, once, against
 * when it should come by the survey.
 *
 * What all pairs share is none of it: time zero, the speed of sound, and wind, which
 * carries sound along and against it.  What is left of an element's pairs has to be what
 * one displacement does to all their paths, by the paths' lengths themselves and not only
 * by their slopes: what moves across a line that all speakers stand along makes its paths
 * longer, wherever it goes.  Elements are taken one by one, the one that explains most
 * first, and all fitted again together (least squares with Huber's weights, Levenberg
 * 1944).  Where displacements to several sides fit as well, what they do not share is not
 * told: how far across is, and not to which side.
 *
 * An element is told as moved when at least LEAST_M and six standard deviations say so,
 * its pairs agree, and that in each of CONFIRM rounds of all speakers one after the
 * other, each with the median of the last RING arrivals of each pair; as back in its
 * place the same way.  What was moved before the start is told from 1.5 cm on, and where
 * it is five times as far as paths of the others are off: places that were measured by
 * hand are what they are, and finer is what `anlos calibrate array` is for.
 *
 * Where it stands now is found by the wall's echo, too, if one was heard before
 * (recon/frontend/echo_shift.h): paths over the wall go across the line.  It is placed
 * when the rounds of CONFIRM agree to PLACED_M, and what is not told then changes no path
 * that is heard.  For who was moved before the start the paths over the wall are those of
 * the survey, too, and so it is placed only among others that stand where the survey has
 * them, to a millimetre or so.
 *
 * Errors and allocations are create's alone.  A round of 16 x 16 pairs costs some 50 us
 * while nothing has moved, and ten times that for each element that has. */
#ifndef ANLOS_RECON_FRONTEND_DISPLACEMENT_H
#define ANLOS_RECON_FRONTEND_DISPLACEMENT_H

#include <stdbool.h>
#include <stddef.h>

#include "recon/survey.h"
#include "recon/walls/wall.h"

#define DISPLACEMENT_RING     5
#define DISPLACEMENT_FIRST    8 /* arrivals of a pair that its reference is made of */
#define DISPLACEMENT_CONFIRM  5
#define DISPLACEMENT_LEAST_M  3e-3
#define DISPLACEMENT_PLACED_M 1.5e-3

struct displacement_of { /* of one element, in the array frame */
    bool moved;
    bool placed;     /* by_m is all that has to be known for images */
    bool at_start;   /* before the start: from where the survey has it */
    double by_m[3];  /* as far as it is told; 0 along an axis of which it is not */
    double across_m; /* how far along what is not told; 0: all is */
    double size_m;   /* of all of it */
    double sigma_m;  /* of the size, one standard deviation; of what goes across, with
                        5 mm for where the element stood before */
};

struct displacement;

/* Copies what it needs.  0, -ENOMEM. */
int displacement_create(struct displacement **out, const struct survey *s);

/* The wall whose echoes come from now on, in the array frame; NULL: none is known. */
void displacement_wall(struct displacement *d, const struct wall_gate *wall);

/* A ping: delays of the direct sound and of the wall's echo, [n_microphones], NaN: not
 * heard well.  echo_s may be NULL: none. */
void displacement_take(struct displacement *d, size_t speaker, const double *delay_s,
                       const double *echo_s);

/* The same array's elements stand where this survey has them, from now on: who moved to
 * there has not moved any more. */
void displacement_stand(struct displacement *d, const struct survey *s);

const struct displacement_of *displacement_speaker(const struct displacement *d,
                                                   size_t speaker);
const struct displacement_of *displacement_microphone(const struct displacement *d,
                                                      size_t microphone);
void displacement_destroy(struct displacement *d);

#endif
