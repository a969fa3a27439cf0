/* SPDX-License-Identifier: MIT */
/* tests/bench/drive_jobs.h -- many drives, some side by side: each in a process of
 * its own, because plans of FFTW are made by one thread at a time.  What comes out does
 * not depend on how many there are. */
#ifndef ANLOS_TESTS_BENCH_DRIVE_JOBS_H
#define ANLOS_TESTS_BENCH_DRIVE_JOBS_H

#include <stdint.h>

#include "nodes/anlos/score/drive_result.h"
#include "nodes/rt/launchfile.h"

/* One simulated drive from its beginning to its end. */

struct drive_run { /* borrows */
    const struct launchfile *launch;
    const char *scene; /* file */
    uint32_t draw;     /* room_load_drawn */
    size_t rounds, threads;
};

void drive_run(const struct drive_run *r, struct drive_outcome *out);

struct drive_job {
    struct drive_run run;
    bool keeps_moments; /* else the outcome has none */
    struct drive_outcome outcome;
    bool done; /* it has one, which may be that of a part */
};

struct drive_jobs {
    struct drive_job *list; /* [n] */
    size_t n;
    size_t side_by_side; /* 1: in this process */
    /* Each when it is done, in any order; an error ends it all. */
    int (*done)(void *context, struct drive_job *job, struct error *why);
    void *context;
};

/* 0; -EINTR (Ctrl-C; all that was begun is done and told), the first error of a drive or
 * of done, -ENOMEM, errors of fork. */
int drive_jobs_run(const struct drive_jobs *jobs, struct error *why);

/* free() what the outcomes hold. */
void drive_jobs_clear(struct drive_jobs *jobs);

#endif
