/* nodes/rt/vehicle_frame.h -- how the array sits on the vehicle, and how the world moves
 * in its frame when the vehicle does. */
#ifndef ANLOS_NODES_RT_VEHICLE_FRAME_H
#define ANLOS_NODES_RT_VEHICLE_FRAME_H

#include "msgs/survey.h"
#include "recon/ego.h"

/* A point p of the array frame stands at r p + t in the vehicle frame, r
 * [vehicle][array]. Without a mount that is p itself, as in survey_to_vehicle. */
void vehicle_frame_axes(const struct survey *s, double r[3][3], double t[3]);

/* The same; without a mount the array counts as looking forward from the vehicle's
 * origin, its x axis to the left. */
void vehicle_frame_mounted(const struct survey *s, double r[3][3], double t[3]);

/* Where a point that stands still is in the array's frame after the vehicle's step:
 * r p + t.  Mounted as vehicle_frame_mounted says; so is vehicle_frame_velocity. */
void vehicle_frame_step(const struct survey *s, const struct ego_step *step,
                        double r[3][3], double t[3]);

/* What the vehicle's motion is for the array: its velocity in the array's frame, m/s. */
void vehicle_frame_velocity(const struct survey *s, const struct ego_motion *motion,
                            double out[3]);

#endif
