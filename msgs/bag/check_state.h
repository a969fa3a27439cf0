/* msgs/bag/check_state.h -- what the parts of the check share. */
#ifndef ANLOS_MSGS_BAG_CHECK_STATE_H
#define ANLOS_MSGS_BAG_CHECK_STATE_H

#include "msgs/bag/catalog_build.h"
#include "msgs/bag/check.h"
#include "msgs/bag/compression.h"
#include "msgs/bag/section.h"

struct check_entry { /* a message of the chunk that came last */
    uint16_t channel_id;
    uint64_t log_time, offset;
};

struct check_chunk { /* the one that came last, and the message indexes after it */
    bool there;
    bool unread;                       /* damaged: nothing is known of its messages */
    uint64_t offset, end, indexes_end; /* in the file: it, its message indexes */
    struct bag_record index;           /* the chunk index that it should have */
    struct check_entry *entries;       /* [n] by channel, then offset */
    size_t n, room;
    size_t n_indexes, n_indexed; /* message indexes, and messages in them */
    struct bytes_buffer offsets; /* of its index */
};

struct check_group { /* records of one kind in the summary */
    uint64_t start, length;
};

struct bag_check {
    struct bag_catalog *found; /* what is really there, with the indexes it should have */
    const struct bag_check_watch *watch;
    uint64_t n_faults;
    enum bag_section section;
    uint64_t offset, next; /* of the record that came last, of the one to come */
    uint32_t crc;          /* of the section up to next */
    uint64_t allowance;    /* bytes that chunks may still hold */
    struct bytes_buffer bytes, plain;
    struct check_chunk chunk;
    uint32_t n_chunks; /* with the one that came last */
    /* of the summary */
    uint64_t summary_start;
    struct check_group groups[16]; /* by opcode */
    struct bag_kept *offsets;      /* summary offset records */
    size_t n_offsets;
    struct bag_kept statistics;
    bool *seen[3]; /* [found->n_..] of chunks, attachments, metadata: has an index */
    size_t n_seen[3];
};

/* A fault of the record that came last, or at another offset. */
void check_fault(struct bag_check *c, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
void check_fault_at(struct bag_check *c, uint64_t offset, const char *what);

/* A schema or channel, wherever it stands.  0, -ENOMEM. */
int check_definition(struct bag_check *c, const struct bag_record *r);
void check_message(struct bag_check *c, const struct bag_message *m);

/* A chunk with its records in c->plain; a message index; the end of those.  0, -ENOMEM.
 */
int check_chunk_begin(struct bag_check *c, const struct bag_chunk *k);
int check_message_index(struct bag_check *c, const struct bag_message_index *m);
int check_chunk_end(struct bag_check *c);

/* A record of the summary; all of them at the footer.  0, -ENOMEM. */
int check_summary_record(struct bag_check *c, const struct bag_record *r);
void check_footer(struct bag_check *c, const struct bag_footer *f);

#endif
