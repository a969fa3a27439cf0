#include "nodes/rt/export.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "nodes/rt/export_file.h"
#include "nodes/rt/export_plot.h"
#include "nodes/rt/export_projection.h"

#define RANGE_DB 25.0

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

static int write_png(const char *folder, const char *name, cairo_surface_t *surface,
                     struct complaint *why)
{
    struct export_file e;
    int err = export_file_open(&e, folder, name, why);
    if (err)
        return err;
    errno = 0;
    cairo_status_t status = cairo_surface_write_to_png_stream(surface, write_bytes, e.f);
    if (status == CAIRO_STATUS_NO_MEMORY)
        return export_file_abandon(&e, -ENOMEM, why);
    if (status != CAIRO_STATUS_SUCCESS)
        return export_file_abandon(&e, errno ? -errno : -EIO, why);
    return export_file_commit(&e, why);
}

int export_projection(const char *folder, size_t which, const struct grid *grid,
                      const float *intensity, const Anlos__DetectionList *detections,
                      struct complaint *why)
{
    const struct view *view = &views[which];
    struct projection p = {0};
    struct plot plot = {.title = view->title,
                        .label = {labels[view->across], labels[view->up]},
                        .amplitude = &p,
                        .range_db = RANGE_DB};
    struct plot_mark *marks = make_marks(detections, view, &plot.n_marks);
    cairo_surface_t *surface = NULL;
    int err = marks ? projection_create(&p, grid, intensity, view->across, view->up)
                    : -ENOMEM;
    if (!err) {
        for (size_t i = 0; i < p.n[0] * p.n[1]; i++) {
            p.value[i] = sqrtf(p.value[i]);
            plot.peak = fmax(plot.peak, (double)p.value[i]);
        }
        plot.marks = marks;
        surface = plot_draw(&plot);
        err = surface ? write_png(folder, view->file, surface, why) : -ENOMEM;
    }
    if (err == -ENOMEM)
        complain(why, err, "%s/%s: out of memory", folder, view->file);
    cairo_surface_destroy(surface);
    projection_clear(&p);
    free(marks);
    return err;
}

int export_projections(const char *folder, const struct grid *grid,
                       const float *intensity, const Anlos__DetectionList *detections,
                       struct complaint *why)
{
    for (size_t i = 0; i < EXPORT_PROJECTIONS; i++) {
        int err = export_projection(folder, i, grid, intensity, detections, why);
        if (err)
            return err;
    }
    return 0;
}
