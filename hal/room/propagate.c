/* SPDX-License-Identifier: MIT */
#include "hal/room/propagate.h"

#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include <fftw3.h>

#include "hal/room/arrivals.h"
#include "hal/room/legs.h"
#include "hal/room/vector.h"

enum { POINTS, FACETS, CLUTTER, MIRRORED, GROUPS };
enum { GRID = 2 }; /* samples of the impulse responses for each sample */

struct propagate {
    struct propagate_config cfg;
    size_t n_bins; /* n_samples / 2 + 1 */
    struct propagate_scene scene;
    const struct scatter *groups[GROUPS];
    struct legs in[GROUPS], out[GROUPS];
    struct arrivals *arrivals;
    float *impulses;                 /* [GRID * n_samples] */
    float complex *spectrum, *facet; /* [GRID * n_samples / 2 + 1] */
    float complex *emissions;     /* [n_speakers][n_bins], with the transforms' scale */
    float *responses;             /* [n_microphones][n_bins] */
    float *heard;                 /* [n_samples] */
    fftwf_plan forward, backward; /* impulses -> spectrum, spectrum -> heard */
};

size_t propagate_length(size_t least)
{
    for (size_t n = least + (least & 1);; n += 2) {
        size_t rest = n;
        while (rest % 2 == 0)
            rest /= 2;
        while (rest % 3 == 0)
            rest /= 3;
        while (rest % 5 == 0)
            rest /= 5;
        if (rest == 1)
            return n;
    }
}

static int allocate(struct propagate *p)
{
    size_t n = p->cfg.n_samples, n_wide = GRID * n / 2 + 1;
    p->n_bins = n / 2 + 1;
    p->arrivals = arrivals_create();
    p->impulses = fftwf_malloc(GRID * n * sizeof *p->impulses);
    p->spectrum = fftwf_malloc(n_wide * sizeof *p->spectrum);
    p->facet = fftwf_malloc(n_wide * sizeof *p->facet);
    p->emissions = fftwf_malloc(p->cfg.n_speakers * p->n_bins * sizeof *p->emissions);
    p->responses = malloc(p->cfg.n_microphones * p->n_bins * sizeof *p->responses);
    p->heard = fftwf_malloc(n * sizeof *p->heard);
    if (!p->arrivals || !p->impulses || !p->spectrum || !p->facet || !p->emissions ||
        !p->responses || !p->heard)
        return -ENOMEM;
    p->forward =
        fftwf_plan_dft_r2c_1d((int)(GRID * n), p->impulses, p->spectrum, FFTW_ESTIMATE);
    p->backward = fftwf_plan_dft_c2r_1d((int)n, p->spectrum, p->heard, FFTW_ESTIMATE);
    return p->forward && p->backward ? 0 : -ENOMEM;
}

static int transform_emissions(struct propagate *p)
{
    size_t n = p->cfg.n_samples, n_chirp = p->cfg.n_chirp;
    fftwf_plan plan = fftwf_plan_dft_r2c_1d((int)n, p->heard, p->spectrum, FFTW_ESTIMATE);
    if (!plan)
        return -ENOMEM;
    for (size_t j = 0; j < p->cfg.n_speakers; j++) {
        memset(p->heard, 0, n * sizeof *p->heard);
        memcpy(p->heard, p->cfg.emissions + j * n_chirp, n_chirp * sizeof *p->heard);
        fftwf_execute(plan);
        for (size_t k = 0; k < p->n_bins; k++)
            p->emissions[j * p->n_bins + k] = p->spectrum[k] / (float)n;
    }
    fftwf_destroy_plan(plan);
    return 0;
}

int propagate_create(struct propagate **out, const struct propagate_config *cfg)
{
    *out = NULL;
    if (!cfg->n_samples || cfg->n_samples % 2 || cfg->n_chirp > cfg->n_samples)
        return -EINVAL;
    struct propagate *p = calloc(1, sizeof *p);
    if (!p)
        return -ENOMEM;
    p->cfg = *cfg;
    int err = allocate(p);
    if (!err)
        err = transform_emissions(p);
    if (err) {
        propagate_destroy(p);
        return err;
    }
    memcpy(p->responses, cfg->responses,
           cfg->n_microphones * p->n_bins * sizeof *p->responses);
    *out = p;
    return 0;
}

