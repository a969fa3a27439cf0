/* nodes/anlos/bag/takes.h -- which pings of a bag make up a scan: of each emission the
 * last one that is valid, as pings that failed were taken again. */
#ifndef ANLOS_NODES_ANLOS_BAG_TAKES_H
#define ANLOS_NODES_ANLOS_BAG_TAKES_H

#include "msgs/array.pb-c.h"
#include "recon/survey.h"
#include "nodes/anlos/bag/stream.h"

struct takes {
    struct survey survey; /* its stage positions are where the stage really stood */
    uint32_t scan;
    uint64_t n_retaken;  /* pings that another one stands for */
    uint64_t n_unplaced; /* of the scan, but not of the survey */
    uint64_t n_others;   /* of other scans */
    bool has_background;
    bool endless; /* of an array that stands: all of its pings count, and nothing of what
                   * follows is filled in */
    /* Number from 1 of the message in the stream, 0: there is none. */
    uint64_t *chosen; /* [2 passes][n_positions][n_speakers] */
    size_t n_missing; /* of the passes that there are */
};

/* Reads all of the stream; scan 0: the last one.  Clear with takes_clear, also after an
 * error.  0, -ENODATA (no pings, or none of that scan, or no survey of theirs), -EBADMSG,
 * -EFBIG (surveys without number), errors of stream_next. */
int takes_find(struct takes *t, struct stream *s, size_t scan, struct complaint *why);

/* Of an array that stands: is it one of them? */
bool takes_has(const struct takes *t, const Anlos__Ping *p);

/* The place of a ping among chosen; false: it is none of the scan's. */
bool takes_slot(const struct takes *t, const Anlos__Ping *p, size_t *slot);
void takes_clear(struct takes *t);

#endif
