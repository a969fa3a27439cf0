/* SPDX-License-Identifier: MIT */
#include "dsp/chirp.h"

#include <errno.h>
#include <math.h>

size_t chirp_length(const struct chirp *c, double sample_rate_hz)
{
    double n = round(c->duration_s * sample_rate_hz);

    return n > 0.0 && n < 1e9 ? (size_t)n : 0;
}

double chirp_phase_rad(const struct chirp *c, double t_s)
{
    double slope_hz_s = (c->stop_hz - c->start_hz) / c->duration_s;
    double cycles = (c->start_hz + 0.5 * slope_hz_s * t_s) * t_s;

    return 2.0 * M_PI * (cycles - (c->sine ? 0.25 : 0.0));
}

void chirp_generate(const struct chirp *c, double sample_rate_hz, float *out)
{
    size_t n = chirp_length(c, sample_rate_hz);

    for (size_t i = 0; i < n; i++)
        out[i] = (float)cos(chirp_phase_rad(c, (double)i / sample_rate_hz));
}

#define LEAST_PART 0.1

int harmonic_chirp(const struct chirp *c, unsigned order, double highest_hz,
                   double sample_rate_hz, struct chirp *out)
{
    double slope_hz_s = (c->stop_hz - c->start_hz) / c->duration_s;
    double last_hz = fmin(c->stop_hz, highest_hz / order);
    if (!(slope_hz_s > 0.0))
        return -ERANGE;
    double part_s = floor((last_hz - c->start_hz) / slope_hz_s * sample_rate_hz) /
                    sample_rate_hz;
    if (!(part_s >= LEAST_PART * c->duration_s))
        return -ERANGE;
    *out = (struct chirp){.start_hz = order * c->start_hz,
                          .stop_hz = order * (c->start_hz + slope_hz_s * part_s),
                          .duration_s = part_s,
                          .sine = c->sine};
    return 0;
}
