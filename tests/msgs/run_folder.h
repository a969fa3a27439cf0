/* SPDX-License-Identifier: MIT */
/* tests/msgs/run_folder.h -- a run folder of its own for each test, and what the tests of
 * the bus have in common.  Nothing here sleeps: it waits for messages, with a deadline.
 */
#ifndef ANLOS_TESTS_MSGS_RUN_FOLDER_H
#define ANLOS_TESTS_MSGS_RUN_FOLDER_H

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "msgs/bus.h"

#define DEADLINE_MS 60000

static char run_folder[64];

static int make_run_folder(void **state)
{
    (void)state;
    strcpy(run_folder, "/tmp/anlos-bus-XXXXXX");
    return mkdtemp(run_folder) ? 0 : -1;
}

static int remove_run_folder(void **state)
{
    (void)state;
    char path[400];
    DIR *d = opendir(run_folder);
    for (struct dirent *e; d && (e = readdir(d));) {
        snprintf(path, sizeof path, "%s/%s", run_folder, e->d_name);
        unlink(path); /* fails on "." and ".." */
    }
    if (d)
        closedir(d);
    return rmdir(run_folder);
}

static inline struct bus *open_bus(const char *node, int64_t epoch_ns)
{
    const struct bus_config cfg = {
        .node = node, .run_dir = run_folder, .epoch_ns = epoch_ns};
    struct error why = {""};
    struct bus *b = NULL;
    if (bus_create(&b, &cfg, &why) != 0)
        fail_msg("%s", why.text);
    return b;
}

static inline struct bus_message receive(struct bus *b)
{
    struct bus_message m = {0};
    assert_int_equal(bus_receive(b, &m, DEADLINE_MS), 0);
    return m;
}

static inline struct bus_count count_of(struct bus *b, const struct topic *t,
                                        bool published)
{
    struct bus_count counts[32];
    size_t n = bus_counts(b, counts, 32);
    assert_true(n <= 32);
    for (size_t i = 0; i < n; i++)
        if (counts[i].topic == t && counts[i].published == published)
            return counts[i];
    fail_msg("no count of %s", t->name);
    return counts[0];
}

static inline int64_t now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000 + t.tv_nsec / 1000000;
}

#endif
