/* SPDX-License-Identifier: MIT */
/* nodes/dsp/dsp.h -- the node dsp: pings go to the front end (recon/frontend/frontend.h),
 * and their traces come back; the array's self-test, to health.  Background pings end
 * here and are acknowledged with a receipt; so is every ping that cannot be used.  Of a
 * static array (Ping.frame) there are no receipts. */
#ifndef ANLOS_NODES_DSP_DSP_H
#define ANLOS_NODES_DSP_DSP_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"
#include "msgs/array.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "msgs/traces.pb-c.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/wall.pb-c.h"
#include "nodes/rt/loop.h"
#include "recon/frontend/frontend.h"

struct dsp_output { /* what to publish; borrows from the dsp until the next ping */
    bool has_traces, has_receipt, has_echoes;
    Anlos__Traces traces;
    Anlos__Echoes echoes; /* for node wall, where that hears walls */
    Anlos__Receipt receipt;
    char note[256]; /* for the log; empty: nothing new */
    struct frontend_faults faults;
};

struct dsp;

extern const struct loop dsp_loop;

/* node is not owned; NULL: for the steps below alone.  0, -ENOMEM. */
int dsp_create(struct dsp **out, struct node *node, const struct frontend_config *cfg);

/* Plans for a survey; the background of another one is forgotten.  0, -EINVAL and others
 * of frontend_survey; the error says what does not fit. */
int dsp_survey(struct dsp *d, const Anlos__Survey *survey, struct error *why);
bool dsp_is_planned(const struct dsp *d);
void dsp_ego(struct dsp *d, const Anlos__EgoMotion *ego, int64_t capture_ns);
void dsp_ambient(struct dsp *d, const Anlos__Ambient *ambient);

/* Before dsp_is_planned no ping can be used, and no note says so. */
void dsp_ping(struct dsp *d, const Anlos__Ping *ping, int64_t capture_ns,
              struct dsp_output *out);

/* Of the scan that the newest ping belongs to. */
const struct air *dsp_air(const struct dsp *d);
void dsp_destroy(struct dsp *d);

#endif
