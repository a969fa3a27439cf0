/* SPDX-License-Identifier: MIT */
#include "recon/power/shares.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "dsp/vector.h"

static struct shares *allocate(size_t n_out, size_t n_in, size_t n_weights)
{
    struct shares *s = calloc(1, sizeof *s);
    if (!s)
        return NULL;
    s->n_out = n_out;
    s->n_in = n_in;
    s->first = calloc(n_out, sizeof *s->first);
    s->start = calloc(n_out + 1, sizeof *s->start);
    s->weight = malloc((n_weights ? n_weights : 1) * sizeof *s->weight);
    if (s->first && s->start && s->weight)
        return s;
    shares_destroy(s);
    return NULL;
}

int shares_create(struct shares **out, const double *out_edges, size_t n_out,
                  const double *in_edges, size_t n_in, const double *out_gain,
                  const double *in_gain)
{
    /* Each edge of either side begins at most one share. */
    struct shares *s = allocate(n_out, n_in, n_out + n_in + 1);
    if (!s)
        return -ENOMEM;
    size_t i = 0, n = 0;
    for (size_t o = 0; o < n_out; o++) {
        while (i < n_in && in_edges[i + 1] <= out_edges[o])
            i++;
        s->first[o] = (uint32_t)i;
        s->start[o] = (uint32_t)n;
        for (size_t q = i; q < n_in && in_edges[q] < out_edges[o + 1]; q++) {
            double length = fmin(in_edges[q + 1], out_edges[o + 1]) -
                            fmax(in_edges[q], out_edges[o]);
            s->weight[n++] = (float)(length * out_gain[o] * in_gain[q]);
        }
    }
    s->start[n_out] = (uint32_t)n;
    *out = s;
    return 0;
}

int shares_transpose(struct shares **out, const struct shares *s)
{
    struct shares *t = allocate(s->n_in, s->n_out, s->start[s->n_out]);
    if (!t)
        return -ENOMEM;
    for (size_t o = 0; o < s->n_out; o++) {
        for (size_t q = s->start[o]; q < s->start[o + 1]; q++) {
            size_t i = s->first[o] + q - s->start[o];
            if (t->start[i + 1]++ == 0)
                t->first[i] = (uint32_t)o;
        }
    }
    for (size_t i = 0; i < t->n_out; i++)
        t->start[i + 1] += t->start[i];
    for (size_t o = 0; o < s->n_out; o++) {
        for (size_t q = s->start[o]; q < s->start[o + 1]; q++) {
            size_t i = s->first[o] + q - s->start[o];
            t->weight[t->start[i] + o - t->first[i]] = s->weight[q];
        }
    }
    *out = t;
    return 0;
}

VECTOR_CLONES
void shares_apply(const struct shares *s, const float *x, size_t in_stride, size_t width,
                  float *restrict y, size_t out_stride)
{
    for (size_t o = 0; o < s->n_out; o++) {
        const float *w = s->weight + s->start[o];
        const float *from = x + s->first[o] * in_stride;
        size_t n = s->start[o + 1] - s->start[o], a = 0;
        float *to = y + o * out_stride;
        for (; a + VECTOR_LANES <= width; a += VECTOR_LANES) {
            vector16 sum = {0};
            for (size_t q = 0; q < n; q++)
                sum += w[q] * *(const vector16 *)(from + q * in_stride + a);
            *(vector16 *)(to + a) = sum;
        }
        for (; a < width; a++) {
            float sum = 0.0f;
            for (size_t q = 0; q < n; q++)
                sum += w[q] * from[q * in_stride + a];
            to[a] = sum;
        }
    }
}

void shares_destroy(struct shares *s)
{
    if (!s)
        return;
    free(s->first);
    free(s->start);
    free(s->weight);
    free(s);
}
