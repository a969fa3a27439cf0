/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cairo.h>

#include "dsp/rank.h"
#include "nodes/rt/export_ink.h"
#include "nodes/rt/export_projection.h"

/* -- the maximum along an axis ------------------------------------------------------- */

static float greater(float a, float b)
{
    return a > b ? a : b;
}

/* out[x * stride] = the greater of it and row[x]; strides 0 and 1 are what volumes of
 * hundreds of MB are projected with, and vector code can do those. */
static void fold_row(const float *restrict row, size_t n, float *restrict out,
                     size_t stride)
{
    if (stride == 1) {
        for (size_t x = 0; x < n; x++)
            out[x] = greater(row[x], out[x]);
    } else if (stride == 0) {
        float lane[8] = {0.0f}, most = *out;
        size_t x = 0;
        for (; x + 8 <= n; x += 8)
            for (size_t k = 0; k < 8; k++)
                lane[k] = greater(row[x + k], lane[k]);
        for (; x < n; x++)
            most = greater(row[x], most);
        for (size_t k = 0; k < 8; k++)
            most = greater(lane[k], most);
        *out = most;
    } else {
        for (size_t x = 0; x < n; x++)
            out[x * stride] = greater(row[x], out[x * stride]);
    }
}

int projection_create(struct projection *out, const struct grid *grid,
                      const float *volume, int across, int up)
{
    const int axis[2] = {across, up};
    size_t stride[3] = {0}; /* of the volume's axes in the picture */

    memset(out, 0, sizeof *out);
    for (int i = 0; i < 2; i++) {
        out->axis[i] = axis[i];
        out->n[i] = grid->n[axis[i]];
        out->origin_m[i] = grid->origin_m[axis[i]];
        out->step_m[i] = grid->step_m[axis[i]];
    }
    stride[across] = 1;
    stride[up] = out->n[0];
    out->value = calloc(out->n[0] * out->n[1], sizeof *out->value);
    if (!out->value)
        return -ENOMEM;
    for (size_t z = 0; z < grid->n[2]; z++) {
        for (size_t y = 0; y < grid->n[1]; y++) {
            const float *row = volume + (z * grid->n[1] + y) * grid->n[0];
            fold_row(row, grid->n[0], out->value + z * stride[2] + y * stride[1],
                     stride[0]);
        }
    }
    return 0;
}

/* Where a pixel's centre lies among the samples of an axis. */
struct taps {
    size_t index[4]; /* held inside */
    float weight[4]; /* Catmull-Rom */
};

static struct taps *taps_create(size_t n_samples, size_t n_pixels)
{
    struct taps *all = malloc(n_pixels * sizeof *all);
    double last = (double)n_samples - 1.0;
    for (size_t k = 0; all && k < n_pixels; k++) {
        double at = ((double)k + 0.5) * (double)n_samples / (double)n_pixels - 0.5;
        at = fmin(fmax(at, 0.0), last);
        double t = at - floor(at);
        const double w[4] = {
            t * (-0.5 + t * (1.0 - 0.5 * t)),
            1.0 + t * t * (1.5 * t - 2.5),
            t * (0.5 + t * (2.0 - 1.5 * t)),
            t * t * (0.5 * t - 0.5),
        };
        for (int i = 0; i < 4; i++) {
            all[k].index[i] = (size_t)fmin(fmax(floor(at) - 1.0 + i, 0.0), last);
            all[k].weight[i] = (float)w[i];
        }
    }
    return all;
}

static void widen_row(const float *row, const struct taps *taps, size_t w, float *out)
{
    for (size_t c = 0; c < w; c++) {
        const struct taps *t = &taps[c];
        out[c] = t->weight[0] * row[t->index[0]] + t->weight[1] * row[t->index[1]] +
                 t->weight[2] * row[t->index[2]] + t->weight[3] * row[t->index[3]];
    }
}

