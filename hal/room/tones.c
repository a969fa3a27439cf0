/* SPDX-License-Identifier: MIT */
#include "hal/room/tones.h"

#include <math.h>
#include <stdbool.h>

static bool sounds(const struct scene_tone *tone, const struct drive *drive, double t_s)
{
    if (!tone->during_s)
        return true;
    double at_s = drive_time_s(drive, t_s);
    return at_s >= tone->during_s[0] && at_s < tone->during_s[1];
}

void tone_add(const struct scene_tone *tone, const struct drive *drive, double t_s,
              double sample_rate_hz, size_t n_microphones, float *samples, size_t stride,
              size_t n)
{
    unsigned harmonics = tone->harmonics ? tone->harmonics : 1;
    if (!sounds(tone, drive, t_s))
        return;
    for (unsigned h = 1; h <= harmonics; h++) {
        double hz = h * tone->frequency_hz, step = 2 * M_PI * hz / sample_rate_hz;
        double begins = 2 * M_PI * fmod(hz * t_s, 1);
        if (hz >= sample_rate_hz / 2)
            break;
        for (size_t i = 0; i < n; i++) {
            float x = (float)(M_SQRT2 * tone->rms / h * sin(begins + step * (double)i));
            for (size_t m = 0; m < n_microphones; m++)
                samples[m * stride + i] += x;
        }
    }
}
