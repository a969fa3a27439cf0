/* SPDX-License-Identifier: MIT */
/* hal/survey/rig_file.h -- a rig: an array on a sound card.  Its file has the keys of
 * survey.yaml (hal/survey/yaml.h), and all of these are optional:
 *
 *   calibrated: FILE.yaml   # what `anlos calibrate` wrote, relative to the rig's file
 *   device:
 *     format: S32           # S16, S24_3, S24, S32, float; else the best there is
 *     access: mmap          # or rw; else mmap where the device has it
 *     period_frames: 480    # else 10 ms
 *     buffer_ms: 200        # of sound that is always written ahead
 *     level_db: -6          # of the chirp, under full scale
 *     outputs: [0, 1]       # the channel of each speaker; else in their order
 *     inputs: [2, 3]        # the channel of each microphone
 *     output_gain_db: [0]   # of each speaker, on top of level_db
 *     input_gain_db: [0]    # of each microphone
 *     invert_outputs: [1]   # speakers that are wired the other way round, from 0
 *     invert_inputs: []     # microphones likewise
 */
#ifndef ANLOS_HAL_SURVEY_RIG_FILE_H
#define ANLOS_HAL_SURVEY_RIG_FILE_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"
#include "hal/alsa/sample_format.h"
#include "hal/survey/calibration.h"
#include "recon/survey.h"

#define RIG_MAX_CHANNELS 256

enum rig_access { RIG_ACCESS_ANY, RIG_ACCESS_MMAP, RIG_ACCESS_RW };

struct rig {
    struct survey survey;            /* its source is live; calibrated */
    struct calibration *calibration; /* NULL: none */
    char *background;                /* the recording that it names; NULL: none */
    bool has_format;
    enum sample_format format;
    enum rig_access access;
    size_t period_frames;
    size_t buffer_frames;
    size_t *outputs;    /* [n_speakers] channels, from 0 */
    size_t *inputs;     /* [n_microphones] */
    float *output_gain; /* [n_speakers], with level_db and the sign */
    float *input_gain;  /* [n_microphones], with the sign */
};

/* Clear with rig_clear.  The error is "file:line: key: what was expected".  0,
 * -ENOENT, -EACCES, -EINVAL, -ENOMEM. */
int rig_load(struct rig *out, const char *path, struct error *why);

/* The same with another calibration file than the rig names, as the path stands; "": with
 * none, NULL: with the rig's. */
int rig_load_calibrated(struct rig *out, const char *path, const char *calibrated,
                        struct error *why);

/* Channels that a card must have for the speakers, and for the microphones. */
size_t rig_output_channels(const struct rig *r);
size_t rig_input_channels(const struct rig *r);
void rig_clear(struct rig *r);

#endif
