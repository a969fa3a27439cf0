/* SPDX-License-Identifier: MIT */
/* nodes/rt/stop.h -- how a process ends: who asks it to, and its exit code.  The flags
 * are global, as signal handlers need. */
#ifndef ANLOS_NODES_RT_STOP_H
#define ANLOS_NODES_RT_STOP_H

#include <signal.h>
#include <stdbool.h>

/* Of every program and command. */
enum {
    EXIT_WORKED = 0,
    EXIT_FAILED = 1,
    EXIT_BAD_INPUT = 2, /* arguments, configuration, files */
    EXIT_INTERRUPTED = 130,
    EXIT_UNREAD =
        141, /* who read standard output has gone: as of one that SIGPIPE ends */
};

struct bus;

/* A node: by SIGINT, SIGTERM, or the end of the launcher that started it. */

/* Catches the signals (SIGPIPE becomes an error of its write) and follows the launcher.
 * 0 or a negative errno. */
int stop_install(void);

/* Threads that are started between the two have the signals blocked and leave them to
 * the main thread: it is its sleep that must end.  *before: the mask of the caller. */
void stop_block(sigset_t *before);
void stop_unblock(const sigset_t *before);

/* From now on a request interrupts this bus too; NULL: none any more. */
void stop_wakes(struct bus *bus);

bool stop_requested(void);

/* A command: Ctrl-C asks it to stop at the next good place. */

/* SIGINT, SIGTERM and SIGHUP only set the flag from now on (the second one kills as
 * usual); SIGPIPE and SIGXFSZ become errors of the write that caused them. */
void interrupt_catch(void);
bool interrupt_requested(void);
bool interrupt_stops(void *unused); /* the same, as pool_stop_by takes it */

#endif
