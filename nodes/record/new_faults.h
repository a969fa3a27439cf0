/* SPDX-License-Identifier: MIT */
/* nodes/record/new_faults.h -- which faults that nodes state (topic "health") are new. */
#ifndef ANLOS_NODES_RECORD_NEW_FAULTS_H
#define ANLOS_NODES_RECORD_NEW_FAULTS_H

#include <stdbool.h>
#include <stdint.h>

#include "msgs/envelope.h"
#include "msgs/health.pb-c.h"

#define NEW_FAULTS_MAX  64 /* different ones of all nodes; more are not told */
#define NEW_FAULTS_NAME 32

struct new_faults {   /* starts as {0} but for again_ns */
    int64_t again_ns; /* the same one is new again after that long */
    struct {
        char node[ENVELOPE_NODE_SIZE], name[NEW_FAULTS_NAME];
        bool lasts;
        int64_t told_ns;
    } list[NEW_FAULTS_MAX];
    size_t n;
    uint64_t again; /* that came again before */
};

/* A fault that this node did not state before, "fault" for its state without one; NULL:
 * there is none.  To be called until then. */
const char *new_faults_next(struct new_faults *f, const char *node,
                            const Anlos__Health *h, int64_t now_ns);

#endif
