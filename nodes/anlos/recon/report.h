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

#endif
