/* SPDX-License-Identifier: MIT */
/* nodes/dsp/dsp.h -- the dsp node's step: topics to the front end
 * (recon/frontend/frontend.h) and back.  Background pings end here and are acknowledged
 * with a receipt; so is every ping that cannot be used.  Of a static array (Ping.frame)
 * there are no receipts. */
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

/* 0, -ENOMEM. */
int dsp_create(struct dsp **out, const struct frontend_config *cfg);

/* Plans for a survey; the background of another one is forgotten.  0, -EINVAL and others
 * of frontend_survey; the error says what does not fit. */
int dsp_survey(struct dsp *d, const Anlos__Survey *survey, struct error *why);
bool dsp_is_planned(const struct dsp *d);
uint64_t dsp_survey_id(const struct dsp *d); /* 0: not planned */
void dsp_ego(struct dsp *d, const Anlos__EgoMotion *ego, int64_t capture_ns);
void dsp_ambient(struct dsp *d, const Anlos__Ambient *ambient);

/* Before dsp_is_planned no ping can be used, and no note says so. */
void dsp_ping(struct dsp *d, const Anlos__Ping *ping, int64_t capture_ns,
              struct dsp_output *out);

/* As frontend_judge, of the ping of the newest dsp_ping, which has to be there still. */
bool dsp_judge(struct dsp *d, const Anlos__Ping *ping, int64_t capture_ns,
               struct self_test_faults *out, char *note, size_t note_size);

/* As frontend_self_test. */
struct self_test *dsp_self_test(const struct dsp *d, const char **why);

/* Topic "wall", of which the self-test takes its reference. */
void dsp_walls(struct dsp *d, const Anlos__WallList *list);

/* Of the scan that the newest ping belongs to. */
const struct air *dsp_air(const struct dsp *d);
void dsp_destroy(struct dsp *d);

#endif
