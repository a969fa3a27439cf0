/* recon/detect.h -- bright places of a volume to hidden objects: local maxima above the
 * noise and above each other's sidelobes, joined where they belong to one object. */
#ifndef ANLOS_RECON_DETECT_H
#define ANLOS_RECON_DETECT_H

#include <stddef.h>

#include "recon/grid.h"

struct detect_config {
    double threshold_db;     /* above the volume's noise floor; 12 suits most scenes */
    double dynamic_range_db; /* below the brightest; sidelobes start at about -18 */
    double cluster_m;        /* bright places closer than this are one object */
    double resolution_m[3];  /* -6 dB widths of a point's image; 0: four voxels */
};

struct detection {
    double position_m[3];    /* array frame, as imaged (virtual) */
    double covariance_m2[6]; /* xx xy xz yy yz zz */
    double level_db;         /* above the noise floor */
    double existence;        /* 0..1 */
    double extent_m[3];      /* full size of what is above half amplitude; 0: a point */
};

void detect_config_default(struct detect_config *cfg);

/* intensity [nz][ny][nx], finite, >= 0.  Writes up to max detections, strongest first,
 * and how many in *n.  All-zero volumes have none.  0, -ENOMEM. */
int detect_objects(const struct detect_config *cfg, const struct grid *grid,
                   const float *intensity, struct detection *out, size_t max, size_t *n);

#endif
