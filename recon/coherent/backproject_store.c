/* SPDX-License-Identifier: MIT */
/* recon/coherent/backproject_store.c -- traces as they came to the finer ones that
 * back-projection reads by linear interpolation. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "recon/coherent/backprojection.h"

#define CACHE_LINE 64

/* Whole cache lines, so that no vector of traces straddles two. */
static size_t lines_of(size_t bytes)
{
    return (bytes + CACHE_LINE - 1) / CACHE_LINE * CACHE_LINE;
}

static size_t n_traces(const struct backprojection *b)
{
    return backprojection_pairs(b) * b->geometry.n_positions;
}

static int allocate(struct backprojection *b)
{
    size_t n = n_traces(b);
    size_t n_stored = b->fine.n_stored;
    size_t lanes =
        lines_of(backprojection_pairs(b) * n_stored * 2 * b->lanes * sizeof *b->traces);
    b->added = malloc(n * b->fine.in.n_samples * sizeof *b->added);
    b->stored_fold = calloc(n, sizeof *b->stored_fold);
    if (b->scan) {
        b->traces = aligned_alloc(CACHE_LINE, lanes);
        if (b->traces)
            memset(b->traces, 0, lanes);
    } else {
        b->words = calloc(n * n_stored, sizeof *b->words);
        b->unit = malloc(n * sizeof *b->unit);
    }
    bool stored = b->scan ? b->traces != NULL : b->words && b->unit;
    return stored && b->added && b->stored_fold ? 0 : -ENOMEM;
}

int backproject_store_create(struct backprojection *b, const struct trace_format *in,
                             double band_hz, double gate_s)
{
    int err = fine_trace_create(&b->fine, in, band_hz, gate_s, pool_threads(b->pool));
    return err ? err : allocate(b);
}

void backproject_store_destroy(struct backprojection *b)
{
    fine_trace_clear(&b->fine);
    free(b->added);
    free(b->traces);
    free(b->words);
    free(b->unit);
    free(b->stored_fold);
}

/* Stored sample q stands at input sample (q - 1) / upsampling. */
static void store_lane(const struct backprojection *b, const float *const fine[2],
                       uint32_t fold, float *out)
{
    size_t n = b->fine.in.n_samples, upsampling = b->fine.upsampling;
    float weight = fold ? 1.0f / (float)fold : 0.0f;
    for (size_t f = 0; f < upsampling; f++) {
        for (size_t q = 0; q < n; q++) {
            float *x = out + (1 + q * upsampling + f) * 2 * b->lanes;
            x[0] = weight * fine[0][f * n + q];
            x[b->lanes] = weight * fine[1][f * n + q];
        }
    }
}

static void store_scan(const struct backprojection *b, size_t thread, size_t t,
                       uint32_t fold)
{
    size_t pairs = backprojection_pairs(b);
    const float *fine[2];
    fine_trace_refine(&b->fine, thread, b->added + t * b->fine.in.n_samples, fine);
    store_lane(b, fine, fold, backprojection_sample(b, t % pairs, 0) + t / pairs);
}

static void store_trace(struct backprojection *b, size_t thread, size_t t)
{
    uint32_t fold = b->live[t] ? b->fold[b->cell[t]] : 0;
    bool old = b->stored_fold[t] == STORE_STALE;
    if (b->scan && fold != b->stored_fold[t])
        store_scan(b, thread, t, fold);
    else if (!b->scan && old && fold)
        b->unit[t] = fine_trace_words(&b->fine, thread,
                                      b->added + t * b->fine.in.n_samples,
                                      b->words + t * b->fine.n_stored);
    b->stored_fold[t] = fold;
}

static void store_pair(void *ctx, size_t pair, size_t thread)
{
    struct backprojection *b = ctx;
    for (size_t k = 0; k < b->geometry.n_positions; k++)
        store_trace(b, thread, k * backprojection_pairs(b) + pair);
}

static void store_position(void *ctx, size_t position, size_t thread)
{
    struct backprojection *b = ctx;
    for (size_t pair = 0; pair < backprojection_pairs(b); pair++)
        store_trace(b, thread, position * backprojection_pairs(b) + pair);
}

/* Every midpoint counts once, however many live pairs share it. */
void backproject_store(struct backprojection *b)
{
    memset(b->fold, 0, b->n_cells * sizeof *b->fold);
    for (size_t t = 0; t < n_traces(b); t++)
        b->fold[b->cell[t]] += b->live[t];
    b->n_live_cells = 0;
    for (size_t c = 0; c < b->n_cells; c++)
        b->n_live_cells += b->fold[c] > 0;
    if (b->scan)
        pool_run(b->pool, backprojection_pairs(b), store_pair, b);
    else
        pool_run(b->pool, b->geometry.n_positions, store_position, b);
}
