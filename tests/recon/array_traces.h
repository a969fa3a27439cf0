/* SPDX-License-Identifier: MIT */
/* tests/recon/array_traces.h -- all traces of an array like the paper's in memory, its
 * elements not quite where the survey says. */
#ifndef ANLOS_TESTS_RECON_ARRAY_TRACES_H
#define ANLOS_TESTS_RECON_ARRAY_TRACES_H

#include "recon/planning/trace_set.h"
#include "tests/recon/rig.h"

struct array_traces {
    struct rig rig;
    struct trace_set set;
    float complex *traces;
    bool *heard;
    double speaker_off_m[RIG_MAX], microphone_off_m[RIG_MAX]; /* along z */
};

/* n speakers and microphones on 0..1 m of y, 8 positions on 0..1 m of x, gate 1 to 3 m.
 */
void array_traces_create(struct array_traces *a, size_t n);

/* Normally distributed places along z with exactly this rms. */
void array_traces_displace(struct array_traces *a, double rms_m);

/* Echoes of points of 1 / (r r), plus noise of this rms. */
void array_traces_fill(struct array_traces *a, const struct scatterer *points,
                       size_t n_points, double noise);
void array_traces_clear(struct array_traces *a);

#endif
