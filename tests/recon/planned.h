/* SPDX-License-Identifier: MIT */
/* tests/recon/planned.h -- a survey of 8 speakers and 4 microphones upright on a stage of
 * 12 positions, 3 cm apart; slots of a chirp, 62.5 ms, a gate of 0.5 to 2 m. */
#ifndef ANLOS_TESTS_RECON_PLANNED_H
#define ANLOS_TESTS_RECON_PLANNED_H

#include <math.h>

#include "recon/survey.h"

/* Borrows static arrays: the next call makes them anew.  Not to be cleared. */
static inline struct survey planned_survey(void)
{
    static double speakers_m[8][3], microphones_m[4][3], positions_m[12];
    for (int i = 0; i < 8; i++)
        speakers_m[i][1] = 0.07 * i;
    for (int i = 0; i < 4; i++) {
        microphones_m[i][0] = 0.05;
        microphones_m[i][1] = 0.07 * i;
    }
    for (int i = 0; i < 12; i++)
        positions_m[i] = 0.03 * i;
    return (struct survey){
        .source = SURVEY_SIMULATION,
        .sound_speed_m_s = 340,
        .temperature_c = NAN,
        .sample_rate_hz = 48000,
        .chirp_start_hz = 2000,
        .chirp_stop_hz = 20000,
        .chirp_duration_s = 0.0625,
        .slot_samples = 3000,
        .n_speakers = 8,
        .n_microphones = 4,
        .n_positions = 12,
        .speakers_m = speakers_m,
        .microphones_m = microphones_m,
        .stage_axis = {1, 0, 0},
        .stage_positions_m = positions_m,
        .has_gate = true,
        .gate_m = {0.5, 2},
    };
}

#endif
