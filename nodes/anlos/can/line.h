/* nodes/anlos/can/line.h -- a line that candump wrote, of a log (-L) or for the screen:
 *   (1764000000.250000) can0 404#2A10000000000000
 *   (1764000000.250000)  can0  404   [8]  2A 10 00 00 00 00 00 00
 * The time may be missing on the screen.  Longer lines than any of candump's are none. */
#ifndef ANLOS_NODES_ANLOS_CAN_LINE_H
#define ANLOS_NODES_ANLOS_CAN_LINE_H

#include <stdbool.h>
#include <stdint.h>

#include "msgs/can/frame.h"

#define CAN_LINE_SIZE 512 /* the longest of candump with its end: FD with text beside */

struct can_line {
    bool dated;
    int64_t stamp_ns; /* as written; not dated: 0 */
    char interface[16];
    bool data; /* false: a remote or an error frame, or an identifier of 29 bits */
    struct can_frame_data frame;
};

/* 0, -EINVAL. */
int can_line_parse(struct can_line *out, const char *text);

#endif
