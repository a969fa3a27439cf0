/* hal/recording/wav_open.h -- WAV files alone: libsndfile reads some thirty formats, and
 * whatever a file is called; readers of compressed ones are where its faults are. */
#ifndef ANLOS_HAL_RECORDING_WAV_OPEN_H
#define ANLOS_HAL_RECORDING_WAV_OPEN_H

#include <sndfile.h>

#include "dsp/complaint.h"

/* A regular file, RIFF, RIFX or RF64, of PCM or float samples; sf_close it.  0, -EINVAL
 * (anything else; the complaint names it), -ENOENT and other errno of reading. */
int wav_open(SNDFILE **out, SF_INFO *info, const char *path, struct complaint *why);

/* What it says of an error of hal/recording/riff.h.  err. */
int wav_complain(struct complaint *why, int err, const char *path);

#endif
