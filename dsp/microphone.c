/* SPDX-License-Identifier: MIT */
#include "dsp/microphone.h"

#include <math.h>

#define MAX_CORRECTION 10.0

double microphone_gain(const struct microphone *m, double frequency_hz)
{
    const double *f = m->frequency_hz, *g = m->gain_db;
    size_t low = 0, high = m->n_points;
    double db;

    if (!high)
        return 1.0;
    high--;
    if (frequency_hz <= f[0]) {
        db = g[0];
    } else if (frequency_hz >= f[high]) {
        db = g[high];
    } else {
        while (high - low > 1) {
            size_t middle = low + (high - low) / 2;
            if (f[middle] <= frequency_hz)
                low = middle;
            else
                high = middle;
        }
        db = g[low] + (g[high] - g[low]) * (frequency_hz - f[low]) / (f[high] - f[low]);
    }
    return pow(10.0, db / 20.0);
}

double microphone_correction(const struct microphone *m, double frequency_hz)
{
    double gain = m ? microphone_gain(m, frequency_hz) : 1.0;

    return fmin(fmax(1.0 / gain, 1.0 / MAX_CORRECTION), MAX_CORRECTION);
}
