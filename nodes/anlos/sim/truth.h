/* nodes/anlos/sim/truth.h -- truth.json, what is really there in a simulated recording.
 */
#ifndef ANLOS_NODES_ANLOS_SIM_TRUTH_H
#define ANLOS_NODES_ANLOS_SIM_TRUTH_H

#include "hal/room/room.h"
#include "dsp/complaint.h"

/* Writes FOLDER/truth.json.  0 or a negative errno. */
int sim_truth_write(const struct room *room, const char *scene_path, const char *folder,
                    struct complaint *why);

#endif
