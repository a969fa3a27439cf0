/* SPDX-License-Identifier: MIT */
/* tests/recon/survey_numbers.h -- each number of the example, and what it may be. */
#ifndef ANLOS_TESTS_RECON_SURVEY_NUMBERS_H
#define ANLOS_TESTS_RECON_SURVEY_NUMBERS_H

#include "tests/recon/survey_example.h"

struct change { /* one number of the example, and what is said about it */
    size_t offset;
    double value;
    const char *says; /* NULL: still a good survey */
};

#define AT(field) offsetof(struct survey, field)

static const struct change numbers[] = {
    {AT(sound_speed_m_s), 299.9, "sound_speed_m_s"},
    {AT(sound_speed_m_s), 360.1, "300 to 360"},
    {AT(sound_speed_m_s), NAN, "sound_speed_m_s"},
    {AT(sound_speed_m_s), 300, NULL},
    {AT(sound_speed_m_s), 360, NULL},
    {AT(temperature_c), 81, "temperature_c"},
    {AT(temperature_c), -INFINITY, "temperature_c"},
    {AT(temperature_c), NAN, NULL},
    {AT(sample_rate_hz), 7999, "sample_rate_hz"},
    {AT(sample_rate_hz), 400001, "sample_rate_hz"},
    {AT(sample_rate_hz), 40000, "stop_hz is 20000"}, /* at Nyquist, not inside it */
    {AT(chirp_start_hz), 0, "start_hz"},
    {AT(chirp_start_hz), NAN, "start_hz"},
    {AT(chirp_start_hz), 20000, "both"},
    {AT(chirp_start_hz), 23999, NULL}, /* a falling chirp */
    {AT(chirp_stop_hz), 24000, "stop_hz"},
    {AT(chirp_duration_s), 0, "duration_s"},
    {AT(chirp_duration_s), -1, "duration_s"},
    {AT(chirp_duration_s), 1.0001, "duration_s"}, /* over 16 slots */
    {AT(chirp_duration_s), NAN, "duration_s"},
    {AT(latency_samples), -0.5, "latency_samples"},
    {AT(latency_samples), 3000, "latency_samples"},
    {AT(latency_samples), 2999.5, NULL},
    {AT(latency_samples), NAN, "latency_samples"},
    {AT(stage_axis[0]), 1.0011, "stage axis"},
    {AT(stage_axis[0]), 1.0009, NULL},
    {AT(stage_axis[1]), NAN, "stage axis"},
    {AT(gate_m[0]), -0.1, "gate_m"},
    {AT(gate_m[0]), 4, "near < far"},
    {AT(gate_m[0]), NAN, "gate_m"},
    {AT(gate_m[1]), 10.72, NULL}, /* 0.0625 s * 343.2 m/s / 2 = 10.725 m */
    {AT(gate_m[1]), 10.73, "gate beyond the slot"},
    {AT(gate_m[1]), INFINITY, "gate_m"},
    {AT(volume_m[0][0]), 1.5, "x_m"},
    {AT(volume_m[1][2]), 0, "y_m"},
    {AT(volume_m[2][2]), -0.1, "z_m"},
    {AT(volume_m[2][1]), NAN, "z_m"},
    {AT(volume_m[2][2]), 1e-5, "200000 steps"},
    {AT(volume_m[0][1]), -1, NULL}, /* a plane */
    {AT(wall_normal[0]), 0.7, "wall normal"},
    {AT(wall_distance_m), 1001, "wall distance_m"},
    {AT(wall_distance_m), NAN, "wall distance_m"},
    {AT(mount_origin_m[2]), -1001, "mount origin_m"},
    {AT(mount_x_axis[1]), 0.5, "mount x_axis"},
    {AT(mount_y_axis[2]), 2, "mount y_axis"},
};

#endif
