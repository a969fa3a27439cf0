/* nodes/rt/objects.h -- the bright places of a volume as a message: where they really are
 * (mirrored at the wall, in the vehicle frame when a mount is known), with covariance. */
#ifndef ANLOS_NODES_RT_OBJECTS_H
#define ANLOS_NODES_RT_OBJECTS_H

#include "msgs/detections.pb-c.h"
#include "recon/survey.h"
#include "recon/detect.h"
#include "recon/walls.h"
#include "recon/grid.h"

#define OBJECTS_MAX 64

/* Sets resolution_m, and cluster_m where details of one object are seen apart. */
void objects_resolution(struct detect_config *cfg, const struct survey *s,
                        const struct grid *grid);

/* Detects and converts: strongest first, ids from 1; what is less likely than
 * min_existence (0..1) is left out.  cfg->resolution_m is not read: it follows from the
 * survey.  Without a wall the positions are the virtual ones (mirrored = false), without
 * a mount they stay in the array frame.  intensity: [nz][ny][nx].  Free the list with
 * objects_free.  The walls are the survey's.  0, -ENOMEM. */
int objects_find(Anlos__DetectionList **out, const struct survey *s,
                 const struct detect_config *cfg, double min_existence,
                 const struct grid *grid, const float *intensity);

/* The same with other walls, e.g. the newest of topic "wall". */
int objects_find_behind(Anlos__DetectionList **out, const struct survey *s,
                        const struct walls *walls, const struct detect_config *cfg,
                        double min_existence, const struct grid *grid,
                        const float *intensity);

/* The conversion alone; objects[n]. */
int objects_list_behind(Anlos__DetectionList **out, const struct survey *s,
                        const struct walls *walls, const struct detection *objects,
                        size_t n);

/* A standard deviation from which on a place is not known along that axis, rather than
 * known badly (PEAK_UNKNOWN_M, turned). */
#define OBJECTS_KNOWN_M 10.0

/* Where an imaged object really is: in the vehicle frame, or in the array's without a
 * mount. */
struct placement {
    double position_m[3];
    double covariance_m2[6]; /* of image and wall together; the height of an array that
                                cannot tell it is that of the array, give or take half a
                                metre; one on a vehicle takes things to stand on the
                                ground, which brings them nearer */
    double extent_m[3];
    uint32_t wall;       /* that mirrored it; 0: none did, it is where it is imaged */
    bool height_assumed; /* the array hears none */
    bool behind_no_wall; /* walls are known, but none stands before it in its gate */
    bool in_free_view;
};
void objects_place(struct placement *out, const struct survey *s,
                   const struct walls *walls, const struct detection *object);
void objects_free(Anlos__DetectionList *list);

/* A vector for a detection, which frees it with the list.  NULL: no memory. */
Anlos__Vec3 *objects_vec3(const double v[3]);

#endif
