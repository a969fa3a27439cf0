/* SPDX-License-Identifier: MIT */
#include "nodes/rt/export.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "nodes/rt/export_colour.h"
#include "nodes/rt/export_ink.h"
#include "nodes/rt/export_plot.h"
#include "nodes/rt/export_projection.h"

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

static cairo_status_t write_bytes(void *to, const unsigned char *data, unsigned size)
{
    return fwrite(data, 1, size, to) == size ? CAIRO_STATUS_SUCCESS
                                             : CAIRO_STATUS_WRITE_ERROR;
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
                  cairo_surface_write_to_png_stream(surface, write_bytes, f) !=
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
