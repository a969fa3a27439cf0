/* SPDX-License-Identifier: MIT */
/* tests/e2e/held.h -- what the test does to the node can from outside: the program
 * held_can is its main.c with a wall clock and a CAN bus that the test holds, by a file
 * that both have in memory. */
#ifndef ANLOS_TESTS_E2E_HELD_H
#define ANLOS_TESTS_E2E_HELD_H

#include <fcntl.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#define HELD_FILE "ANLOS_TEST_HELD" /* in the environment: its name */

struct held {                      /* all zero: nothing is done */
    _Atomic int64_t wall_ahead_ns; /* the wall clock was set by so much */
    atomic_bool no_ego, no_ambient, bad_walls;
    atomic_bool refuse_list; /* the next one; then it is false again */
    _Atomic int64_t ego_ns;  /* when the newest came that the node was given */
    _Atomic int64_t ambient_ns;
};

static inline struct held *held_open(const char *path)
{
    int fd = path ? open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0600) : -1;

    if (fd < 0 || ftruncate(fd, sizeof(struct held)))
        abort();
    void *h = mmap(NULL, sizeof(struct held), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    close(fd);
    if (h == MAP_FAILED)
        abort();
    return h;
}

#endif
