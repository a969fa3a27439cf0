/* SPDX-License-Identifier: MIT */
/* recon/imaging/image_plan.h -- what imaging derives from a survey, and the traces and
 * volumes at its two ends. */
#ifndef ANLOS_RECON_IMAGING_IMAGE_PLAN_H
#define ANLOS_RECON_IMAGING_IMAGE_PLAN_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"
#include "recon/frontend/compressor.h"
#include "recon/survey.h"
#include "recon/traces.h"
#include "recon/volume.h"

struct image_plan {
    struct survey survey; /* owned */
    uint64_t survey_id;   /* 0: none yet */
    struct processing processing;
    struct trace_format format; /* of the traces, known before the first of them */
    size_t gate_samples;        /* of those that end with the gate: the same, or fewer */
};

/* compression as the front end has it.  beyond: its traces go on beyond the gate, as far
 * as processing_listen_beyond, or end with it.  0, or a negative errno and an error; then
 * p needs no image_plan_clear. */
int image_plan_create(struct image_plan *p, const struct survey *survey,
                      enum compression compression, bool beyond, struct error *why);
void image_plan_clear(struct image_plan *p);

/* Are they such as were planned for? */
bool image_plan_fits(const struct image_plan *p, const struct traces *t);

/* An empty volume on the plan's grid. */
void image_plan_volume(const struct image_plan *p, const float *intensity,
                       struct volume *out);

#endif
