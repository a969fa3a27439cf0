/* SPDX-License-Identifier: MIT */
/* hal/survey/element_places.h -- where the speakers and microphones of an array really
 * stand, from when they hear each other: straight, and by way of planes whose pose nobody
 * knows.
 *
 * All is found together, as photogrammetry adjusts its bundles (Triggs, McLauchlan,
 * Hartley and Fitzgibbon 2000): places, planes, time zero of all and of each channel, and
 * the speed of sound, least squares by Levenberg and Marquardt (MINPACK's lmstr: Moré,
 * Garbow and Hillstrom 1980) with each arrival weighted by Tukey's biweight.  What is
 * known before, of each number, takes part as a measurement: what the arrivals do not
 * tell stays where it was, with the uncertainty that it had, and needs no rank to be
 * found.
 *
 * What they cannot tell, whatever is heard, is where the array stands as a whole: moved
 * and turned, it hears the same.  How it is turned about its own line, the planes say, as
 * far as it is known how they stand: walls upright for a level line; for an upright one
 * a stage along which they are heard from both ends.  A column's arrivals along itself do
 * not tell what is across it; a plane tells what is along its normal.  Two planes that
 * look at the column from different sides, or one heard from the ends of a stage and one
 * that is turned, tell all. */
#ifndef ANLOS_HAL_SURVEY_ELEMENT_PLACES_H
#define ANLOS_HAL_SURVEY_ELEMENT_PLACES_H

#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"

#define ELEMENT_PLACES_STRAIGHT UINT32_MAX
#define ELEMENT_PLACES_PLANES   16  /* at most */
#define ELEMENT_PLACES_MOST     256 /* speakers and microphones together */

struct element_arrival {
    uint32_t speaker, microphone;
    uint32_t plane;      /* that mirrored it, or ELEMENT_PLACES_STRAIGHT */
    double carried_m[3]; /* by the stage, as the planes see it */
    double arrival_s;    /* from the nominal emission on */
};

struct element_plane { /* { p : normal . p = distance_m }, normal of length 1 */
    double normal[3], distance_m;
};

struct element_places_config {
    size_t n_speakers, n_microphones;
    const double (*speakers_m)[3], (*microphones_m)[3]; /* as they were measured */
    double placed_sigma_m;                              /* and how well, each axis */
    double sound_speed_m_s, sound_speed_sigma_m_s;
    double latency_s; /* where to begin */
    /* What each speaker and microphone may delay sound by beside all others, as its curve
     * does; above 0. */
    double channel_sigma_s;
    size_t n_planes;
    const struct element_plane *planes; /* where to begin: to some centimetres */
    double lean_sigma_rad;              /* how well it is known how they lean (y is up) */
};

struct element_places {
    size_t n_speakers, n_microphones, n_planes;
    double (*elements_m)[3]; /* [n_speakers + n_microphones], speakers first */
    /* One standard deviation each axis, of the array's shape: without what it could be
     * moved and turned as a whole, but about its longest axis, about which a column has
     * its elements' offsets alone.  As large as placed_sigma_m: not told. */
    double (*sigma_m)[3];
    double sound_speed_m_s, sound_speed_sigma_m_s;
    double latency_s, latency_sigma_s;
    double *channel_s; /* [n_speakers + n_microphones]: delay beside all others */
    struct element_plane planes[ELEMENT_PLACES_PLANES];
    double before_rms_m; /* of the paths of what is used, with the places as they were */
    double rms_m;        /* of the same with those found */
    size_t n_used;       /* arrivals that agree */
};

/* element_places_clear it.  Whether the arrivals are an array's at all, rms_m says.  0,
 * -EINVAL (numbers out of range, more elements than stated above), -ENODATA (no arrival),
 * -ENOMEM. */
int element_places_fit(struct element_places *out,
                       const struct element_places_config *cfg,
                       const struct element_arrival *arrivals, size_t n,
                       struct error *why);
void element_places_clear(struct element_places *p);

/* Takes out of change [n][3] what moving elements [n][3] as a whole explains, and turning
 * them about any axis across their longest one (x, y or z), by least squares.  0,
 * -ENOMEM. */
int element_places_shape(size_t n, const double (*elements_m)[3], double (*change)[3]);

#endif
