/* SPDX-License-Identifier: MIT */
/* recon/mount.h -- how an array sits on a vehicle, and how the world moves in its frame
 * when the vehicle does. */
#ifndef ANLOS_RECON_MOUNT_H
#define ANLOS_RECON_MOUNT_H

#include "recon/ego.h"
#include "recon/survey.h"

struct mount {
    double origin_m[3]; /* the array's origin in the vehicle frame */
    double axes[3][3];  /* the array's x, y, z axes there, unit */
};

/* From its x and y axes; z is square to both. */
void mount_create(struct mount *m, const double origin_m[3], const double x[3],
                  const double y[3]);

void mount_to_vehicle(const struct mount *m, const double p[3], double out[3]);
void mount_to_array(const struct mount *m, const double p[3], double out[3]);

/* A standing point of the array frame, in the array frame a step later. */
void mount_step_point(const struct mount *m, const struct ego_step *s, const double p[3],
                      double out[3]);

/* The same of all points: from p to r p + t. */
void mount_step(const struct mount *m, const struct ego_step *s, double r[3][3],
                double t[3]);

/* What the vehicle's motion is for the array: its velocity in its own frame, m/s. */
void mount_velocity(const struct mount *m, const struct ego_motion *motion,
                    double out[3]);

/* That of a survey.  For what moves: without a mount the array counts as looking forward
 * from the vehicle's origin, its x axis to the left. */
void mount_of_survey(const struct survey *s, struct mount *out);

/* A point p of the array's frame is at r p + t in that of survey_to_vehicle, r
 * [vehicle][array]; without a mount that is p itself. */
void mount_survey_axes(const struct survey *s, double r[3][3], double t[3]);

#endif
