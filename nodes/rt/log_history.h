/* SPDX-License-Identifier: MIT */
/* nodes/rt/log_history.h -- the newest lines of a system's log, for who comes late: the
 * launcher keeps them in a file of the run folder, which is never seen half written.
 * Where there are too many, lines that only inform go before warnings and errors. */
#ifndef ANLOS_NODES_RT_LOG_HISTORY_H
#define ANLOS_NODES_RT_LOG_HISTORY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/log.pb-c.h"

enum { LOG_HISTORY_LINES = 200 };

/* For who comes to look: its sockets are connected by then, and what was said sooner
 * stands in the file. */
#define LOG_HISTORY_READ_NS 1000000000LL

struct log_history { /* zeroed: keeps nothing */
    char path[120];
    size_t n;
    struct {
        uint8_t *data; /* a packed message, */
        uint32_t size;
        bool informs; /* of level INFO */
    } lines[LOG_HISTORY_LINES];
    bool fresh;     /* there are lines that the file has not */
    int64_t due_ns; /* then it is written again */
};

/* A file that an earlier system left is removed. */
void log_history_open(struct log_history *h, const char *run_dir);
void log_history_add(struct log_history *h, const Anlos__Log *line);

/* Writes the file when it is to be written; returns when that will be (INT64_MAX: not
 * before the next line). */
int64_t log_history_tick(struct log_history *h, int64_t now_ns);

/* Removes the file: the system has ended. */
void log_history_close(struct log_history *h);

/* Calls with each line of a system's file, the oldest first; without a file, never. */
void log_history_read(const char *run_dir,
                      void (*call)(void *ctx, const Anlos__Log *line), void *ctx);

#endif
