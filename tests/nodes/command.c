/* SPDX-License-Identifier: MIT */
#include "tests/nodes/command.h"

#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

pid_t command_start(int (*command)(int, char **), char *const words[], int *out_fd,
                    int *err_fd)
{
    int out[2], err[2], argc = 0;
    if (pipe(out) || pipe(err))
        abort();
    fflush(NULL);
    pid_t pid = fork();
    if (pid < 0)
        abort();
    if (pid) {
        close(out[1]);
        close(err[1]);
        *out_fd = out[0];
        *err_fd = err[0];
        return pid;
    }
    dup2(out[1], STDOUT_FILENO);
    dup2(err[1], STDERR_FILENO);
    for (int i = 0; i < 2; i++) {
        close(out[i]);
        close(err[i]);
    }
    while (words[argc])
        argc++;
    exit(command(argc, (char **)words)); /* exit, so that leaks are looked for */
}

/* Appends what is there; 0 at the end of the pipe. */
static ssize_t drain(int fd, char *text, size_t size)
{
    char rest[4096];
    size_t used = strlen(text);
    ssize_t n = used + 1 < size ? read(fd, text + used, size - 1 - used)
                                : read(fd, rest, sizeof rest);
    return n > 0 ? n : 0;
}

void command_run(struct command_result *r, int (*command)(int, char **),
                 char *const words[])
{
    struct pollfd fds[2] = {{.events = POLLIN}, {.events = POLLIN}};
    char *texts[2] = {r->out, r->err};
    int status;
    memset(r, 0, sizeof *r);
    pid_t pid = command_start(command, words, &fds[0].fd, &fds[1].fd);
    while (fds[0].fd >= 0 || fds[1].fd >= 0) {
        if (poll(fds, 2, -1) < 0)
            continue;
        for (int i = 0; i < 2; i++) {
            if (!fds[i].revents || drain(fds[i].fd, texts[i], sizeof r->out))
                continue;
            close(fds[i].fd);
            fds[i].fd = -1; /* poll passes over it */
        }
    }
    if (waitpid(pid, &status, 0) != pid)
        abort();
    r->code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}
