/* SPDX-License-Identifier: MIT */
/* tests/nodes/living.h -- nodes of a system, each a process that this test starts: they
 * hold their locks and say how they are. */
#ifndef ANLOS_TESTS_NODES_LIVING_H
#define ANLOS_TESTS_NODES_LIVING_H

#include <sys/types.h>

#include "msgs/health.pb-c.h"

enum living_kind {
    LIVING,        /* publishes its health, 20 times a second */
    LIVING_SILENT, /* only holds its lock and sockets */
};

/* Starts a node in a run folder; health: what it says, with topics and device, but for
 * node and pid.  Returns when it is there.  Call it before this process has threads. */
pid_t living_start(const char *run_dir, const char *node, enum living_kind kind,
                   const Anlos__Health *health);

/* Ends it, by SIGTERM (it closes its bus) or by SIGKILL, and waits for that. */
void living_end(pid_t pid, int signal);

#endif
