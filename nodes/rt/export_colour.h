/* SPDX-License-Identifier: MIT */
/* nodes/rt/export_colour.h -- a perceptual colour map, from black over purple and orange
 * to pale yellow: equal steps look equally large, in grey too. */
#ifndef ANLOS_NODES_RT_EXPORT_COLOUR_H
#define ANLOS_NODES_RT_EXPORT_COLOUR_H

#include <stddef.h>

/* t and rgb: 0..1; t outside is held inside.  A polynomial fit of "inferno" (S. van der
 * Walt and N. Smith 2015; fit by M. Zucker), both dedicated to the public. */
void colour_at(double t, double rgb[3]);

/* The intensity that is drawn brightest, 0 dB: the image's brightest, but 30 dB above its
 * median at least.  Noise, whose maximum is 10 to 13 dB above the median, so stays dark
 * where nothing else is.  The median is of what is imaged at all (above 0); where that is
 * less than half of intensity [n], there is none, 0.  noise: the median; may be NULL.
 * 0, -ENOMEM. */
int colour_full_scale(double *out, double *noise, const float *intensity, size_t n,
                      double brightest);

#endif
