/* nodes/can/sender.h -- the can node's step: detection lists and the module's state to
 * CAN frames, layout as msgs/can. */
#ifndef ANLOS_NODES_CAN_SENDER_H
#define ANLOS_NODES_CAN_SENDER_H

#include <stddef.h>
#include <stdint.h>

#include "msgs/can/frames.h"
#include "msgs/detections.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/survey.pb-c.h"

#define SENDER_MAX_FRAMES (2 + 3 * CAN_MAX_OBJECTS)

struct sender {
    uint32_t base_id;
    struct can_status status;
    int64_t list_ns; /* when the last list was sent; 0: none yet */
};

void sender_init(struct sender *s, uint32_t base_id);
void sender_survey(struct sender *s, const Anlos__Survey *survey);
void sender_scan(struct sender *s, const Anlos__ScanStatus *status);

/* frames[SENDER_MAX_FRAMES] of one list: header, time, then state, dynamics and quality
 * of each object, strongest first.  Returns how many.  capture_ns: of the list; 0: not of
 * any sound.  What is not known is sent as not available: the age then, the cycle of the
 * first list, and the place of objects when the list's survey names no wall or mount. */
size_t sender_list(struct sender *s, const Anlos__DetectionList *list, int64_t capture_ns,
                   int64_t now_ns, struct can_frame_data *frames);

/* The status frame, due every 100 ms. */
void sender_status(const struct sender *s, struct can_frame_data *frame);

#endif
