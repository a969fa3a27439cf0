/* SPDX-License-Identifier: MIT */
/* nodes/rt/export_plot.h -- draws a projection as a picture with axes in metres, a colour
 * bar in dB and numbered crosses. */
#ifndef ANLOS_NODES_RT_EXPORT_PLOT_H
#define ANLOS_NODES_RT_EXPORT_PLOT_H

#include <cairo.h>

#include "nodes/rt/export_projection.h"

struct plot_mark {
    double across_m, up_m;
    unsigned number;
};

struct plot {
    const char *title;
    const char *label[2];               /* of the axes */
    const struct projection *amplitude; /* drawn as 20 log10(value / peak) */
    double peak;                        /* amplitude of 0 dB; 0: nothing is there */
    double range_db;                    /* drawn below the peak, > 0 */
    double fineness;                    /* 1: 760 pixels wide, or less; > 0 */
    const struct plot_mark *marks;      /* [n_marks] */
    size_t n_marks;
};

/* A new surface, as large as the picture needs; cairo_surface_destroy it.  NULL: no
 * memory. */
cairo_surface_t *plot_draw(const struct plot *plot);

#endif
