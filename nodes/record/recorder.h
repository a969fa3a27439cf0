/* SPDX-License-Identifier: MIT */
/* nodes/record/recorder.h -- messages into the files of a recording: chunks that are
 * written through at intervals, parts, a quota, and what was lost.  It reads no clock;
 * times are the recorder's.  A part that does not begin with a survey has the one before
 * once more: a message that is in two files, and counts once.
 *
 * A flush syncs the file (fdatasync): a process that dies leaves what it wrote to the
 * kernel, but a vehicle's power goes off without a word.  Meanwhile messages wait in the
 * bus. */
#ifndef ANLOS_NODES_RECORD_RECORDER_H
#define ANLOS_NODES_RECORD_RECORDER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "msgs/bag/compression.h"
#include "msgs/bus.h"
#include "msgs/topics.h"
#include "nodes/record/session.h"
#include "nodes/rt/log.h"

/* What a recording has of each topic, and what it has not, as its files say it
 * (msgs/bag/manifest.h). */

struct balance {
    struct balance_topic {
        const struct topic *topic;
        uint64_t messages, bytes; /* taken */
        uint64_t lost;
        uint64_t told;    /* of those lost: stand in a file */
        uint64_t earlier; /* of those: in files before this one */
    } * list;             /* [n] */
    size_t n;
    int64_t from_ns; /* what is lost and not told was lost since */
};

struct recorder_config {
    const char *path;                  /* "FILE.mcap" */
    bool free_name;                    /* FILE-2.mcap where FILE.mcap is there already */
    const struct topic *const *topics; /* [n_topics], of which losses are told */
    size_t n_topics;
    uint64_t split_bytes; /* a file ends at so many bytes; 0: never */
    int64_t split_ns;     /* after so long; 0: never */
    uint64_t quota_bytes; /* of all files; 0: none */
    int64_t flush_ns;     /* what is older is on the disk */
    enum bag_compression compression;
    bool shuffle;                  /* msgs/shuffle.h, of sound and images */
    const struct session *session; /* outlives the recorder */
    void (*say)(void *context, enum log_level level, const char *text);
    void *context;
};

struct recorder_totals {
    uint64_t messages; /* taken */
    uint64_t lost;
    uint64_t unwritten;  /* of those taken, after an error: those that are in no file */
    uint64_t file_bytes; /* of all files that are there */
    unsigned n_files, n_removed;
};

struct recorder;

/* Makes the first file.  0, -EEXIST, -EINVAL (a quota that has no room for two files),
 * -ENOMEM, errno of files. */
int recorder_create(struct recorder **out, const struct recorder_config *cfg,
                    int64_t now_ns, struct error *why);

/* 0; -ENOSPC and other errno of writing: nothing more can be recorded, and
 * recorder_end makes the file whole. */
int recorder_put(struct recorder *r, const struct bus_message *m, int64_t now_ns,
                 struct error *why);

/* A metadata record, into the file under way.  As recorder_put. */
int recorder_pairs(struct recorder *r, const char *name, const struct pairs *p,
                   struct error *why);

/* So many messages of the topic are lost by now. */
void recorder_lost(struct recorder *r, const struct topic *t, uint64_t total);

/* Flushes when it is time to.  *due_ns: when it will be; INT64_MAX: not before another
 * message.  As recorder_put. */
int recorder_tick(struct recorder *r, int64_t now_ns, int64_t *due_ns, struct error *why);

/* The file under way, or the last one. */
const char *recorder_path(const struct recorder *r);
void recorder_sum(const struct recorder *r, struct recorder_totals *out);

/* Topic by topic; as long as the recorder. */
const struct balance *recorder_balance(const struct recorder *r);

/* Ends the file; nothing can be put any more.  0 or an error of writing; after one that
 * was returned before, 0. */
int recorder_end(struct recorder *r, int64_t now_ns, struct error *why);

/* Ends it too. */
void recorder_destroy(struct recorder *r);

#endif
