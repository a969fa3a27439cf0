/* SPDX-License-Identifier: MIT */
/* tests/hal/rig.h -- a rig file: two speakers, three microphones. */
#ifndef ANLOS_TESTS_HAL_RIG_H
#define ANLOS_TESTS_HAL_RIG_H

#define RIG_SURVEY                                                                       \
    "temperature_c: 20\n"                                                                \
    "sample_rate_hz: 48000\n"                                                            \
    "slot_samples: 1500\n"                                                               \
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.01}\n"                        \
    "speakers_m: [[0, 0, 0], [0.1, 0, 0]]\n"                                             \
    "microphones_m: [[0, 0.1, 0], [0.1, 0.1, 0], [0.2, 0.1, 0]]\n"

#endif
