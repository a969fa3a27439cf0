/* nodes/anlos/confocal/confocal.h -- the part of `anlos recon` for optical confocal
 * scans. */
#ifndef ANLOS_NODES_ANLOS_CONFOCAL_CONFOCAL_H
#define ANLOS_NODES_ANLOS_CONFOCAL_CONFOCAL_H

#include "nodes/anlos/recon/job.h"

/* Runs options->confocal and writes the same files as for sound.  began: when the command
 * started.  Returns the exit code. */
int confocal_run(const struct recon_options *options, const struct stopwatch *began);

#endif
