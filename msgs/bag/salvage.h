/* msgs/bag/salvage.h -- finds whole records in a file whose bytes cannot be trusted. */
#ifndef ANLOS_MSGS_BAG_SALVAGE_H
#define ANLOS_MSGS_BAG_SALVAGE_H

#include <stdbool.h>

#include "msgs/bag/file.h"

struct bag_salvage {
    const struct bag_file *file;
    uint64_t work;      /* bytes that may still be looked at in vain */
    uint64_t allowance; /* bytes that chunks may still hold */
    bool out_of_memory; /* once: what seemed damaged since may be whole */
    struct bytes_buffer window;
    uint64_t window_offset;
    struct bytes_buffer record; /* the one looked at last */
    struct bytes_buffer plain;  /* its records, when it is a chunk */
};

/* Clear it with bag_salvage_free. */
void bag_salvage_init(struct bag_salvage *s, const struct bag_file *file);
void bag_salvage_free(struct bag_salvage *s);

/* Whether a magic stands there. */
bool bag_salvage_is_magic(struct bag_salvage *s, uint64_t offset);

/* The opcode and the length of a record that may begin there, with its head, and may be
 * damaged inside; 0: none, or it would reach beyond the file. */
uint64_t bag_salvage_length(struct bag_salvage *s, uint64_t offset, uint8_t *opcode);

/* A record that is whole, its checksums right, and that something sensible follows. *out
 * points into s. */
bool bag_salvage_take(struct bag_salvage *s, uint64_t offset, struct bag_record *out);

/* Could the file go on there? */
bool bag_salvage_goes_on(struct bag_salvage *s, uint64_t offset);

/* The next offset from `from` on where the file makes sense again; its size: none. */
uint64_t bag_salvage_find(struct bag_salvage *s, uint64_t from);

/* What can be decompressed of a chunk that is damaged, or of which only n bytes are
 * there, into s->plain.  0, -EBADMSG (nothing), -EIO, -ENOMEM. */
int bag_salvage_start(struct bag_salvage *s, uint64_t offset, uint64_t n);

#endif
