/* SPDX-License-Identifier: MIT */
/* msgs/bag/cursor.h -- a bag's messages in the order of their log times (those of one
 * time in the file's order), from any time on.  Reads the chunks that it needs, when it
 * needs them. */
#ifndef ANLOS_MSGS_BAG_CURSOR_H
#define ANLOS_MSGS_BAG_CURSOR_H

#include "msgs/bag/catalog.h"

struct bag_cursor;

/* Before the first message of every channel.  The catalog outlives it.  0, -ENOMEM. */
int bag_cursor_create(struct bag_cursor **out, const struct bag_catalog *catalog);

/* Whether messages of a channel are wanted; to be said before seek and next. */
void bag_cursor_select(struct bag_cursor *c, uint16_t channel_id, bool wanted);

/* The next message will be the first one at or after the time. */
void bag_cursor_seek(struct bag_cursor *c, uint64_t log_time);

/* What *out points to lasts until the next call.  0, -ENODATA (no more), -EBADMSG,
 * -ENOTSUP, -EFBIG (as bag_file_chunk; or chunks of one time, of more than four times
 * BAG_MAX_SIZE), -EIO, -ENOMEM. */
int bag_cursor_next(struct bag_cursor *c, struct bag_message *out, struct error *why);
void bag_cursor_destroy(struct bag_cursor *c);

#endif
