/* msgs/bag/sink.h -- a file that only ever ends after a whole record: what cannot be
 * written is taken back, and space for the end of the file is held ready. */
#ifndef ANLOS_MSGS_BAG_SINK_H
#define ANLOS_MSGS_BAG_SINK_H

#include "msgs/bag/bytes.h"
#include "dsp/complaint.h"

struct bag_sink {
    char *path;
    int fd;
    uint64_t size; /* of what was written whole */
    uint32_t crc;  /* of all of it */
};

/* Makes the file, which must not be there.  0, -EEXIST, other errno, -ENOMEM. */
int bag_sink_create(struct bag_sink *s, const char *path, struct complaint *why);

/* Writes all or nothing.  reserve: bytes that must still fit after it.  0 or a negative
 * errno. */
int bag_sink_write(struct bag_sink *s, struct bytes what, uint64_t reserve,
                   struct complaint *why);

/* Brings what was written to the disk.  0 or a negative errno. */
int bag_sink_sync(struct bag_sink *s, struct complaint *why);

/* Gives what was held ready back, and closes.  0 or a negative errno. */
int bag_sink_close(struct bag_sink *s, struct complaint *why);

#endif
