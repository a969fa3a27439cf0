/* SPDX-License-Identifier: MIT */
#include "nodes/rt/export_chart.h"

#include <cairo-svg.h>
#include <cairo.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "nodes/rt/export.h"
#include "nodes/rt/export_ink.h"

/* In units of the SVG; the PNG is drawn finer. */
#define FINENESS   1.5
#define WIDTH      760.0
#define HEIGHT     520.0
#define LEFT       88.0
#define RIGHT      28.0
#define TOP        58.0
#define BOTTOM     74.0
#define TEXT       17.0
#define TITLE_TEXT 21.0
#define ROW        25.0  /* of the legend */
#define SAMPLE     34.0  /* its piece of line */
#define BESIDE     250.0 /* the axes, for a legend there */

#define LINE 2.6
#define DOT  4.6
#define RING 7.5
#define SIDE 8.0 /* of a square; the others look as large */

/* Okabe and Ito's, told apart by everybody, the pale ones left out. */
static const double colours[CHART_COLOURS][3] = {
    {0.00, 0.45, 0.70}, {0.84, 0.37, 0.00}, {0.00, 0.62, 0.45}, {0.80, 0.47, 0.65},
    {0.34, 0.71, 0.91}, {0.90, 0.62, 0.00}, {0.25, 0.25, 0.28}};

/* Sets colour, width and dashes of a series. */
static void mark_style(cairo_t *cr, const struct chart_series *s)
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

/* Draws its mark at a place of the page.  false: it is a line and has none. */
static bool mark_draw(cairo_t *cr, const struct chart_series *s, double x, double y)
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

/* 0..1 along an axis; NaN for what a logarithmic axis cannot show. */
static double place(const struct chart *c, int axis, double value)
{
    double min = c->min[axis], max = c->max[axis];
    if (!c->logarithmic[axis])
        return (value - min) / (max - min);
    return value > 0.0 ? log(value / min) / log(max / min) : NAN;
}

static double across(double t)
{
    return LEFT + t * (WIDTH - LEFT - RIGHT);
}

static double up(double t)
{
    return HEIGHT - BOTTOM - t * (HEIGHT - TOP - BOTTOM);
}

static void draw_tick(cairo_t *cr, const struct chart *c, int axis, double value,
                      const char *text)
{
    double t = place(c, axis, value);
    if (!(t > -1e-9 && t < 1.0 + 1e-9))
        return;
    double x = axis ? LEFT : across(t), y = axis ? up(t) : HEIGHT - BOTTOM;
    cairo_set_source_rgb(cr, 0.89, 0.89, 0.91);
    cairo_set_line_width(cr, 1.0);
    cairo_move_to(cr, x, y);
    cairo_line_to(cr, axis ? WIDTH - RIGHT : x, axis ? y : TOP);
    cairo_stroke(cr);
    cairo_set_source_rgb(cr, 0.15, 0.15, 0.18);
    if (text && axis)
        ink_text(cr, x - 9.0, y, TEXT, INK_RIGHT, text);
    else if (text)
        ink_text(cr, x, y + 18.0, TEXT, INK_CENTRE, text);
}

static void draw_linear_ticks(cairo_t *cr, const struct chart *c, int axis)
{
    double step = ink_tick_step(c->max[axis] - c->min[axis], axis ? 6.0 : 8.0);
    int digits = ink_digits(step);
    for (double i = ceil(c->min[axis] / step - 1e-9);
         i * step <= c->max[axis] + 1e-9 * step; i += 1.0) {
        char text[32];
        snprintf(text, sizeof text, "%.*f", digits, i * step + 0.0);
        draw_tick(cr, c, axis, i * step, text);
    }
}

/* Every 1..9 of a decade has its line; over few decades 1, 2 and 5 have numbers, over
 * more only the 1. */
static void draw_log_ticks(cairo_t *cr, const struct chart *c, int axis)
{
    double decades = log10(c->max[axis] / c->min[axis]);
    for (int e = (int)floor(log10(c->min[axis])); pow(10.0, e) <= c->max[axis]; e++) {
        for (int i = 1; i <= 9; i++) {
            double value = i * pow(10.0, e);
            char text[32];
            snprintf(text, sizeof text, "%.6g", value);
            bool numbered = i == 1 || (decades < 2.5 && (i == 2 || i == 5)) ||
                            (decades < 0.9);
            if (numbered || decades < 4.0)
                draw_tick(cr, c, axis, value, numbered ? text : NULL);
        }
    }
}

static void draw_axes(cairo_t *cr, const struct chart *c)
{
    for (int axis = 0; axis < 2; axis++) {
        if (c->logarithmic[axis])
            draw_log_ticks(cr, c, axis);
        else
            draw_linear_ticks(cr, c, axis);
    }
    cairo_set_source_rgb(cr, 0.15, 0.15, 0.18);
    cairo_set_line_width(cr, 1.5);
    cairo_rectangle(cr, LEFT, TOP, WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM);
    cairo_stroke(cr);
    ink_text(cr, across(0.5), HEIGHT - 22.0, TEXT, INK_CENTRE, c->label[0]);
    cairo_save(cr);
    cairo_translate(cr, 24.0, up(0.5));
    cairo_rotate(cr, -M_PI / 2.0);
    ink_text(cr, 0.0, 0.0, TEXT, INK_CENTRE, c->label[1]);
    cairo_restore(cr);
}

