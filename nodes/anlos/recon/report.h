/* SPDX-License-Identifier: MIT */
/* nodes/anlos/recon/report.h -- what a reconstruction leaves behind, of sound or of
 * light: the image, its pictures, the list of objects, report.json; and what `anlos
 * recon` tells about its work on sound: warnings, and the table on the screen. */
#ifndef ANLOS_NODES_ANLOS_RECON_REPORT_H
#define ANLOS_NODES_ANLOS_RECON_REPORT_H

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

/* Of sound. */

struct recon_job;
struct air;

/* What a person should know about the recording, an array of strings: microphones left
 * out, clipping, lost pings, no background.  Microphones count from 1.  NULL: no memory.
 */
json_t *recon_report_warnings(const struct recon_job *job);

/* The contents of report.json, without the warnings.  NULL: no memory. */
json_t *recon_report_create(const struct recon_job *job, const struct recon_results *r);

/* The objects, the time and the folder, on stdout. */
void recon_report_print(const struct recon_job *job);

/* Parts of both for other ways to an image.  own_places: each ping has places of its own;
 * traces: they came compressed, with places of their own terms. */
json_t *recon_report_air(const struct air *a);
void recon_report_print_objects(const Anlos__DetectionList *list, bool own_places,
                                bool traces);
void recon_report_print_stages(const struct stopwatch stages[RECON_STAGES]);

#endif
