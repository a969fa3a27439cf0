#include "dsp/harmonic.h"

#include <errno.h>
#include <math.h>

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
