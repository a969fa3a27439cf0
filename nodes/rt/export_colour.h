/* nodes/rt/export_colour.h -- a perceptual colour map, from black over purple and orange
 * to pale yellow: equal steps look equally large, in grey too. */
#ifndef ANLOS_NODES_RT_EXPORT_COLOUR_H
#define ANLOS_NODES_RT_EXPORT_COLOUR_H

/* t and rgb: 0..1; t outside is held inside.  A polynomial fit of "inferno" (S. van der
 * Walt and N. Smith 2015; fit by M. Zucker), both dedicated to the public. */
void colour_at(double t, double rgb[3]);

#endif
