/* nodes/foxglove/reply.h -- what the server says by Foxglove's WebSocket protocol. */
#ifndef ANLOS_NODES_FOXGLOVE_REPLY_H
#define ANLOS_NODES_FOXGLOVE_REPLY_H

#include <stdbool.h>

#include "nodes/foxglove/blob.h"

#define REPLY_MESSAGE_HEAD 13 /* bytes before a message's payload */
#define REPLY_TIME_SIZE    9

enum reply_level { REPLY_INFO, REPLY_WARNING, REPLY_ERROR };

/* JSON texts.  NULL: no memory. */
struct blob *reply_server_info(const char *name, int64_t session_ns);
/* The channels that are to be named, of all there are; the id of each is its index. */
struct blob *reply_advertise(const bool *named);
struct blob *reply_status(enum reply_level level, const char *text);

void reply_message_head(uint8_t out[REPLY_MESSAGE_HEAD], uint32_t subscription,
                        int64_t t_ns);
void reply_time(uint8_t out[REPLY_TIME_SIZE], int64_t t_ns);

#endif
