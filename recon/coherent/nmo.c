/* SPDX-License-Identifier: MIT */
#include "recon/coherent/nmo.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>

#include "dsp/vector.h"
#include "recon/coherent/sinc.h"

#define TAPS         8
#define TAPER_LENGTH 8 /* samples over which the ends of a trace fade */

struct moveout { /* one output sample */
    float phase[2];
    float weight[TAPS];
};

struct nmo {
    size_t n_out;
    uint32_t *begin, *end; /* [n_offsets]: output samples that hear anything */
    uint32_t *first;       /* [n_offsets][n_out]: first input sample of the taps */
    struct moveout *steps; /* [n_offsets][n_out] */
};

static double taper(size_t n, size_t size, double t_s, const struct nmo_config *cfg)
{
    double after_mute = (t_s - cfg->mute_s) * cfg->out.rate_hz;
    double edge = fmin(fmin((double)n, (double)(size - 1 - n)) + 1.0, after_mute);
    if (edge <= 0.0)
        return 0.0;
    if (edge >= TAPER_LENGTH)
        return 1.0;
    return 0.5 - 0.5 * cos(M_PI * edge / TAPER_LENGTH);
}

/* false: nothing is heard there. */
static bool plan_sample(const struct nmo_config *cfg, size_t offset, size_t n,
                        uint32_t *first, struct moveout *m)
{
    double t0 = cfg->out.t0_s + (double)n / cfg->out.rate_hz;
    double moveout_s = 2.0 * cfg->half_offset_m[offset] / cfg->sound_speed_m_s;
    double shift_s = cfg->shift_s ? cfg->shift_s[offset] : 0.0;
    double t = sqrt(t0 * t0 + moveout_s * moveout_s) + shift_s;
    double at = (t - cfg->in.t0_s) * cfg->in.rate_hz;
    double below = floor(at);
    double start = below - (TAPS / 2 - 1);
    *first = 0;
    *m = (struct moveout){{0}, {0}};
    if (t0 <= 0.0 || start < 0.0 || start + TAPS > (double)cfg->in.n_samples)
        return false;
    double weights[TAPS];
    sinc_weights(TAPS, cfg->band_hz / cfg->in.rate_hz, at - below, weights);
    double gain = 0.5 * cfg->sound_speed_m_s * t0 * taper(n, cfg->out.n_samples, t0, cfg);
    for (int q = 0; q < TAPS; q++)
        m->weight[q] = (float)(gain * weights[q]);
    double turns = cfg->in.carrier_hz * t - cfg->out.carrier_hz * t0;
    double phase = 2.0 * M_PI * (turns - rint(turns));
    m->phase[0] = (float)cos(phase);
    m->phase[1] = (float)sin(phase);
    *first = (uint32_t)start;
    return gain > 0.0;
}

/* What is heard has no gaps: between the mute, or the input's start, and its end. */
static void plan_offset(struct nmo *n, const struct nmo_config *cfg, size_t offset)
{
    uint32_t *begin = &n->begin[offset], *end = &n->end[offset];
    for (size_t s = 0; s < n->n_out; s++) {
        size_t q = offset * n->n_out + s;
        if (!plan_sample(cfg, offset, s, &n->first[q], &n->steps[q]))
            continue;
        *begin = *end ? *begin : (uint32_t)s;
        *end = (uint32_t)s + 1;
    }
}

int nmo_create(struct nmo **out, const struct nmo_config *cfg)
{
    if (cfg->in.n_samples < TAPS || !cfg->out.n_samples || !(cfg->in.rate_hz > 0.0) ||
        !(cfg->out.rate_hz > 0.0) || !(cfg->sound_speed_m_s > 0.0))
        return -EINVAL;
    struct nmo *n = calloc(1, sizeof *n);
    if (!n)
        return -ENOMEM;
    size_t total = cfg->n_offsets * cfg->out.n_samples;
    n->n_out = cfg->out.n_samples;
    n->begin = calloc(cfg->n_offsets, sizeof *n->begin);
    n->end = calloc(cfg->n_offsets, sizeof *n->end);
    n->first = malloc(total * sizeof *n->first);
    n->steps = malloc(total * sizeof *n->steps);
    if (!n->begin || !n->end || !n->first || !n->steps) {
        nmo_destroy(n);
        return -ENOMEM;
    }
    for (size_t offset = 0; offset < cfg->n_offsets; offset++)
        plan_offset(n, cfg, offset);
    *out = n;
    return 0;
}

VECTOR_CLONES
void nmo_stack(const struct nmo *n, size_t offset, const float complex *restrict in,
               float complex *restrict out)
{
    const uint32_t *first = n->first + offset * n->n_out;
    const struct moveout *steps = n->steps + offset * n->n_out;
    const float *x = (const float *)in;
    float *y = (float *)out;
    for (size_t s = n->begin[offset]; s < n->end[offset]; s++) {
        const float *taps = x + 2 * (size_t)first[s];
        const struct moveout *m = &steps[s];
        float re = 0.0f, im = 0.0f;
        for (int q = 0; q < TAPS; q++) {
            re += m->weight[q] * taps[2 * q];
            im += m->weight[q] * taps[2 * q + 1];
        }
        y[2 * s] += re * m->phase[0] - im * m->phase[1];
        y[2 * s + 1] += re * m->phase[1] + im * m->phase[0];
    }
}

void nmo_destroy(struct nmo *n)
{
    if (!n)
        return;
    free(n->begin);
    free(n->end);
    free(n->first);
    free(n->steps);
    free(n);
}
