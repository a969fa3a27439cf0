/* SPDX-License-Identifier: MIT */
/* msgs/bag/reader.h -- a bag from its first byte to its last: every record in the file's
 * order, those inside chunks in the chunk's place, and every checksum looked at. */
#ifndef ANLOS_MSGS_BAG_READER_H
#define ANLOS_MSGS_BAG_READER_H

#include "dsp/error.h"
#include "msgs/bag/record.h"

struct bag_reader;

/* 0, -ENOENT and other errno of opening, -EINVAL (no file), -EBADMSG (no bag), -ENOMEM.
 */
int bag_reader_open(struct bag_reader **out, const char *path, struct error *why);

/* The next record; what it points to lasts until the next call.  Chunks themselves do
 * not appear, their index records do; opcodes that are not known are ignored.  0,
 * -ENODATA (the bag has ended as it should), -EBADMSG (damaged or cut: nothing more can
 * be read), -ENOTSUP (compression), -EFBIG (BAG_MAX_SIZE), -EIO, -ENOMEM.  An error
 * stays. */
int bag_reader_next(struct bag_reader *r, struct bag_record *out, struct error *why);
void bag_reader_close(struct bag_reader *r);

#endif
