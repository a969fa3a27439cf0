/* SPDX-License-Identifier: MIT */
#include "hal/room/doppler.h"

#include "hal/room/vector.h"

void doppler_place(const struct doppler_point *p, double t_s, double out[3])
{
    vector_add(p->at_m, t_s, p->velocity_m_s, out);
}

void doppler_mirror(const double normal[3], double distance_m,
                    const struct doppler_point *p, struct doppler_point *out)
{
    vector_mirror(normal, distance_m, p->at_m, out->at_m);
    vector_mirror(normal, 0, p->velocity_m_s, out->velocity_m_s);
}

double doppler_way_s(const struct doppler_point *from, double t_s,
                     const struct doppler_point *to, double sound_speed_m_s)
{
    double a[3], b[3], c2 = sound_speed_m_s * sound_speed_m_s;
    doppler_place(from, t_s, a);
    doppler_place(to, t_s, b);
    vector_add(b, -1, a, b);
    double along = vector_dot(b, to->velocity_m_s);
    double slack = c2 - vector_dot(to->velocity_m_s, to->velocity_m_s);
    return (along + sqrt(along * along + slack * vector_dot(b, b))) / slack;
}

void doppler_axis(const double at[3], struct wave_axis *out)
{
    double length = at[2] - at[0], middle = (at[1] - at[0]) / length;
    *out = (struct wave_axis){.start = at[0],
                              .length = length,
                              .bend = (0.5 - middle) / (middle * (1 - middle))};
}
