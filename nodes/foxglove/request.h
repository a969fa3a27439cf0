/* nodes/foxglove/request.h -- what a client of Foxglove's WebSocket protocol asks for.  A
 * client is anybody who can connect: nothing in its bytes is trusted. */
#ifndef ANLOS_NODES_FOXGLOVE_REQUEST_H
#define ANLOS_NODES_FOXGLOVE_REQUEST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/complaint.h"

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
 * which the server offers no capability), -EFBIG, -ENOMEM; the complaint is fit to be
 * shown to the client: ASCII, without control characters. */
int foxglove_request_parse(const void *data, size_t size, bool binary,
                           struct foxglove_request *out, struct complaint *why);
void foxglove_request_clear(struct foxglove_request *r);

#endif
