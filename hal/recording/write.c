#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <sndfile.h>

#include "hal/recording/recording.h"

enum { BLOCK_FRAMES = 4096 };

static int write_frames(SNDFILE *f, size_t n_microphones, size_t n_frames,
                        const float *samples)
{
    float *block = malloc(n_microphones * BLOCK_FRAMES * sizeof *block);
    int err = 0;
    if (!block)
        return -ENOMEM;
    for (size_t at = 0; at < n_frames && !err; at += BLOCK_FRAMES) {
        size_t n = n_frames - at < BLOCK_FRAMES ? n_frames - at : BLOCK_FRAMES;
        for (size_t c = 0; c < n_microphones; c++)
            for (size_t i = 0; i < n; i++)
                block[i * n_microphones + c] = samples[c * n_frames + at + i];
        errno = 0;
        if (sf_writef_float(f, block, (sf_count_t)n) != (sf_count_t)n)
            err = errno ? -errno : -EIO;
    }
    free(block);
    return err;
}

int recording_write(const char *folder, size_t position, size_t n_microphones,
                    size_t n_frames, double sample_rate_hz, const float *samples,
                    struct complaint *why)
{
    char *path = NULL, *partial = NULL;
    SF_INFO info = {.samplerate = (int)lround(sample_rate_hz),
                    .channels = (int)n_microphones,
                    .format = SF_FORMAT_WAV | SF_FORMAT_FLOAT};
    int err = 0;
    if (asprintf(&path, "%s/pos%02zu.wav", folder, position) < 0)
        return complain(why, -ENOMEM, "%s: out of memory", folder);
    if (asprintf(&partial, "%s.part", path) < 0) {
        partial = NULL;
        err = complain(why, -ENOMEM, "%s: out of memory", folder);
        goto names;
    }
    SNDFILE *f = sf_open(partial, SFM_WRITE, &info);
    if (!f) {
        err = complain(why, -EIO, "%s cannot be written: %s", path, sf_strerror(NULL));
        goto names;
    }
    err = write_frames(f, n_microphones, n_frames, samples);
    errno = 0;
    if (sf_close(f) && !err)
        err = errno ? -errno : -EIO;
    if (!err && rename(partial, path) < 0)
        err = -errno;
    if (err) {
        unlink(partial);
        complain(why, err, "%s cannot be written: %s", path, strerror(-err));
    }
names:
    free(partial);
    free(path);
    return err;
}
