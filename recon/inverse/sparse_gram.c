/* recon/inverse/sparse_gram.c -- K' K of a few points as a matrix. */
#include "recon/inverse/sparse_operator_plan.h"

#include <math.h>
#include <string.h>

#include "dsp/vector.h"

/* Delays and amplitudes of all points in one pair; 0 for those that miss the trace. */
VECTOR_CLONES
static void amplitudes(const struct sparse_pair *p, size_t n, const float *restrict scale,
                       float weight, float last, float *restrict at, float *restrict re,
                       float *restrict im)
{
    for (size_t v = 0; v < n; v++) {
        float delay = p->delay_s[v] + p->delay_m[v];
        float gain = delay >= 0.0f && delay < last ? weight * scale[v] : 0.0f;
        at[v] = delay;
        re[v] = gain * (p->re_s[v] * p->re_m[v] - p->im_s[v] * p->im_m[v]);
        im[v] = gain * (p->re_s[v] * p->im_m[v] + p->im_s[v] * p->re_m[v]);
    }
}

/* row += conj(own) R(at - own_at) of all points. */
VECTOR_CLONES
static void correlate(size_t n, const float *restrict at, const float *restrict re,
                      const float *restrict im, size_t own, const float *restrict table,
                      int last_lag, float *restrict row_re, float *restrict row_im)
{
    float own_at = at[own], own_re = re[own], own_im = im[own];
    for (size_t v = 0; v < n; v++) {
        int lag = (int)(fabsf(at[v] - own_at) * SPARSE_LAGS + 0.5f);
        float r = table[lag < last_lag ? lag : last_lag];
        row_re[v] += r * (own_re * re[v] + own_im * im[v]);
        row_im[v] += r * (own_re * im[v] - own_im * re[v]);
    }
}

/* A part of the rows, over all pairs. */
static void gram_rows(void *ctx, size_t item, size_t thread)
{
    struct sparse_operator *s = ctx;
    size_t n = s->n, rows = (n + SPARSE_RUNS - 1) / SPARSE_RUNS, first = item * rows;
    size_t end = first + rows < n ? first + rows : n;
    float *at = s->runs[item].window, *re = at + n, *im = re + n;
    (void)thread;
    if (first >= end)
        return;
    memset(s->gram + 2 * first * n, 0, 2 * (end - first) * n * sizeof *s->gram);
    for (size_t t = 0; t < s->n_traces; t++) {
        struct sparse_pair p = sparse_find_pair(s, t / s->pairs, t % s->pairs);
        if (!(s->weight[t] > 0.0f))
            continue;
        amplitudes(&p, n, s->scale, s->weight[t], (float)(s->format.n_samples - 1), at,
                   re, im);
        for (size_t v = first; v < end; v++)
            correlate(n, at, re, im, v, s->autocorrelation, (int)s->n_lags - 1,
                      s->gram + 2 * v * n, s->gram + (2 * v + 1) * n);
    }
}

void sparse_operator_gram(struct sparse_operator *s, float *gram)
{
    double energy = 0.0;
    for (size_t k = 0; k < 2 * s->half; k++)
        energy += pow(s->pulse[SPARSE_FRACTIONS / 2 * 2 * s->half + k], 2.0);
    s->gram = gram;
    pool_run(s->pool, SPARSE_RUNS, gram_rows, s);
    for (size_t i = 0; i < 2 * s->n * s->n; i++)
        gram[i] *= (float)energy;
}
