/* SPDX-License-Identifier: MIT */
#include "recon/vehicle_frame.h"

void vehicle_frame_axes(const struct survey *s, double r[3][3], double t[3])
{
    static const double zero[3] = {0.0, 0.0, 0.0};

    survey_to_vehicle(s, zero, t);
    for (int a = 0; a < 3; a++) {
        double unit[3] = {a == 0, a == 1, a == 2}, moved[3];
        survey_to_vehicle(s, unit, moved);
        for (int b = 0; b < 3; b++)
            r[b][a] = moved[b] - t[b];
    }
}

void vehicle_frame_mount(const struct survey *s, struct mount *out)
{
    static const double origin[3] = {0, 0, 0}, left[3] = {0, 1, 0}, up[3] = {0, 0, 1};

    if (s->has_mount)
        mount_create(out, s->mount_origin_m, s->mount_x_axis, s->mount_y_axis);
    else
        mount_create(out, origin, left, up);
}