int projection_resample(const struct projection *p, size_t w, size_t h, float *out)
{
    struct taps *across = taps_create(p->n[0], w), *up = taps_create(p->n[1], h);
    float *wide = malloc(p->n[1] * w * sizeof *wide); /* [n[1]][w] */
    int err = across && up && wide ? 0 : -ENOMEM;

    for (size_t r = 0; !err && r < p->n[1]; r++)
        widen_row(p->value + r * p->n[0], across, w, wide + r * w);
    for (size_t r = 0; !err && r < h; r++) {
        const struct taps *t = &up[h - 1 - r];
        const float *in[4];
        for (int i = 0; i < 4; i++)
            in[i] = wide + t->index[i] * w;
        for (size_t c = 0; c < w; c++) {
            float v = t->weight[0] * in[0][c] + t->weight[1] * in[1][c] +
                      t->weight[2] * in[2][c] + t->weight[3] * in[3][c];
            out[r * w + c] = v > 0.0f ? v : 0.0f;
        }
    }
    free(wide);
    free(up);
    free(across);
    return err;
}

/* The outer edges of the samples' cells. */
static void projection_edges(const struct projection *p, int axis, double *min,
                             double *max)
{
    *min = p->origin_m[axis] - 0.5 * p->step_m[axis];
    *max = *min + (double)p->n[axis] * p->step_m[axis];
}

void projection_clear(struct projection *p)
{
    free(p->value);
    memset(p, 0, sizeof *p);
}

/* -- colours ------------------------------------------------------------------------- */

#define STANDS_OUT_DB 30.0
#define MOST_SAMPLES  65536 /* that a median is of */

static const double inferno[7][3] = {
    {0.0002189403691192265, 0.001651004631001012, -0.01948089843709184},
    {0.1065134194856116, 0.5639564367884091, 3.932712388889277},
    {11.60249308247187, -3.972853965665698, -15.9423941062914},
    {-41.70399613139459, 17.43639888205313, 44.35414519872813},
    {77.162935699427, -33.40235894210092, -81.80730925738993},
    {-71.31942824499214, 32.62606426397723, 73.20951985803202},
    {25.13112622477341, -12.24266895238567, -23.07032500287172},
};

void colour_at(double t, double rgb[3])
{
    t = fmin(fmax(t, 0.0), 1.0);
    for (int c = 0; c < 3; c++) {
        double v = 0.0;
        for (int k = 6; k >= 0; k--)
            v = v * t + inferno[k][c];
        rgb[c] = fmin(fmax(v, 0.0), 1.0);
    }
}

int colour_full_scale(double *out, double *noise, const float *intensity, size_t n,
                      double brightest)
{
    size_t step = n / MOST_SAMPLES + 1, taken = 0, kept = 0;
    float *list = malloc((n / step + 1) * sizeof *list);

    if (!list)
        return -ENOMEM;
    for (size_t i = 0; i < n; i += step, taken++)
        if (intensity[i] > 0.0f && isfinite(intensity[i]))
            list[kept++] = intensity[i];
    double median = 2 * kept > taken ? (double)rank_smallest(list, kept, kept / 2 + 1)
                                     : 0.0;
    free(list);
    if (noise)
        *noise = median;
    *out = fmax(brightest, median * pow(10.0, 0.1 * STANDS_OUT_DB));
    return 0;
}

/* -- the picture --------------------------------------------------------------------- */

#define RANGE_DB       25.0
#define FILE_FINENESS  1.5 /* sharp on any screen */
#define SHOWN_FINENESS 1.0 /* drawn again and again while a scan goes on */

struct view {
    const char *file, *title;
    int across, up;
};

static const struct view views[EXPORT_PROJECTIONS] = {
    {"projection_xy.png", "Front view, maximum over z", 0, 1},
    {"projection_xz.png", "Top view, maximum over y", 0, 2},
    {"projection_yz.png", "Side view, maximum over x", 2, 1},
};

static const char *const labels[3] = {"x (m)", "y (m)", "z (m)"};

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

