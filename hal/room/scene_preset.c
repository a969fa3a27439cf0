/* SPDX-License-Identifier: MIT */
#include "hal/room/scene_preset.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

int scene_fill_in(void *p, const void *value, size_t size)
{
    void *there;
    memcpy(&there, p, sizeof there);
    if (there)
        return 0;
    there = malloc(size);
    if (!there)
        return -ENOMEM;
    memcpy(there, value, size);
    memcpy(p, &there, sizeof there);
    return 0;
}

/* 16 speakers and 16 microphones upright, 0.08 m apart, carried 1 m in 32 steps (Lindell
 * 2019, section 4). */
static int fill_in_paper(struct survey_yaml *y)
{
    enum { ELEMENTS = 16, POSITIONS = 32 };
    static const double rate_hz = 48000;
    static const uint32_t slot = 3000;
    static const struct survey_yaml_chirp chirp = {2000, 20000, 0.0625, 0, false};
    struct survey_yaml_stage stage = {.axis = {1, 0, 0}, .n_positions = POSITIONS};
    double speakers[ELEMENTS][3], microphones[ELEMENTS][3], positions[POSITIONS];
    for (int i = 0; i < ELEMENTS; i++)
        for (int a = 0; a < 3; a++) {
            speakers[i][a] = a == 1 ? i / 15.0 : 0;
            microphones[i][a] = a == 0 ? 0.08 : speakers[i][a];
        }
    for (int k = 0; k < POSITIONS; k++)
        positions[k] = k / 31.0;
    y->n_speakers = y->n_microphones = ELEMENTS;
    if (scene_fill_in(&y->sample_rate_hz, &rate_hz, sizeof rate_hz) ||
        scene_fill_in(&y->slot_samples, &slot, sizeof slot) ||
        scene_fill_in(&y->chirp, &chirp, sizeof chirp) ||
        scene_fill_in(&y->speakers_m, speakers, sizeof speakers) ||
        scene_fill_in(&y->microphones_m, microphones, sizeof microphones) ||
        scene_fill_in(&y->stage, &stage, sizeof stage) ||
        scene_fill_in(&y->stage->positions_m, positions, sizeof positions))
        return -ENOMEM;
    return 0;
}

/* 16 microphones along 1 m of a bumper and 16 speakers between them, at one height; a
 * slot of 24 ms, for 4 m. */
static int fill_in_bumper(struct survey_yaml *y)
{
    enum { ELEMENTS = 16 };
    static const double rate_hz = 48000, pitch_m = 1.0 / (ELEMENTS - 0.5);
    static const uint32_t slot = 1152;
    static const struct survey_yaml_chirp chirp = {2000, 20000, 0.02, 0, false};
    double speakers[ELEMENTS][3] = {{0}}, microphones[ELEMENTS][3] = {{0}};
    for (int i = 0; i < ELEMENTS; i++) {
        microphones[i][0] = -0.5 + i * pitch_m;
        speakers[i][0] = microphones[i][0] + pitch_m / 2;
    }
    y->n_speakers = y->n_microphones = ELEMENTS;
    if (scene_fill_in(&y->sample_rate_hz, &rate_hz, sizeof rate_hz) ||
        scene_fill_in(&y->slot_samples, &slot, sizeof slot) ||
        scene_fill_in(&y->chirp, &chirp, sizeof chirp) ||
        scene_fill_in(&y->speakers_m, speakers, sizeof speakers) ||
        scene_fill_in(&y->microphones_m, microphones, sizeof microphones))
        return -ENOMEM;
    return 0;
}

int scene_fill_in_array(struct survey_yaml *y, enum scene_array array)
{
    switch (array) {
    case SCENE_PAPER:
        return fill_in_paper(y);
    case SCENE_BUMPER:
        return fill_in_bumper(y);
    default:
        return 0;
    }
}
