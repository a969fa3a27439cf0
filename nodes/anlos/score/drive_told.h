/* SPDX-License-Identifier: MIT */
/* nodes/anlos/score/drive_told.h -- what the vehicle is told of lists of tracks: each
 * goes through the can node's own step into frames, and is read back from these. */
#ifndef ANLOS_NODES_ANLOS_SCORE_DRIVE_TOLD_H
#define ANLOS_NODES_ANLOS_SCORE_DRIVE_TOLD_H

#include "nodes/can/sender.h"
#include "nodes/rt/launchfile.h"

struct drive_told {
    struct sender sender;
    int64_t last_ns; /* when the list before went */
    struct can_object objects[CAN_MAX_OBJECTS];
    size_t n; /* of the newest list */
};

/* l NULL: the bus as it is by default. */
void drive_told_init(struct drive_told *t, const struct launchfile *l);
void drive_told_survey(struct drive_told *t, const Anlos__Survey *survey);

/* It goes at now_ns; t->objects are those of its frames, also the deleted. */
void drive_told_list(struct drive_told *t, const Anlos__DetectionList *list,
                     int64_t capture_ns, int64_t now_ns);

#endif
