/* nodes/anlos/doctor/check.h -- looks at one thing in a process of its own, so that a
 * driver or a disk that hangs, or a library that crashes, costs no more than its lines.
 */
#ifndef ANLOS_NODES_ANLOS_DOCTOR_CHECK_H
#define ANLOS_NODES_ANLOS_DOCTOR_CHECK_H

#include <stdint.h>
#include <sys/types.h>

#include "nodes/anlos/doctor/findings.h"

struct check {
    const char *area; /* of what is found when it does not answer */
    void (*look)(const void *ctx, struct findings *out);
};

struct check_job { /* a check under way */
    pid_t pid;
    int fd;
};

/* To be called while this process has no other thread. */
void check_start(struct check_job *job, const struct check *c, const void *ctx);

/* Waits until it has answered, or the deadline (CLOCK_MONOTONIC) is over: that is a
 * finding too. */
void check_finish(struct check_job *job, const struct check *c, int64_t deadline_ns,
                  struct findings *out);

int64_t check_now_ns(void);

#endif
