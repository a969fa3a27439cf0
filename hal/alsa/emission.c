/* SPDX-License-Identifier: MIT */
#include "hal/alsa/emission.h"

#include <math.h>
#include <stdlib.h>

float *emission_create(const struct survey *s, bool down, size_t *n)
{
    double rate_hz = s->sample_rate_hz;
    double start_hz = down ? s->chirp_stop_hz : s->chirp_start_hz;
    double stop_hz = down ? s->chirp_start_hz : s->chirp_stop_hz;
    double slope = (stop_hz - start_hz) / s->chirp_duration_s;
    *n = (size_t)llround(s->chirp_duration_s * rate_hz);
    float *out = calloc(*n + 1, sizeof *out);
    for (size_t i = 0; out && i < *n; i++) {
        double t = (double)i / rate_hz;
        double turns = fmod((start_hz + 0.5 * slope * t) * t, 1);
        double phase = 2 * M_PI * turns;
        out[i] = (float)(s->chirp_sine ? sin(phase) : cos(phase));
    }
    return out;
}
