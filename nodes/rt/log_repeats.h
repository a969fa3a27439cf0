/* SPDX-License-Identifier: MIT */
/* nodes/rt/log_repeats.h -- the texts that were written of late, so that one that comes
 * again and again is counted instead, and said once in a while. */
#ifndef ANLOS_NODES_RT_LOG_REPEATS_H
#define ANLOS_NODES_RT_LOG_REPEATS_H

#include <stdbool.h>

#include "nodes/rt/log_line.h"

#define LOG_REPEATS_NS 10000000000LL /* a text is written at most once in this time */

enum { LOG_REPEATS_MAX = 16 };

struct log_repeats {
    struct {
        bool used;
        enum log_level level;
        char text[LOG_TEXT_SIZE];
        int64_t told_ns; /* when it was written last */
        int64_t came_ns; /* when it came last */
        uint64_t count;  /* how often it came since it was written */
    } recent[LOG_REPEATS_MAX];
};

/* A line with stamp, level and text is about to be written.  false: it is not, but
 * counted.  *out (if out->repeats > 0) is to be written, before it: the text itself, when
 * its count is due just now, or, when there is no place left to remember it in, the one
 * told longest ago, which is forgotten. */
bool log_repeats_take(struct log_repeats *r, const struct log_line *l,
                      struct log_line *out);

/* The next text, in the order in which they came last, whose repeats are to be said now
 * (with all: however short ago it was said last); stamp, level, text and repeats of *out
 * are set.  false: there is none. */
bool log_repeats_due(struct log_repeats *r, int64_t now_ns, bool all,
                     struct log_line *out);

#endif
