/* SPDX-License-Identifier: MIT */
/* tests/recon/moving.h -- what microphones on a vehicle that drives record of chirps from
 * its speakers and a point that may move too, or a plane that mirrors them, sample by
 * sample in closed form and double precision: no step is taken of standing still while
 * sound is under way. */
#ifndef ANLOS_TESTS_RECON_MOVING_H
#define ANLOS_TESTS_RECON_MOVING_H

#include <stdbool.h>
#include <stddef.h>

struct moving { /* ground frame: the vehicle's (x forward, y left, z up) at time 0 */
    double sound_speed_m_s, sample_rate_hz;
    double chirp_hz[2], chirp_s;      /* first and last frequency of an up-chirp */
    double speed_m_s, yaw_rate_rad_s; /* of the vehicle, for all time */
    double mount_m[3]; /* the array in the vehicle: x to the left, y up, z forward */
    double at_m[3], velocity_m_s[3]; /* of the point at time 0, over ground */
    double normal[3]; /* unit, ground frame: a plane at rest through at_m; 0: a point */
    double level_db;  /* of its echo; -INFINITY: nothing is there */
};

/* Array frame of a time to ground, and back. */
void moving_to_ground(const struct moving *m, double time_s, const double p[3],
                      double out[3]);
void moving_to_array(const struct moving *m, double time_s, const double p[3],
                     double out[3]);

/* Adds to rx[n], whose sample 0 is at time_s, a chirp that starts at chirp_at_s; elements
 * in the array frame.  Amplitude 1 / (way there x way back) of a point, 1 / (whole way)
 * of a plane, and level_db more.  Nothing comes nearer at more than 15 m/s. */
void moving_record(const struct moving *m, double time_s, double chirp_at_s, bool down,
                   const double speaker[3], const double microphone[3], size_t n,
                   float *rx);

#endif
