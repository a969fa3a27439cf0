/* SPDX-License-Identifier: MIT */
/* nodes/anlos/doctor/doctor.h -- what `anlos doctor` looks at, and what it finds: for
 * each thing how it is, and what to do about it.  Nothing is changed, made or kept open:
 * a system that runs does not notice. */
#ifndef ANLOS_NODES_ANLOS_DOCTOR_DOCTOR_H
#define ANLOS_NODES_ANLOS_DOCTOR_DOCTOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#include "dsp/error.h"
#include "nodes/rt/launchfile.h"

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

/* What is looked at. */

struct doctor {
    const char *launch;  /* a launch file, or NULL */
    const char *host;    /* which of the launch file's hosts this is, or NULL */
    const char *run_dir; /* asked for, or NULL */
};

/* ctx: a struct doctor.  Each adds what it finds. */
void doctor_machine(const void *ctx, struct findings *f);   /* cores, memory, governor */
void doctor_clock(const void *ctx, struct findings *f);     /* is it synchronised? */
void doctor_limits(const void *ctx, struct findings *f);    /* real time, buffers */
void doctor_libraries(const void *ctx, struct findings *f); /* versions, programs */
void doctor_launch(const void *ctx, struct findings *f);    /* the file, its folders */
void doctor_array(const void *ctx, struct findings *f);     /* of the launch file */
void doctor_stage(const void *ctx, struct findings *f);
void doctor_can(const void *ctx, struct findings *f);
void doctor_view(const void *ctx, struct findings *f);    /* the port of the node view */
void doctor_present(const void *ctx, struct findings *f); /* devices, without a file */
void doctor_run_dir(const void *ctx, struct findings *f);
void doctor_system(const void *ctx, struct findings *f);      /* who runs, and how */
void doctor_load_budget(const void *ctx, struct findings *f); /* the pace of a drive */

/* The launch file; NULL: there is none, or it is bad, which doctor_launch says. */
struct launchfile *doctor_load(const struct doctor *d);

/* Is the node to run on this machine? */
bool doctor_runs(const struct doctor *d, const struct launchfile *l, const char *node);

/* A word of a file such as /proc/sys/net/core/wmem_max.  0, -errno. */
int doctor_read_word(const char *path, char *out, size_t size);

/* Can this machine keep the pace of a drive?  The chain from the simulated sound to the
 * tracks is computed for 2 s, as fast as it goes, and its processor time is compared with
 * what there is: not how long it took. */

/* Of the processors that there are for the nodes, array, dsp, recon, wall and track may
 * take so much: the rest is for the other nodes, the bus between them, the kernel, and
 * what comes all at once.  launch/hardware.md has each node's part. */
#define LOAD_BUDGET 0.7
#define LOAD_NOTE   0.75 /* of the budget */

/* As many processors can the chain of nodes keep busy. */
#define LOAD_AT_ONCE 2.0

struct load {
    double needed; /* processors that the chain takes at the pace of its sound */
    double left;   /* that there are for it */
};

/* Wrong: the budget is not kept, with what is needed, what there is, and what to do. */
void load_judge(const struct load *m, struct findings *f);

/* What there is for the chain, where one thread that always computes had `share` of a
 * processor while `idle` processors had nothing to do, of `usable` ones. */
double load_left(double share, double idle, size_t usable);

/* The launch file: of a simulated drive.  At least probe_s, and some images.  0, errors
 * of drive_pipe_create and drive_pipe_next. */
int load_measure(const struct launchfile *l, double probe_s, struct load *out,
                 struct error *why);

#endif
