/* SPDX-License-Identifier: MIT */
#include "nodes/foxglove/parts.h"

#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define BLOCK_SIZE 4096u
#define TEXT_SIZE  256

struct arena_block {
    struct arena_block *older;
    size_t used, size;
    _Alignas(max_align_t) unsigned char data[];
};

static struct arena_block *add_block(struct arena *a, size_t size)
{
    struct arena_block *b = calloc(1, sizeof *b + size);

    if (!b)
        return NULL;
    b->older = a->newest;
    b->size = size;
    return a->newest = b;
}

void *arena_array(struct arena *a, size_t n, size_t size)
{
    const size_t unit = _Alignof(max_align_t);
    struct arena_block *b = a->newest;
    size_t bytes;

    if (__builtin_mul_overflow(n, size, &bytes) || bytes > SIZE_MAX / 2) {
        a->failed = true;
        return NULL;
    }
    bytes = bytes ? (bytes + unit - 1) / unit * unit : unit;
    if (!b || b->size - b->used < bytes)
        b = add_block(a, bytes > BLOCK_SIZE ? bytes : BLOCK_SIZE);
    if (!b) {
        a->failed = true;
        return NULL;
    }
    b->used += bytes;
    return b->data + (b->used - bytes);
}

void *arena_one(struct arena *a, size_t size)
{
    void *part = arena_array(a, 1, size);

    return part ? part : memset(a->spare, 0, sizeof a->spare);
}

char *arena_print(struct arena *a, const char *format, ...)
{
    char text[TEXT_SIZE];
    va_list args;

    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    char *copy = arena_one(a, strlen(text) + 1);
    return memcpy(copy, text, strlen(text) + 1);
}

void arena_clear(struct arena *a)
{
    while (a->newest) {
        struct arena_block *b = a->newest;
        a->newest = b->older;
        free(b);
    }
    a->failed = false;
}

#define NS_PER_S    1000000000LL
#define TEXT_PIXELS 14.0

Google__Protobuf__Timestamp *part_time(struct arena *a, int64_t t_ns)
{
    Google__Protobuf__Timestamp *t = arena_one(a, sizeof *t);

    google__protobuf__timestamp__init(t);
    t->seconds = t_ns / NS_PER_S - (t_ns % NS_PER_S < 0);
    t->nanos = (int32_t)(t_ns - t->seconds * NS_PER_S);
    return t;
}

Foxglove__Vector3 *part_vector(struct arena *a, const double v[3])
{
    Foxglove__Vector3 *m = arena_one(a, sizeof *m);

    foxglove__vector3__init(m);
    m->x = v[0];
    m->y = v[1];
    m->z = v[2];
    return m;
}

Foxglove__Color *part_colour(struct arena *a, const double rgb[3], double alpha)
{
    Foxglove__Color *c = arena_one(a, sizeof *c);

    foxglove__color__init(c);
    c->r = rgb[0];
    c->g = rgb[1];
    c->b = rgb[2];
    c->a = alpha;
    return c;
}

/* Shepperd 1978: by the largest of w, x, y, z, which no rounding makes 0. */
static void turn(const double axes[3][3], double q[4])
{
    double trace = axes[0][0] + axes[1][1] + axes[2][2];
    int most = 3;

    for (int i = 0; i < 3; i++)
        if (axes[i][i] > (most == 3 ? trace : axes[most][most]))
            most = i;
    if (most == 3) {
        q[0] = axes[1][2] - axes[2][1];
        q[1] = axes[2][0] - axes[0][2];
        q[2] = axes[0][1] - axes[1][0];
        q[3] = 1.0 + trace;
    } else {
        int j = (most + 1) % 3, k = (most + 2) % 3;
        q[most] = 1.0 + axes[most][most] - axes[j][j] - axes[k][k];
        q[j] = axes[most][j] + axes[j][most];
        q[k] = axes[most][k] + axes[k][most];
        q[3] = axes[j][k] - axes[k][j];
    }
    double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; i++)
        q[i] /= length;
}

Foxglove__Quaternion *part_quaternion(struct arena *a, const double axes[3][3])
{
    Foxglove__Quaternion *m = arena_one(a, sizeof *m);
    double q[4] = {0.0, 0.0, 0.0, 1.0};

    if (axes)
        turn(axes, q);
    foxglove__quaternion__init(m);
    m->x = q[0];
    m->y = q[1];
    m->z = q[2];
    m->w = q[3];
    return m;
}

Foxglove__Pose *part_pose(struct arena *a, const double position[3],
                          const double axes[3][3])
{
    Foxglove__Pose *p = arena_one(a, sizeof *p);

    foxglove__pose__init(p);
    p->position = part_vector(a, position);
    p->orientation = part_quaternion(a, axes);
    return p;
}

