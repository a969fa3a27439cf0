/* nodes/rt/launchfile_wall.h -- the section "wall" of a launch file. */
#ifndef ANLOS_NODES_RT_LAUNCHFILE_WALL_H
#define ANLOS_NODES_RT_LAUNCHFILE_WALL_H

#include "nodes/rt/launchfile.h"
#include "nodes/rt/launchfile_text.h"

/* Fills in l->wall.  0, -EINVAL. */
int launchfile_copy_wall(struct launchfile *l, const struct launch_text *t,
                         struct error *why);

#endif
