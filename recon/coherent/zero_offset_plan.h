/* recon/coherent/zero_offset_plan.h -- inside recon/coherent/zero_offset: which trace
 * goes where, made once, and what the parts of it share. */
#ifndef ANLOS_RECON_COHERENT_ZERO_OFFSET_PLAN_H
#define ANLOS_RECON_COHERENT_ZERO_OFFSET_PLAN_H

#include <pthread.h>
#include <stdint.h>

#include "dsp/lane_fft.h"
#include "recon/coherent/dmo.h"
#include "recon/coherent/stretch.h"
#include "recon/coherent/zero_offset.h"

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

#define POINT LANE_FFT_POINT /* floats of 16 complex numbers: re, then im */

struct zero_offset_scratch { /* one a thread */
    float *samples;          /* [n_in][POINT]: 0 where no midpoint stands */
    float *finished;         /* [n_out][POINT] */
    float *plane;            /* [n_x_parts * ny][groups][POINT] */
    float *turned;           /* [n_x_parts * nx][turned_groups][POINT] */
    float *imaged;           /* [nx][turned_groups][POINT] */
};

struct zero_offset {
    struct zero_offset_plan plan;
    struct pool *pool;
    bool power;
    bool packed;    /* every float is a power, also those where im stands */
    size_t n_pairs; /* of a position */
    size_t n_microphones, n_in, n_out, n_rows;
    size_t floats;        /* of a stored sample: 1 or 2 */
    size_t groups;        /* points of a line of midpoints in x */
    size_t turned_groups; /* of a line in y */
    size_t pitch;         /* floats from group to group of spectra */
    struct stretch *stretch;
    struct lane_fft *fft;
    struct dmo **along_y;   /* [n_x_parts] */
    struct dmo *along_x;    /* NULL: not needed */
    pthread_mutex_t *locks; /* [nx] */
    float *traces;          /* [n_inputs][nx][n_in][floats] */
    uint32_t *fold;         /* [nx][ny] traces of a midpoint */
    float *spectra;         /* [n_inputs][groups][pitch]: [n_rows][POINT] */
    float *stacked;         /* [ny][groups][pitch] */
    struct zero_offset_scratch *scratch;
    float *out; /* of zero_offset_stack */
};

/* Of midpoints, x and y. */
static inline const size_t *zero_offset_lines(const struct zero_offset *c)
{
    return c->plan.lattice.n;
}

#endif
