#include "nodes/rt/vehicle_frame.h"

#include <string.h>

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

void vehicle_frame_mounted(const struct survey *s, double r[3][3], double t[3])
{
    static const double forward[3][3] = {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}};

    vehicle_frame_axes(s, r, t);
    if (!s->has_mount)
        memcpy(r, forward, sizeof forward);
}

/* out = r' v */
static void turn_back(const double r[3][3], const double v[3], double out[3])
{
    for (int a = 0; a < 3; a++)
        out[a] = r[0][a] * v[0] + r[1][a] * v[1] + r[2][a] * v[2];
}

void vehicle_frame_step(const struct survey *s, const struct ego_step *step,
                        double r[3][3], double t[3])
{
    double mount[3][3], origin[3], there[3];

    vehicle_frame_mounted(s, mount, origin);
    ego_step_point(step, origin, there);
    for (int a = 0; a < 3; a++)
        there[a] -= origin[a];
    turn_back((const double(*)[3])mount, there, t);
    for (int a = 0; a < 3; a++) {
        const double axis[3] = {mount[0][a], mount[1][a], mount[2][a]};
        double turned[3], column[3];
        ego_step_turn(step, axis, turned);
        turn_back((const double(*)[3])mount, turned, column);
        for (int b = 0; b < 3; b++)
            r[b][a] = column[b];
    }
}

void vehicle_frame_velocity(const struct survey *s, const struct ego_motion *motion,
                            double out[3])
{
    double mount[3][3], origin[3];

    vehicle_frame_mounted(s, mount, origin);
    const double there[3] = {motion->speed_m_s - motion->yaw_rate_rad_s * origin[1],
                             motion->yaw_rate_rad_s * origin[0], 0.0};
    turn_back((const double(*)[3])mount, there, out);
}
