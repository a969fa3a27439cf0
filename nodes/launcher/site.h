/* SPDX-License-Identifier: MIT */
/* nodes/launcher/site.h -- where a launch takes place: the run folder, and what its nodes
 * and tools find there about the other hosts. */
#ifndef ANLOS_NODES_LAUNCHER_SITE_H
#define ANLOS_NODES_LAUNCHER_SITE_H

#include <stdint.h>

#include "nodes/rt/arguments.h"
#include "nodes/rt/launchfile.h"
#include "nodes/rt/rundir.h"

/* Opens the run folder, writes RUN_DIR/hosts, or removes it, and leaves a link to the
 * launch file there for the tools; launchfile_choose_host comes before.  0, -EINVAL,
 * -EADDRNOTAVAIL (the host is not this machine), -EADDRINUSE (a launcher runs in the
 * folder), other negative errno. */
int site_open(const struct launchfile *l, const struct arguments *a,
              char run_dir[RUNDIR_SIZE], struct error *why);

/* When all has ended: takes away what it wrote, unless another launcher runs there. */
void site_close(const struct launchfile *l, const char *run_dir);

/* The lock of the folder of results, which is there: two systems that write into it mix
 * theirs.  It goes with the process, however that ends.  Where the file
 * system has no locks everybody gets it.  *out: to be given back.  0, -EADDRINUSE
 * (another launcher has it), other negative errno. */
int site_lock_results(int *out, const char *folder, struct error *why);
void site_unlock_results(int lock, const char *folder);

/* A hash of the launch file's bytes; 0: it cannot be read. */
uint64_t site_launch_file(const struct launchfile *l);

#endif
