/* SPDX-License-Identifier: MIT */
/* hal/room/scene_preset.h -- what a scene file need not say. */
#ifndef ANLOS_HAL_ROOM_SCENE_PRESET_H
#define ANLOS_HAL_ROOM_SCENE_PRESET_H

#include <stddef.h>

#include "hal/room/scene.h"

/* p: of a pointer to what the file says.  Keeps that, or makes it and copies the default
 * value.  0, -ENOMEM. */
int scene_fill_in(void *p, const void *value, size_t size);

/* The keys of an array of that name.  0, -ENOMEM. */
int scene_fill_in_array(struct survey_yaml *y, enum scene_array array);

#endif
