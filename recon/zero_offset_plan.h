/* recon/zero_offset_plan.h -- inside recon/zero_offset: which trace goes where, made
 * once. */
#ifndef ANLOS_RECON_ZERO_OFFSET_PLAN_H
#define ANLOS_RECON_ZERO_OFFSET_PLAN_H

#include <stdint.h>

#include "recon/zero_offset.h"

/* An input is what one offset contributes to one line of midpoints in y; it has a trace
 * for each line in x.  Inputs are sorted by the x part of their offset. */
struct zero_offset_plan {
    struct zero_offset_lattice lattice;
    size_t n_offsets;  /* different (hx, hy) */
    double *half_m[3]; /* [n_offsets]: x, y, their length */
    size_t n_x_parts;  /* different hx; 1 when dip in x is left out */
    double *x_part_m;  /* [n_x_parts] */
    bool dip_in_x;     /* hx matters */
    size_t n_inputs;
    uint32_t *offset, *line; /* [n_inputs] */
    size_t *part_end;        /* [n_x_parts]: inputs before this */
    uint32_t *input, *x;     /* [position][pair] */
};

/* sample_s: what event times may be off by a fraction of; first_s: the earliest.
 * 0, -ENOTSUP (*why), -ENOMEM; clear also after a failure. */
int zero_offset_plan(struct zero_offset_plan *p, const struct geometry *g, double first_s,
                     double sample_s, const char **why);
void zero_offset_plan_clear(struct zero_offset_plan *p);

#endif
