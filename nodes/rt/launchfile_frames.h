/* nodes/rt/launchfile_frames.h -- the images of a fixed array in a launch file:
 *
 *   recon: {frames: {pings: 16, sum: power, every: frame}}
 *
 * They are made by back-projection (recon/frames.h); methods, their options and previews
 * are for scans. */
#ifndef ANLOS_NODES_RT_LAUNCHFILE_FRAMES_H
#define ANLOS_NODES_RT_LAUNCHFILE_FRAMES_H

#include "nodes/rt/launchfile.h"
#include "nodes/rt/launchfile_text.h"

/* Fills in l->recon.frames; l->scan is there.  0, -EINVAL. */
int launchfile_copy_frames(struct launchfile *l, const struct launch_text *t,
                           struct error *why);

#endif
