/* SPDX-License-Identifier: MIT */
/* msgs/bag/writer.h -- a bag as it grows: messages gather in a chunk, which is written,
 * with its indexes, when it is full or flushed; the summary comes at the end.
 *
 * After an error of writing (a full disk) what was written before it is still whole, and
 * bag_writer_close still ends the file as it should: space for that is held ready. */
#ifndef ANLOS_MSGS_BAG_WRITER_H
#define ANLOS_MSGS_BAG_WRITER_H

#include <stdbool.h>

#include "dsp/error.h"
#include "msgs/bag/compression.h"
#include "msgs/bag/record.h"

struct bag_writer_config {
    const char *profile, *library;
    size_t chunk_size; /* bytes of records after which a chunk ends; 0: no chunks */
    enum bag_compression compression;
    int level; /* of compression; 0: the library's own */
    /* What a bag can go without, and only a test leaves out. */
    bool without_message_index, without_chunk_index, without_statistics,
        without_summary_offsets, without_schemas, without_channels,
        without_attachment_index, without_metadata_index;
};

struct bag_writer;

/* Makes the file, which must not be there.  0, -EEXIST and other errno of opening and
 * writing, -ENOMEM. */
int bag_writer_create(struct bag_writer **out, const char *path,
                      const struct bag_writer_config *cfg, struct error *why);

/* *id: what a channel names it by, from 1.  0, -EINVAL (65535 are there), as
 * bag_writer_message. */
int bag_writer_schema(struct bag_writer *w, const struct bag_schema *schema, uint16_t *id,
                      struct error *why);

/* The schema's id is 0 or one that there is.  *id from 1.  Errors as bag_writer_schema.
 */
int bag_writer_channel(struct bag_writer *w, const struct bag_channel *channel,
                       uint16_t *id, struct error *why);

/* Of a channel that there is.  0, -EINVAL, -EMSGSIZE (more than the reader takes,
 * BAG_MAX_SIZE: nothing is written, and the bag goes on), -ENOMEM, -ENOSPC and other
 * errno of writing. */
int bag_writer_message(struct bag_writer *w, const struct bag_message *m,
                       struct error *why);
int bag_writer_attachment(struct bag_writer *w, const struct bag_attachment *a,
                          struct error *why);
int bag_writer_metadata(struct bag_writer *w, const struct bag_metadata *m,
                        struct error *why);

/* Ends the chunk, and brings all to the disk.  Errors of writing. */
int bag_writer_flush(struct bag_writer *w, struct error *why);

/* Bytes in the file, and those of the chunk that is not yet in it. */
uint64_t bag_writer_size(const struct bag_writer *w);

/* Messages in the file: after an error of writing, all that it will have. */
uint64_t bag_writer_messages(const struct bag_writer *w);

/* Writes the summary and frees w.  0 or an error of writing, now or before. */
int bag_writer_close(struct bag_writer *w, struct error *why);

#endif
