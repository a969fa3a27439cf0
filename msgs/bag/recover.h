/* SPDX-License-Identifier: MIT */
/* msgs/bag/recover.h -- what is whole in a bag that was cut or damaged, as a new bag. */
#ifndef ANLOS_MSGS_BAG_RECOVER_H
#define ANLOS_MSGS_BAG_RECOVER_H

#include <stdbool.h>
#include <stdint.h>

#include "dsp/error.h"

struct bag_recovery {
    uint64_t n_messages, n_attachments, n_metadata; /* saved */
    uint64_t n_unchecked; /* of the messages: from chunks that are damaged or cut */
    uint64_t n_nameless;  /* messages left out, whose channel is defined nowhere */
    uint64_t n_misplaced; /* records left out that have no place in a chunk */
    uint64_t n_redefined; /* schemas and channels that have the id of another one */
    uint64_t n_damages;   /* places */
    uint64_t lost_bytes;  /* in a chunk that is whole: as they are when decompressed */
    uint64_t expected_messages; /* what the bag's own statistics say; 0: they are gone */
    uint64_t indexed_messages;  /* of those in chunks: what their indexes say */
    bool ended;                 /* the bag had its end */
};

/* Was something lost, or may it be? */
bool bag_recovery_is_loss(const struct bag_recovery *r);

/* How many messages the bag had at least, of all that tells. */
uint64_t bag_recovery_known(const struct bag_recovery *r);

/* Whoever looks on; each may be NULL. */
struct bag_recover_watch {
    /* A place that is damaged: from which byte to before which, and what is wrong. */
    void (*damaged)(void *context, uint64_t begin, uint64_t end, const char *what);
    bool (*stop)(void); /* asked between records */
    void *context;
};

/* Writes every record that is whole from `from` to `to`, which must not be there.  In a
 * chunk that does not have its checksum the messages before the end of what can be
 * decompressed count as whole.  Of channels that share an id each is kept, and a message
 * belongs to the one that stands before it last.  watch may be NULL.
 * 0 even when much was lost; -EEXIST, -ENOENT and other errno of files, -ENOMEM, -EINTR
 * (stopped).  After an error *to may be there, unfinished. */
int bag_recover(struct bag_recovery *out, const char *from, const char *to,
                const struct bag_recover_watch *watch, struct error *why);

#endif