static void draw_series(cairo_t *cr, const struct chart *c, const struct chart_series *s)
{
    bool drawing = false;
    cairo_save(cr);
    cairo_rectangle(cr, LEFT, TOP, WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM);
    cairo_clip(cr);
    mark_style(cr, s);
    for (size_t i = 0; i < s->n; i++) {
        double x = across(place(c, 0, s->x[i])), y = up(place(c, 1, s->y[i]));
        if (!isfinite(x) || !isfinite(y)) {
            drawing = false;
            continue;
        }
        /* Far outside cairo's fixed point overflows; the clip hides it anyway. */
        x = fmin(fmax(x, -1e4), 1e4);
        y = fmin(fmax(y, -1e4), 1e4);
        if (mark_draw(cr, s, x, y))
            continue;
        if (drawing)
            cairo_line_to(cr, x, y);
        else
            cairo_move_to(cr, x, y);
        drawing = true;
    }
    cairo_stroke(cr);
    cairo_restore(cr);
}

static void draw_legend(cairo_t *cr, const struct chart *c)
{
    double widest = 0.0, row = TOP + 22.0;
    cairo_text_extents_t e;
    size_t n = 0;
    cairo_set_font_size(cr, TEXT);
    for (size_t i = 0; i < c->n_series; i++) {
        if (!c->series[i].name)
            continue;
        cairo_text_extents(cr, c->series[i].name, &e);
        widest = fmax(widest, e.x_advance);
        n++;
    }
    if (!n)
        return;
    double x = c->legend_beside  ? WIDTH - RIGHT + 20.0
               : c->legend_right ? WIDTH - RIGHT - widest - SAMPLE - 26.0
                                 : LEFT + 16.0;
    cairo_set_source_rgba(cr, 1.0, 1.0, 1.0, 0.9);
    cairo_rectangle(cr, x - 8.0, TOP + 6.0, widest + SAMPLE + 26.0,
                    ROW * (double)n + 8.0);
    cairo_fill(cr);
    for (size_t i = 0; i < c->n_series; i++) {
        const struct chart_series *s = &c->series[i];
        if (!s->name)
            continue;
        cairo_save(cr);
        mark_style(cr, s);
        if (!mark_draw(cr, s, x + 0.5 * SAMPLE, row)) {
            cairo_move_to(cr, x, row);
            cairo_rel_line_to(cr, SAMPLE, 0.0);
            cairo_stroke(cr);
        }
        cairo_restore(cr);
        cairo_set_source_rgb(cr, 0.15, 0.15, 0.18);
        ink_text(cr, x + SAMPLE + 10.0, row, TEXT, INK_LEFT, s->name);
        row += ROW;
    }
}

static double page_width(const struct chart *c)
{
    return c->legend_beside ? WIDTH + BESIDE : WIDTH;
}

static cairo_status_t draw(cairo_surface_t *surface, const struct chart *c,
                           double fineness)
{
    cairo_t *cr = cairo_create(surface);
    cairo_scale(cr, fineness, fineness);
    cairo_set_source_rgb(cr, 1.0, 1.0, 1.0);
    cairo_paint(cr);
    cairo_set_line_join(cr, CAIRO_LINE_JOIN_ROUND);
    cairo_select_font_face(cr, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
                           CAIRO_FONT_WEIGHT_NORMAL);
    draw_axes(cr, c);
    for (size_t i = 0; i < c->n_series; i++)
        draw_series(cr, c, &c->series[i]);
    draw_legend(cr, c);
    cairo_select_font_face(cr, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
                           CAIRO_FONT_WEIGHT_BOLD);
    cairo_set_source_rgb(cr, 0.15, 0.15, 0.18);
    ink_text(cr, across(0.5), TOP - 27.0, TITLE_TEXT, INK_CENTRE, c->title);
    cairo_status_t status = cairo_status(cr);
    cairo_destroy(cr);
    return status;
}

static cairo_status_t write_svg(FILE *f, const struct chart *c)
{
    cairo_surface_t *s =
        cairo_svg_surface_create_for_stream(ink_write, f, page_width(c), HEIGHT);
    cairo_status_t status = draw(s, c, 1.0);
    cairo_surface_finish(s);
    if (status == CAIRO_STATUS_SUCCESS)
        status = cairo_surface_status(s);
    cairo_surface_destroy(s);
    return status;
}

static cairo_status_t write_png(FILE *f, const struct chart *c)
{
    cairo_surface_t *s = cairo_image_surface_create(
        CAIRO_FORMAT_RGB24, (int)(FINENESS * page_width(c)), (int)(FINENESS * HEIGHT));
    cairo_status_t status = draw(s, c, FINENESS);
    if (status == CAIRO_STATUS_SUCCESS)
        status = cairo_surface_write_to_png_stream(s, ink_write, f);
    cairo_surface_destroy(s);
    return status;
}

int export_chart(const char *folder, const char *name, const struct chart *chart,
                 struct error *why)
{
    for (int a = 0; a < 2; a++)
        if (!(chart->max[a] > chart->min[a]) || !isfinite(chart->max[a]) ||
            !isfinite(chart->min[a]) || (chart->logarithmic[a] && !(chart->min[a] > 0.0)))
            return error_say(why, -EINVAL, "%s/%s: the axis %s is empty: %g to %g",
                             folder, name, chart->label[a], chart->min[a], chart->max[a]);
    for (int kind = 0; kind < 2; kind++) {
        struct export_file e;
        char file[128];
        snprintf(file, sizeof file, "%s.%s", name, kind ? "png" : "svg");
        int err = export_file_open(&e, folder, file, why);
        if (err)
            return err;
        errno = 0;
        cairo_status_t status = kind ? write_png(e.f, chart) : write_svg(e.f, chart);
        if (status != CAIRO_STATUS_SUCCESS)
            return export_file_abandon(&e,
                                       status == CAIRO_STATUS_NO_MEMORY ? -ENOMEM
                                       : errno                          ? -errno
                                                                        : -EIO,
                                       why);
        err = export_file_commit(&e, why);
        if (err)
            return err;
    }
    return 0;
}
