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
};

/* A list on its way to the bus. */
struct sender_list {
    struct can_list_header header; /* latency and cycle are known when it goes out */
    int64_t capture_ns;            /* 0: not of any sound */
    int64_t dated_ns;              /* of a replay: when it came about; 0: when it goes */
    size_t n_frames;
    struct can_frame_data frames[SENDER_MAX_FRAMES]; /* [n_frames] */
};

void sender_init(struct sender *s, uint32_t base_id);
void sender_survey(struct sender *s, const Anlos__Survey *survey);
void sender_scan(struct sender *s, const Anlos__ScanStatus *status);

/* State, dynamics and quality of each object, strongest first, behind two places for what
 * sender_date writes.  What is not known is sent as not available: the place of objects
 * when the list's survey names no wall or mount. */
void sender_list(const struct sender *s, const Anlos__DetectionList *list,
                 int64_t capture_ns, struct sender_list *out);

/* Header and time, when the list goes out.  last_ns: when the one before began; 0: none
 * did.  Cycle and, without capture, latency are then not available. */
void sender_date(const struct sender *s, struct sender_list *list, int64_t now_ns,
                 int64_t last_ns);

/* The status frame, due every 100 ms. */
void sender_status(const struct sender *s, struct can_frame_data *frame);

#endif
