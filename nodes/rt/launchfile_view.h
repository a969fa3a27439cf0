/* nodes/rt/launchfile_view.h -- the section "view" of a launch file. */
#ifndef ANLOS_NODES_RT_LAUNCHFILE_VIEW_H
#define ANLOS_NODES_RT_LAUNCHFILE_VIEW_H

#include "nodes/rt/launchfile.h"
#include "nodes/rt/launchfile_text.h"

/* Fills in l->view; a bag's path is relative to the launch file's folder.  0, -EINVAL,
 * -ENOMEM. */
int launchfile_copy_view(struct launchfile *l, const struct launch_text *t,
                         struct error *why);
void launchfile_free_view(struct launchfile *l);

#endif
