#include <errno.h>
#include <string.h>

#include "nodes/foxglove/convert.h"
#include "nodes/foxglove/image.h"
#include "nodes/foxglove/parts.h"

#define MAX_POINTS 100000u
#define N_FIELDS   4u

static const char *const names[N_FIELDS] = {"x", "y", "z", "intensity"};

/* Where a voxel really is. */
static void place(const struct image *image, size_t x, size_t y, size_t z, float out[3])
{
    const size_t index[3] = {x, y, z};
    double p[3];

    for (int a = 0; a < 3; a++)
        p[a] = image->grid.origin_m[a] + (double)index[a] * image->grid.step_m[a];
    if (image->has_wall)
        wall_mirror(&image->wall, p, p);
    for (int a = 0; a < 3; a++)
        out[a] = (float)p[a];
}

static size_t put_points(const struct image *image, float (*out)[N_FIELDS])
{
    const struct grid *g = &image->grid;
    const float *v = image->intensity;
    size_t n = 0;

    for (size_t z = 0; z < g->n[2]; z++) {
        for (size_t y = 0; y < g->n[1]; y++) {
            for (size_t x = 0; x < g->n[0]; x++, v++) {
                if (!(*v >= image->levels.threshold && *v <= image->levels.brightest))
                    continue;
                place(image, x, y, z, out[n]);
                out[n++][3] = level_db(&image->levels, *v, -(float)LEVEL_RANGE_DB);
            }
        }
    }
    return n;
}

int convert_cloud(struct arena *a, const struct setting *s,
                  const struct foxglove_message *m, ProtobufCMessage **out)
{
    static const double origin[3] = {0.0, 0.0, 0.0};
    Foxglove__PointCloud *cloud = arena_one(a, sizeof *cloud);
    struct image image;
    int err = image_open(&image, s, m, MAX_POINTS);

    if (err)
        return err;
    float(*points)[N_FIELDS] = arena_array(a, image.levels.n, sizeof *points);
    foxglove__point_cloud__init(cloud);
    cloud->timestamp = part_time(a, m->capture_ns ? m->capture_ns : m->publish_ns);
    cloud->frame_id = arena_print(a, FRAME_ARRAY);
    cloud->pose = part_pose(a, origin, NULL);
    cloud->point_stride = sizeof *points;
    cloud->fields = part_fields(a, names, N_FIELDS);
    cloud->n_fields = cloud->fields ? N_FIELDS : 0;
    if (points) {
        cloud->data.len = put_points(&image, points) * sizeof *points;
        cloud->data.data = (uint8_t *)points;
    }
    *out = &cloud->base;
    return a->failed ? -ENOMEM : 0;
}
