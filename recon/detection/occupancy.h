/* SPDX-License-Identifier: MIT */
/* recon/detection/occupancy.h -- has something come?  Told ping by ping, before the image
 * of several pings shows it (track before detect).  Who comes from behind a corner is
 * heard by a few pairs of speakers and microphones first: by some pings of a round well,
 * by the others not at all, and in their sum hardly.
 *
 * Each block of the image may be occupied by something that is not there yet, comes, goes
 * about and goes.  The odds that it is follow from ping to ping by Bayes,
 *
 *   odds' = (moved odds * stays + comes) * likelihood ratio of what the ping shows,
 *
 * the statistic of Shiryaev (1963) and Roberts (1966) for a change at an unknown time, on
 * a grid on which what has come moves (Bruno and Moura 2001, "Multiframe
 * detector/tracker: optimal performance", IEEE Trans. AES-37).  Its mean over noise grows
 * no faster than what may come, whatever path is looked for, so that it is seldom wrong
 * as often as it says: where noise is as it is taken to be.
 *
 * Noise of a block is gamma distributed about the median of what is as far away, of a
 * shape that is learnt from the rarest five hundredth; what a background always leaves at
 * a place is learnt, too (dsp/cfar_map.h).  What has come is as noise of more power, by
 * 4, 12, 36, 108 or 324 times that (6 to 25 dB), and heard by two pings of five. */
#ifndef ANLOS_RECON_DETECTION_OCCUPANCY_H
#define ANLOS_RECON_DETECTION_OCCUPANCY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "recon/grid.h"
#include "recon/tracking/sidelobes.h"

struct occupancy;

/* The array about the origin of the grid's frame, of which the margin does not matter.
 * 0, -ENOMEM.  Free with occupancy_destroy. */
int occupancy_create(struct occupancy **out, const struct grid *blocks,
                     const struct sidelobe_array *array);

/* power [nz][ny][nx] of one ping, finite, >= 0 (0: not imaged); stamps in order: what is
 * not newer, or by more than a second, restarts.  A tenth of a millisecond for two
 * thousand blocks. */
void occupancy_step(struct occupancy *o, const float *power, int64_t stamp_ns);

/* What the newest ping shows is what is mostly there, but within held_m of these places
 * [n] of the grid's frame. */
void occupancy_learn(struct occupancy *o, const double (*held)[3], size_t n,
                     double held_m);

/* How probable it is, 0..1, that something is within reach_m of a place. */
double occupancy_near(const struct occupancy *o, const double at_m[3], double reach_m);

/* How bright it has been within reach_m of a place in the last LATELY_S, in the mean,
 * over how bright the pings of the last tenth of a second have it: who stood there may
 * leave no more than that of himself in a background, since he is as little of what that
 * is a mean of.  By what is around, which somebody bright raises, or less 5 dB as it is
 * heard: whichever is more.  0: never. */
#define OCCUPANCY_LATELY_S 10.0
double occupancy_lately(const struct occupancy *o, const double at_m[3], double reach_m);

struct occupancy_spot {
    double at_m[3]; /* the middle of its odds */
    double probability;
};

/* The likeliest places, at least apart_m from each other, each with what is within half
 * of that; the likeliest first.  Returns how many, up to max. */
size_t occupancy_spots(const struct occupancy *o, double probability, double apart_m,
                       struct occupancy_spot *out, size_t max);

/* Nobody is there; what was learnt of noise stays, what always is at a place does not. */
void occupancy_reset(struct occupancy *o);
void occupancy_destroy(struct occupancy *o);

#endif
