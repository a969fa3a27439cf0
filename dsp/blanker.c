/* SPDX-License-Identifier: MIT */
#include "dsp/blanker.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>

#include "dsp/rank.h"
#include "dsp/vector.h"

#define HARMLESS 2e-5 /* times the loudest sample */

struct reference {  /* without a background, and with one */
    double part;    /* of the powers that lies below the statistic */
    double *levels; /* [n_channels]; 0: not known */
};

struct blanker {
    struct blanker_config cfg;
    size_t n; /* samples that count */
    struct reference references[2];
    double *levels; /* [n_channels] of this ping; 0: not judged */
    bool *harmless; /* [n_channels]: it is so little */
    float *powers;  /* [n] */
    float *ratios;  /* [n_channels] */
    bool blanks;
    int64_t since_ns; /* it does */
};

int blanker_create(struct blanker **out, const struct blanker_config *cfg)
{
    *out = NULL;
    if (!cfg->n_channels || cfg->from >= cfg->until || cfg->until > cfg->n_samples)
        return -EINVAL;
    struct blanker *b = calloc(1, sizeof *b);
    if (!b)
        return -ENOMEM;
    b->cfg = *cfg;
    b->n = cfg->until - cfg->from;
    b->references[0].part = 0.1;
    b->references[1].part = 0.5;
    b->levels = calloc(cfg->n_channels, sizeof *b->levels);
    b->harmless = calloc(cfg->n_channels, sizeof *b->harmless);
    b->powers = calloc(b->n, sizeof *b->powers);
    b->ratios = calloc(cfg->n_channels, sizeof *b->ratios);
    bool all = b->levels && b->harmless && b->powers && b->ratios;
    for (int k = 0; k < 2; k++) {
        b->references[k].levels = calloc(cfg->n_channels, sizeof(double));
        all = all && b->references[k].levels;
    }
    if (!all) {
        blanker_destroy(b);
        return -ENOMEM;
    }
    *out = b;
    return 0;
}

void blanker_destroy(struct blanker *b)
{
    if (!b)
        return;
    for (int k = 0; k < 2; k++)
        free(b->references[k].levels);
    free(b->levels);
    free(b->harmless);
    free(b->powers);
    free(b->ratios);
    free(b);
}

VECTOR_CLONES
static void take_powers(size_t n, const float *restrict x, float *restrict out)
{
    for (size_t i = 0; i < n; i++)
        out[i] = x[2 * i] * x[2 * i] + x[2 * i + 1] * x[2 * i + 1];
}

VECTOR_CLONES
static void take_differences(size_t n, const float *restrict x, const float *restrict y,
                             float *restrict out)
{
    for (size_t i = 0; i < n; i++) {
        float re = x[2 * i] - y[2 * i], im = x[2 * i + 1] - y[2 * i + 1];
        out[i] = re * re + im * im;
    }
}

/* The mean of exponential powers of which a part is below what is so here. */
static void measure(struct blanker *b, size_t m, const float complex *trace,
                    const float complex *background, double part)
{
    size_t k = (size_t)(part * (double)b->n);
    float loudest = 0.0f;

    take_powers(b->n, (const float *)trace, b->powers);
    for (size_t i = 0; i < b->n; i++)
        loudest = fmaxf(loudest, b->powers[i]);
    if (background)
        take_differences(b->n, (const float *)trace, (const float *)background,
                         b->powers);
    double level = (double)rank_smallest(b->powers, b->n, k + 1) / -log1p(-part);
    b->levels[m] = fmax(level, (double)FLT_MIN);
    b->harmless[m] = level < HARMLESS * (double)loudest;
}

/* By how much it is over the reference in three of four channels; 0: none is known. */
static double rise(struct blanker *b, const struct reference *r)
{
    size_t n = 0;

    for (size_t m = 0; m < b->cfg.n_channels; m++)
        if (b->levels[m] > 0.0 && r->levels[m] > 0.0)
            b->ratios[n++] = b->harmless[m] ? 0.0f : (float)(b->levels[m] / r->levels[m]);
    return n ? (double)rank_smallest(b->ratios, n, n / 4 + 1) : 0.0;
}

static void follow(struct blanker *b, struct reference *r)
{
    for (size_t m = 0; m < b->cfg.n_channels; m++) {
        double now = b->levels[m], was = r->levels[m];
        if (now > 0.0)
            r->levels[m] = now > was ? now : was + (now - was) / BLANKER_FADES;
    }
}

bool blanker_execute(struct blanker *b, const float complex *traces,
                     const float complex *background, const bool *masked,
                     int64_t stamp_ns)
{
    struct reference *r = &b->references[background != NULL];

    for (size_t m = 0; m < b->cfg.n_channels; m++) {
        size_t at = m * b->cfg.n_samples + b->cfg.from;
        b->levels[m] = 0.0;
        if (!masked[m])
            measure(b, m, traces + at, background ? background + at : NULL, r->part);
    }
    bool was = b->blanks;
    bool loud = rise(b, r) > BLANKER_RISE;
    if (loud && !was)
        b->since_ns = stamp_ns;
    if (loud && stamp_ns - b->since_ns > b->cfg.longest_ns)
        loud = was = false;
    b->blanks = loud;
    if (!loud && !was)
        follow(b, r);
    return loud || was;
}
