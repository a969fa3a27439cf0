/* nodes/rt/launchfile_scan.h -- of a launch file's sections "scan" and "dsp": whether the
 * array is carried or stands, with which speakers, and what is subtracted.
 *
 *   scan: {mode: fixed, speakers: [0, 5, 10, 15], background: true, background_frames: 8}
 *   dsp: {background: adaptive, background_s: 5}
 */
#ifndef ANLOS_NODES_RT_LAUNCHFILE_SCAN_H
#define ANLOS_NODES_RT_LAUNCHFILE_SCAN_H

#include "nodes/rt/launchfile.h"
#include "nodes/rt/launchfile_text.h"

/* Fills in l->scan but its numbers of a stepped scan, and l->dsp's background.  0,
 * -EINVAL, -ENOMEM. */
int launchfile_copy_scan(struct launchfile *l, const struct launch_text *t,
                         struct error *why);
void launchfile_free_scan(struct launchfile *l);

#endif
