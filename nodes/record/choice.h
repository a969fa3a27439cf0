/* nodes/record/choice.h -- the topics to be recorded, by patterns (nodes/rt/patterns.h).
 */
#ifndef ANLOS_NODES_RECORD_CHOICE_H
#define ANLOS_NODES_RECORD_CHOICE_H

#include <stddef.h>

#include "dsp/complaint.h"
#include "msgs/topics.h"

struct choice {
    const struct topic **topics; /* [n] */
    size_t n;
};

/* exclude may be NULL.  0, -EINVAL (a pattern that no topic matches, or nothing is left),
 * -ENOMEM. */
int choice_make(struct choice *c, const char *topics, const char *exclude,
                struct complaint *why);
void choice_clear(struct choice *c);

#endif
