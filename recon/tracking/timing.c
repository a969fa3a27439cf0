/* SPDX-License-Identifier: MIT */
#include "recon/tracking/timing.h"

#include <math.h>

#include "recon/static_array/range_doppler.h"

#define MOST_AGE_S 5.0 /* of an image; more is no age */

/* From one ping to the next; two that sound together count as half a slot apart. */
static double ping_s(const struct survey *s)
{
    double together = s->together > 1 ? (double)s->together : 1.0;
    return (double)s->slot_samples / s->sample_rate_hz / together;
}

double timing_age_s(const struct survey *s, const struct volume *v)
{
    double n = v->pings_used ? (double)v->pings_used : 1.0;

    return fmax(0.5 * (n - 1.0) * ping_s(s), v->age_s < MOST_AGE_S ? v->age_s : 0.0);
}

double timing_lag_s(const struct survey *s, const struct volume *v, double range_m)
{
    bool both_ways = s->chirp_alternates || s->together > 1 || s->n_replica;
    double shown_s = both_ways
                         ? 0.5 * s->chirp_duration_s
                         : range_doppler_instant_s(s->chirp_start_hz, s->chirp_stop_hz,
                                                   s->chirp_duration_s);

    return shown_s + range_m / s->sound_speed_m_s - timing_age_s(s, v);
}

double timing_fresh(const struct survey *s, const struct volume *v, double dt_s,
                    double look_s)
{
    double all_s = 2.0 * timing_age_s(s, v) + ping_s(s);

    return fmin(dt_s / fmax(all_s, look_s), 1.0);
}

double timing_round_s(const struct survey *s)
{
    return (double)s->n_speakers * ping_s(s);
}
