/* nodes/anlos/calibrate/wiring.h -- does each channel lead to its own element? */
#ifndef ANLOS_NODES_ANLOS_CALIBRATE_WIRING_H
#define ANLOS_NODES_ANLOS_CALIBRATE_WIRING_H

#include "nodes/anlos/calibrate/diagnosis.h"

/* Fills in answers_as and either_swapped from the first arrivals (paths
 * [n_speakers][n_microphones]), the latency, and which channels are dead.  0, -ENOMEM. */
int wiring_find(struct diagnosis *d, const struct path *paths, double speed_m_s);

#endif
