/* SPDX-License-Identifier: MIT */
/* nodes/rt/exit_code.h -- the exit codes of every program and command. */
#ifndef ANLOS_NODES_RT_EXIT_CODE_H
#define ANLOS_NODES_RT_EXIT_CODE_H

enum {
    EXIT_WORKED = 0,
    EXIT_FAILED = 1,
    EXIT_BAD_INPUT = 2, /* arguments, configuration, files */
    EXIT_INTERRUPTED = 130,
    EXIT_UNREAD =
        141, /* who read standard output has gone: as of one that SIGPIPE ends */
};

#endif
