/* nodes/can/pick.h -- which objects are left out when not all fit: the less likely ones,
 * in steps of a tenth, and of these the farther ones.  What is said to exist with no
 * probability at all, but NaN, -1 or 7, goes before those. */
#ifndef ANLOS_NODES_CAN_PICK_H
#define ANLOS_NODES_CAN_PICK_H

#include <stddef.h>

#include "msgs/can/frames.h"
#include "msgs/detections.pb-c.h"

/* Writes the indices of up to max into picked[max], in their order, and returns how many.
 * max: up to CAN_MAX_OBJECTS.  A place that is not known counts as the farthest. */
size_t pick_detections(const Anlos__DetectionList *list, size_t max, size_t *picked);
size_t pick_objects(const struct can_object *objects, size_t n, size_t max,
                    size_t *picked);

#endif
