/* SPDX-License-Identifier: MIT */
/* nodes/foxglove/request.h -- what a client of Foxglove's WebSocket protocol asks for.  A
 * client is anybody who can connect: nothing in its bytes is trusted. */
#ifndef ANLOS_NODES_FOXGLOVE_REQUEST_H
#define ANLOS_NODES_FOXGLOVE_REQUEST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "nodes/foxglove/queue.h"

#define FOXGLOVE_REQUEST_MAX_SIZE   ((size_t)64 << 10)
#define FOXGLOVE_REQUEST_MAX_WISHES 1024

enum foxglove_operation { FOXGLOVE_SUBSCRIBE, FOXGLOVE_UNSUBSCRIBE };

struct foxglove_request {
    enum foxglove_operation operation;
    size_t n;
    struct foxglove_wish {
        uint32_t subscription;
        uint32_t channel; /* of FOXGLOVE_SUBSCRIBE */
    } * wishes;           /* [n] */
};

/* The whole of a text or binary message, data[size].  After 0 clear it with
 * foxglove_request_clear.  0, -EINVAL (no request by the protocol), -ENOTSUP (one for
 * which the server offers no capability), -EFBIG, -ENOMEM; the error is fit to be
 * shown to the client: ASCII, without control characters. */
int foxglove_request_parse(const void *data, size_t size, bool binary,
                           struct foxglove_request *out, struct error *why);
void foxglove_request_clear(struct foxglove_request *r);

/* What the server says by Foxglove's WebSocket protocol. */

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

/* Which web pages may connect.  A browser lets any page open a WebSocket to this machine
 * and says, in the header Origin, whose page it is. */

/* origin and host: these headers; NULL: not there, which is no browser.  Allowed are
 * pages of this machine (localhost, 127.x.x.x, [::1]), files (the desktop program),
 * Foxglove's own over https, and those of the very address that was asked for, unless
 * that is a name: an attacker's name may be made to point here. */
bool origin_is_allowed(const char *origin, const char *host);

#endif
