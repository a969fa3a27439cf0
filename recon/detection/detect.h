/* SPDX-License-Identifier: MIT */
/* recon/detection/detect.h -- bright places of a volume to hidden objects: local maxima
 * above the noise and above each other's sidelobes, joined where they belong to one
 * object. */
#ifndef ANLOS_RECON_DETECTION_DETECT_H
#define ANLOS_RECON_DETECTION_DETECT_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/cfar.h"
#include "dsp/cfar_map.h"
#include "recon/detection/occupancy.h"
#include "recon/detection/shape.h"
#include "recon/grid.h"

struct clean;
struct pool;
struct surroundings_view;
struct trace_set;

struct detect_config {
    double threshold_db; /* above the volume's noise floor; 12 suits most scenes */
    struct cfar *cfar;   /* in place of floor and threshold: what is around each peak
                          * decides.  NULL: none.  Not owned. */
    bool learns;         /* cfar, from this image (default), but... */
    const bool *known;   /* ...[voxels] where something is known to be; NULL: nowhere.
                          * Not owned. */
    const struct trace_set *traces; /* for objects_find: what was imaged, to tell lobes
                                     * apart; NULL: not at hand.  Not owned. */
    struct pool *pool;              /* with traces: to look at what lies beyond the volume
                                     * (recon/detection/beyond); NULL: not done.  Not owned. */
    const struct surroundings_view *around; /* for objects_find: what lies around the
                                             * volume, when that was looked at before;
                                             * NULL: it was not.  Not owned. */
    const struct clean *clean;  /* for objects_find: to look for what others hide
                                 * (recon/detection/clean); NULL: not done.  Not owned. */
    const struct cfar_map *map; /* with cfar: of this grid; NULL: none.  Not owned. */
    bool clipped; /* an image of power: what is less than nothing is 0, and a place is
                   * known to a twentieth of a point's width at best */
    const struct occupancy *occupied; /* with cfar: by what single pings tell, too; NULL:
                                       * they are not at hand.  Not owned. */
    bool followed;           /* by tracks, which know themselves that an object may go on
                              * beyond a border: its place is that of what is seen of it */
    bool multipath;          /* for objects_find: echoes of others are told (default) */
    double dynamic_range_db; /* below the brightest; sidelobes start at about -18 */
    double cluster_m;        /* bright places closer than this are one object */
    double resolution_m[3];  /* -6 dB widths of a point's image; 0: four voxels */
};

enum multipath { /* how an echo came (recon/detection/multipath.h) */
                 MULTIPATH_NONE,
                 MULTIPATH_PAIR,   /* from one object to another */
                 MULTIPATH_FACE,   /* by way of a flat face, or of the ground */
                 MULTIPATH_SHADOW, /* from behind an object, by way of it */
};

struct detection {
    double position_m[3]; /* array frame, as imaged (virtual) */
    double middle_m[3];   /* likewise, of all that is bright there: of what moves the
                           * brightest spot wanders from limb to limb */
    /* xx xy xz yy yz zz; PEAK_UNKNOWN_M along what the image does not tell; beside a
     * border at least what is seen of it, beside an end in depth the front of an echo,
     * sideways */
    double covariance_m2[6];
    unsigned at_border; /* PEAK_BORDER (peak.h): it may lie beyond, or go on */
    double level_db;    /* above the noise floor */
    double existence;   /* 0..1 */
    double proven;      /* by the pings one by one: it has come, 0..1; 0: not known */
    double lately;      /* how bright it was there, over how bright it is
                         * (occupancy_lately); below 0: not known */
    double extent_m[3]; /* full size of what is above half amplitude; 0: a point */
    struct shape_guess shape;
    enum multipath multipath;
    size_t of[2]; /* then: the objects that make it, among those that were found with it;
                   * twice the same where the other is none of them */
};

void detect_config_default(struct detect_config *cfg);

/* For images of this method.  Of one that isolates points only voxels that touch are one
 * object, and what a body consists of is not told from echoes of its parts. */
void detect_config_method(struct detect_config *cfg, const char *method,
                          const struct grid *grid);

/* Guard and training cells for images on a grid: objects of half a metre and the smear of
 * a point are left out, and training cells lie as far apart as the image resolves.
 * resolution_m as above; an axis of one voxel does not count.  0, -EINVAL (a rate outside
 * 1e-12 to 0.5, or a grid too small to train on), -ENOMEM. */
int detect_cfar(struct cfar **out, enum cfar_kind kind, double false_alarm_rate,
                const struct grid *grid, const double resolution_m[3]);

/* intensity [nz][ny][nx], finite, >= 0 (0: nothing was imaged there).  Writes up to max
 * detections, strongest first, and how many in *n.  All-zero volumes have none.  0,
 * -ENOMEM. */
int detect_objects(const struct detect_config *cfg, const struct grid *grid,
                   const float *intensity, struct detection *out, size_t max, size_t *n);

#endif
