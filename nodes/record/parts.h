/* SPDX-License-Identifier: MIT */
/* nodes/record/parts.h -- the files of one recording: FILE.mcap, or FILE_0001.mcap,
 * FILE_0002.mcap .. when it is split, and which of them go to keep a quota. */
#ifndef ANLOS_NODES_RECORD_PARTS_H
#define ANLOS_NODES_RECORD_PARTS_H

#include <limits.h>
#include <stdbool.h>
#include <stdint.h>

#include "dsp/error.h"

struct parts {
    char stem[PATH_MAX - 40]; /* the path without its ending; room for a number */
    char ending[16];          /* ".mcap" */
    bool split;
    unsigned n; /* begun so far */
    struct part {
        unsigned number; /* from 1 */
        uint64_t bytes;
    } * closed; /* [n_closed], the oldest first */
    unsigned n_closed;
    size_t room;
    unsigned n_removed;
    uint64_t removed_bytes;
};

/* 0, -EEXIST (the file, or one of FILE_0001.mcap .. FILE_9999.mcap, is there),
 * -ENAMETOOLONG. */
int parts_init(struct parts *p, const char *path, bool split, struct error *why);

/* The same with FILE-2.mcap, FILE-3.mcap .. where an earlier recording is in the way. */
int parts_init_free(struct parts *p, const char *path, bool split, struct error *why);

/* The name of the next file. */
const char *parts_begin(struct parts *p, char path[PATH_MAX]);

/* The file begun last is complete.  0, -ENOMEM. */
int parts_end(struct parts *p, uint64_t bytes);

/* Removes the oldest complete files until they and open_bytes more are within the quota
 * or there is none.  0 or an errno of unlink(2), which a file that somebody else has
 * removed is not. */
int parts_keep_quota(struct parts *p, uint64_t quota_bytes, uint64_t open_bytes,
                     struct error *why);

/* Bytes in complete files that are there. */
uint64_t parts_bytes(const struct parts *p);
void parts_clear(struct parts *p);

#endif
