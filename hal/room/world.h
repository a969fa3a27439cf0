/* hal/room/world.h -- a scene's objects and clutter as pieces that scatter, and the truth
 * about them. */
#ifndef ANLOS_HAL_ROOM_WORLD_H
#define ANLOS_HAL_ROOM_WORLD_H

#include "hal/room/room.h"
#include "hal/room/scatter.h"
#include "hal/room/scene.h"

struct world {
    struct scatter points, facets; /* hidden, where they really are */
    struct scatter clutter;        /* wall and room */
    size_t n_objects;
    struct room_object *objects; /* [n_objects] */
};

/* path: for complaints.  0, -EINVAL (an object behind the wall), -ENOMEM. */
int world_create(struct world *out, const struct scene *scene, const struct survey *s,
                 const char *path, struct complaint *why);
void world_clear(struct world *w);

#endif
