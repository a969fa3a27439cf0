/* SPDX-License-Identifier: MIT */
/* nodes/rt/export_plan.h -- the plan view as a picture: tracks with where they were and
 * how they went, walls, the array and its vehicle, what the image covers. */
#ifndef ANLOS_NODES_RT_EXPORT_PLAN_H
#define ANLOS_NODES_RT_EXPORT_PLAN_H

#include "dsp/error.h"
#include "nodes/rt/trails.h"
#include "recon/grid.h"
#include "recon/survey.h"
#include "recon/walls/walls.h"

struct plan_track { /* of what is in trails, its last word */
    uint32_t id;
    double velocity_m_s[2]; /* of the vehicle frame; NAN: not known */
    const char *class;      /* "": not known */
};

struct plan_picture {
    const char *title;
    const struct survey *survey;
    const struct walls *walls;
    const struct trails *trails;
    const struct plan_track *tracks; /* [n_tracks] */
    size_t n_tracks;
    const struct grid *grid; /* of the image; NULL: there is none */
};

/* Writes FOLDER/NAME, a PNG.  0, -ENOMEM, other negative errno. */
int export_plan(const char *folder, const char *name, const struct plan_picture *picture,
                struct error *why);

#endif
