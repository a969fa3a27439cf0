/* SPDX-License-Identifier: MIT */
/* nodes/view/view.h -- what the pages show: messages in, frames on the board out.  One
 * thread takes messages; pages read the board, and ask for slices, from any other. */
#ifndef ANLOS_NODES_VIEW_VIEW_H
#define ANLOS_NODES_VIEW_VIEW_H

#include <protobuf-c/protobuf-c.h>

#include "msgs/topics.h"
#include "nodes/view/board.h"

#define VIEW_PERIOD_NS 100000000LL  /* between two frames of a subject, but images */
#define VIEW_BEAT_NS   1000000000LL /* between two signs of life */
#define VIEW_TRAIL_NS  3000000000LL /* the time that trails of tracks show */
#define VIEW_SILENT_NS 3500000000LL /* without health, a node counts as silent */
#define VIEW_STEP_NS   250000000LL  /* of the plots over time of a running system */

struct view;

/* origin: where it looks, for a person: a run folder, or a bag's path.  0, -ENOMEM. */
int view_create(struct view **out, const char *origin, bool is_bag);

/* Whether pages may ask a recorder for the last seconds; at first they may not. */
void view_may_save(struct view *v, bool may);

struct view_message { /* borrowed */
    const struct topic *topic;
    const char *from;
    const ProtobufCMessage *content;
    int64_t capture_ns, publish_ns, epoch_ns;
};

/* The i-th topic of which it takes messages, NULL: no more.  Others are ignored. */
const struct topic *view_topic(size_t i);

/* now_ns: the time of the system that is looked at: of the machine, or of the bag. */
void view_take(struct view *v, const struct view_message *m, int64_t now_ns);

/* Posts what has changed and is due.  Returns in how many ms something will be. */
int view_tick(struct view *v, int64_t now_ns);

/* As if nothing had been taken yet, for another place in a bag; and then, when all of
 * that place is taken, posts all of it. */
void view_reset(struct view *v);
void view_flush(struct view *v, int64_t now_ns);

/* Of a bag: what the plots over time show is all of it, whatever place is shown.  Its
 * lists of objects, in any order, and then those that were taken are posted. */
void view_history_span(struct view *v, int64_t start_ns, int64_t end_ns);
void view_history_take(struct view *v, const struct view_message *m);
void view_history_post(struct view *v);

/* A sign of life for the pages; view_tick and view_flush give some too.  Any thread. */
void view_beat(struct view *v, int64_t now_ns);

struct board *view_board(struct view *v);

/* The slice at a depth index of the newest image.  NULL: there is none. */
struct frame *view_slice(struct view *v, size_t k);

/* A page was opened (+1) or closed (-1). */
void view_pages(struct view *v, int change);
void view_destroy(struct view *v);

#endif
