/* SPDX-License-Identifier: MIT */
/* nodes/anlos/doctor/doctor.h -- what `anlos doctor` looks at.  Nothing is changed, made
 * or kept open: a system that runs does not notice.  Each function adds what it finds. */
#ifndef ANLOS_NODES_ANLOS_DOCTOR_DOCTOR_H
#define ANLOS_NODES_ANLOS_DOCTOR_DOCTOR_H

#include "nodes/anlos/doctor/findings.h"
#include "nodes/rt/launchfile.h"

struct doctor {
    const char *launch;  /* a launch file, or NULL */
    const char *host;    /* which of the launch file's hosts this is, or NULL */
    const char *run_dir; /* asked for, or NULL */
};

/* ctx: a struct doctor. */
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

#endif
