/* SPDX-License-Identifier: MIT */
/* recon/planning/trace_set.h -- all traces of a scan in memory, for those who look at
 * them before an image is made: recon/planning/coherence, recon/planning/probe. */
#ifndef ANLOS_RECON_PLANNING_TRACE_SET_H
#define ANLOS_RECON_PLANNING_TRACE_SET_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "dsp/pulse_compress.h"
#include "recon/geometry.h"
#include "recon/imaging/imager.h"

struct trace_set {
    const struct geometry *geometry;
    struct trace_format format;
    double band_hz[2];
    double gate_m[2];            /* ranges (half paths) below the first are muted */
    const float complex *traces; /* [position][speaker][microphone][format.n_samples] */
    const bool *heard;           /* [position][speaker][microphone] */
};

/* An image of them on a grid, by a method to be named. */
struct imager_config trace_set_imager(const struct trace_set *s, const struct grid *grid,
                                      struct pool *pool);

/* Adds every ping of which something was heard.  0, -ENOMEM, -ECANCELED (the pool has
 * stopped). */
int trace_set_feed(const struct trace_set *s, struct imager *im, struct pool *pool);

static inline size_t trace_set_pairs(const struct trace_set *s)
{
    return s->geometry->n_speakers * s->geometry->n_microphones;
}

#endif
