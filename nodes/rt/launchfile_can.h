/* nodes/rt/launchfile_can.h -- the section "can" of a launch file. */
#ifndef ANLOS_NODES_RT_LAUNCHFILE_CAN_H
#define ANLOS_NODES_RT_LAUNCHFILE_CAN_H

#include "nodes/rt/launchfile.h"
#include "nodes/rt/launchfile_text.h"

/* Fills in l->can; paths are as they are written.  0, -EINVAL, -ENOMEM. */
int launchfile_copy_can(struct launchfile *l, const struct launch_text *t,
                        struct error *why);

/* A log into the report's folder; a scene is relative to the launch file's, folder.  0,
 * -ENOMEM. */
int launchfile_resolve_can(struct launchfile *l, const char *folder);
void launchfile_free_can(struct launchfile *l);

#endif
