/* nodes/rt/launchfile_play.h -- the section "play" of a launch file. */
#ifndef ANLOS_NODES_RT_LAUNCHFILE_PLAY_H
#define ANLOS_NODES_RT_LAUNCHFILE_PLAY_H

#include "nodes/rt/launchfile.h"
#include "nodes/rt/launchfile_text.h"

/* Fills in l->play; what the options say wins.  0, -EINVAL, -ENOMEM. */
int launchfile_copy_play(struct launchfile *l, const struct launch_text *t,
                         const struct launchfile_options *options, struct error *why);
void launchfile_free_play(struct launchfile *l);

/* "2", "0.5", or "max": 0.  0, -EINVAL. */
int launchfile_play_rate(const char *text, double *out);

#endif
