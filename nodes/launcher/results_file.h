/* nodes/launcher/results_file.h -- what the node report has left in its folder, read for
 * the lines at the end of a launch. */
#ifndef ANLOS_NODES_LAUNCHER_RESULTS_FILE_H
#define ANLOS_NODES_LAUNCHER_RESULTS_FILE_H

#include <jansson.h>

#include "dsp/complaint.h"

/* FOLDER/NAME; release *out with json_decref.  path[size] gets its name, for complaints.
 * 0, -ENOENT (there is none), -EINVAL (no JSON, too long a name). */
int results_file_load(json_t **out, const char *folder, const char *name, char *path,
                      size_t size, struct complaint *why);

#endif
