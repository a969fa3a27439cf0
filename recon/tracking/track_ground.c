/* SPDX-License-Identifier: MIT */
#include <math.h>

#include "recon/tracking/track_state.h"

#define GLINT_M 0.05 /* of a walker, what is brightest besides wanders so much more */

void track_turn(double angle, const double from[2], double to[2])
{
    double c = cos(angle), s = sin(angle), x = from[0], y = from[1];
    to[0] = c * x - s * y;
    to[1] = s * x + c * y;
}

void track_to_ground(const struct ego_step *pose, const double from[2], double to[2])
{
    track_turn(pose->dyaw, from, to);
    to[0] += pose->dx_m;
    to[1] += pose->dy_m;
}

void track_turn_matrix(double angle, const double from[2][2], double to[2][2])
{
    double c = cos(angle), s = sin(angle), r[2][2] = {{c, -s}, {s, c}}, half[2][2];

    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
            half[i][j] = r[i][0] * from[0][j] + r[i][1] * from[1][j];
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
            to[i][j] = half[i][0] * r[j][0] + half[i][1] * r[j][1];
}

/* The smaller axis of the ellipse: the longer one has the height, which is not heard. */
static double heard_sigma_m(const double covariance_m2[6])
{
    double half = 0.5 * (covariance_m2[0] - covariance_m2[3]);
    double mean = 0.5 * (covariance_m2[0] + covariance_m2[3]);

    return sqrt(fmax(mean - hypot(half, covariance_m2[1]), 0.0));
}

/* Of whom walks all heights are heard in turn, which his place is filtered of: what stays
 * of it is told (track_report.c). */
static void of_a_walker(const struct tracker *t, const struct track_detection *d,
                        double fresh, double out_m2[2][2])
{
    double spot_m2 = t->cfg.wander_m * t->cfg.wander_m + GLINT_M * GLINT_M;
    double xy_m2 = d->covariance_m2[1] - d->height_m2[1];
    const double c[2][2] = {
        {(d->covariance_m2[0] - d->height_m2[0] + spot_m2) / fresh, xy_m2 / fresh},
        {xy_m2 / fresh, (d->covariance_m2[3] - d->height_m2[3] + spot_m2) / fresh}};

    track_turn_matrix(t->pose.dyaw, c, out_m2);
}

/* What an image says again is worth its fresh part. */
void track_place(struct tracker *t, const struct track_scan *scan, double fresh)
{
    double wander_m2 = t->cfg.wander_m * t->cfg.wander_m, yaw = t->pose.dyaw;
    struct track_rest_look look;

    track_to_ground(&t->pose, scan->array.at_m, look.array_m);
    track_turn(yaw, scan->array.axis, look.axis);
    for (size_t j = 0; j < scan->n; j++) {
        const struct track_detection *d = &scan->detections[j];
        struct track_position *p = &t->positions[j];
        const double c[2][2] = {
            {(d->covariance_m2[0] + wander_m2) / fresh, d->covariance_m2[1] / fresh},
            {d->covariance_m2[1] / fresh, (d->covariance_m2[3] + wander_m2) / fresh}};
        track_to_ground(&t->pose, d->position_m, p->at_m);
        track_turn_matrix(yaw, c, p->covariance_m2);
        of_a_walker(t, d, fresh, p->walker_m2);
        track_turn(yaw, d->middle_m, p->middle_m);
        p->lag_s = d->lag_s;
        p->height_m = d->position_m[2];
        p->height_m2 = d->height_assumed ? d->covariance_m2[5]
                                         : (d->covariance_m2[5] + wander_m2) / fresh;
        p->height_assumed = d->height_assumed;
        look.along_m = d->along_m;
        look.range_m = d->range_m;
        look.sigma_m = hypot(t->cfg.rest_m, heard_sigma_m(d->covariance_m2));
        t->looks[j] = look;
    }
}
