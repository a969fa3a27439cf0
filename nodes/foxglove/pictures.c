#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "foxglove/image.pb-c.h"
#include "nodes/foxglove/convert.h"
#include "nodes/foxglove/parts.h"
#include "nodes/rt/export.h"
#include "nodes/rt/volume_grid.h"

/* A picture is of the image as it is: it needs no survey. */
static int convert(struct arena *a, size_t which, const char *frame,
                   const struct foxglove_message *m, ProtobufCMessage **out)
{
    Foxglove__CompressedImage *c = arena_one(a, sizeof *c);
    struct grid grid;
    const float *intensity = volume_grid((const Anlos__Volume *)m->content, &grid);
    uint8_t *png = NULL;
    size_t size = 0;

    if (!intensity)
        return -EINVAL;
    if (export_projection_png(which, &grid, intensity, NULL, &png, &size))
        return -ENOMEM;
    foxglove__compressed_image__init(c);
    c->timestamp = part_time(a, m->capture_ns ? m->capture_ns : m->publish_ns);
    c->frame_id = arena_print(a, "%s", frame);
    c->format = arena_print(a, "png");
    c->data.data = arena_array(a, size, 1);
    if (c->data.data)
        memcpy(c->data.data, png, c->data.len = size);
    free(png);
    *out = &c->base;
    return a->failed ? -ENOMEM : 0;
}

int convert_front(struct arena *a, const struct setting *s,
                  const struct foxglove_message *m, ProtobufCMessage **out)
{
    (void)s;
    return convert(a, 0, "front", m, out);
}

int convert_top(struct arena *a, const struct setting *s,
                const struct foxglove_message *m, ProtobufCMessage **out)
{
    (void)s;
    return convert(a, 1, "top", m, out);
}

int convert_side(struct arena *a, const struct setting *s,
                 const struct foxglove_message *m, ProtobufCMessage **out)
{
    (void)s;
    return convert(a, 2, "side", m, out);
}
