/* nodes/launcher/scenes.h -- do the simulated devices of a launch file go together?  The
 * array and the vehicle are of one drive, and a drive goes on while a scan with steps
 * would want everything to stand still. */
#ifndef ANLOS_NODES_LAUNCHER_SCENES_H
#define ANLOS_NODES_LAUNCHER_SCENES_H

#include "dsp/complaint.h"
#include "nodes/rt/launchfile.h"

/* 0, -EINVAL, -ENOMEM, or what a scene file has wrong; the complaint names file and key.
 */
int scenes_check(const struct launchfile *l, struct complaint *why);

#endif