/* In units of a picture about 760 wide. */
#define LEFT       88.0
#define RIGHT      122.0
#define TOP        58.0
#define BOTTOM     74.0
#define WIDEST     550.0
#define HIGHEST    600.0
#define NARROWEST  280.0
#define LEAST      90.0 /* of an image of one plane: room for numbers and label */
#define BAR_GAP    22.0
#define BAR_WIDTH  20.0
#define TEXT       19.0
#define TITLE_TEXT 23.0

struct page {          /* where the image lies, and how metres become units */
    double x, y, w, h; /* y: top */
    double min_m[2], max_m[2];
    double width, height;
    double bar_x;
};

static void lay_out(struct page *page, const struct plot *plot)
{
    for (int a = 0; a < 2; a++)
        projection_edges(plot->amplitude, a, &page->min_m[a], &page->max_m[a]);
    double w_m = page->max_m[0] - page->min_m[0], h_m = page->max_m[1] - page->min_m[1];
    double scale = fmin(WIDEST / w_m, HIGHEST / h_m);
    page->w = fmax(round(scale * w_m), LEAST);
    page->h = fmax(round(scale * h_m), LEAST);
    double room = fmax(page->w, NARROWEST);
    page->x = LEFT + round(0.5 * (room - page->w));
    page->y = TOP;
    page->width = LEFT + room + RIGHT;
    page->height = TOP + page->h + BOTTOM;
    page->bar_x = page->x + page->w + BAR_GAP;
}

static double page_across(const struct page *p, double m)
{
    return p->x + p->w * (m - p->min_m[0]) / (p->max_m[0] - p->min_m[0]);
}

static double page_up(const struct page *p, double m)
{
    return p->y + p->h * (p->max_m[1] - m) / (p->max_m[1] - p->min_m[1]);
}

static uint32_t pixel(double t)
{
    double rgb[3];
    colour_at(t, rgb);
    return 0xff000000u | (uint32_t)lrint(255.0 * rgb[0]) << 16 |
           (uint32_t)lrint(255.0 * rgb[1]) << 8 | (uint32_t)lrint(255.0 * rgb[2]);
}

/* The map in steps that the eye does not see: cheaper than a polynomial a pixel. */
#define SHADES 512

static void paint_pixels(const struct plot *plot, const float *amplitude,
                         cairo_surface_t *image)
{
    int w = cairo_image_surface_get_width(image),
        h = cairo_image_surface_get_height(image);
    size_t stride = (size_t)cairo_image_surface_get_stride(image);
    uint8_t *data = cairo_image_surface_get_data(image);
    uint32_t shade[SHADES];

    for (int i = 0; i < SHADES; i++)
        shade[i] = pixel((double)i / (SHADES - 1));
    float per_peak = plot->peak > 0.0 ? (float)(1.0 / plot->peak) : 0.0f;
    float per_decade = (float)(20.0 / plot->range_db);
    for (int r = 0; r < h; r++) {
        uint32_t *row = (uint32_t *)(void *)(data + (size_t)r * stride);
        for (int c = 0; c < w; c++) {
            float a =
                fmaxf(amplitude[(size_t)r * (size_t)w + (size_t)c] * per_peak, 1e-9f);
            float t = fminf(fmaxf(1.0f + per_decade * log10f(a), 0.0f), 1.0f);
            row[c] = shade[(int)(t * (SHADES - 1) + 0.5f)];
        }
    }
}

