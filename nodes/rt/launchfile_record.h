/* nodes/rt/launchfile_record.h -- the section "record" of a launch file. */
#ifndef ANLOS_NODES_RT_LAUNCHFILE_RECORD_H
#define ANLOS_NODES_RT_LAUNCHFILE_RECORD_H

#include "nodes/rt/launchfile.h"
#include "nodes/rt/launchfile_text.h"

/* Fills in l->record; a path in the options adds the node, before all others.  0,
 * -EINVAL, -ENOMEM. */
int launchfile_copy_record(struct launchfile *l, const struct launch_text *t,
                           const struct launchfile_options *options, struct error *why);
void launchfile_free_record(struct launchfile *l);

#endif
