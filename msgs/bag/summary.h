/* SPDX-License-Identifier: MIT */
/* msgs/bag/summary.h -- what stands at the end of a bag: its definitions again, what is
 * in it, and where. */
#ifndef ANLOS_MSGS_BAG_SUMMARY_H
#define ANLOS_MSGS_BAG_SUMMARY_H

#include "msgs/bag/record.h"

enum { BAG_SUMMARY_GROUPS = 6 };

/* The groups in the order in which they are written; each is the records as bytes. */
struct bag_summary {
    struct bytes_buffer schemas, channels, statistics, chunk_indexes, attachment_indexes,
        metadata_indexes;
    /* Chunk indexes come as long as the bag grows: those before chunk_indexes stand in a
     * file without a name. */
    uint64_t n_laid_down; /* bytes of it */
    int fd;               /* of it, once is_open */
    bool is_open, no_room;
};

void bag_summary_free(struct bag_summary *s);

/* Lays chunk indexes down that have become many, beside the file at the path.  Where that
 * cannot be done they stay in memory. */
void bag_summary_lay_down(struct bag_summary *s, const char *path);

/* Appends everything from the end of the data section to the closing magic.  start: where
 * in the file this begins; data_crc: of all before it.  0, -EIO and other errno of
 * reading what was laid down; memory that ran out shows in out->failed. */
int bag_summary_put(struct bytes_buffer *out, const struct bag_summary *s,
                    bool with_offsets, uint64_t start, uint32_t data_crc);

/* A bound of the bytes that bag_summary_put appends. */
uint64_t bag_summary_size(const struct bag_summary *s);

#endif