static int draw_image(cairo_t *cr, const struct plot *plot, const struct page *page)
{
    int w = (int)fmax(lrint(plot->fineness * page->w), 1.0);
    int h = (int)fmax(lrint(plot->fineness * page->h), 1.0);
    float *amplitude = malloc((size_t)w * (size_t)h * sizeof *amplitude);
    cairo_surface_t *image = cairo_image_surface_create(CAIRO_FORMAT_RGB24, w, h);
    int err = amplitude && cairo_surface_status(image) == CAIRO_STATUS_SUCCESS ? 0
                                                                               : -ENOMEM;
    if (!err)
        err = projection_resample(plot->amplitude, (size_t)w, (size_t)h, amplitude);
    if (!err) {
        cairo_surface_flush(image);
        paint_pixels(plot, amplitude, image);
        cairo_surface_mark_dirty(image);
        cairo_save(cr);
        cairo_translate(cr, page->x, page->y);
        cairo_scale(cr, page->w / w, page->h / h);
        cairo_set_source_surface(cr, image, 0.0, 0.0);
        cairo_pattern_set_filter(cairo_get_source(cr), CAIRO_FILTER_NEAREST);
        cairo_paint(cr);
        cairo_restore(cr);
    }
    cairo_surface_destroy(image);
    free(amplitude);
    return err;
}

static void draw_axis(cairo_t *cr, const struct plot *plot, const struct page *p,
                      int axis)
{
    double min = p->min_m[axis], max = p->max_m[axis];
    double step = ink_tick_step(max - min, fmax((axis ? p->h : p->w) / 75.0, 2.0));
    int digits = ink_digits(step);

    for (double i = ceil(min / step - 1e-9); i * step <= max + 1e-9 * step; i += 1.0) {
        char text[32];
        double at = axis ? page_up(p, i * step) : page_across(p, i * step);
        snprintf(text, sizeof text, "%.*f", digits, i * step + 0.0);
        cairo_set_source_rgba(cr, 1.0, 1.0, 1.0, 0.13);
        cairo_set_line_width(cr, 1.0);
        cairo_move_to(cr, axis ? p->x : at, axis ? at : p->y);
        cairo_line_to(cr, axis ? p->x + p->w : at, axis ? at : p->y + p->h);
        cairo_stroke(cr);
        cairo_set_source_rgb(cr, 0.15, 0.15, 0.18);
        cairo_set_line_width(cr, 1.5);
        cairo_move_to(cr, axis ? p->x : at, axis ? at : p->y + p->h);
        cairo_rel_line_to(cr, axis ? -6.0 : 0.0, axis ? 0.0 : 6.0);
        cairo_stroke(cr);
        if (axis)
            ink_text(cr, p->x - 11.0, at, TEXT, INK_RIGHT, text);
        else
            ink_text(cr, at, p->y + p->h + 20.0, TEXT, INK_CENTRE, text);
    }

    cairo_save(cr);
    if (axis) {
        cairo_translate(cr, p->x - LEFT + 20.0, p->y + 0.5 * p->h);
        cairo_rotate(cr, -M_PI / 2.0);
        ink_text(cr, 0.0, 0.0, TEXT, INK_CENTRE, plot->label[axis]);
    } else {
        ink_text(cr, p->x + 0.5 * p->w, p->y + p->h + 52.0, TEXT, INK_CENTRE,
                 plot->label[axis]);
    }
    cairo_restore(cr);
}

static void draw_frame(cairo_t *cr, double x, double y, double w, double h)
{
    cairo_set_source_rgb(cr, 0.15, 0.15, 0.18);
    cairo_set_line_width(cr, 1.5);
    cairo_rectangle(cr, x, y, w, h);
    cairo_stroke(cr);
}

static void draw_bar(cairo_t *cr, const struct plot *plot, const struct page *p)
{
    cairo_pattern_t *shades = cairo_pattern_create_linear(0.0, p->y + p->h, 0.0, p->y);
    for (int i = 0; i <= 64; i++) {
        double rgb[3];
        colour_at(i / 64.0, rgb);
        cairo_pattern_add_color_stop_rgb(shades, i / 64.0, rgb[0], rgb[1], rgb[2]);
    }
    cairo_rectangle(cr, p->bar_x, p->y, BAR_WIDTH, p->h);
    cairo_set_source(cr, shades);
    cairo_fill(cr);
    cairo_pattern_destroy(shades);
    draw_frame(cr, p->bar_x, p->y, BAR_WIDTH, p->h);

    double step = p->h / plot->range_db > 9.0 ? 5.0 : 10.0;
    for (double db = 0.0; db <= plot->range_db + 1e-9; db += step) {
        char text[32];
        double y = p->y + p->h * db / plot->range_db;
        snprintf(text, sizeof text, db > 0.0 ? "\xe2\x88\x92%.0f" : "%.0f dB", db);
        cairo_move_to(cr, p->bar_x + BAR_WIDTH, y);
        cairo_rel_line_to(cr, 6.0, 0.0);
        cairo_stroke(cr);
        ink_text(cr, p->bar_x + BAR_WIDTH + 11.0, y, TEXT, INK_LEFT, text);
    }
}

