/* SPDX-License-Identifier: MIT */
/* nodes/anlos/recon/report.h -- what `anlos recon` tells about its work on sound:
 * warnings, report.json and the table on the screen. */
#ifndef ANLOS_NODES_ANLOS_RECON_REPORT_H
#define ANLOS_NODES_ANLOS_RECON_REPORT_H

#include <jansson.h>

#include "nodes/anlos/recon/job.h"

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
