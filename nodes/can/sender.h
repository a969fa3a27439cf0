/* SPDX-License-Identifier: MIT */
/* nodes/can/sender.h -- the can node's step: detection lists and the module's state to
 * CAN frames, layout as msgs/can. */
#ifndef ANLOS_NODES_CAN_SENDER_H
#define ANLOS_NODES_CAN_SENDER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hal/canbus.h"
#include "msgs/can/e2e.h"
#include "msgs/can/frames.h"
#include "msgs/can/load.h"
#include "msgs/detections.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "nodes/rt/launchfile.h"

/* How many objects the next list may have, so that the bus is not used more than it may
 * be: in no second, wherever it begins, do the frames of lists and all that comes in
 * cycles take more than `load` of it.  (A list without objects always goes, even where
 * that is more.)
 *
 * A list counts until a second after the next one began, so that what was still on its
 * way is in.  What comes in cycles is counted at its most: each kind once more than its
 * cycle says, the vehicle's frames too, and CAN_STATUS_CHANGES more of Status. While
 * lists come fast, each gets the same share, not the first ones all of it: as many
 * objects as fit at the pace of the last second, or of what there is of it after a start
 * or a silence. */

#define BUS_BUDGET_LISTS 256 /* in a second; of more none has objects */

struct bus_budget_config {
    struct can_bus_rate rate;
    bool fd;     /* one FD frame an object, in place of three */
    bool motion; /* and before these its motion frame */
    bool view;   /* with the list's field of view, a frame a corner */
    double load; /* share of the bus: 0..1 */
};

struct bus_budget { /* all zero: nothing was sent */
    size_t n;       /* lists that have begun */
    struct {
        int64_t begun_ns;
        double bus_s;
    } lists[BUS_BUDGET_LISTS]; /* a ring */
};

/* For a list that begins at now_ns, with so many frames of its field of view; times rise,
 * or all restarts.  0..CAN_MAX_OBJECTS. */
size_t bus_budget_objects(struct bus_budget *a, const struct bus_budget_config *cfg,
                          int64_t now_ns, size_t n_view);

/* It begins, with so many. */
void bus_budget_begin(struct bus_budget *a, const struct bus_budget_config *cfg,
                      int64_t now_ns, size_t n_objects, size_t n_view);

#define SENDER_MAX_VIEW   32 /* corners: 8.6 % of 500 kbit/s at ten lists a second */
#define SENDER_MAX_FRAMES (2 + SENDER_MAX_VIEW + 4 * CAN_MAX_OBJECTS)

struct sender_config {
    uint32_t base_id; /* of the sensor: with 0x10 for each before it */
    struct bus_budget_config bus;
    int64_t stale_ns; /* objects that were heard longer ago are predicted at best; 0: no
                         limit, of scans of what stands still */
};

struct sender {
    struct sender_config cfg;
    struct can_status status;
    struct can_diagnosis diagnosis;
    struct can_protection protection;
    bool lets_objects; /* of sender_let_objects.  true at first */
    enum can_time_sync time_sync;
    int64_t wall_ahead_ns;    /* of the vehicle's time over that of capture stamps */
    uint32_t counter;         /* of the newest list; UINT32_MAX: none, as of messages */
    uint32_t message_counter; /* of the newest that came in a message */
    bool told[256];           /* the vehicle knows of the object of this id */
    double array_m[3];        /* in the vehicle; of the survey */
    bool has_array;
    uint64_t beyond; /* places that were withheld: beyond the wall that mirrors them */
    uint64_t out_of_range; /* objects with a number that the frames have no room for */
    struct bus_budget budget;
};

