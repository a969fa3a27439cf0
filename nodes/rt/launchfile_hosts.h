/* SPDX-License-Identifier: MIT */
/* nodes/rt/launchfile_hosts.h -- the section `hosts` of a launch file: which machine runs
 * which nodes, and where they are reached.  Without it all is on one machine. */
#ifndef ANLOS_NODES_RT_LAUNCHFILE_HOSTS_H
#define ANLOS_NODES_RT_LAUNCHFILE_HOSTS_H

#include "nodes/rt/launchfile.h"

/* Says which host this machine is; name NULL where there are none.  0, -EINVAL. */
int launchfile_choose_host(struct launchfile *l, const char *name, struct error *why);

/* After that: has this host its keys, and those of the others, if it needs any?  As
 * keys_read. */
int launchfile_check_keys(const struct launchfile *l, struct error *why);

/* Is the node to be started on this machine, after launchfile_choose_host? */
bool launchfile_runs_here(const struct launchfile *l, const char *node);

/* For a node that is started alone: writes RUN_DIR/hosts when the name is given; else, of
 * a launch file with hosts, it has to be there.  0, -EINVAL, other negative errno. */
int launchfile_join_hosts(struct launchfile *l, const char *name, const char *run_dir,
                          struct error *why);

#endif
