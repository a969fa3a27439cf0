/* SPDX-License-Identifier: MIT */
/* recon/detection/detector.h -- an image to the list of hidden objects, where they really
 * are.  Each list stands for itself: nothing is tracked. */
#ifndef ANLOS_RECON_DETECTION_DETECTOR_H
#define ANLOS_RECON_DETECTION_DETECTOR_H

#include <stdbool.h>
#include <stdint.h>

#include "dsp/error.h"
#include "recon/detection/detect.h"
#include "recon/detection/objects.h"
#include "recon/survey.h"
#include "recon/volume.h"
#include "recon/walls/walls.h"

struct detector_config {
    double threshold_db;     /* above the volume's noise floor */
    double min_existence;    /* 0..1: what is less likely is left out */
    enum cfar_kind cfar;     /* on: in place of the threshold */
    double false_alarm_rate; /* of each voxel, with cfar */
};

#define DETECTOR_SETTLES 7.0 /* rounds of the speakers after what stands was there */

struct detector {
    struct detector_config cfg;
    struct survey survey;
    uint64_t survey_id;
    bool has_survey;
    struct cfar *cells[2]; /* for images on cells_grid; NULL: none yet.  The first knows
                            * those alone from which what stands was taken, the second
                            * all: of a vehicle that sets off and stops again it would
                            * else not know enough when it is asked */
    struct cfar_map *map;  /* the same */
    struct occupancy *occupied; /* by pings one by one, on blocks; NULL: none told yet */
    struct grid blocks;
    bool *held;  /* [voxels], scratch */
    bool *known; /* [voxels]: something is tracked there */
    struct grid cells_grid;
    uint32_t frame, learnt_frame; /* of the newest image, and the newest learnt from */
    uint32_t counter;             /* of lists */
    int64_t stood_ns;             /* of the newest image with what stands; 0: none yet */
    bool settling;                /* that is so, or was a moment ago: the newest image */
};

void detector_init(struct detector *d, const struct detector_config *cfg);

/* Copies it; what was learnt of another one is forgotten.  0, -ENOMEM. */
int detector_survey(struct detector *d, const struct survey *survey);

/* The objects of a volume behind walls (NULL: the survey's).  0, -EAGAIN (its survey is
 * not known yet), -EINVAL (not a volume; the error says why), -ENOMEM. */
int detector_volume(struct detector *d, const struct volume *volume,
                    const struct walls *walls, struct object_list *out,
                    struct error *why);

/* With cfar: what an image of the volume's grid shows is mostly there, so the next ones
 * have to show more (dsp/cfar_map.h), but within held_m of these places [n] of the array
 * frame. */
void detector_learn(struct detector *d, const struct volume *volume,
                    const double (*held)[3], size_t n, double held_m);

/* With cfar: what the next images show within known_m of these places [n] of the array
 * frame is no noise. */
void detector_know(struct detector *d, const double (*known)[3], size_t n,
                   double known_m);

/* What was mostly there may be elsewhere now. */
void detector_forget(struct detector *d);
void detector_clear(struct detector *d);

#endif
