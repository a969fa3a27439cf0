#include <errno.h>
#include <math.h>

#include "nodes/foxglove/convert.h"
#include "nodes/foxglove/image.h"
#include "nodes/foxglove/parts.h"

#define MAX_CELLS ((size_t)1 << 18)
#define LEAST_DB  (-40.0f)

struct cells {
    size_t n[3];    /* along x, y, z */
    size_t fold[3]; /* voxels in one */
    double size_m[3];
};

static size_t cells_count(const struct cells *c)
{
    return c->n[0] * c->n[1] * c->n[2];
}

/* Folds the axis with the shortest cells until there are few enough. */
static void cells_plan(struct cells *c, const struct grid *g)
{
    for (int a = 0; a < 3; a++) {
        c->n[a] = g->n[a];
        c->fold[a] = 1;
        c->size_m[a] = g->step_m[a];
    }
    while (cells_count(c) > MAX_CELLS) {
        int shortest = -1;
        for (int a = 0; a < 3; a++)
            if (c->n[a] > 1 && (shortest < 0 || c->size_m[a] < c->size_m[shortest]))
                shortest = a;
        c->fold[shortest]++;
        c->size_m[shortest] = (double)c->fold[shortest] * g->step_m[shortest];
        c->n[shortest] = (g->n[shortest] + c->fold[shortest] - 1) / c->fold[shortest];
    }
}

/* Maxima of `fold` values each, into those that out has. */
static void fold_row(const float *v, size_t n, size_t fold, float brightest, float *out)
{
    for (size_t x = 0; x < n; out++)
        for (size_t end = x + fold < n ? x + fold : n; x < end; x++)
            if (v[x] > *out && v[x] <= brightest)
                *out = v[x];
}

/* out [n[2]][n[1]][n[0]], zeroed, becomes maxima; mirrored: z falling. */
static void fold(const struct image *image, const struct cells *c, float *out)
{
    const struct grid *g = &image->grid;
    const float *v = image->intensity;

    for (size_t z = 0; z < g->n[2]; z++) {
        size_t slice = z / c->fold[2];
        if (image->has_wall)
            slice = c->n[2] - 1 - slice;
        for (size_t y = 0; y < g->n[1]; y++, v += g->n[0])
            fold_row(v, g->n[0], c->fold[0], image->levels.brightest,
                     out + (slice * c->n[1] + y / c->fold[1]) * c->n[0]);
    }
}

/* The corner that is least in all three of the box's own axes.  A mirrored box has axes
 * of the left hand; turning z around makes them those of a right one, and its corner is
 * the one that was farthest in z. */
static Foxglove__Pose *pose_of(struct arena *a, const struct image *image,
                               const struct cells *c)
{
    const struct grid *g = &image->grid;
    double corner[3], axes[3][3];

    for (int i = 0; i < 3; i++)
        corner[i] = g->origin_m[i] - 0.5 * g->step_m[i];
    if (!image->has_wall)
        return part_pose(a, corner, NULL);
    const struct wall around = {
        .normal = {image->wall.normal[0], image->wall.normal[1], image->wall.normal[2]}};
    for (int i = 0; i < 3; i++) {
        const double axis[3] = {i == 0, i == 1, i == 2 ? -1.0 : 0.0};
        wall_mirror(&around, axis, axes[i]);
    }
    corner[2] += (double)c->n[2] * c->size_m[2];
    wall_mirror(&image->wall, corner, corner);
    return part_pose(a, corner, (const double(*)[3])axes);
}

int convert_voxels(struct arena *a, const struct setting *s,
                   const struct foxglove_message *m, ProtobufCMessage **out)
{
    static const char *const name = "intensity";
    Foxglove__VoxelGrid *v = arena_one(a, sizeof *v);
    struct image image;
    struct cells c;
    int err = image_open(&image, s, m, 0);

    if (err)
        return err;
    cells_plan(&c, &image.grid);
    float *data = arena_array(a, cells_count(&c), sizeof *data);
    foxglove__voxel_grid__init(v);
    v->timestamp = part_time(a, m->capture_ns ? m->capture_ns : m->publish_ns);
    v->frame_id = arena_print(a, FRAME_ARRAY);
    v->pose = pose_of(a, &image, &c);
    v->column_count = (uint32_t)c.n[0];
    v->row_count = (uint32_t)c.n[1];
    v->cell_size = part_vector(a, c.size_m);
    v->cell_stride = sizeof *data;
    v->row_stride = (uint32_t)(c.n[0] * sizeof *data);
    v->slice_stride = (uint32_t)(c.n[1] * c.n[0] * sizeof *data);
    v->fields = part_fields(a, &name, 1);
    v->n_fields = v->fields ? 1 : 0;
    if (data) {
        fold(&image, &c, data);
        for (size_t i = 0; i < cells_count(&c); i++)
            data[i] = level_db(&image.levels, data[i], LEAST_DB);
        v->data = (ProtobufCBinaryData){cells_count(&c) * sizeof *data, (uint8_t *)data};
    }
    *out = &v->base;
    return a->failed ? -ENOMEM : 0;
}
