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
};

void bag_summary_free(struct bag_summary *s);

/* Appends everything from the end of the data section to the closing magic.  start: where
 * in the file this begins; data_crc: of all before it. */
void bag_summary_put(struct bytes_buffer *out, const struct bag_summary *s,
                     bool with_offsets, uint64_t start, uint32_t data_crc);

/* A bound of the bytes that bag_summary_put appends. */
uint64_t bag_summary_size(const struct bag_summary *s);

#endif
