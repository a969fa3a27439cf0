/* hal/recording/riff.h -- how much sound a WAV file promises, and how much of it is
 * there. libsndfile reads what is left of a truncated file without a word. */
#ifndef ANLOS_HAL_RECORDING_RIFF_H
#define ANLOS_HAL_RECORDING_RIFF_H

#include <stdint.h>

/* Sizes of the data chunk in bytes.  A writer that never closed its file leaves 0 or
 * 0xffffffff: then both are what is there.  0, -EINVAL (no RIFF, RIFX or RF64 file, or no
 * data chunk), -ESPIPE (not a regular file), a negative errno of reading. */
int riff_data_size(const char *path, uint64_t *promised, uint64_t *present);

enum { RIFF_PCM = 1, RIFF_FLOAT = 3, RIFF_EXTENSIBLE = 0xfffe };

/* The number of its sample format, from the chunk "fmt ".  Errors as riff_data_size. */
int riff_format(const char *path, unsigned *format);

#endif
