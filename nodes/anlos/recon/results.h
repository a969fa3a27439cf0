/* SPDX-License-Identifier: MIT */
/* nodes/anlos/recon/results.h -- what a reconstruction leaves behind, of sound or of
 * light: the image, its pictures, the list of objects, and what both reports tell. */
#ifndef ANLOS_NODES_ANLOS_RECON_RESULTS_H
#define ANLOS_NODES_ANLOS_RECON_RESULTS_H

#include <jansson.h>

#include "dsp/error.h"
#include "dsp/pool.h"
#include "msgs/detections.pb-c.h"
#include "nodes/anlos/recon/options.h"
#include "nodes/anlos/stopwatch.h"
#include "recon/grid.h"
#include "recon/imaging/imager.h"

enum recon_stage {
    RECON_PLAN,
    RECON_READ,
    RECON_COMPRESS,
    RECON_LOOK, /* auto: at the scene, before it decides */
    RECON_STACK,
    RECON_IMAGE,
    RECON_DETECT,
    RECON_WRITE,
    RECON_STAGES
};

const char *recon_stage_name(enum recon_stage stage);

struct recon_results { /* borrows from a job */
    const struct recon_options *options;
    const char *method;
    const struct imager_options *imaging;
    struct pool *pool;
    const struct grid *grid;
    const float *intensity; /* [nz][ny][nx] */
    const Anlos__DetectionList *detections;
    const double *gate_m, *band_hz;       /* [2]; band_hz NULL: the method has none */
    const struct imager_outcome *outcome; /* NULL: nothing is known of it */
    struct stopwatch *stages; /* [RECON_STAGES]; that of writing is counted here */
    struct stopwatch *total;
};

/* All files but report.json; began: when the command started, for *total. */
int recon_results_write(struct recon_results *r, const char *folder,
                        const struct stopwatch *began, struct error *why);

/* What report.json says of either; takes over recording.  NULL: no memory. */
json_t *recon_results_report(const struct recon_results *r, json_t *recording);

/* Adds an array of warnings (takes it over) and writes report.json (takes it over too).
 */
int recon_results_finish(json_t *report, json_t *warnings, const char *folder,
                         struct error *why);

#endif
