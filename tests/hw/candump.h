/* SPDX-License-Identifier: MIT */
/* tests/hw/candump.h -- candump of can-utils, read line by line, and other commands of
 * the guest.  Nothing here sleeps: it waits for lines, with a deadline. */
#ifndef ANLOS_TESTS_HW_CANDUMP_H
#define ANLOS_TESTS_HW_CANDUMP_H

#include <poll.h>
#include <setjmp.h>
#include <signal.h>
#include <spawn.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#define DEADLINE_MS 60000

struct candump {
    pid_t pid;
    int fd;
    size_t used;
    char text[4096];
    char frame[200]; /* the last one: "404#0011223344556677" */
};

extern char **environ;

__attribute__((format(printf, 1, 2))) static inline void run(const char *format, ...)
{
    char command[400];
    va_list args;

    va_start(args, format);
    vsnprintf(command, sizeof command, format, args);
    va_end(args);
    if (system(command) != 0)
        fail_msg("failed: %s", command);
}

/* Reads the next frame; false: there was none for so long. */
static inline bool candump_next(struct candump *c, int timeout_ms)
{
    char *end;

    while (!(end = memchr(c->text, '\n', c->used))) {
        struct pollfd p = {.fd = c->fd, .events = POLLIN};
        if (poll(&p, 1, timeout_ms) == 0)
            return false;
        ssize_t n = read(c->fd, c->text + c->used, sizeof c->text - c->used);
        if (n <= 0)
            fail_msg("candump ended");
        c->used += (size_t)n;
    }
    *end++ = '\0'; /* "(seconds) interface frame" */
    assert_int_equal(sscanf(c->text, "%*s %*s %199s", c->frame), 1);
    c->used -= (size_t)(end - c->text);
    memmove(c->text, end, c->used);
    return true;
}

static inline const char *candump_read(struct candump *c)
{
    if (!candump_next(c, DEADLINE_MS))
        fail_msg("candump saw nothing for %d ms", DEADLINE_MS);
    return c->frame;
}

/* Listens when this returns, to error frames too. */
static inline void candump_start(struct candump *c, const char *interface)
{
    char filter[64];
    char *argv[] = {"candump", "-L", "-D", filter, NULL};
    posix_spawn_file_actions_t files;
    int ends[2];

    snprintf(filter, sizeof filter, "%s,0:0,#FFFFFFFF", interface);
    memset(c, 0, sizeof *c);
    assert_int_equal(pipe(ends), 0);
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, ends[1], STDOUT_FILENO);
    posix_spawn_file_actions_addclose(&files, ends[0]);
    posix_spawn_file_actions_addclose(&files, ends[1]);
    assert_int_equal(posix_spawnp(&c->pid, argv[0], &files, NULL, argv, environ), 0);
    posix_spawn_file_actions_destroy(&files);
    close(ends[1]);
    c->fd = ends[0];
    for (int i = 0; i < 1000; i++) {
        run("cansend %s 7FF#", interface);
        while (candump_next(c, 20))
            if (!strcmp(c->frame, "7FF#"))
                return;
    }
    fail_msg("candump does not listen to %s", interface);
}

static inline void candump_stop(struct candump *c)
{
    kill(c->pid, SIGKILL);
    waitpid(c->pid, NULL, 0);
    close(c->fd);
}

#endif
