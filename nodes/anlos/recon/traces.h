/* nodes/anlos/recon/traces.h -- `anlos recon --traces`: the parts of a job that differ
 * when traces come compressed from a file (nodes/anlos/recon/traces_file.h). */
#ifndef ANLOS_NODES_ANLOS_RECON_TRACES_H
#define ANLOS_NODES_ANLOS_RECON_TRACES_H

#include "nodes/anlos/recon/job.h"

/* Fills the job's traces, survey and processing.  The volume is the options' or that of
 * options->survey, of which only the place is read (hal/survey/file.h); so are the wall
 * and the mount.  0, or as traces_load; -EINVAL (no volume, or one that no trace
 * reaches).
 */
int recon_traces_open(struct recon_job *job, struct error *why);

/* All pings but those that are masked. */
void recon_traces_add(struct recon_job *job, const struct recon_sink *sink);

#endif
