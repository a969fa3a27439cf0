/* nodes/launcher/tracks.h -- what an array that stands has tracked: the table at the end
 * of its launch.  The last list alone would show who is there at the end, and often
 * nobody is. */
#ifndef ANLOS_NODES_LAUNCHER_TRACKS_H
#define ANLOS_NODES_LAUNCHER_TRACKS_H

#include <stdio.h>

#include "dsp/complaint.h"

#define TRACKS_SHOWN 20 /* of more, the newest */

/* From report.json in a folder.  0, -ENOENT (there is none), -ENODATA (none of tracks),
 * -EINVAL. */
int tracks_print(const char *folder, FILE *to, struct complaint *why);

#endif
