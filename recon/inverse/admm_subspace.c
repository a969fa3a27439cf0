/* SPDX-License-Identifier: MIT */
#include "recon/inverse/admm_subspace.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/normal_equations.h"
#include "dsp/vector.h"

#define CHUNK 4096 /* floats worked on at once: sums do not depend on threads */
#define BLOCK 256  /* floats that are summed in single precision */
/* What a direction adds to those before it, over its own curvature, to count. */
#define INDEPENDENT 1e-9

struct admm_subspace {
    struct pool *pool;
    size_t n, n_chunks, count, next;
    struct admm_direction all[ADMM_DIRECTIONS];
    double gram[ADMM_DIRECTIONS][ADMM_DIRECTIONS]; /* P' M P */
    double step[ADMM_DIRECTIONS];                  /* d = P step */
    double (*sums)[ADMM_DIRECTIONS];               /* [n_chunks] */

    /* of the call under way */
    const float *with;
    float *residual, *x, *mx;
};

int admm_subspace_create(struct admm_subspace **out, size_t n, struct pool *pool)
{
    struct admm_subspace *s = calloc(1, sizeof *s);
    if (!s)
        return -ENOMEM;
    s->pool = pool;
    s->n = n;
    s->n_chunks = (n + CHUNK - 1) / CHUNK;
    s->sums = malloc(s->n_chunks * sizeof *s->sums);
    bool ok = s->sums != NULL;
    for (size_t i = 0; i < ADMM_DIRECTIONS; i++) {
        s->all[i].p = malloc(n * sizeof(float));
        s->all[i].mp = malloc(n * sizeof(float));
        ok = ok && s->all[i].p && s->all[i].mp;
    }
    if (!ok) {
        admm_subspace_destroy(s);
        return -ENOMEM;
    }
    *out = s;
    return 0;
}

void admm_subspace_destroy(struct admm_subspace *s)
{
    if (!s)
        return;
    for (size_t i = 0; i < ADMM_DIRECTIONS; i++) {
        free(s->all[i].p);
        free(s->all[i].mp);
    }
    free(s->sums);
    free(s);
}

void admm_subspace_clear(struct admm_subspace *s)
{
    s->count = s->next = 0;
}

size_t admm_subspace_count(const struct admm_subspace *s)
{
    return s->count;
}

struct admm_direction admm_subspace_at(struct admm_subspace *s, size_t i)
{
    return s->all[i];
}

/* -- passes over memory -----------------------------------------------------------------
 */

VECTOR_CLONES
static double dot(size_t n, const float *restrict x, const float *restrict y)
{
    double sum = 0.0;
    for (size_t b = 0; b < n; b += BLOCK) {
        size_t end = b + BLOCK < n ? b + BLOCK : n, i = b;
        float lanes[VECTOR_LANES] = {0}, part = 0.0f;
        for (; i + VECTOR_LANES <= end; i += VECTOR_LANES)
            for (size_t l = 0; l < VECTOR_LANES; l++)
                lanes[l] += x[i + l] * y[i + l];
        for (; i < end; i++)
            part += x[i] * y[i];
        for (size_t l = 0; l < VECTOR_LANES; l++)
            part += lanes[l];
        sum += (double)part;
    }
    return sum;
}

VECTOR_CLONES
static void add(size_t n, float step, const float *restrict p, const float *restrict mp,
                float *restrict residual, float *restrict x, float *restrict mx)
{
    for (size_t i = 0; i < n; i++) {
        float d = step * mp[i];
        x[i] += step * p[i];
        mx[i] += d;
        residual[i] -= d;
    }
}

static size_t chunk_size(const struct admm_subspace *s, size_t chunk)
{
    return (chunk + 1) * CHUNK < s->n ? CHUNK : s->n - chunk * CHUNK;
}

static void dot_chunk(void *ctx, size_t chunk, size_t thread)
{
    struct admm_subspace *s = ctx;
    (void)thread;
    for (size_t i = 0; i < s->count; i++)
        s->sums[chunk][i] = dot(chunk_size(s, chunk), s->all[i].p + chunk * CHUNK,
                                s->with + chunk * CHUNK);
}

/* out[count] = P' with. */
static void dot_all(struct admm_subspace *s, const float *with, double *out)
{
    s->with = with;
    pool_run(s->pool, s->n_chunks, dot_chunk, s);
    for (size_t i = 0; i < s->count; i++) {
        out[i] = 0.0;
        for (size_t c = 0; c < s->n_chunks; c++)
            out[i] += s->sums[c][i];
    }
}

static void step_chunk(void *ctx, size_t chunk, size_t thread)
{
    struct admm_subspace *s = ctx;
    size_t at = chunk * CHUNK, n = chunk_size(s, chunk);
    (void)thread;
    for (size_t i = 0; i < s->count; i++)
        add(n, (float)s->step[i], s->all[i].p + at, s->all[i].mp + at, s->residual + at,
            s->x + at, s->mx + at);
}

/* -- the small system -------------------------------------------------------------------
 */

/* step = gram^-1 right.  A direction that the ones before it hold already gets no step.
 */
static void solve(struct admm_subspace *s, const double *right)
{
    double m[ADMM_DIRECTIONS * ADMM_DIRECTIONS], step[ADMM_DIRECTIONS];
    size_t n = s->count;
    for (size_t i = 0; i < n; i++)
        memcpy(m + i * n, s->gram[i], n * sizeof *m);
    memcpy(step, right, n * sizeof *step);
    normal_equations_solve(n, m, step, INDEPENDENT);
    for (size_t i = 0; i < n; i++)
        s->step[i] = isfinite(step[i]) ? step[i] : 0.0;
}

static void measure(struct admm_subspace *s, size_t i)
{
    double row[ADMM_DIRECTIONS];
    dot_all(s, s->all[i].mp, row);
    for (size_t j = 0; j < s->count; j++)
        s->gram[i][j] = s->gram[j][i] = row[j];
}

void admm_subspace_renew(struct admm_subspace *s)
{
    for (size_t i = 0; i < s->count; i++)
        measure(s, i);
}

/* -- steps ------------------------------------------------------------------------------
 */

void admm_subspace_descend(struct admm_subspace *s, float *residual, float *x, float *mx)
{
    double right[ADMM_DIRECTIONS];
    dot_all(s, residual, right);
    solve(s, right);
    s->residual = residual;
    s->x = x;
    s->mx = mx;
    pool_run(s->pool, s->n_chunks, step_chunk, s);
}

struct admm_direction admm_subspace_next(struct admm_subspace *s)
{
    return s->all[s->next];
}

void admm_subspace_keep(struct admm_subspace *s)
{
    size_t i = s->next;
    s->next = (i + 1) % ADMM_DIRECTIONS;
    s->count = s->count > i ? s->count : i + 1;
    measure(s, i);
}
