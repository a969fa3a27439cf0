/* SPDX-License-Identifier: MIT */
/* nodes/play/rewrite.h -- what is said otherwise than it was recorded: that it is a
 * replay, where a bag is played more than once the number of the scan, and which survey
 * it is of, where another program recorded it without saying so.  Sound and images that
 * were shuffled for the bag (msgs/shuffle.h) are float32 again, as everybody on the bus
 * expects them. */
#ifndef ANLOS_NODES_PLAY_REWRITE_H
#define ANLOS_NODES_PLAY_REWRITE_H

#include "msgs/bag/bytes.h"
#include "msgs/topics.h"

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
