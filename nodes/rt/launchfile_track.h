/* nodes/rt/launchfile_track.h -- the section "track" of a launch file. */
#ifndef ANLOS_NODES_RT_LAUNCHFILE_TRACK_H
#define ANLOS_NODES_RT_LAUNCHFILE_TRACK_H

#include "nodes/rt/launchfile.h"
#include "nodes/rt/launchfile_text.h"

/* What holds where nothing is said. */
extern const struct launch_track launch_track_default;

/* Fills in l->track.  0, -EINVAL. */
int launchfile_copy_track(struct launchfile *l, const struct launch_text *t,
                          struct error *why);

#endif
