/* SPDX-License-Identifier: MIT */
/* nodes/anlos/doctor/load.h -- can this machine keep the pace of a drive?  The chain from
 * the simulated sound to the tracks is computed for 2 s, as fast as it goes, and its
 * processor time is compared with what there is: not how long it took. */
#ifndef ANLOS_NODES_ANLOS_DOCTOR_LOAD_H
#define ANLOS_NODES_ANLOS_DOCTOR_LOAD_H

#include "dsp/error.h"
#include "nodes/anlos/doctor/findings.h"
#include "nodes/rt/launchfile.h"

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
