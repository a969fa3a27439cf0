/* nodes/rt/objects.h -- the bright places of a volume as a message: where they really are
 * (mirrored at the wall, in the vehicle frame when a mount is known), with covariance. */
#ifndef ANLOS_NODES_RT_OBJECTS_H
#define ANLOS_NODES_RT_OBJECTS_H

#include "msgs/detections.pb-c.h"
#include "msgs/survey.h"
#include "recon/detect.h"
#include "recon/grid.h"

#define OBJECTS_MAX 64

/* Detects and converts: strongest first, ids from 1; what is less likely than
 * min_existence (0..1) is left out.  cfg->resolution_m is not read: it follows from the
 * survey.  Without a wall the positions are the virtual ones (mirrored = false), without
 * a mount they stay in the array frame.  intensity: [nz][ny][nx].  Free the list with
 * objects_free.  0, -ENOMEM. */
int objects_find(Anlos__DetectionList **out, const struct survey *s,
                 const struct detect_config *cfg, double min_existence,
                 const struct grid *grid, const float *intensity);

/* The conversion alone; objects[n]. */
int objects_list(Anlos__DetectionList **out, const struct survey *s,
                 const struct detection *objects, size_t n);
void objects_free(Anlos__DetectionList *list);

#endif
