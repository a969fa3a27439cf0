/* SPDX-License-Identifier: MIT */
#include "nodes/rt/export_mark.h"

#include <math.h>

#define LINE 2.6
#define DOT  4.6
#define RING 7.5
#define SIDE 8.0 /* of a square; the others look as large */

/* Okabe and Ito's, told apart by everybody, the pale ones left out. */
static const double colours[CHART_COLOURS][3] = {
    {0.00, 0.45, 0.70}, {0.84, 0.37, 0.00}, {0.00, 0.62, 0.45}, {0.80, 0.47, 0.65},
    {0.34, 0.71, 0.91}, {0.90, 0.62, 0.00}, {0.25, 0.25, 0.28}};

void mark_style(cairo_t *cr, const struct chart_series *s)
{
    const double *rgb = colours[s->colour % CHART_COLOURS];
    const double dashes[2] = {8.0, 6.0};
    cairo_set_source_rgb(cr, rgb[0], rgb[1], rgb[2]);
    cairo_set_line_width(cr, s->style == CHART_DASHED ? 0.75 * LINE : LINE);
    cairo_set_dash(cr, dashes, s->style == CHART_DASHED ? 2 : 0, 0.0);
}

/* A regular polygon; turn: of its first corner, in quarters of a turn. */
static void draw_polygon(cairo_t *cr, double x, double y, double radius, int corners,
                         double turn)
{
    cairo_new_sub_path(cr); /* not on from where text ended */
    for (int i = 0; i < corners; i++) {
        double angle = 0.5 * M_PI * turn + 2.0 * M_PI * i / corners;
        cairo_line_to(cr, x + radius * cos(angle), y + radius * sin(angle));
    }
    cairo_close_path(cr);
    cairo_fill(cr);
}

static void draw_cross(cairo_t *cr, double x, double y)
{
    for (int i = -1; i <= 1; i += 2) {
        cairo_move_to(cr, x - 0.55 * SIDE, y - 0.55 * i * SIDE);
        cairo_line_to(cr, x + 0.55 * SIDE, y + 0.55 * i * SIDE);
    }
    cairo_stroke(cr);
}

bool mark_draw(cairo_t *cr, const struct chart_series *s, double x, double y)
{
    switch (s->style) {
    case CHART_LINE:
    case CHART_DASHED:
        return false;
    case CHART_POINTS:
        cairo_new_sub_path(cr);
        cairo_arc(cr, x, y, DOT, 0.0, 2.0 * M_PI);
        cairo_fill(cr);
        return true;
    case CHART_RINGS:
        cairo_new_sub_path(cr);
        cairo_arc(cr, x, y, RING, 0.0, 2.0 * M_PI);
        cairo_stroke(cr);
        return true;
    case CHART_SQUARES:
        draw_polygon(cr, x, y, SIDE * M_SQRT1_2, 4, 0.5);
        return true;
    case CHART_TRIANGLES:
        draw_polygon(cr, x, y, 0.75 * SIDE, 3, -1.0);
        return true;
    case CHART_DIAMONDS:
        draw_polygon(cr, x, y, 0.75 * SIDE, 4, 0.0);
        return true;
    case CHART_CROSSES:
        draw_cross(cr, x, y);
        return true;
    }
    return false;
}
