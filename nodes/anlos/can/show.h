/* nodes/anlos/can/show.h -- one decoded frame as a line, for a person or as JSON. */
#ifndef ANLOS_NODES_ANLOS_CAN_SHOW_H
#define ANLOS_NODES_ANLOS_CAN_SHOW_H

#include <stdio.h>

#include "nodes/anlos/can/tally.h"

/* f: of a message of ours. */
void show_frame(const struct can_line *l, const struct tally_frame *f, FILE *to);

/* 0, -ENOMEM. */
int show_frame_json(const struct can_line *l, const struct tally_frame *f, FILE *to);

#endif