int propagate_prepare(struct propagate *p, const struct propagate_scene *scene)
{
    double per_m = GRID * p->cfg.sample_rate_hz / scene->sound_speed_m_s;
    p->scene = *scene;
    p->groups[POINTS] = scene->points;
    p->groups[FACETS] = scene->facets;
    p->groups[CLUTTER] = scene->clutter;
    p->groups[MIRRORED] = scene->mirrored;
    for (int g = 0; g < GROUPS; g++) {
        bool direct = g == CLUTTER;
        if (p->groups[g] && !p->groups[g]->n)
            p->groups[g] = NULL;
        if (!p->groups[g])
            continue;
        if (legs_set(&p->in[g], direct ? scene->speakers_m : scene->speaker_images_m,
                     p->cfg.n_speakers, p->groups[g], false,
                     direct ? NULL : scene->mirror, per_m) < 0 ||
            legs_set(&p->out[g],
                     direct ? scene->microphones_m : scene->microphone_images_m,
                     p->cfg.n_microphones, p->groups[g], true,
                     direct ? NULL : scene->mirror, per_m) < 0)
            return -ENOMEM;
    }
    return 0;
}

static void add_group(struct propagate *p, int g, size_t speaker, size_t microphone,
                      double gain)
{
    if (!p->groups[g])
        return;
    size_t n = p->groups[g]->n, n_impulses = GRID * p->cfg.n_samples;
    const struct scatter_piece *pieces = p->groups[g]->pieces;
    const struct legs *in = &p->in[g], *out = &p->out[g];
    size_t a = speaker * n, b = microphone * n;
    double latency = GRID * p->scene.latency_samples;
    for (size_t i = 0; i < n; i++, a++, b++) {
        float cosine = 0.5f * (in->cosine[a] + out->cosine[b]);
        float amplitude = (float)(gain * pieces[i].weight) * cosine * in->gain[a] *
                          out->gain[b];
        arrivals_add(p->arrivals, p->impulses, n_impulses,
                     latency + in->delay[a] + out->delay[b], amplitude);
    }
}

/* Speaker (or its image) straight to the microphone. */
static void add_direct(struct propagate *p, const double from[3], const double to[3],
                       double gain)
{
    double way[3];
    if (gain == 0)
        return;
    vector_add(from, -1, to, way);
    double r = sqrt(vector_dot(way, way));
    double t = p->scene.latency_samples +
               r / p->scene.sound_speed_m_s * p->cfg.sample_rate_hz;
    arrivals_add(p->arrivals, p->impulses, GRID * p->cfg.n_samples, GRID * t,
                 (float)(gain / r));
}

/* (jk / 2 pi) = j f / c, which turns the facets' areas into amplitudes. */
static void transform_facets(struct propagate *p, size_t speaker, size_t microphone)
{
    size_t n = p->cfg.n_samples;
    float per_bin = (float)(p->cfg.sample_rate_hz / (double)n / p->scene.sound_speed_m_s);
    memset(p->impulses, 0, GRID * n * sizeof *p->impulses);
    add_group(p, FACETS, speaker, microphone, p->scene.mirror_gain);
    fftwf_execute_dft_r2c(p->forward, p->impulses, p->facet);
    for (size_t k = 0; k < p->n_bins; k++)
        p->facet[k] *= per_bin * (float)k * I;
}

const float *propagate_pair(struct propagate *p, size_t speaker, size_t microphone)
{
    const struct propagate_scene *s = &p->scene;
    const float *response = p->responses + microphone * p->n_bins;
    const float complex *emission = p->emissions + speaker * p->n_bins;
    memset(p->impulses, 0, GRID * p->cfg.n_samples * sizeof *p->impulses);
    add_group(p, POINTS, speaker, microphone, s->mirror_gain);
    add_group(p, CLUTTER, speaker, microphone, 1);
    add_group(p, MIRRORED, speaker, microphone, s->mirror_gain);
    add_direct(p, s->speakers_m[speaker], s->microphones_m[microphone], s->direct_gain);
    if (mirror_reflects(s->mirror, s->speaker_images_m[speaker],
                        s->microphones_m[microphone]))
        add_direct(p, s->speaker_images_m[speaker], s->microphones_m[microphone],
                   s->wall_echo_gain);
    fftwf_execute(p->forward);
    if (p->groups[FACETS]) {
        transform_facets(p, speaker, microphone);
        for (size_t k = 0; k < p->n_bins; k++)
            p->spectrum[k] += p->facet[k];
    }
    for (size_t k = 0; k < p->n_bins; k++)
        p->spectrum[k] *= emission[k] * response[k];
    p->spectrum[0] = crealf(p->spectrum[0]);
    p->spectrum[p->n_bins - 1] = crealf(p->spectrum[p->n_bins - 1]);
    fftwf_execute(p->backward);
    return p->heard;
}

void propagate_destroy(struct propagate *p)
{
    if (!p)
        return;
    for (int g = 0; g < GROUPS; g++) {
        legs_clear(&p->in[g]);
        legs_clear(&p->out[g]);
    }
    fftwf_destroy_plan(p->forward);
    fftwf_destroy_plan(p->backward);
    free(p->arrivals);
    fftwf_free(p->impulses);
    fftwf_free(p->spectrum);
    fftwf_free(p->facet);
    fftwf_free(p->emissions);
    free(p->responses);
    fftwf_free(p->heard);
    free(p);
}
