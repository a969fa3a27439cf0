/* SPDX-License-Identifier: MIT */
/* hal/room/doppler.h -- sound between things that move: when what was emitted at a time
 * arrives, exactly for things in straight motion through air at rest. */
#ifndef ANLOS_HAL_ROOM_DOPPLER_H
#define ANLOS_HAL_ROOM_DOPPLER_H

#include "hal/room/wave.h"

/* A point in straight motion: at_m at time 0. */
struct doppler_point {
    double at_m[3], velocity_m_s[3];
};

void doppler_place(const struct doppler_point *p, double t_s, double out[3]);

/* Its image behind the wall { p : normal . p = distance_m }. */
void doppler_mirror(const double normal[3], double distance_m,
                    const struct doppler_point *p, struct doppler_point *out);

/* Sound leaves `from` at t_s and gets to `to` *way_s later: the root of |to(t + way) -
 * from(t)| = c way, of things slower than sound. */
double doppler_way_s(const struct doppler_point *from, double t_s,
                     const struct doppler_point *to, double sound_speed_m_s);

/* The time axis of an echo whose emission's beginning, middle and end arrive at samples
 * at[3]: a parabola through the three.  For a reflector that recedes from a standing
 * array at v the emission gets longer by (1 + v/c) / (1 - v/c). */
void doppler_axis(const double at[3], struct wave_axis *out);

#endif
