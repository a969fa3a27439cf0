/* recon/inverse/sparse_operator_plan.h -- inside the coherent operator: tables and sums.
 */
#ifndef ANLOS_RECON_INVERSE_SPARSE_OPERATOR_PLAN_H
#define ANLOS_RECON_INVERSE_SPARSE_OPERATOR_PLAN_H

#include <stdint.h>

#include "recon/inverse/sparse_operator.h"

#define SPARSE_FRACTIONS 512 /* steps of the pulse's table between two samples */
#define SPARSE_REACH     4.0 /* of the pulse, over 1 / band: -46 dB and falling */
#define SPARSE_MAX_HALF  16  /* samples of it on each side, at most */
#define SPARSE_LAGS      1024 /* steps of its autocorrelation's table between two samples */
#define SPARSE_RUNS                                                                      \
    16 /* sums are split in so many parts, however many threads there are */

struct sparse_run {         /* one a part of the sums */
    float *sum_re, *sum_im; /* [max_points] */
    float
        *window; /* [2][n_samples + 2 * half] of one trace: re, im; or [3][max_points] */
};

struct sparse_operator {
    struct geometry geometry;
    struct trace_format format;
    struct pool *pool;
    size_t pairs, n_traces, max_points, n;
    size_t half;            /* samples of the pulse on each side */
    float *autocorrelation; /* [n_lags] */
    size_t n_lags;
    float *pulse;          /* [SPARSE_FRACTIONS + 1][2 * half] */
    float *traces;         /* [position][speaker][microphone][n_samples] re im */
    bool *live;            /* [position][speaker][microphone] */
    float *weight;         /* square root of what each trace counts */
    uint32_t *cell, *fold; /* [n_traces] its midpoint; [n_cells] live traces of it */
    size_t n_cells;

    /* [position][speakers, microphones][max_points]: delay in samples (of a pair the sum
     * of two), carrier's phasor over it times one over the distance */
    float *delay, *re, *im;
    float *scale; /* [max_points]: makes columns unit length */

    struct sparse_run runs[SPARSE_RUNS];

    /* of the call under way */
    float *x_re, *x_im; /* [max_points], scaled */
    float *gram;
    const float *from;
    float *to;
    bool forward, adjoint;
    bool recorded; /* the traces are as recorded, not yet weighted */
};

static inline size_t sparse_elements(const struct sparse_operator *s)
{
    return s->geometry.n_speakers + s->geometry.n_microphones;
}

/* Samples of a run's window: a trace with the pulse's reach on both sides. */
static inline size_t sparse_window(const struct sparse_operator *s)
{
    return s->format.n_samples + 2 * s->half;
}

struct sparse_pair { /* tables of its speaker and its microphone */
    const float *delay_s, *delay_m, *re_s, *re_m, *im_s, *im_m;
};

static inline struct sparse_pair sparse_find_pair(const struct sparse_operator *s,
                                                  size_t k, size_t pair)
{
    size_t n_m = s->geometry.n_microphones, base = k * sparse_elements(s);
    size_t j = (base + pair / n_m) * s->max_points;
    size_t i = (base + s->geometry.n_speakers + pair % n_m) * s->max_points;
    return (struct sparse_pair){s->delay + j, s->delay + i, s->re + j,
                                s->re + i,    s->im + j,    s->im + i};
}

#endif
