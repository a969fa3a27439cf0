/* SPDX-License-Identifier: MIT */
/* msgs/shuffle.h -- tensors of float32 in an order that compresses: first byte 0 of all
 * elements, then byte 1, ... (the "shuffle" filter of HDF5 and Blosc).  Nothing is lost
 * and nothing gets smaller: that is for the compression of a bag's chunks to do.
 *
 * Samples of a converter are whole numbers of its steps, and as such have bytes that are
 * all 0: they are shuffled as these, of 2^-15, 2^-23 or 2^-31 of full scale, sign last
 * (zigzag).  All others are shuffled as they are, the sign behind the mantissa, so that
 * the exponent is a byte of its own.  The tensor's type says which. */
#ifndef ANLOS_MSGS_SHUFFLE_H
#define ANLOS_MSGS_SHUFFLE_H

#include <stdbool.h>

#include "msgs/bag/bytes.h"
#include "msgs/tensor.pb-c.h"

/* A message that owns its data, as message_unpack gives it; both leave alone what is not
 * theirs to do: other types, no data or a size that does not divide by 4.  Costs some
 * bytes a nanosecond.  0, -ENOMEM. */
int tensor_shuffle(Anlos__Tensor *t);
int tensor_unshuffle(Anlos__Tensor *t);

/* The same of all tensors that stand in the message itself. */
int message_unshuffle(ProtobufCMessage *m);

/* Is any of them? */
bool message_is_shuffled(ProtobufCMessage *m);

/* Replaces what is in out by the payload, with its tensors shuffled or not, whatever they
 * were.  0, -EINVAL (none by the schema), -ENOMEM. */
int payload_shuffle(struct bytes_buffer *out, const ProtobufCMessageDescriptor *schema,
                    struct bytes payload, bool shuffled);

#endif
