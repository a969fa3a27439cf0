/* SPDX-License-Identifier: MIT */
/* nodes/rt/launchfile_pipeline.h -- with what a launch file has the stages run: the one
 * place where it is read for them.  A node takes its stage's part, and who holds all
 * stages (recon/pipeline.h) takes all of it. */
#ifndef ANLOS_NODES_RT_LAUNCHFILE_PIPELINE_H
#define ANLOS_NODES_RT_LAUNCHFILE_PIPELINE_H

#include "nodes/rt/launchfile.h"
#include "recon/pipeline.h"

/* l: NULL: what holds where nothing is said, but for a scan's method, which is NULL then;
 * else it outlives what is made with it. */
void launchfile_pipeline(struct pipeline_config *out, const struct launchfile *l);

/* Errors of the stages begin with the field of anlos/config.h that they are about, and a
 * colon.  Whoever has it from a launch file reads its key there: "track.cfar: ...".
 * Returns err. */
int launchfile_name_key(struct error *why, int err);

#endif
