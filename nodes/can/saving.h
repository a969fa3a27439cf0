/* SPDX-License-Identifier: MIT */
/* nodes/can/saving.h -- a request of the vehicle to save the last seconds, on its way to
 * a recorder: asked until one says that it saves, and given up after SAVING_NS.  A
 * recorder that keeps nothing is no answer while another one may keep something.  Time is
 * an argument. */
#ifndef ANLOS_NODES_CAN_SAVING_H
#define ANLOS_NODES_CAN_SAVING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hal/device.h"
#include "msgs/can/frames.h"
#include "msgs/save.pb-c.h"

#define SAVING_NS    3000000000LL /* a recorder says once a second what it does */
#define SAVING_AGAIN 250000000LL  /* asked again */
enum { SAVING_COUNTS = 2, SAVING_TEXT_SIZE = 320 };

struct saving {  /* all zero: nothing was asked for */
    uint64_t id; /* of the request under way; 0: there is none */
    int64_t next_ns, end_ns;
    char reason[48];
    char failed[SAVING_TEXT_SIZE]; /* why the newest was not saved; empty: it was, or may
                                      still be */
    char answer[160];              /* of a recorder that did not */
    uint64_t asked, unsaved;
};

/* One that is under way is given up for it: it asks for the same seconds. */
void saving_begin(struct saving *s, const struct can_save_request *request,
                  int64_t now_ns);

/* Is out to be published now? */
bool saving_due(struct saving *s, int64_t now_ns, Anlos__SaveRequest *out);

/* What a recorder says.  True once when it saves. */
bool saving_status(struct saving *s, const Anlos__SaveStatus *status);

/* True once when nobody has saved it in time: failed says why. */
bool saving_ends(struct saving *s, int64_t now_ns);

/* "saves_asked", "saves_failed" */
void saving_counts(const struct saving *s, struct device_count out[SAVING_COUNTS]);

#endif
