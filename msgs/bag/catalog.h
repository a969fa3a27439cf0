/* SPDX-License-Identifier: MIT */
/* msgs/bag/catalog.h -- what is in a bag and where, without its messages: from the
 * summary at its end, or, where that is missing or says too little, from the whole file.
 */
#ifndef ANLOS_MSGS_BAG_CATALOG_H
#define ANLOS_MSGS_BAG_CATALOG_H

#include <stdbool.h>

#include "msgs/bag/file.h"

/* A record that is kept: it points into its own copy. */
struct bag_kept {
    struct bag_record record;
    struct bytes_buffer copy;
};

/* A chunk, or a message that stands outside of chunks. */
struct bag_block {
    uint64_t offset, length; /* in the file */
    uint64_t start_time, end_time;
    struct bytes channels; /* of a chunk: message_index_offsets; empty: not known */
};

struct bag_catalog {
    struct bag_file file;
    bool scanned; /* the summary did not do */
    struct bag_kept header;
    struct bag_kept *schemas, *channels; /* [n_schemas], [n_channels] in their order */
    size_t n_schemas, n_channels;
    uint32_t schema_at[1 << 16], channel_at[1 << 16]; /* index + 1 of an id; 0: none */
    struct bag_kept *attachments, *metadata;          /* their index records */
    size_t n_attachments, n_metadata;
    struct bag_kept *chunks; /* their index records, when not scanned */
    size_t n_chunks;
    struct bag_block *blocks; /* [n_blocks] by start_time, then offset */
    size_t n_blocks, blocks_room;
    uint64_t n_messages, start_time, end_time; /* log times; 0 without messages */
    uint64_t counts[1 << 16];                  /* messages of each channel id */
};

/* 0; -ENOENT and other errno of opening, -EINVAL, -EBADMSG (no bag, or damaged in such a
 * way that not all of it can be found), -ENOTSUP, -EFBIG, -EIO, -ENOMEM. */
int bag_catalog_open(struct bag_catalog **out, const char *path, struct error *why);

/* NULL: none of that id. */
const struct bag_channel *bag_catalog_channel(const struct bag_catalog *c, uint16_t id);
const struct bag_schema *bag_catalog_schema(const struct bag_catalog *c, uint16_t id);

/* An attachment or metadata record by its index record; *out points into `into`.  0,
 * -EBADMSG (damaged, or there is something else), as bag_file_record. */
int bag_catalog_read(const struct bag_catalog *c, const struct bag_record *index,
                     struct bytes_buffer *into, struct bag_record *out,
                     struct error *why);
void bag_catalog_close(struct bag_catalog *c);

/* How a catalog is filled, from the summary or by a scan. */

/* Appends a copy of the record; a list grows by doubling.  0, -ENOMEM. */
int bag_catalog_keep(struct bag_kept **list, size_t *n, const struct bag_record *r);

/* A schema or channel, unless its id is known.  0, -ENOMEM. */
int bag_catalog_define(struct bag_catalog *c, const struct bag_record *r);

/* A schema or channel in place of what has its id.  0 (as it was, or new), 1 (it was
 * another), -ENOMEM. */
int bag_catalog_redefine(struct bag_catalog *c, const struct bag_record *r);

/* A message, in a chunk or outside. */
void bag_catalog_count(struct bag_catalog *c, const struct bag_message *m);

/* The index of an attachment or metadata at an offset.  0, -ENOMEM. */
int bag_catalog_add_attachment(struct bag_catalog *c, uint64_t offset, uint64_t length,
                               const struct bag_attachment *a);
int bag_catalog_add_metadata(struct bag_catalog *c, uint64_t offset, uint64_t length,
                             const struct bag_metadata *m);

#endif
