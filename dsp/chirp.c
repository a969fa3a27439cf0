#include "dsp/chirp.h"

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
