/* SPDX-License-Identifier: MIT */
/* nodes/rt/export_chart.h -- lines and points over two axes, linear or logarithmic, as
 * SVG and PNG. */
#ifndef ANLOS_NODES_RT_EXPORT_CHART_H
#define ANLOS_NODES_RT_EXPORT_CHART_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"

enum chart_style {
    CHART_LINE,
    CHART_DASHED,
    CHART_POINTS,
    CHART_RINGS,
    CHART_SQUARES,
    CHART_TRIANGLES,
    CHART_DIAMONDS,
    CHART_CROSSES,
};

struct chart_series {
    const char *name;    /* in the legend; NULL: not there */
    const double *x, *y; /* [n]; what is not finite, or not above 0 on a logarithmic
                          * axis, is left out */
    size_t n;
    enum chart_style style;
    int colour; /* 0..CHART_COLOURS-1, then around again */
};

#define CHART_COLOURS 7

struct chart {
    const char *title;
    const char *label[2];
    bool logarithmic[2];
    double min[2], max[2];             /* of the axes */
    const struct chart_series *series; /* [n_series], later ones over earlier ones */
    size_t n_series;
    bool legend_right;  /* in the upper right corner, not the left one */
    bool legend_beside; /* the axes, on a wider page */
};

/* Writes FOLDER/NAME.svg and FOLDER/NAME.png.  0, -EINVAL (empty axes), -ENOMEM, other
 * negative errno. */
int export_chart(const char *folder, const char *name, const struct chart *chart,
                 struct error *why);

#endif
