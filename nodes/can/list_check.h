/* SPDX-License-Identifier: MIT */
/* nodes/can/list_check.h -- may a detection list be told to the vehicle at all?  One that
 * came before, or contradicts itself, says that who made it does not work any more: it is
 * refused whole, so that it is not taken for a new image either. */
#ifndef ANLOS_NODES_CAN_LIST_CHECK_H
#define ANLOS_NODES_CAN_LIST_CHECK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/detections.pb-c.h"
#include "msgs/envelope.h"

#define LIST_CHECK_SOURCES 4 /* that are remembered, each with its process */

enum list_verdict {
    LIST_GOOD,
    LIST_REPEATED,  /* its sequence or counter is not after that of one that came */
    LIST_MALFORMED, /* two of its objects have one id, as the vehicle would see them */
    LIST_VERDICTS
};

struct list_source {
    char node[ENVELOPE_NODE_SIZE];
    int64_t epoch_ns; /* another one: it was started again, and counts anew */
    uint64_t sequence;
    uint32_t counter;
};

/* All zero: none came. */
struct list_check {
    struct list_source sources[LIST_CHECK_SOURCES]; /* a ring */
    size_t n;
    uint64_t verdicts[LIST_VERDICTS]; /* how often each was */
};

/* from, epoch_ns, sequence: of its envelope.  replayed: a person may go back in a bag,
 * and it comes as often as it is played. */
enum list_verdict list_check(struct list_check *c, const Anlos__DetectionList *list,
                             const char *from, int64_t epoch_ns, uint64_t sequence,
                             bool replayed);

/* What is wrong, for a person. */
const char *list_verdict_text(enum list_verdict v);

#endif