Foxglove__PackedElementField **part_fields(struct arena *a, const char *const *names,
                                           size_t n)
{
    Foxglove__PackedElementField **fields = arena_array(a, n, sizeof *fields);

    for (size_t i = 0; fields && i < n; i++) {
        fields[i] = arena_one(a, sizeof **fields);
        foxglove__packed_element_field__init(fields[i]);
        fields[i]->name = arena_print(a, "%s", names[i]);
        fields[i]->offset = (uint32_t)(i * sizeof(float));
        fields[i]->type = FOXGLOVE__PACKED_ELEMENT_FIELD__NUMERIC_TYPE__FLOAT32;
    }
    return fields;
}

Foxglove__SceneEntity *part_entity(struct arena *a, const char *id, const char *frame,
                                   int64_t t_ns, const struct part_room *room)
{
    Foxglove__SceneEntity *e = arena_one(a, sizeof *e);

    foxglove__scene_entity__init(e);
    e->timestamp = part_time(a, t_ns);
    e->frame_id = arena_print(a, "%s", frame);
    e->id = arena_print(a, "%s", id);
    e->arrows = arena_array(a, room->arrows, sizeof *e->arrows);
    e->cubes = arena_array(a, room->cubes, sizeof *e->cubes);
    e->spheres = arena_array(a, room->spheres, sizeof *e->spheres);
    e->texts = arena_array(a, room->texts, sizeof *e->texts);
    e->metadata = arena_array(a, room->metadata, sizeof *e->metadata);
    return e;
}

/* Axes of the right hand of which the first goes along v. */
static void axes_along(const double v[3], double axes[3][3])
{
    double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    int other = fabs(v[2]) < 0.9 * length ? 2 : 0; /* not along it */

    for (int i = 0; i < 3; i++)
        axes[0][i] = v[i] / length;
    double along = axes[0][other], rest = sqrt(1.0 - along * along);
    for (int i = 0; i < 3; i++)
        axes[2][i] = ((i == other) - along * axes[0][i]) / rest;
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        axes[1][i] = axes[2][j] * axes[0][k] - axes[2][k] * axes[0][j];
    }
}

void part_add_arrow(struct arena *a, Foxglove__SceneEntity *e, const double from[3],
                    const double way[3], double diameter, Foxglove__Color *colour)
{
    Foxglove__ArrowPrimitive *p = arena_one(a, sizeof *p);
    double length = sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2]);
    double head = fmin(4.0 * diameter, 0.5 * length), axes[3][3];

    axes_along(way, axes);
    foxglove__arrow_primitive__init(p);
    p->pose = part_pose(a, from, (const double(*)[3])axes);
    p->shaft_length = length - head;
    p->shaft_diameter = diameter;
    p->head_length = head;
    p->head_diameter = 2.5 * diameter;
    p->color = colour;
    if (e->arrows)
        e->arrows[e->n_arrows++] = p;
}

void part_add_cube(struct arena *a, Foxglove__SceneEntity *e, Foxglove__Pose *pose,
                   const double size[3], Foxglove__Color *colour)
{
    Foxglove__CubePrimitive *c = arena_one(a, sizeof *c);

    foxglove__cube_primitive__init(c);
    c->pose = pose;
    c->size = part_vector(a, size);
    c->color = colour;
    if (e->cubes)
        e->cubes[e->n_cubes++] = c;
}

void part_add_sphere(struct arena *a, Foxglove__SceneEntity *e, Foxglove__Pose *pose,
                     const double size[3], Foxglove__Color *colour)
{
    Foxglove__SpherePrimitive *s = arena_one(a, sizeof *s);

    foxglove__sphere_primitive__init(s);
    s->pose = pose;
    s->size = part_vector(a, size);
    s->color = colour;
    if (e->spheres)
        e->spheres[e->n_spheres++] = s;
}

void part_add_text(struct arena *a, Foxglove__SceneEntity *e, const double position[3],
                   const char *text)
{
    static const double white[3] = {1.0, 1.0, 1.0};
    Foxglove__TextPrimitive *t = arena_one(a, sizeof *t);

    foxglove__text_primitive__init(t);
    t->pose = part_pose(a, position, NULL);
    t->billboard = true;
    t->scale_invariant = true;
    t->font_size = TEXT_PIXELS;
    t->color = part_colour(a, white, 1.0);
    t->text = arena_print(a, "%s", text);
    if (e->texts)
        e->texts[e->n_texts++] = t;
}

void part_add_fact(struct arena *a, Foxglove__SceneEntity *e, const char *key,
                   char *value)
{
    Foxglove__KeyValuePair *p = arena_one(a, sizeof *p);

    foxglove__key_value_pair__init(p);
    p->key = arena_print(a, "%s", key);
    p->value = value;
    if (e->metadata)
        e->metadata[e->n_metadata++] = p;
}
