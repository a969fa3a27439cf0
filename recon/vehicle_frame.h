/* SPDX-License-Identifier: MIT */
/* recon/vehicle_frame.h -- how the array of a survey sits on the vehicle. */
#ifndef ANLOS_RECON_VEHICLE_FRAME_H
#define ANLOS_RECON_VEHICLE_FRAME_H

#include "recon/mount.h"
#include "recon/survey.h"

/* A point p of the array's frame is at r p + t in that of survey_to_vehicle, r
 * [vehicle][array]; without a mount that is p itself. */
void vehicle_frame_axes(const struct survey *s, double r[3][3], double t[3]);

/* For what moves: without a mount the array counts as looking forward from the vehicle's
 * origin, its x axis to the left. */
void vehicle_frame_mount(const struct survey *s, struct mount *out);

#endif
