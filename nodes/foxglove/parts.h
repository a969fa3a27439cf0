/* SPDX-License-Identifier: MIT */
/* nodes/foxglove/parts.h -- the small messages that Foxglove's larger ones are made of,
 * in an arena. */
#ifndef ANLOS_NODES_FOXGLOVE_PARTS_H
#define ANLOS_NODES_FOXGLOVE_PARTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "foxglove/cloud.pb-c.h"
#include "foxglove/scene.pb-c.h"

/* Memory for the parts of one message, freed at once. */

#define ARENA_SPARE 512

struct arena { /* begins zeroed; clear with arena_clear */
    struct arena_block *newest;
    bool failed; /* there was no memory: what was made is not whole, and not to be used */
    _Alignas(max_align_t) unsigned char spare[ARENA_SPARE];
};

/* A part of up to ARENA_SPARE bytes, never NULL: without memory it is the spare one, so
 * that only the end of a conversion needs to look at failed. */
void *arena_one(struct arena *a, size_t size);

/* n zeroed elements.  NULL: no memory. */
void *arena_array(struct arena *a, size_t n, size_t size);

/* A text, of which 255 bytes are kept. */
char *arena_print(struct arena *a, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
void arena_clear(struct arena *a);

Google__Protobuf__Timestamp *part_time(struct arena *a, int64_t t_ns);
Foxglove__Vector3 *part_vector(struct arena *a, const double v[3]);
Foxglove__Color *part_colour(struct arena *a, const double rgb[3], double alpha);

/* axes[i]: where the i-th axis points, of length 1, right-handed; NULL: as those of the
 * frame. */
Foxglove__Quaternion *part_quaternion(struct arena *a, const double axes[3][3]);
Foxglove__Pose *part_pose(struct arena *a, const double position[3],
                          const double axes[3][3]);

/* Numbers of float32, one after the other, under these names.  NULL: no memory. */
Foxglove__PackedElementField **part_fields(struct arena *a, const char *const *names,
                                           size_t n);

/* An entity with room for so many of each; the counts begin at 0. */
struct part_room {
    size_t arrows, cubes, spheres, texts, metadata;
};
Foxglove__SceneEntity *part_entity(struct arena *a, const char *id, const char *frame,
                                   int64_t t_ns, const struct part_room *room);

/* They go into the room there is; sizes are full ones, in m.  An arrow goes along a way
 * that is longer than 0. */
void part_add_arrow(struct arena *a, Foxglove__SceneEntity *e, const double from[3],
                    const double way[3], double diameter, Foxglove__Color *colour);
void part_add_cube(struct arena *a, Foxglove__SceneEntity *e, Foxglove__Pose *pose,
                   const double size[3], Foxglove__Color *colour);
void part_add_sphere(struct arena *a, Foxglove__SceneEntity *e, Foxglove__Pose *pose,
                     const double size[3], Foxglove__Color *colour);
void part_add_text(struct arena *a, Foxglove__SceneEntity *e, const double position[3],
                   const char *text);
void part_add_fact(struct arena *a, Foxglove__SceneEntity *e, const char *key,
                   char *value);

#endif
