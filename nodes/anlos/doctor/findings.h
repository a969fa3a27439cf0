/* SPDX-License-Identifier: MIT */
/* nodes/anlos/doctor/findings.h -- what `anlos doctor` found: for each thing it looked at
 * how it is, and what to do about it. */
#ifndef ANLOS_NODES_ANLOS_DOCTOR_FINDINGS_H
#define ANLOS_NODES_ANLOS_DOCTOR_FINDINGS_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/types.h>

enum finding_level {
    FINDING_OK,
    FINDING_NOTE,  /* works, but not as well as it could */
    FINDING_WRONG, /* will not work, or does not */
};

struct finding {
    enum finding_level level;
    char area[16];
    char what[1100];
    char todo[512]; /* empty: nothing */
};

struct findings { /* zeroed: none */
    size_t n, room;
    struct finding *list;
    bool full; /* out of memory: some are missing */
};

void finding_add(struct findings *f, enum finding_level level, const char *area,
                 const char *format, ...) __attribute__((format(printf, 4, 5)));

/* What to do about the one added last. */
void finding_todo(struct findings *f, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

size_t findings_count(const struct findings *f, enum finding_level level);

/* A line for each, what to do below it, and how many there are. */
void findings_print(const struct findings *f, bool colour, FILE *to);

/* {"findings": [...], "wrong": n, "notes": n}; NULL: no memory. */
json_t *findings_json(const struct findings *f);

void findings_clear(struct findings *f);

/* Looks at one thing in a process of its own, so that a driver or a disk that hangs, or
 * a library that crashes, costs no more than its lines. */

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

#endif
