/* SPDX-License-Identifier: MIT */
/* nodes/record/balance.h -- what a recording has of each topic, and what it has not, as
 * its files say it (msgs/bag/manifest.h). */
#ifndef ANLOS_NODES_RECORD_BALANCE_H
#define ANLOS_NODES_RECORD_BALANCE_H

#include <stdint.h>

#include "dsp/error.h"
#include "msgs/bag/writer.h"
#include "msgs/topics.h"

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

/* 0, -ENOMEM. */
int balance_init(struct balance *t, const struct topic *const *topics, size_t n,
                 int64_t now_ns);

/* A message was taken, or so many are lost in all by now.  Topics that are not in the
 * list are ignored. */
void balance_take(struct balance *t, const struct topic *topic, size_t bytes);
void balance_lost(struct balance *t, const struct topic *topic, uint64_t total);

/* Over all topics. */
struct balance_topic balance_sum(const struct balance *t);

/* Tells what is lost and not told, if anything is.  Errors of the writer. */
int balance_tell(struct balance *t, int64_t now_ns, struct bag_writer *w,
                 struct error *why);

/* The losses of a file at its end; the next one starts at 0. */
int balance_end_file(struct balance *t, int64_t now_ns, struct bag_writer *w,
                     struct error *why);
void balance_clear(struct balance *t);

#endif
