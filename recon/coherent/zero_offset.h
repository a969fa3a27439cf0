/* SPDX-License-Identifier: MIT */
/* recon/coherent/zero_offset.h -- from all pairs' traces to those that co-located pairs
 * would have recorded at the midpoints (Lindell 2019, 3.3 and Eq. 10-14): gain, sort by
 * midpoint and offset, normal moveout, log-stretch dip moveout along both axes, stack.
 *
 * Works on powers, as the paper does, and on traces with their phase.  A midpoint counts
 * once, however many pairs share it (each trace is divided by their number). */
#ifndef ANLOS_RECON_COHERENT_ZERO_OFFSET_H
#define ANLOS_RECON_COHERENT_ZERO_OFFSET_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "dsp/pool.h"
#include "dsp/pulse_compress.h"
#include "recon/imaging/imager.h"

struct zero_offset_config {
    const struct geometry *geometry;
    struct trace_format in;
    double band_hz[2];
    bool power;    /* traces are squared, their gain is (t c)^2; else t0 c / 2 */
    double mute_s; /* zero-offset times before this become 0 */
    struct trace_format out; /* co-located; carrier_hz as in */
    struct pool *pool;       /* used while creating and stacking; not owned */
};

struct zero_offset_lattice {       /* of midpoints */
    size_t n[2];                   /* x, y */
    double first_m[2], pitch_m[2]; /* pitch 0: one line */
    double plane_z_m;
};

struct zero_offset;

/* 0, -EINVAL, -ENOTSUP (*why: what the geometry lacks), -ENOMEM. */
int zero_offset_create(struct zero_offset **out, const struct zero_offset_config *cfg,
                       const char **why);
void zero_offset_lattice(const struct zero_offset *c, struct zero_offset_lattice *out);

/* Of powers, for an image: its zero-offset times and its margins', at twice the band's
 * width.  volume: the stack as one; a line of midpoints is as wide as the image's step.
 * range_m: of its first plane from the array's.  As zero_offset_create. */
int zero_offset_of_image(struct zero_offset **out, struct grid *volume, double *range_m,
                         const struct imager_config *cfg, const char **why);

/* traces [n_microphones][in.n_samples] of one ping; masked may be NULL.  Threads may add
 * different pings at once. */
void zero_offset_add(struct zero_offset *c, size_t position, size_t speaker,
                     const float complex *traces, const bool *masked);

/* out [ny][nx][out.n_samples]: floats of powers, which can be a little below 0, or
 * complex numbers, re im. */
void zero_offset_stack(struct zero_offset *c, float *out);

/* Forget all traces. */
void zero_offset_reset(struct zero_offset *c);
void zero_offset_destroy(struct zero_offset *c);

#endif
