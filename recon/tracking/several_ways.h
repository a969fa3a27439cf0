/* SPDX-License-Identifier: MIT */
/* recon/tracking/several_ways.h -- one body that is heard in several ways.  By way of
 * each of several walls it has an image where it is one body, and two more that are none:
 * out by way of one wall and back by way of another, an echo comes from where the wall
 * that it comes back by shows the body, at the mean of both ranges.  (One speaker sounds
 * at a time, so that the microphones tell the direction.)  They are as bright as the mean
 * of both images in dB, brighter than the fainter one, and walk along.
 *
 * Who has come out to where the array sees him itself is heard straight there and back by
 * way of a wall, too: in the direction of his image, nearer by half of what the wall
 * makes longer, and some dB fainter or louder, for the way is shorter and the array sees
 * another side of him.  (Back straight it comes from before the wall, where nothing
 * hidden is.)
 *
 * And where two walls meet, an image by way of the one is seen past its edge, as if the
 * other stood before it: by that other it would be of somebody elsewhere. */
#ifndef ANLOS_RECON_TRACKING_SEVERAL_WAYS_H
#define ANLOS_RECON_TRACKING_SEVERAL_WAYS_H

#include "recon/detection/objects.h"
#include "recon/tracking/sight.h"

struct several_ways {
    const struct sight *sight;
    size_t n_walls;
    struct track_mirror mirrors[TRACK_MIRRORS];
    double half_m; /* from the array's middle to its ends, along x */
    double far_m;  /* what is heard ends there */
    size_t n;
    struct several_ways_body { /* that is known */
        double level_db;
        size_t wall;               /* by which it is known */
        bool shown[TRACK_MIRRORS]; /* by a wall: before it, between its ends, in its gate
                                    */
        double virtual_m[TRACK_MIRRORS][3];
        double straight_m[3]; /* itself, array frame */
        unsigned track;       /* its id; 0: of this image */
    } bodies[TRACKS_MAX + OBJECTS_MAX];
};

/* Borrows sight. */
void several_ways_init(struct several_ways *s, const struct sight *sight,
                       const struct survey *survey);

/* All places of the array frame, out[max], at which somebody at a place of the vehicle
 * frame is imaged: first by his own mirror, then by the walls that are known.  Returns
 * how many. */
size_t several_ways_images(const struct several_ways *s, const double at_m[3],
                           const struct track_mirror *own, double (*out)[3], size_t max);

/* Who is known to be at a place of the vehicle frame, imaged by way of a wall: he, whose
 * track the caller may say.  NULL, and not taken, where it is rather an echo by two walls
 * of one that is known already and as bright. */
struct several_ways_body *several_ways_know(struct several_ways *s, const double at_m[3],
                                            uint32_t wall, double level_db);

/* By way of which wall somebody is imaged there, array frame: its id; that of `wall`,
 * which stands before it (0: none does), unless it is of one who is known by another.
 * Or nobody is: out by one way and back by another, or, of two walls, where what is heard
 * ends, by the sidelobes of one who is beyond. */
#define SEVERAL_WAYS_NOBODY UINT32_MAX
uint32_t several_ways_show(const struct several_ways *s, const double virtual_m[3],
                           uint32_t wall, double level_db);

/* Whose echo is imaged there, array frame, straight there and back by way of a wall, and
 * how far he is from the array by it.  NULL: of nobody who is known, and straight_m stays
 * as it was. */
const struct several_ways_body *several_ways_see(const struct several_ways *s,
                                                 const double virtual_m[3],
                                                 double level_db, double *straight_m);

#endif
