/* SPDX-License-Identifier: MIT */
#include "dsp/async_pulse.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"

struct heard {     /* a ping before */
    bool *fit;     /* [n_channels] */
    float *powers; /* [n_channels][n_samples] */
};

struct async_pulse {
    struct async_pulse_config cfg;
    size_t n;       /* samples that count */
    size_t n_known; /* of the pings before, up to ASYNC_PULSE_PINGS */
    struct heard pings[ASYNC_PULSE_PINGS + 1]; /* this one, the one before, ... */
    float *most[ASYNC_PULSE_PINGS];            /* [n_samples] */
    float *ahead, *behind; /* [n_samples], scratch of running maxima */
};

int async_pulse_create(struct async_pulse **out, const struct async_pulse_config *cfg)
{
    *out = NULL;
    if (!cfg->n_channels || !cfg->n_samples || cfg->until > cfg->n_samples)
        return -EINVAL;
    struct async_pulse *a = calloc(1, sizeof *a);
    if (!a)
        return -ENOMEM;
    a->cfg = *cfg;
    a->n = cfg->until ? cfg->until : cfg->n_samples;
    a->ahead = calloc(cfg->n_samples, sizeof *a->ahead);
    a->behind = calloc(cfg->n_samples, sizeof *a->behind);
    bool all = a->ahead && a->behind;
    for (int k = 0; k < ASYNC_PULSE_PINGS; k++) {
        a->most[k] = calloc(cfg->n_samples, sizeof(float));
        all = all && a->most[k];
    }
    for (int k = 0; k <= ASYNC_PULSE_PINGS; k++) {
        struct heard *h = &a->pings[k];
        h->fit = calloc(cfg->n_channels, sizeof *h->fit);
        h->powers = calloc(cfg->n_channels * cfg->n_samples, sizeof *h->powers);
        all = all && h->fit && h->powers;
    }
    if (!all) {
        async_pulse_destroy(a);
        return -ENOMEM;
    }
    *out = a;
    return 0;
}

void async_pulse_destroy(struct async_pulse *a)
{
    if (!a)
        return;
    for (int k = 0; k < ASYNC_PULSE_PINGS; k++)
        free(a->most[k]);
    for (int k = 0; k <= ASYNC_PULSE_PINGS; k++) {
        free(a->pings[k].fit);
        free(a->pings[k].powers);
    }
    free(a->ahead);
    free(a->behind);
    free(a);
}

void async_pulse_reset(struct async_pulse *a)
{
    a->n_known = 0;
}

VECTOR_CLONES
static void take_powers(size_t n, const float *restrict x, float *restrict out)
{
    for (size_t i = 0; i < n; i++)
        out[i] = x[2 * i] * x[2 * i] + x[2 * i + 1] * x[2 * i + 1];
}

/* out[i]: the largest x within reach of i (van Herk 1992, Gil and Werman 1993: running
 * maxima of blocks as long as the window, from both of their ends). */
static void take_maxima(struct async_pulse *a, const float *x, size_t reach, float *out)
{
    size_t n = a->n, whole = 2 * reach + 1;

    for (size_t i = 0; i < n; i++)
        a->ahead[i] = i % whole ? fmaxf(a->ahead[i - 1], x[i]) : x[i];
    for (size_t i = n; i-- > 0;)
        a->behind[i] = i + 1 < n && (i + 1) % whole ? fmaxf(a->behind[i + 1], x[i])
                                                    : x[i];
    for (size_t i = 0; i < n; i++) {
        size_t from = i > reach ? i - reach : 0;
        size_t to = i + reach < n ? i + reach : n - 1;
        bool one_block = from / whole == to / whole;
        /* At the ends the window is cut, and may lie in one block. */
        out[i] = !one_block          ? fmaxf(a->behind[from], a->ahead[to])
                 : from % whole == 0 ? a->ahead[to]
                                     : a->behind[from];
    }
}

static void mark(const struct async_pulse *a, size_t at, uint8_t *foreign)
{
    size_t guard = a->cfg.guard, n = a->n;
    size_t from = at > guard ? at - guard : 0, to = at + guard < n ? at + guard : n - 1;

    memset(foreign + from, 1, to - from + 1);
}

/* true: some samples are foreign. */
static bool judge(struct async_pulse *a, size_t m, const size_t reach[ASYNC_PULSE_PINGS],
                  uint8_t *foreign)
{
    size_t n = a->n, first = m * a->cfg.n_samples;
    const float *now = a->pings[0].powers + first;
    bool any = false;

    for (size_t k = 0; k < ASYNC_PULSE_PINGS; k++)
        take_maxima(a, a->pings[k + 1].powers + first, reach[k] < n ? reach[k] : n - 1,
                    a->most[k]);
    for (size_t i = 0; i < n; i++) {
        float least = a->most[0][i];
        for (size_t k = 1; k < ASYNC_PULSE_PINGS; k++)
            least = fminf(least, a->most[k][i]);
        any |= now[i] > (float)ASYNC_PULSE_RATIO * least;
        if (now[i] > (float)ASYNC_PULSE_REST * least)
            mark(a, i, foreign);
    }
    return any;
}

static void take(struct async_pulse *a, const float complex *traces, const bool *masked)
{
    struct heard oldest = a->pings[ASYNC_PULSE_PINGS];
    size_t n = a->cfg.n_samples;

    memmove(a->pings + 1, a->pings, ASYNC_PULSE_PINGS * sizeof *a->pings);
    a->pings[0] = oldest;
    for (size_t m = 0; m < a->cfg.n_channels; m++) {
        oldest.fit[m] = !masked[m];
        take_powers(n, (const float *)(traces + m * n), oldest.powers + m * n);
    }
}

bool async_pulse_execute(struct async_pulse *a, const float complex *traces,
                         const bool *masked, const size_t reach[ASYNC_PULSE_PINGS],
                         uint8_t *foreign)
{
    size_t n = a->cfg.n_samples, judged = 0, hit = 0;

    memset(foreign, 0, a->cfg.n_channels * n);
    take(a, traces, masked);
    for (size_t m = 0; m < a->cfg.n_channels && a->n_known == ASYNC_PULSE_PINGS; m++) {
        bool fit = true;
        for (int k = 0; k <= ASYNC_PULSE_PINGS; k++)
            fit = fit && a->pings[k].fit[m];
        judged += fit;
        hit += fit && judge(a, m, reach, foreign + m * n);
    }
    a->n_known += a->n_known < ASYNC_PULSE_PINGS;
    if (judged && 2 * hit >= judged)
        return true;
    memset(foreign, 0, a->cfg.n_channels * n);
    return false;
}
