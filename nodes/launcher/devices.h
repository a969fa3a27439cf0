/* SPDX-License-Identifier: MIT */
/* nodes/launcher/devices.h -- looks at the devices that a launch file names before any
 * process is started and any file is written, so that a mistake costs nothing. */
#ifndef ANLOS_NODES_LAUNCHER_DEVICES_H
#define ANLOS_NODES_LAUNCHER_DEVICES_H

#include "dsp/error.h"
#include "nodes/rt/launchfile.h"

/* Opens and closes the array, the stage and the CAN bus, as far as nodes of the file have
 * them and opening leaves nothing behind: a log is looked at, not made.  The error
 * names the launch file and the key.  0, or what the device says. */
int devices_check(const struct launchfile *l, struct error *why);

/* Do they go together, and with the scan?  A simulated array and vehicle are of one
 * drive, a drive goes on while a scan with steps would want everything to stand still,
 * and a recording has a background, or none is scanned.  Part of devices_check.  0,
 * -EINVAL, -ENOMEM, or what a scene file has wrong; the error names file and key. */
int devices_fit(const struct launchfile *l, struct error *why);

#endif
