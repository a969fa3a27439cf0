/* SPDX-License-Identifier: MIT */
/* nodes/launcher/launcher.h -- runs the nodes of a launch file until the report is
 * written, a node fails for good, or a signal asks to stop. */
#ifndef ANLOS_NODES_LAUNCHER_LAUNCHER_H
#define ANLOS_NODES_LAUNCHER_LAUNCHER_H

#include <stdbool.h>
#include <stdint.h>

#include "nodes/rt/arguments.h"
#include "nodes/rt/launchfile.h"

struct launcher_config {
    const struct launchfile *launch;
    const struct arguments *arguments; /* handed on to the nodes */
    const char *run_dir;
    uint64_t launch_file; /* a hash of it, for the other hosts */
    const char *bin_dir;  /* where anlos-NODE stand */
};

/* Shows logs and progress while it runs.  Returns the exit code: 0 (the report is
 * written), 1 (a node or the scan failed, or a node as it was stopped), 2 (a node refused
 * its configuration), 128 + the signal that stopped it.  *reported: the report is
 * written, be it of a scan that failed. */
int launcher_run(const struct launcher_config *cfg, bool *reported);

#endif
