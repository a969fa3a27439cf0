/* SPDX-License-Identifier: MIT */
/* tests/nodes/recorder_full.h -- a recorder that writes until there is no more room. */
#ifndef ANLOS_TESTS_NODES_RECORDER_FULL_H
#define ANLOS_TESTS_NODES_RECORDER_FULL_H

#include "recorder_rig.h"

#include <sys/wait.h>
#include <unistd.h>

/* In a bag without a fault that has its end; 0: it is not one. */
static inline uint64_t count_messages(const char *path)
{
    struct bag_catalog *c;
    uint64_t n_faults, n;

    if (bag_check(&n_faults, path, NULL, NULL) || n_faults ||
        bag_catalog_open(&c, path, NULL))
        return 0;
    n = c->scanned ? 0 : c->n_messages;
    bag_catalog_close(c);
    return n;
}

/* Records until the disk is full; exit code 0: it ended as it should.  In a process of
 * its own: limits and mounts are the process's. */
static inline int fill_disk(struct rig *g, int expected_err)
{
    struct recorder_config cfg = config(g);
    struct recorder_totals t;
    struct error why = {""};
    uint8_t payload[PAYLOAD_MAX];
    struct recorder *r;
    int64_t due_ns;
    size_t i = 0;
    int err;

    cfg.flush_ns = MS;
    if (recorder_create(&r, &cfg, 0, &why))
        return 2;
    do {
        struct bus_message m = make_message(i, payload);
        err = recorder_put(r, &m, (int64_t)i * MS / 8, &why);
        if (!err)
            err = recorder_tick(r, (int64_t)i * MS / 8, &due_ns, &why);
    } while (!err && ++i < 100000);
    if (err != expected_err || !strstr(why.text, g->bag))
        return 3;
    if (recorder_end(r, 0, &why))
        return 4;
    recorder_sum(r, &t);
    recorder_destroy(r);
    uint64_t n = count_messages(g->bag);
    return n < 100 || t.messages - t.unwritten != n || t.unwritten > 10 ? 5 : 0;
}

static inline int run_child(struct rig *g, int (*act)(struct rig *g))
{
    int status;
    pid_t pid = fork();

    assert_true(pid >= 0);
    if (!pid)
        _exit(act(g));
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFEXITED(status));
    return WEXITSTATUS(status);
}

#endif
