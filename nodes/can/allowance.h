/* nodes/can/allowance.h -- how many objects the next list may have, so that the bus is
 * not used more than it may be: in no second, wherever it begins, do the frames of lists
 * and all that comes in cycles take more than `load` of it.  (A list without objects
 * always goes, even where that is more.)
 *
 * A list counts until a second after the next one began, so that what was still on its
 * way is in.  What comes in cycles is counted at its most: each kind once more than its
 * cycle says, the vehicle's frames too, and CAN_STATUS_CHANGES more of Status. While
 * lists come fast, each gets the same share, not the first ones all of it: as many
 * objects as fit at the pace of the last second, or of what there is of it after a start
 * or a silence. */
#ifndef ANLOS_NODES_CAN_ALLOWANCE_H
#define ANLOS_NODES_CAN_ALLOWANCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/can/load.h"

#define ALLOWANCE_LISTS 256 /* in a second; of more none has objects */

struct allowance_config {
    struct can_bus_rate rate;
    bool fd;     /* one FD frame an object, in place of three */
    double load; /* share of the bus: 0..1 */
};

struct allowance { /* all zero: nothing was sent */
    size_t n;      /* lists that have begun */
    struct {
        int64_t begun_ns;
        double bus_s;
    } lists[ALLOWANCE_LISTS]; /* a ring */
};

/* For a list that begins at now_ns; times rise, or all begins anew.  0..CAN_MAX_OBJECTS.
 */
size_t allowance_objects(struct allowance *a, const struct allowance_config *cfg,
                         int64_t now_ns);

/* It begins, with so many. */
void allowance_begin(struct allowance *a, const struct allowance_config *cfg,
                     int64_t now_ns, size_t n_objects);

#endif
