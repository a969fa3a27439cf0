/* nodes/dsp/dsp.h -- the dsp node's step: a ping to compressed traces with the background
 * subtracted, as it would sound in the air of now.  Background pings end here and are
 * acknowledged with a receipt; so is every ping that cannot be used. */
#ifndef ANLOS_NODES_DSP_DSP_H
#define ANLOS_NODES_DSP_DSP_H

#include <stdbool.h>
#include <stddef.h>

#include "msgs/array.pb-c.h"
#include "msgs/complaint.h"
#include "msgs/scan.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "msgs/traces.pb-c.h"
#include "nodes/rt/air.h"
#include "nodes/rt/compressor.h"

struct dsp_config {
    enum window window;
    enum compression compression;
    bool background; /* scene pings are of no use without it */
};

struct dsp_output { /* what to publish; borrows from the dsp until the next ping */
    bool has_traces, has_receipt;
    Anlos__Traces traces;
    Anlos__Receipt receipt;
    char note[256]; /* for the log; empty: nothing new */
};

struct dsp;

/* 0, -ENOMEM. */
int dsp_create(struct dsp **out, const struct dsp_config *cfg);

/* Plans for a survey; the background of another one is forgotten.  0, -EINVAL and others
 * of processing_plan; the complaint says what does not fit. */
int dsp_survey(struct dsp *d, const Anlos__Survey *survey, struct complaint *why);
bool dsp_is_planned(const struct dsp *d);

void dsp_ping(struct dsp *d, const Anlos__Ping *ping, struct dsp_output *out);

/* Of the scan that the newest ping belongs to. */
const struct air *dsp_air(const struct dsp *d);
void dsp_destroy(struct dsp *d);

#endif
