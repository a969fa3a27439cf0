/* SPDX-License-Identifier: MIT */
/* recon/detection/shape.h -- what a bright place looks like: a point, a plate (long along
 * one or two directions and as thin as a point across), or extended in all directions. */
#ifndef ANLOS_RECON_DETECTION_SHAPE_H
#define ANLOS_RECON_DETECTION_SHAPE_H

enum shape { SHAPE_UNKNOWN, SHAPE_POINT, SHAPE_PLATE, SHAPE_EXTENDED };

struct shape_guess {
    enum shape shape;
    double probability; /* 0..1, of this one among the three */
};

/* variance_m2 (xx xy xz yy yz zz): of the intensity of what is within 6 dB of the peak.
 * resolution_m: -6 dB widths of a point's image; an axis whose width is not a positive
 * number, or along which the image has one voxel (variance 0), does not count.  Fewer
 * than two axes: unknown. */
struct shape_guess shape_guess(const double variance_m2[6], const double resolution_m[3]);

#endif
