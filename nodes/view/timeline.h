/* SPDX-License-Identifier: MIT */
/* nodes/view/timeline.h -- the state of a recorded system at any time: of each channel of
 * a bag the newest message at or before it, found in the chunks before that time. */
#ifndef ANLOS_NODES_VIEW_TIMELINE_H
#define ANLOS_NODES_VIEW_TIMELINE_H

#include "dsp/error.h"
#include "nodes/view/view.h"

struct timeline;

/* 0; errors as bag_catalog_open; -ENODATA (nothing in it that could be shown). */
int timeline_open(struct timeline **out, const char *path, struct error *why);

/* Log times of the first and the last message. */
void timeline_span(const struct timeline *t, int64_t *start_ns, int64_t *end_ns);

/* The times at which there are images, in us after the start, rounded up; 1000 at most,
 * evenly thinned.  Of a bag without an index: none. */
json_t *timeline_images(const struct timeline *t);

/* Gives each of those messages to take, surveys first, then in the order of their times;
 * of the log all lines that it has come across, of pings the last 16 or more, of lists of
 * objects and the vehicle's motion those of the last VIEW_TRAIL_NS too.  What is damaged
 * is left out.  0, or the error of what was left out; -ENOMEM. */
int timeline_at(struct timeline *t, int64_t time_ns,
                void (*take)(void *ctx, const struct view_message *m), void *ctx,
                struct error *why);

/* Gives all lists of objects, a chunk after the other, and asks between them whether it
 * should stop: it goes on from there when it is called again.  What is damaged is left
 * out.  0, -EINTR, -ENOMEM. */
int timeline_lists(struct timeline *t,
                   void (*take)(void *ctx, const struct view_message *m),
                   bool (*stop)(void *ctx), void *ctx);

/* When the bag was asked for and why, where a recorder keeps the last seconds; false: it
 * was recorded as a whole. */
bool timeline_saved(const struct timeline *t, int64_t *at_ns, char *reason, size_t size);

/* Are the chunks whole from which timeline_at has taken single messages?  Reads some MB
 * for each, and asks between them whether it should stop.  0, -EINTR, -EBADMSG and other
 * errors as bag_file_chunk. */
int timeline_check(struct timeline *t, bool (*stop)(void *ctx), void *ctx,
                   struct error *why);
void timeline_close(struct timeline *t);

#endif
