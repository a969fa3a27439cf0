/* SPDX-License-Identifier: MIT */
/* hal/room/clutter.h -- what is heard without the wall's mirror: the roughness of the
 * wall itself, and things anywhere around. */
#ifndef ANLOS_HAL_ROOM_CLUTTER_H
#define ANLOS_HAL_ROOM_CLUTTER_H

#include "hal/room/mirror.h"
#include "hal/room/scatter.h"
#include "hal/room/scene.h"

/* Points by the scene's seed, first the *n_patches of the wall; centre: the array's.  0,
 * -ENOMEM. */
int clutter_add(struct scatter *out, size_t *n_patches, const struct scene *scene,
                const struct survey *s, const struct mirror *mirror,
                const double centre[3]);

#endif
