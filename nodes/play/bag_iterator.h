/* SPDX-License-Identifier: MIT */
/* nodes/play/bag_iterator.h -- the messages of a bag that are to be played, in the order
 * of their publish stamps, from any time on. */
#ifndef ANLOS_NODES_PLAY_BAG_ITERATOR_H
#define ANLOS_NODES_PLAY_BAG_ITERATOR_H

#include "dsp/error.h"
#include "msgs/bag/bytes.h"
#include "msgs/bag/record.h"
#include "msgs/envelope.h"
#include "msgs/topics.h"

struct bag_iterator_config {
    const char *bag;
    double start_s, end_s; /* after the bag's first message; end_s may be INFINITY */
    const char *remap; /* "FROM:=TO,...": channels called FROM are of topic TO; NULL */
};

struct bag_iterator_part { /* the messages of one node and topic */
    const struct topic *topic;
    char node[ENVELOPE_NODE_SIZE];
    bool wanted; /* all are at first */
};

struct bag_iterator_message {
    const struct bag_iterator_part *part;
    struct envelope envelope; /* as it went over the bus */
    struct bytes payload;     /* until the next one */
};

struct bag_iterator;

/* 0; errors of bag_catalog_open; -EINVAL (a remap that says nothing, or a time beyond the
 * bag's end), -ENODATA (no message of ours), -ENOMEM. */
int bag_iterator_open(struct bag_iterator **out, const struct bag_iterator_config *cfg,
                      struct error *why);

/* The i-th part, or NULL. */
struct bag_iterator_part *bag_iterator_part(struct bag_iterator *t, size_t i);

/* Channels whose messages nobody here understands. */
size_t bag_iterator_foreign(const struct bag_iterator *t);

/* First and last publish stamp of what is played. */
int64_t bag_iterator_start_ns(const struct bag_iterator *t);
int64_t bag_iterator_end_ns(const struct bag_iterator *t);

/* The next message will be the first one at or after the time.  To be called before the
 * first bag_iterator_next, and after a part became wanted or unwanted. */
void bag_iterator_seek(struct bag_iterator *t, int64_t publish_ns);

/* 0, -ENODATA (the end), as bag_cursor_next. */
int bag_iterator_next(struct bag_iterator *t, struct bag_iterator_message *out,
                      struct error *why);

/* The newest survey at or before the time, else the first one after it.  0, -ENODATA
 * (there is none), as bag_cursor_next. */
int bag_iterator_find_survey(struct bag_iterator *t, int64_t publish_ns,
                             struct bag_iterator_message *out, struct error *why);
void bag_iterator_close(struct bag_iterator *t);

/* What is said otherwise than it was recorded: that it is a replay, where a bag is played
 * more than once the number of the scan, and which survey it is of, where another program
 * recorded it without saying so.  Sound and images that were shuffled for the bag
 * (msgs/shuffle.h) are float32 again, as everybody on the bus expects them. */

/* Adds scan_base to the scan of a message that has one, makes a source REPLAY, and
 * gives a survey without id its own, and what is of a survey without saying of which,
 * survey_id.
 * *payload stays where nothing is to be said otherwise, else it points into `into`.  0,
 * -EPROTO (not a message of the topic's schema), -ENOMEM. */
int rewrite(const struct topic *t, uint32_t scan_base, uint64_t survey_id,
            struct bytes *payload, struct bytes_buffer *into);

/* -1 where the message has no such field, of 32 bits or an enumeration. */
int64_t rewrite_peek(const ProtobufCMessage *m, const char *field);

#endif
