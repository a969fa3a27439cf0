/* nodes/anlos/can/lists.h -- did the object lists come whole?  A list is its header, a
 * time, and for each object three frames or one of FD, all of the header's counter. */
#ifndef ANLOS_NODES_ANLOS_CAN_LISTS_H
#define ANLOS_NODES_ANLOS_CAN_LISTS_H

#include <stdbool.h>
#include <stdint.h>

#include "msgs/can/frames.h"

struct lists {
    uint64_t whole;
    uint64_t cut; /* of which something was missing when the next one began */
    bool under_way;
    struct can_list_header header;
    unsigned frames[CAN_SENSOR_STEP]; /* by enum can_id, of the list under way */
};

/* An undamaged frame of a sensor, in the order in which they came. */
void lists_take(struct lists *l, enum can_id id, const struct can_frame_data *f);

#endif
