/* nodes/anlos/calibrate/state.h -- a channel's faults in words. */
#ifndef ANLOS_NODES_ANLOS_CALIBRATE_STATE_H
#define ANLOS_NODES_ANLOS_CALIBRATE_STATE_H

enum { STATE_SIZE = 48 };

/* "inverted, noisy"; "good" without any (enum calibration_fault).  Returns out. */
const char *state_print(unsigned faults, char out[STATE_SIZE]);

#endif
