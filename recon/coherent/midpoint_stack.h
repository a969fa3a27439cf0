/* SPDX-License-Identifier: MIT */
/* recon/coherent/midpoint_stack.h -- all pairs' traces to those that co-located pairs
 * would have recorded at the midpoints: moved out with their phase, and stacked so that
 * each midpoint counts once.  Without dip moveout (recon/coherent/nmo) echoes from aside
 * come out a little early; with it (recon/coherent/zero_offset) they do not, for evenly
 * spaced midpoints that take no static corrections.
 *
 * On a stage that does not stop no two pairs share a midpoint; those that would on one
 * that stands count together as one. */
#ifndef ANLOS_RECON_COHERENT_MIDPOINT_STACK_H
#define ANLOS_RECON_COHERENT_MIDPOINT_STACK_H

#include <complex.h>
#include <stdbool.h>

#include "dsp/pool.h"
#include "dsp/pulse_compress.h"
#include "recon/coherent/midpoint.h"
#include "recon/coherent/statics.h"

struct midpoint_stack_config {
    const struct geometry *geometry;
    const struct midpoints *midpoints; /* of that geometry; outlives the stack */
    const struct statics *statics;     /* or of its line, likewise; NULL */
    struct trace_format in;            /* oversampled by 2 or nearly */
    struct trace_format out;           /* co-located; carrier_hz as in */
    double band_hz[2];
    double mute_s; /* zero-offset times before this become 0 */
    bool dip;
    struct pool *pool; /* used while creating and finishing; not owned */
};

struct midpoint_stack;

/* 0, -EINVAL, -ENOTSUP (dip moveout; *why: what the geometry lacks), -ENOMEM. */
int midpoint_stack_create(struct midpoint_stack **out,
                          const struct midpoint_stack_config *cfg, const char **why);

/* traces [n_microphones][in.n_samples] of one ping; masked may be NULL.  Threads may add
 * different pings at once. */
void midpoint_stack_add(struct midpoint_stack *s, size_t position, size_t speaker,
                        const float complex *traces, const bool *masked);

/* *gather [nx][ny][out.n_samples] and what each trace is to be multiplied by [nx][ny];
 * they stay the stack's, until it is called again. */
void midpoint_stack_finish(struct midpoint_stack *s, const float complex **gather,
                           const float **weight);

/* Forget all traces. */
void midpoint_stack_reset(struct midpoint_stack *s);
void midpoint_stack_destroy(struct midpoint_stack *s);

#endif
