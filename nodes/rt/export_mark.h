/* SPDX-License-Identifier: MIT */
/* nodes/rt/export_mark.h -- the colours, lines and marks of a chart's series, on the page
 * as in the legend. */
#ifndef ANLOS_NODES_RT_EXPORT_MARK_H
#define ANLOS_NODES_RT_EXPORT_MARK_H

#include <cairo.h>

#include "nodes/rt/export_chart.h"

/* Sets colour, width and dashes of a series. */
void mark_style(cairo_t *cr, const struct chart_series *s);

/* Draws its mark at a place of the page.  false: it is a line and has none. */
bool mark_draw(cairo_t *cr, const struct chart_series *s, double x, double y);

#endif
