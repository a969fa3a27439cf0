/* SPDX-License-Identifier: MIT */
/* nodes/can/vehicle_bus.h -- the bus that a launch file names, as the node opens it. */
#ifndef ANLOS_NODES_CAN_VEHICLE_BUS_H
#define ANLOS_NODES_CAN_VEHICLE_BUS_H

#include "hal/canbus.h"
#include "hal/clock.h"
#include "nodes/rt/launchfile.h"

/* A log lies in the report's folder, which is made; what this node logged before it
 * crashed in the same run of a launcher stays, and the log goes on.  0 or as canbus_open.
 */
int vehicle_bus_open(struct canbus **out, const struct launchfile *l, struct error *why);

/* A bus has time-outs of its own; a log has none, and is dated like what it holds:
 * replayed. */
const struct clock_source *vehicle_bus_clock(const struct launchfile *l,
                                             const struct clock_source *replayed);

#endif
