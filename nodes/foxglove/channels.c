/* SPDX-License-Identifier: MIT */
#include "nodes/foxglove/channels.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/bag/schemas.h"
#include "msgs/foxglove/schema_table.h"

static const struct view {
    const char *name, *schema, *sources[CHANNEL_MAX_SOURCES];
    foxglove_convert convert;
} views[] = {
    {CHANNEL_VIEW "cloud", "foxglove.PointCloud", {"volume"}, convert_cloud},
    {CHANNEL_VIEW "voxels", "foxglove.VoxelGrid", {"volume"}, convert_voxels},
    {CHANNEL_VIEW "front", "foxglove.CompressedImage", {"volume"}, convert_front},
    {CHANNEL_VIEW "top", "foxglove.CompressedImage", {"volume"}, convert_top},
    {CHANNEL_VIEW "side", "foxglove.CompressedImage", {"volume"}, convert_side},
    {CHANNEL_VIEW "objects", "foxglove.SceneUpdate", {"detections"}, convert_objects},
    {CHANNEL_VIEW "scene", "foxglove.SceneUpdate", {"survey"}, convert_scene},
    {CHANNEL_VIEW "walls", "foxglove.SceneUpdate", {"wall"}, convert_walls},
    {CHANNEL_VIEW "frames",
     "foxglove.FrameTransforms",
     {"survey", "stage/state"},
     convert_transforms},
    {CHANNEL_VIEW "figures", "anlos.Figures", {"detections"}, convert_figures},
    {CHANNEL_VIEW "log", "foxglove.Log", {"log"}, convert_log},
};

#define N_VIEWS (sizeof views / sizeof *views)

static size_t count_topics(void)
{
    size_t n = 0;

    while (topics_all()[n].name)
        n++;
    return n;
}

size_t channels_count(void)
{
    return count_topics() + N_VIEWS;
}

static struct bag_schema schema_of(const char *name)
{
    struct bag_schema out = {.name = bytes_of(name), .encoding = bytes_of(BAG_PROTOBUF)};

    for (const struct bag_schema_entry *e = foxglove_schema_table; e->name; e++)
        if (!strcmp(e->name, name))
            out.data = (struct bytes){e->data, e->size};
    return out;
}

void channel_get(size_t index, struct channel *out)
{
    size_t n = count_topics();

    if (index < n) {
        const struct topic *t = &topics_all()[index];
        *out = (struct channel){t->name, bag_schema_of(t), {t}, NULL};
        return;
    }
    const struct view *v = &views[index - n];
    *out = (struct channel){
        .name = v->name, .schema = schema_of(v->schema), .convert = v->convert};
    for (size_t i = 0; i < CHANNEL_MAX_SOURCES && v->sources[i]; i++)
        out->sources[i] = topics_find(v->sources[i]);
}

bool channel_is_from(const struct channel *c, const struct topic *t)
{
    for (size_t i = 0; i < CHANNEL_MAX_SOURCES && c->sources[i]; i++)
        if (c->sources[i] == t)
            return true;
    return false;
}

static int pack(const ProtobufCMessage *m, uint8_t **out, size_t *size)
{
    *size = protobuf_c_message_get_packed_size(m);
    *out = malloc(*size ? *size : 1);
    if (!*out)
        return -ENOMEM;
    protobuf_c_message_pack(m, *out);
    return 0;
}

int channel_pack(const struct channel *c, const struct setting *s,
                 const struct foxglove_message *m, uint8_t **out, size_t *size)
{
    struct arena arena = {.newest = NULL};
    ProtobufCMessage *converted;
    int err;

    if (!c->convert)
        return pack(m->content, out, size);
    err = c->convert(&arena, s, m, &converted);
    if (!err)
        err = pack(converted, out, size);
    arena_clear(&arena);
    return err;
}
