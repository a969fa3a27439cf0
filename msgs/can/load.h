/* SPDX-License-Identifier: MIT */
/* msgs/can/load.h -- how long frames keep a bus busy, at worst.
 *
 * Bits of a frame with as many stuff bits as there can be: R. I. Davis, A. Burns, R. J.
 * Bril, J. J. Lukkien, "Controller Area Network (CAN) schedulability analysis: Refuted,
 * revisited and revised", Real-Time Systems 35, 2007, equation 1 (11-bit identifiers);
 * FD frames as in ISO 11898-1:2015, 10.4 and 10.5: 11-bit identifier, rates switched. */
#ifndef ANLOS_MSGS_CAN_LOAD_H
#define ANLOS_MSGS_CAN_LOAD_H

#include <stdbool.h>
#include <stddef.h>

struct can_bus_rate {
    double nominal_bit_s; /* 500e3 */
    double data_bit_s;    /* of the data phase of FD frames: 2e6 */
};

/* With the pause of three bits after it.  size: bytes of data. */
double can_frame_s(const struct can_bus_rate *rate, size_t size, bool fd);

/* Seconds of the bus for a list of n objects, header and time included; motion: with the
 * motion frame of each. */
double can_list_s(const struct can_bus_rate *rate, size_t n_objects, bool fd_objects,
                  bool motion);

/* For so many corners of its field of view. */
double can_view_s(const struct can_bus_rate *rate, size_t n_corners);

/* Seconds of the bus in one second, wherever that begins, for all that is sent in cycles
 * at most: status, diagnosis, what the vehicle says, the changes of the status, and the
 * repetitions of a request to save. */
#define CAN_STATUS_CHANGES 10 /* that do not wait for its cycle */
#define CAN_SAVE_REPEATS   5  /* of SaveRequest, 100 ms apart */
double can_cycles_s(const struct can_bus_rate *rate);

#endif
