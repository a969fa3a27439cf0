/* recon/backproject_store.c -- traces as they came to the finer ones that back-projection
 * reads by linear interpolation. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/backprojection.h"
#include "recon/sinc.h"

#define SINC_TAPS  8
#define TAPS       (SINC_TAPS + 2)
#define CACHE_LINE 64
#define FULL       32767.0f /* of half a word */
#define SILENT     1e-30f

struct store_scratch {
    float *in[2];  /* [TAPS + n_samples] re, im of a trace with zeros around it */
    float *out[2]; /* [upsampling][n_samples] */
};

/* Linear interpolation between samples low-passes by sinc(f / rate)^2, on average over
 * the places between: by 1 - w^2 / 12, w in rad a sample.  Subtracting a twelfth of the
 * second difference beforehand makes up for it, and leaves 0.41 of the error. */
static void fine_weights(size_t upsampling, double occupancy, float *out)
{
    double plain[SINC_TAPS];
    for (size_t f = 0; f < upsampling; f++)
        for (size_t q = 0; q < TAPS; q++)
            out[f * TAPS + q] = 0.0f;
    for (size_t f = 0; f < upsampling; f++) {
        for (int beside = -1; beside <= 1; beside++) {
            long at = (long)f + beside + (long)upsampling;
            double part = (double)(at % (long)upsampling) / (double)upsampling;
            float *w = out + f * TAPS + at / (long)upsampling;
            sinc_weights(SINC_TAPS, occupancy, part, plain);
            for (size_t q = 0; q < SINC_TAPS; q++)
                w[q] += (float)(plain[q] * (beside ? -1.0 / 12.0 : 7.0 / 6.0));
        }
    }
}

/* Whole cache lines, so that no vector of traces straddles two. */
static size_t lines_of(size_t bytes)
{
    return (bytes + CACHE_LINE - 1) / CACHE_LINE * CACHE_LINE;
}

static int scratch_create(struct store_scratch *s, const struct backprojection *b)
{
    size_t n = b->in.n_samples;
    for (int a = 0; a < 2; a++) {
        s->in[a] = calloc(n + TAPS, sizeof *s->in[a]);
        s->out[a] = malloc(b->upsampling * n * sizeof *s->out[a]);
        if (!s->in[a] || !s->out[a])
            return -ENOMEM;
    }
    return 0;
}

static size_t n_traces(const struct backprojection *b)
{
    return backprojection_pairs(b) * b->geometry.n_positions;
}

static int allocate(struct backprojection *b)
{
    size_t n = n_traces(b);
    size_t lanes = lines_of(backprojection_pairs(b) * b->n_stored * 2 * b->lanes *
                            sizeof *b->traces);
    b->added = malloc(n * b->in.n_samples * sizeof *b->added);
    b->fine = malloc(b->upsampling * TAPS * sizeof *b->fine);
    b->stored_fold = calloc(n, sizeof *b->stored_fold);
    b->own = calloc(pool_threads(b->pool), sizeof *b->own);
    if (b->scan) {
        b->traces = aligned_alloc(CACHE_LINE, lanes);
        if (b->traces)
            memset(b->traces, 0, lanes);
    } else {
        b->words = calloc(n * b->n_stored, sizeof *b->words);
        b->unit = malloc(n * sizeof *b->unit);
    }
    bool stored = b->scan ? b->traces != NULL : b->words && b->unit;
    return stored && b->added && b->fine && b->stored_fold && b->own ? 0 : -ENOMEM;
}

int backproject_store_create(struct backprojection *b, double band_hz)
{
    int err = allocate(b);
    for (size_t t = 0; !err && t < pool_threads(b->pool); t++)
        err = scratch_create(&b->own[t], b);
    if (!err)
        fine_weights(b->upsampling, fmin(band_hz / b->in.rate_hz, 0.95), b->fine);
    return err;
}

void backproject_store_destroy(struct backprojection *b)
{
    for (size_t t = 0; b->own && t < pool_threads(b->pool); t++) {
        for (int a = 0; a < 2; a++) {
            free(b->own[t].in[a]);
            free(b->own[t].out[a]);
        }
    }
    free(b->own);
    free(b->added);
    free(b->traces);
    free(b->words);
    free(b->unit);
    free(b->fine);
    free(b->stored_fold);
}

