/* SPDX-License-Identifier: MIT */
/* nodes/can/config.h -- what a launch file says of the CAN frames, for the node and for a
 * reconstruction in one process. */
#ifndef ANLOS_NODES_CAN_CONFIG_H
#define ANLOS_NODES_CAN_CONFIG_H

#include "nodes/can/sender.h"
#include "nodes/can/watch.h"
#include "nodes/rt/launchfile.h"

/* l NULL: the defaults. */
void can_config_sender(struct sender_config *out, const struct launchfile *l);

/* Of a system that runs now. */
void can_config_watch(struct watch_config *out, const struct launchfile *l);

#endif
