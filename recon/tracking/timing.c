/* SPDX-License-Identifier: MIT */
#include "recon/tracking/timing.h"

#include <math.h>

#include "recon/static_array/range_doppler.h"

/* From one ping to the next; two that sound together count as half a slot apart. */
static double ping_s(const struct survey *s)
{
    double together = s->together > 1 ? (double)s->together : 1.0;
    return (double)s->slot_samples / s->sample_rate_hz / together;
}

double timing_age_s(const struct survey *s, size_t n_pings)
{
    return n_pings > 1 ? 0.5 * (double)(n_pings - 1) * ping_s(s) : 0.0;
}

double timing_lag_s(const struct survey *s, size_t n_pings, double range_m)
{
    bool both_ways = s->chirp_alternates || s->together > 1 || s->n_replica;
    double shown_s = both_ways
                         ? 0.5 * s->chirp_duration_s
                         : range_doppler_instant_s(s->chirp_start_hz, s->chirp_stop_hz,
                                                   s->chirp_duration_s);

    return shown_s + range_m / s->sound_speed_m_s - timing_age_s(s, n_pings);
}

double timing_fresh(const struct survey *s, size_t n_pings, double dt_s, double look_s)
{
    double all_s = (double)(n_pings ? n_pings : 1) * ping_s(s);

    return fmin(dt_s / fmax(all_s, look_s), 1.0);
}

double timing_round_s(const struct survey *s)
{
    return (double)s->n_speakers * ping_s(s);
}
