/* SPDX-License-Identifier: MIT */
/* recon/detection/plane.h -- a flat face that fills the view, such as a plate or a wall:
 * it mirrors the array, and is heard by each pair from its own place on the face.  An
 * image shows its speckle and its lobes as many objects; it is one, known by how its echo
 * arrives: the range of a midpoint m is D - n . m, without the bend that a point or a
 * corner has (recon/planning/scattering.h).  Fitted to the first strong arrival of every
 * trace, by consensus (RANSAC, Fischler and Bolles 1981) and then least squares. */
#ifndef ANLOS_RECON_DETECTION_PLANE_H
#define ANLOS_RECON_DETECTION_PLANE_H

#include "recon/detection/detect.h"
#include "recon/planning/trace_set.h"

struct plane {
    struct detection object; /* position_m the middle of what mirrors, extent_m its size,
                              * covariance_m2 within the plane that of anywhere on it,
                              * SHAPE_PLATE */
    double normal[3];        /* away from the array, length 1 */
    double pulse_s;          /* length of its echo, -6 dB */
    double lag_s;            /* from its arrival to its middle */
};

/* burst: the traces were not compressed, their time zero is the start of what was
 * emitted, and an echo arrives when it has risen to half; else at its maximum.  0;
 * -ERANGE: there is no plane, or the aperture is a line or too small to tell; -ENOMEM. */
int plane_fit(struct plane *out, const struct trace_set *set, bool burst);

/* traces, as the set's: muted where the plane's echo is. */
void plane_mute(const struct plane *plane, const struct trace_set *set,
                float complex *traces);

/* How far behind it p is, and whether its outline covers p. */
double plane_behind_m(const struct plane *plane, const double p[3]);
bool plane_covers(const struct plane *plane, const double p[3]);

#endif
