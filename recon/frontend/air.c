/* SPDX-License-Identifier: MIT */
#include "recon/frontend/air.h"

#include <math.h>
#include <stdio.h>

#define LEAST_KELVIN              0.05  /* less is not worth a word */
#define SOUND_SPEED_SQUARED_PER_K 401.9 /* dry air: 1.4 * 8.314 / 0.02896 m2/s2/K */

void air_start(struct air *a, double sound_speed_m_s, size_t expected)
{
    *a = (struct air){.sound_speed_m_s = sound_speed_m_s, .expected = expected};
}

void air_add(struct air *a, double stretch, bool corrected)
{
    a->pings++;
    a->corrected += corrected;
    a->sum += stretch;
    if (fabs(stretch) > fabs(a->largest))
        a->largest = stretch;
}

void air_join(struct air *a, const struct air *other)
{
    a->pings += other->pings;
    a->corrected += other->corrected;
    a->sum += other->sum;
    if (fabs(other->largest) > fabs(a->largest))
        a->largest = other->largest;
}

double air_kelvin(const struct air *a, double stretch)
{
    double kelvin = a->sound_speed_m_s * a->sound_speed_m_s / SOUND_SPEED_SQUARED_PER_K;

    return -2.0 * kelvin * stretch;
}

bool air_is_distrusted(const struct air *a)
{
    return fabs(a->largest) >= AIR_DISTRUST;
}

void air_text(const struct air *a, char *out, size_t size)
{
    double mean = a->pings ? a->sum / (double)a->pings : 0.0;

    if (!size)
        return;
    out[0] = 0;
    if (a->corrected && fabs(air_kelvin(a, a->largest)) >= LEAST_KELVIN)
        snprintf(out, size,
                 "air %+.1f K (%.2f%%) since the background, at most %+.1f K (%.2f%%)",
                 air_kelvin(a, mean), 100.0 * fabs(mean), air_kelvin(a, a->largest),
                 100.0 * fabs(a->largest));
}
