/* SPDX-License-Identifier: MIT */
#include "nodes/rt/plan_view.h"

#include <math.h>
#include <string.h>

#define SHARE_95 2.447746830680816 /* sqrt(-2 ln 0.05) */
#define DRAWN_M  2.0               /* at most: what is not known has no end */

void plan_point(bool in_vehicle_frame, const double p[3], double out[2])
{
    out[0] = in_vehicle_frame ? -p[1] : p[0];
    out[1] = in_vehicle_frame ? p[0] : p[2];
}

void plan_ellipse(bool in_vehicle_frame, const double c[6], struct plan_ellipse *out)
{
    double xx = in_vehicle_frame ? c[3] : c[0];
    double yy = in_vehicle_frame ? c[0] : c[5];
    double xy = in_vehicle_frame ? -c[1] : c[2];
    double mean = 0.5 * (xx + yy), half = hypot(0.5 * (xx - yy), xy);

    out->major_m = fmin(SHARE_95 * sqrt(fmax(mean + half, 0.0)), DRAWN_M);
    out->minor_m = fmin(SHARE_95 * sqrt(fmax(mean - half, 0.0)), DRAWN_M);
    out->angle_rad = 0.5 * atan2(2.0 * xy, xx - yy);
}

/* How the array's x, y, z turn into the frame of the positions. */
static void turn(const struct survey *s, const double v[3], double out[3])
{
    static const double zero[3] = {0.0, 0.0, 0.0};
    double origin[3];

    survey_to_vehicle(s, zero, origin);
    survey_to_vehicle(s, v, out);
    for (int i = 0; i < 3; i++)
        out[i] -= origin[i];
}

bool plan_wall(const struct survey *s, const struct wall *wall, double point[2],
               double direction[2])
{
    static const double zero[3] = {0.0, 0.0, 0.0};
    double normal[3], level[2], origin[3], start[2];

    turn(s, wall->normal, normal);
    plan_point(s->has_mount, normal, level);
    double square = level[0] * level[0] + level[1] * level[1];
    if (square < 1e-3) /* within 2 degrees of lying flat */
        return false;
    survey_to_vehicle(s, zero, origin);
    plan_point(s->has_mount, origin, start);
    double length = sqrt(square);
    for (int i = 0; i < 2; i++)
        point[i] = start[i] + level[i] * wall->distance_m / square;
    direction[0] = -level[1] / length;
    direction[1] = level[0] / length;
    return true;
}

void plan_footprint(const struct survey *s, const struct wall *wall,
                    const struct grid *grid, double corners[4][2])
{
    static const int ends[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};

    for (int c = 0; c < 4; c++) {
        double p[3], real[3], there[3];
        for (int a = 0; a < 3; a++) {
            double far = a == 1 ? 0.5 : ends[c][a == 2];
            p[a] = grid->origin_m[a] + grid->step_m[a] * ((double)grid->n[a] * far - 0.5);
        }
        memcpy(real, p, sizeof real);
        if (wall)
            wall_mirror(wall, p, real);
        survey_to_vehicle(s, real, there);
        plan_point(s->has_mount, there, corners[c]);
    }
}