/* A list on its way to the bus. */
struct sender_list {
    struct can_list_header header; /* with the number of objects that there are */
    int64_t capture_ns;            /* 0: not of any sound */
    bool tracked;                  /* its objects have ids that stay */
    bool lives[256];               /* the object of this id is there and not deleted */
    const char *note;              /* what is not sent of it, and why; NULL: all is */
    int64_t dated_ns;              /* of a replay: when it came about; 0: when it goes */
    struct can_object objects[CAN_MAX_OBJECTS]; /* [n_objects], strongest first */
    size_t n_objects;
    struct can_view_corner view[SENDER_MAX_VIEW]; /* [n_view] of its field of view */
    size_t n_view;
    bool claims;                    /* an area is seen, says what sender_finalize made */
    size_t picked[CAN_MAX_OBJECTS]; /* [n_picked] of them that go; of sender_finalize */
    size_t n_picked;
    bool truncated; /* some of the objects did not fit; of sender_finalize */
    bool stale;     /* its objects are predicted at best; of sender_finalize */
    size_t n_frames;
    struct can_frame_data frames[SENDER_MAX_FRAMES]; /* [n_frames], of sender_finalize */
};

/* What a launch file says; NULL: the defaults. */
void sender_config_set(struct sender_config *out, const struct launchfile *l);

void sender_init(struct sender *s, const struct sender_config *cfg);
void sender_survey(struct sender *s, const Anlos__Survey *survey);

/* From now on lists have objects, or none: the vehicle then knows of none any more. */
void sender_let_objects(struct sender *s, bool lets);

/* Counters rise with each list, whoever made it.  A gap in those of messages stays one;
 * where they begin again, ours go on.
 *
 * Of more than CAN_MAX_OBJECTS the likeliest are taken, in steps of a tenth, and of these
 * the nearest.  What is not known is sent as not available: the place of objects when the
 * list's survey names no wall or mount.  So is the place of what is farther away than its
 * own mirror image, which nothing is that is before its wall: it is counted.  So is what
 * is out of the range of its signal, with all that belongs to it: a place, a velocity, a
 * covariance go as a whole.  Sizes, ages and standard deviations have no upper end: the
 * largest of a signal means that or more.
 *
 * Of the field of view whole areas are taken, as long as they are no more than
 * SENDER_MAX_VIEW corners; one that is out of range is left out. */
void sender_list(struct sender *s, const Anlos__DetectionList *list, int64_t capture_ns,
                 struct sender_list *out);

/* An empty one of our own, of the newest sound that there was: when no message comes. */
void sender_empty_list(struct sender *s, int64_t capture_ns, struct sender_list *out);

/* Makes the frames, when the list goes out: header, field of view, if wanted, and time,
 * then the motion frame, if any, and state, dynamics and quality or the FD frame of each
 * object that the bus has room for (struct bus_budget) and that is allowed.  What was
 * heard too long ago is said to be predicted; what was heard, but in no list that the
 * vehicle got, is new: nothing was sent before the sensor was ready, lists were lost or
 * had no room for it.  A track is not sent before it is new.  last_ns: when the list
 * before began; 0: none did.  Cycle is then not available; nor is latency without
 * capture, or of one that is still to come. */
void sender_finalize(struct sender *s, struct sender_list *list, int64_t now_ns,
                     int64_t last_ns);

/* May what sender_finalize made of it still be said?  No: it has objects or claims to see
 * an area, and none may be sent any more, or they are said to be measured and were heard
 * too long ago by now. */
bool sender_holds(const struct sender *s, const struct sender_list *list, int64_t now_ns);

/* All of it is on the bus, or never will be. */
void sender_sent(struct sender *s, const struct sender_list *list);
void sender_dropped(struct sender *s, const struct sender_list *list);

/* The status frame, due every 100 ms, and the diagnosis, every second. */
void sender_status(const struct sender *s, struct can_frame_data *frame);
void sender_diagnosis(const struct sender *s, struct can_frame_data *frame);

/* Protects a frame of ours and sends it; the counter goes on if the bus took it.  As
 * canbus_send. */
int sender_send(struct sender *s, struct canbus *bus, const struct can_frame_data *frame,
                int64_t now_ns);

/* Which objects are left out when not all fit: the less likely ones, in steps of a
 * tenth, and of these the farther ones.  What is said to exist with no probability at
 * all, but NaN, -1 or 7, goes before those. */

/* Writes the indices of up to max into picked[max], in their order, and returns how many.
 * max: up to CAN_MAX_OBJECTS.  A place that is not known counts as the farthest. */
size_t pick_detections(const Anlos__DetectionList *list, size_t max, size_t *picked);
size_t pick_objects(const struct can_object *objects, size_t n, size_t max,
                    size_t *picked);

#endif
