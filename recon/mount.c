/* SPDX-License-Identifier: MIT */
#include "recon/mount.h"

#include <string.h>

void mount_create(struct mount *m, const double origin_m[3], const double x[3],
                  const double y[3])
{
    memcpy(m->origin_m, origin_m, sizeof m->origin_m);
    memcpy(m->axes[0], x, sizeof m->axes[0]);
    memcpy(m->axes[1], y, sizeof m->axes[1]);
    for (int a = 0; a < 3; a++) {
        int b = (a + 1) % 3, c = (a + 2) % 3;
        m->axes[2][a] = x[b] * y[c] - x[c] * y[b];
    }
}

void mount_to_vehicle(const struct mount *m, const double p[3], double out[3])
{
    const double q[3] = {p[0], p[1], p[2]};
    for (int a = 0; a < 3; a++)
        out[a] = m->origin_m[a] + q[0] * m->axes[0][a] + q[1] * m->axes[1][a] +
                 q[2] * m->axes[2][a];
}

void mount_to_array(const struct mount *m, const double p[3], double out[3])
{
    const double q[3] = {p[0] - m->origin_m[0], p[1] - m->origin_m[1],
                         p[2] - m->origin_m[2]};
    for (int a = 0; a < 3; a++)
        out[a] = q[0] * m->axes[a][0] + q[1] * m->axes[a][1] + q[2] * m->axes[a][2];
}

void mount_step_point(const struct mount *m, const struct ego_step *s, const double p[3],
                      double out[3])
{
    double q[3];
    mount_to_vehicle(m, p, q);
    ego_step_point(s, q, q);
    mount_to_array(m, q, out);
}

void mount_step(const struct mount *m, const struct ego_step *s, double r[3][3],
                double t[3])
{
    static const double zero[3] = {0.0, 0.0, 0.0};
    mount_step_point(m, s, zero, t);
    for (int a = 0; a < 3; a++) {
        const double unit[3] = {a == 0, a == 1, a == 2};
        double there[3];
        mount_step_point(m, s, unit, there);
        for (int b = 0; b < 3; b++)
            r[b][a] = there[b] - t[b];
    }
}

void mount_velocity(const struct mount *m, const struct ego_motion *motion, double out[3])
{
    double ahead = motion->speed_m_s - motion->yaw_rate_rad_s * m->origin_m[1];
    double left = motion->yaw_rate_rad_s * m->origin_m[0];
    for (int a = 0; a < 3; a++)
        out[a] = m->axes[a][0] * ahead + m->axes[a][1] * left;
}

void mount_of_survey(const struct survey *s, struct mount *out)
{
    static const double origin[3] = {0, 0, 0}, left[3] = {0, 1, 0}, up[3] = {0, 0, 1};

    if (s->has_mount)
        mount_create(out, s->mount_origin_m, s->mount_x_axis, s->mount_y_axis);
    else
        mount_create(out, origin, left, up);
}

void mount_survey_axes(const struct survey *s, double r[3][3], double t[3])
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
