/* nodes/track/candidates.h -- which detections of an image are tracked: neither the wall
 * itself, nor what no wall can have mirrored, nor what may be a sidelobe. */
#ifndef ANLOS_NODES_TRACK_CANDIDATES_H
#define ANLOS_NODES_TRACK_CANDIDATES_H

#include "msgs/detections.pb-c.h"
#include "nodes/track/ghosts.h"
#include "nodes/track/sight.h"

/* Brings them to the front of the list, in the order they had, and returns how many they
 * are.  tracks[n]: what is already tracked, as it is in this image. */
size_t candidates_choose(Anlos__DetectionList *list, const struct sight *sight,
                         const struct ghost_array *array,
                         const struct ghost_source *tracks, size_t n);

#endif
