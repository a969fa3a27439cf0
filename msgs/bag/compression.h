/* SPDX-License-Identifier: MIT */
/* msgs/bag/compression.h -- the compressions that a chunk may have: none, zstd and lz4
 * (its frame format). */
#ifndef ANLOS_MSGS_BAG_COMPRESSION_H
#define ANLOS_MSGS_BAG_COMPRESSION_H

#include "msgs/bag/bytes.h"

enum bag_compression { BAG_NONE, BAG_ZSTD, BAG_LZ4 };

/* "", "zstd", "lz4", as the format names them. */
const char *bag_compression_name(enum bag_compression c);

/* 0, -ENOTSUP (no such name). */
int bag_compression_find(enum bag_compression *out, struct bytes name);

/* Replaces what is in out.  level 0: the library's own.  0, -ENOMEM, -EIO. */
int bag_compress(struct bytes_buffer *out, enum bag_compression c, int level,
                 struct bytes plain);

/* Replaces what is in out by exactly plain_size bytes.  0, -EBADMSG (damaged, or another
 * size comes out), -ENOMEM. */
int bag_decompress(struct bytes_buffer *out, enum bag_compression c, struct bytes packed,
                   uint64_t plain_size);

/* Replaces what is in out by what can be decompressed before the damage or the end, at
 * most max bytes.  0, -ENOMEM. */
int bag_decompress_start(struct bytes_buffer *out, enum bag_compression c,
                         struct bytes packed, uint64_t max);

#endif
