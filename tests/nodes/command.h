/* SPDX-License-Identifier: MIT */
/* tests/nodes/command.h -- runs a subcommand of `anlos` in a child process. */
#ifndef ANLOS_TESTS_NODES_COMMAND_H
#define ANLOS_TESTS_NODES_COMMAND_H

#include <sys/types.h>

struct command_result {
    int code; /* of exit; -1: killed by a signal */
    char out[8192], err[8192];
};

/* Starts command(argc, argv) of the NULL-terminated words (argv[0] first) with stdout and
 * stderr in pipes, *out_fd and *err_fd.  Call it before this process has threads. */
pid_t command_start(int (*command)(int, char **), char *const words[], int *out_fd,
                    int *err_fd);

/* command_start, then reads both to their ends and waits. */
void command_run(struct command_result *r, int (*command)(int, char **),
                 char *const words[]);

#endif