static void take_apart(const float complex *in, size_t n, float *restrict re,
                       float *restrict im)
{
    const float *x = (const float *)in;
    for (size_t q = 0; q < n; q++) {
        re[q] = x[2 * q];
        im[q] = x[2 * q + 1];
    }
}

VECTOR_CLONES
static void interpolate(size_t n, const float *restrict w, const float *restrict in,
                        float *restrict out)
{
    for (size_t q = 0; q < n; q++) {
        float x = 0.0f;
        for (size_t l = 0; l < TAPS; l++)
            x += w[l] * in[q + l];
        out[q] = x;
    }
}

/* All phases of a trace; what lies before the gate is muted. */
static void refine(const struct backprojection *b, const struct store_scratch *s,
                   const float complex *in)
{
    size_t n = b->in.n_samples, upsampling = b->upsampling;
    take_apart(in, n, s->in[0] + SINC_TAPS / 2, s->in[1] + SINC_TAPS / 2);
    for (int a = 0; a < 2; a++) {
        for (size_t f = 0; f < upsampling; f++) {
            float *out = s->out[a] + f * n;
            interpolate(n, b->fine + f * TAPS, s->in[a], out);
            for (size_t q = 0; q < n && q * upsampling + f < b->muted; q++)
                out[q] = 0.0f;
        }
    }
}

/* Stored sample q stands at input sample (q - 1) / upsampling. */
static void store_lane(const struct backprojection *b, const struct store_scratch *s,
                       uint32_t fold, float *out)
{
    size_t n = b->in.n_samples;
    float weight = fold ? 1.0f / (float)fold : 0.0f;
    for (size_t f = 0; f < b->upsampling; f++) {
        for (size_t q = 0; q < n; q++) {
            float *x = out + (1 + q * b->upsampling + f) * 2 * b->lanes;
            x[0] = weight * s->out[0][f * n + q];
            x[b->lanes] = weight * s->out[1][f * n + q];
        }
    }
}

/* What is no number counts for nothing. */
static float largest(const float *x, size_t n)
{
    float largest = 0.0f;
    for (size_t q = 0; q < n; q++)
        largest = fabsf(x[q]) > largest ? fabsf(x[q]) : largest;
    return largest;
}

static uint32_t half_word(float x, float per_unit)
{
    float y = x * per_unit;
    return (uint16_t)(int16_t)(fabsf(y) < FULL + 1.0f ? lrintf(y) : 0);
}

static float store_words(const struct backprojection *b, const struct store_scratch *s,
                         uint32_t *out)
{
    size_t n = b->in.n_samples, n_fine = n * b->upsampling;
    float most = fmaxf(largest(s->out[0], n_fine), largest(s->out[1], n_fine));
    float per_unit = most > SILENT ? FULL / most : 0.0f;
    for (size_t f = 0; f < b->upsampling; f++)
        for (size_t q = 0; q < n; q++)
            out[1 + q * b->upsampling + f] = half_word(s->out[0][f * n + q], per_unit)
                                                 << 16 |
                                             half_word(s->out[1][f * n + q], per_unit);
    return most / FULL;
}

static void store_trace(struct backprojection *b, const struct store_scratch *s,
                        size_t position, size_t pair)
{
    size_t t = position * backprojection_pairs(b) + pair;
    uint32_t fold = b->live[t] ? b->fold[b->cell[t]] : 0;
    bool old = b->stored_fold[t] == STORE_STALE;
    if (b->scan ? fold != b->stored_fold[t] : old && fold) {
        if (fold)
            refine(b, s, b->added + t * b->in.n_samples);
        if (b->scan)
            store_lane(b, s, fold, backprojection_sample(b, pair, 0) + position);
        else
            b->unit[t] = store_words(b, s, b->words + t * b->n_stored);
    }
    b->stored_fold[t] = fold;
}

static void store_pair(void *ctx, size_t pair, size_t thread)
{
    struct backprojection *b = ctx;
    for (size_t k = 0; k < b->geometry.n_positions; k++)
        store_trace(b, &b->own[thread], k, pair);
}

static void store_position(void *ctx, size_t position, size_t thread)
{
    struct backprojection *b = ctx;
    for (size_t pair = 0; pair < backprojection_pairs(b); pair++)
        store_trace(b, &b->own[thread], position, pair);
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
