/* SPDX-License-Identifier: MIT */
/* nodes/view/timeline_state.h -- what a timeline knows of its bag, and the place that it
 * looks for. */
#ifndef ANLOS_NODES_VIEW_TIMELINE_STATE_H
#define ANLOS_NODES_VIEW_TIMELINE_STATE_H

#include "msgs/bag/catalog.h"
#include "msgs/bag/topic_message.h"
#include "nodes/view/timeline.h"

struct held { /* a message */
    const struct bag_source *source;
    uint64_t log_time, publish_time;
    struct bytes_buffer payload;
};

struct track { /* a channel that is shown */
    struct bag_source source;
    uint16_t id;
    bool found;
    size_t n_given;     /* of those that give several */
    struct held newest; /* without payload when track_gives_several */
};

struct timeline {
    struct bag_catalog *catalog;
    struct track *tracks; /* [n_tracks] */
    size_t n_tracks;
    uint64_t time;              /* that is looked for */
    uint32_t track_at[1 << 16]; /* index + 1 of a channel; 0: not shown */
    struct held *several; /* [n_several], of tracks of which more than one is given */
    size_t n_several, room;
    struct bytes_buffer record, records;
    const struct bag_block **unchecked; /* [n_unchecked] chunks of the place of which only
                                         * single messages were read; room for all */
    size_t n_unchecked;
    size_t lists_next; /* the chunk with which timeline_lists goes on */
    struct held list;
};

/* Unpacked, to take; not what is no message of its topic. */
void timeline_give(const struct held *h,
                   void (*take)(void *ctx, const struct view_message *m), void *ctx);

/* Lines of the log, and pings: each is of one speaker. */
bool track_gives_several(const struct track *k);

/* Lists of objects, and the vehicle's motion: those of the time that trails show, and the
 * newest if there are none. */
bool track_gives_trail(const struct track *k);

/* Takes from a chunk what is the newest up to that time, if there may be something newer
 * than what was found.  0, errors as bag_file_record and bag_file_chunk. */
int timeline_take_chunk(struct timeline *t, const struct bag_block *b, uint64_t time,
                        struct error *why);

#endif
