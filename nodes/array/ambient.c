/* SPDX-License-Identifier: MIT */
#include "nodes/array/ambient.h"

#include <math.h>

#define DIFFERS 0.0025 /* of the speed of sound: 1 cm at 4 m */
#define REST_NS 60000000000LL

/* Cramer's formula is one of -20..50 C, and good to 0.1 % a little beyond. */
static bool is_plausible(const Anlos__Ambient *a)
{
    return a->temperature_c >= -40.0 && a->temperature_c <= 60.0;
}

bool ambient_take(struct ambient *a, const struct survey *measured, struct survey *s,
                  const Anlos__Ambient *said, int64_t now_ns)
{
    if (!is_plausible(said) || (a->changed_ns && now_ns - a->changed_ns < REST_NS))
        return false;
    double humidity = isnan(said->humidity) ? 0.0 : said->humidity;
    double speed_m_s = survey_humid_sound_speed_m_s(said->temperature_c, humidity);
    if (fabs(speed_m_s / s->sound_speed_m_s - 1.0) <= DIFFERS)
        return false;
    s->temperature_c = said->temperature_c;
    s->sound_speed_m_s = speed_m_s;
    s->gate_m[1] = fmin(measured->gate_m[1], survey_gate_limit_m(s));
    a->changed_ns = now_ns;
    return true;
}
