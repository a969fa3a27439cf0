/* SPDX-License-Identifier: MIT */
/* hal/room/tones.h -- electrical noise in the cables, a scene's `noise.tones`: sines that
 * all microphones have alike. */
#ifndef ANLOS_HAL_ROOM_TONES_H
#define ANLOS_HAL_ROOM_TONES_H

#include <stddef.h>

#include "hal/room/drive.h"
#include "hal/room/scene.h"

/* Onto samples [n_microphones], stride apart, n of each, from world time t_s on: the
 * phase goes by the world's time, whoever asks. */
void tone_add(const struct scene_tone *tone, const struct drive *drive, double t_s,
              double sample_rate_hz, size_t n_microphones, float *samples, size_t stride,
              size_t n);

#endif
