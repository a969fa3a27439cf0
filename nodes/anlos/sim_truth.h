/* nodes/anlos/sim_truth.h -- the files beside a simulated recording: what is really there
 * (truth.json) and the microphones' calibration curves. */
#ifndef ANLOS_NODES_ANLOS_SIM_TRUTH_H
#define ANLOS_NODES_ANLOS_SIM_TRUTH_H

#include "hal/room.h"
#include "msgs/complaint.h"

/* Writes FOLDER/truth.json.  0 or a negative errno. */
int sim_truth_write(const struct room *room, const char *scene_path, const char *folder,
                    struct complaint *why);

/* Writes FOLDER/SERIAL.txt for each response (a "*1000Hz" head line, then Hz TAB dB), the
 * form that calibration folders have.  0 or a negative errno. */
int sim_curves_write(const struct survey *s, const char *folder, struct complaint *why);

#endif
