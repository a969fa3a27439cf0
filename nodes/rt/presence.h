/* SPDX-License-Identifier: MIT */
/* nodes/rt/presence.h -- which nodes live in a run folder, seen without disturbing them:
 * a live node holds the lock of RUN_DIR/NODE.lock, and /proc/locks names who holds what.
 * (Trying the lock instead would turn away a node that starts just then.) */
#ifndef ANLOS_NODES_RT_PRESENCE_H
#define ANLOS_NODES_RT_PRESENCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

enum presence {
    PRESENCE_NEVER, /* there is no lock file: it has never run here */
    PRESENCE_GONE,  /* it ran here, and nobody holds its lock now */
    PRESENCE_ALIVE,
};

#define PRESENCE_MAX_LOCKS 1024

struct presence_locks { /* of the whole machine */
    size_t n;
    struct {
        uint64_t inode;
        pid_t pid;
    } held[PRESENCE_MAX_LOCKS];
};

/* Reads the locks (path: NULL for /proc/locks).  What cannot be read is empty. */
void presence_read(struct presence_locks *out, const char *path);

/* Compares the lock's inode and the process that wrote its number into the file: a file
 * system may show another device number here than there. */
enum presence presence_of(const struct presence_locks *locks, const char *run_dir,
                          const char *node);

/* Does the node that holds the lock, or held it last, live in a replay? */
bool presence_replays(const char *run_dir, const char *node);

#endif