static void trace_cross(cairo_t *cr, double x, double y)
{
    static const double direction[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    for (int i = 0; i < 4; i++) {
        cairo_move_to(cr, x + 6.0 * direction[i][0], y + 6.0 * direction[i][1]);
        cairo_rel_line_to(cr, 9.0 * direction[i][0], 9.0 * direction[i][1]);
    }
}

/* Drawn twice, wide and dark below narrow and bright: seen on every colour of the map. */
static void draw_mark(cairo_t *cr, const struct page *p, const struct plot_mark *m)
{
    double x = page_across(p, m->across_m), y = page_up(p, m->up_m);
    char text[16];
    cairo_text_extents_t e;

    if (!(x >= p->x && x <= p->x + p->w && y >= p->y && y <= p->y + p->h))
        return;
    snprintf(text, sizeof text, "%u", m->number);
    cairo_set_font_size(cr, TEXT);
    cairo_text_extents(cr, text, &e);
    double text_x = x + 9.0 + e.x_advance < p->x + p->w ? x + 9.0 : x - 9.0 - e.x_advance;
    double text_y = y - 9.0 - e.height > p->y ? y - 9.0 : y + 9.0 + e.height;
    for (int pass = 0; pass < 2; pass++) {
        if (pass)
            cairo_set_source_rgb(cr, 0.45, 0.95, 1.0);
        else
            cairo_set_source_rgba(cr, 0.0, 0.0, 0.0, 0.85);
        trace_cross(cr, x, y);
        cairo_set_line_width(cr, pass ? 2.2 : 5.0);
        cairo_stroke(cr);
        cairo_move_to(cr, text_x, text_y);
        cairo_text_path(cr, text);
        if (pass) {
            cairo_fill(cr);
        } else {
            cairo_set_line_width(cr, 4.0);
            cairo_stroke(cr);
        }
    }
}

/* A new surface, as large as the picture needs; cairo_surface_destroy it.  NULL: no
 * memory. */
static cairo_surface_t *plot_draw(const struct plot *plot)
{
    struct page page;
    lay_out(&page, plot);
    cairo_surface_t *surface = cairo_image_surface_create(
        CAIRO_FORMAT_RGB24, (int)lrint(plot->fineness * page.width),
        (int)lrint(plot->fineness * page.height));
    cairo_t *cr = cairo_create(surface);

    cairo_scale(cr, plot->fineness, plot->fineness);
    cairo_set_source_rgb(cr, 1.0, 1.0, 1.0);
    cairo_paint(cr);
    int err = draw_image(cr, plot, &page);
    cairo_select_font_face(cr, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
                           CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_line_join(cr, CAIRO_LINE_JOIN_ROUND);
    draw_axis(cr, plot, &page, 0);
    draw_axis(cr, plot, &page, 1);
    draw_frame(cr, page.x, page.y, page.w, page.h);
    draw_bar(cr, plot, &page);
    cairo_select_font_face(cr, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
                           CAIRO_FONT_WEIGHT_BOLD);
    ink_text(cr, 0.5 * (page.x + page.bar_x + BAR_WIDTH), page.y - 27.0, TITLE_TEXT,
             INK_CENTRE, plot->title);
    for (size_t i = 0; i < plot->n_marks; i++)
        draw_mark(cr, &page, &plot->marks[i]);

    if (cairo_status(cr) != CAIRO_STATUS_SUCCESS)
        err = -ENOMEM;
    cairo_destroy(cr);
    cairo_surface_flush(surface);
    if (!err)
        return surface;
    cairo_surface_destroy(surface);
    return NULL;
}

static double component(const Anlos__Vec3 *v, int axis)
{
    return axis == 0 ? v->x : axis == 1 ? v->y : v->z;
}

static struct plot_mark *make_marks(const Anlos__DetectionList *list,
                                    const struct view *view, size_t *n)
{
    size_t all = list ? list->n_detections : 0;
    struct plot_mark *marks = calloc(all ? all : 1, sizeof *marks);
    *n = 0;
    for (size_t i = 0; marks && i < all; i++) {
        const Anlos__Detection *d = list->detections[i];
        if (!d->virtual_m)
            continue;
        marks[(*n)++] = (struct plot_mark){component(d->virtual_m, view->across),
                                           component(d->virtual_m, view->up), d->id};
    }
    return marks;
}

/* NULL: no memory. */
static cairo_surface_t *draw(const struct view *view, double fineness,
                             const struct grid *grid, const float *intensity,
                             const Anlos__DetectionList *detections)
{
    struct projection p = {0};
    struct plot plot = {.title = view->title,
                        .label = {labels[view->across], labels[view->up]},
                        .amplitude = &p,
                        .range_db = RANGE_DB,
                        .fineness = fineness};
    struct plot_mark *marks = make_marks(detections, view, &plot.n_marks);
    cairo_surface_t *surface = NULL;

    if (marks && !projection_create(&p, grid, intensity, view->across, view->up)) {
        for (size_t i = 0; i < p.n[0] * p.n[1]; i++) {
            p.value[i] = sqrtf(p.value[i]);
            plot.peak = fmax(plot.peak, (double)p.value[i]);
        }
        double full, brightest = plot.peak * plot.peak;
        plot.marks = marks;
        if (!colour_full_scale(&full, NULL, intensity, grid_size(grid), brightest)) {
            plot.peak = sqrt(full);
            surface = plot_draw(&plot);
        }
    }
    projection_clear(&p);
    free(marks);
    return surface;
}

int export_projection(const char *folder, size_t which, const struct grid *grid,
                      const float *intensity, const Anlos__DetectionList *detections,
                      struct error *why)
{
    const struct view *view = &views[which];
    cairo_surface_t *surface = draw(view, FILE_FINENESS, grid, intensity, detections);
    int err = surface ? ink_png(folder, view->file, surface, why) : -ENOMEM;

    if (err == -ENOMEM)
        error_say(why, err, "%s/%s: out of memory", folder, view->file);
    cairo_surface_destroy(surface);
    return err;
}

int export_projection_png(size_t which, const struct grid *grid, const float *intensity,
                          const Anlos__DetectionList *detections, uint8_t **png,
                          size_t *size)
{
    cairo_surface_t *surface =
        draw(&views[which], SHOWN_FINENESS, grid, intensity, detections);
    char *data = NULL;
    FILE *f = open_memstream(&data, size);
    bool failed = !f || !surface ||
                  cairo_surface_write_to_png_stream(surface, ink_write, f) !=
                      CAIRO_STATUS_SUCCESS;

    if (f)
        failed = fclose(f) || !data || failed; /* glibc may lose it and say nothing */
    cairo_surface_destroy(surface);
    if (failed)
        free(data);
    else
        *png = (uint8_t *)data;
    return failed ? -ENOMEM : 0;
}

int export_projections(const char *folder, const struct grid *grid,
                       const float *intensity, const Anlos__DetectionList *detections,
                       struct error *why)
{
    for (size_t i = 0; i < EXPORT_PROJECTIONS; i++) {
        int err = export_projection(folder, i, grid, intensity, detections, why);
        if (err)
            return err;
    }
    return 0;
}
