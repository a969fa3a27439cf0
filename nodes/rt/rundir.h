/* SPDX-License-Identifier: MIT */
/* nodes/rt/rundir.h -- the folder where the processes of one system find each other, and
 * who lives in it. */
#ifndef ANLOS_NODES_RT_RUNDIR_H
#define ANLOS_NODES_RT_RUNDIR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#include "dsp/error.h"

#define RUNDIR_SIZE 88 /* with zero; a socket's path has room for 108 characters */

/* The name alone: nothing is made or looked at.  0, -EINVAL (too long). */
int rundir_name(char out[RUNDIR_SIZE], const char *asked, struct error *why);

/* The folder asked for, or $XDG_RUNTIME_DIR/anlos, or /tmp/anlos-UID; made with mode 0700
 * when missing.  0, -EINVAL (too long), as rundir_check, other negative errno. */
int rundir_open(char out[RUNDIR_SIZE], const char *asked, struct error *why);

/* Whoever can write into it can speak as any node.  So, if it is there, it has to be this
 * user's (root is no exception), and nobody else's to write into; and not everybody may
 * replace it, nor one that is to be made (owners of the folders around it may).  0,
 * -EINVAL (not a folder), -EACCES, other negative errno.
 */
int rundir_check(const char *run_dir, struct error *why);

/* The launch file of the system that runs there, RUN_DIR/launch-file: a link, so that
 * paths in the file mean what they mean where it lies.  path NULL: takes it away.  What
 * is there and is no link is left alone.  0, -EEXIST (such), -ENOMEM, other negative
 * errno. */
int rundir_set_launch(const char *run_dir, const char *path, struct error *why);

/* Its absolute path, owned by the caller; NULL: nobody left one, or the file is gone. */
char *rundir_launch(const char *run_dir);

/* Which nodes live in it, seen without disturbing them: a live node holds the lock of
 * RUN_DIR/NODE.lock, and /proc/locks names who holds what.  (Trying the lock instead
 * would turn away a node that starts just then.) */

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
