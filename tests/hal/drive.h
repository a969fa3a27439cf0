/* SPDX-License-Identifier: MIT */
/* tests/hal/drive.h -- scene files of drives, for tests. */
#ifndef ANLOS_TESTS_HAL_DRIVE_H
#define ANLOS_TESTS_HAL_DRIVE_H

#include "scratch.h"

#include "hal/room/room.h"

/* One pair, 340 m/s, chirp 2 to 20 kHz of 20 ms in slots of 24 ms, nothing but echoes;
 * the mount makes x of the array the vehicle's left, and z its forward direction. */
#define DRIVE_TIMING                                                                     \
    "sound_speed_m_s: 340\nsample_rate_hz: 48000\n"                                      \
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.02}\n"                        \
    "slot_samples: 1152\ngate_m: [0.2, 4]\n"                                             \
    "mount: {origin_m: [3.6, 0.2, 0.4], x_axis: [0, 1, 0], y_axis: [0, 0, 1]}\n"         \
    "level: 1\ndirect_level: 0\n"
#define DRIVE_PAIR "speakers_m: [[-0.02, 0, 0]]\nmicrophones_m: [[0.03, 0, 0]]\n"
#define DRIVE_WALL "wall: {normal: [0, 0, 1], distance_m: 2}\n"

static inline struct room *drive_load(void **state, const char *text)
{
    struct error why = {.text = ""};
    struct room *r;
    if (room_load(&r, scratch_write(*state, "scene.yaml", text), &why))
        fail_msg("%s", why.text);
    return r;
}

/* One emission; free() it. */
static inline float *drive_emit(struct room *r, double t_s, enum pass pass, uint32_t take)
{
    struct room_emission e = {.pass = pass, .t_s = t_s, .take = take};
    float *samples =
        malloc(room_survey(r)->n_microphones * room_frames(r, 1) * sizeof *samples);
    assert_non_null(samples);
    assert_int_equal(room_emit(r, &e, samples), 0);
    return samples;
}

#endif
