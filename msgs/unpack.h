/* SPDX-License-Identifier: MIT */
/* msgs/unpack.h -- a protobuf message from bytes that anyone may have sent.
 *
 * Two bytes can stand for a field, and each field takes some 40 in memory, and as many
 * again for what it holds: a message of 256 MB would become one of 20 GB.  So what it
 * would take is counted before memory is taken for it. */
#ifndef ANLOS_MSGS_UNPACK_H
#define ANLOS_MSGS_UNPACK_H

#include <protobuf-c/protobuf-c.h>
#include <stddef.h>
#include <stdint.h>

/* The memory that a message may take: 4 times its bytes, and this. */
#define UNPACK_SPARE_BYTES ((size_t)16 << 20)

/* Tensors that were shuffled for a bag are float32 again (msgs/shuffle.h).  NULL, and
 * errno: EBADMSG (it is not one by the schema, or would take too much memory), ENOMEM
 * (there is none).  Free the result with protobuf_c_message_free_unpacked(m, NULL). */
ProtobufCMessage *message_unpack(const ProtobufCMessageDescriptor *schema, size_t size,
                                 const uint8_t *data);

/* The same, with its tensors as they are. */
ProtobufCMessage *message_unpack_as_it_is(const ProtobufCMessageDescriptor *schema,
                                          size_t size, const uint8_t *data);

/* A deep copy of one of ours, by way of its bytes, to be freed likewise.  NULL: no
 * memory.
 */
ProtobufCMessage *message_copy(const ProtobufCMessage *m);

#endif
