/* SPDX-License-Identifier: MIT */
/* msgs/bag/check.h -- is a bag what it says it is?  Every checksum; every record in its
 * place and whole; message and chunk indexes, statistics and summary offsets against what
 * is really there; every message of a channel, every channel of a schema that was defined
 * before it. */
#ifndef ANLOS_MSGS_BAG_CHECK_H
#define ANLOS_MSGS_BAG_CHECK_H

#include <stdbool.h>
#include <stdint.h>

#include "dsp/error.h"

/* Whoever looks on; each may be NULL. */
struct bag_check_watch {
    void (*fault)(void *context, uint64_t offset, const char *what);
    bool (*stop)(void); /* asked between records */
    void *context;
};

/* Reads all of the file.  0, also when there are faults; -ENOENT and other errno of
 * opening, -EINVAL (no file), -EBADMSG (no bag at all), -EIO, -ENOMEM, -EINTR (stopped).
 */
int bag_check(uint64_t *n_faults, const char *path, const struct bag_check_watch *watch,
              struct error *why);

#endif
