/* SPDX-License-Identifier: MIT */
/* nodes/can/vehicle.h -- the node can: what the sensor knows goes to the vehicle in
 * frames, as its bus takes them, and what the vehicle says comes back as topics. */
#ifndef ANLOS_NODES_CAN_VEHICLE_H
#define ANLOS_NODES_CAN_VEHICLE_H

#include "hal/canbus.h"
#include "hal/clock.h"
#include "nodes/rt/loop.h"

struct vehicle;

extern const struct loop vehicle_loop; /* closes it */

/* The bus that the node's launch file names.  0, -ENOMEM, or as canbus_open and
 * canbus_listen with an error. */
int vehicle_open(struct vehicle **out, struct node *node, struct error *why);

/* The bus that a launch file names.  A log lies in the report's folder, which is made;
 * what this node logged before it crashed in the same run of a launcher stays, and the
 * log goes on.  0 or as canbus_open.
 */
int vehicle_bus_open(struct canbus **out, const struct launchfile *l, struct error *why);

#endif
