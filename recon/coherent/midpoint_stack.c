/* SPDX-License-Identifier: MIT */
#include "recon/coherent/midpoint_stack.h"

#include <errno.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "recon/coherent/nmo.h"
#include "recon/coherent/zero_offset.h"

struct midpoint_stack {
    const struct midpoints *midpoints;
    const struct statics *statics;
    size_t n_microphones, n_in, n_out;
    size_t n_lines;                  /* of x, of one place of the stage */
    struct nmo *nmo;                 /* one of the two: */
    struct zero_offset *zero_offset; /* with dip moveout */
    pthread_mutex_t *locks;          /* [n_lines]: of midpoints */
    float complex *gather;           /* [nx][ny][n_out] */
    float complex *turned;           /* [ny][nx][n_out], with dip moveout */
    float *fold;                     /* [n_lines][ny] pairs in the stack, of all places */
    float *weight;                   /* [nx][ny] 1 / fold */
};

static size_t cells(const struct midpoint_stack *s)
{
    return s->midpoints->nx * s->midpoints->ny;
}

/* Each pair has a moveout of its own, for each group of positions. */
static int create_shifted(struct midpoint_stack *s,
                          const struct midpoint_stack_config *cfg, struct nmo_config *nmo)
{
    const struct midpoints *m = cfg->midpoints;
    nmo->n_offsets = cfg->statics->n_groups * m->n_pairs;
    double *half_m = malloc(nmo->n_offsets * sizeof *half_m);
    if (!half_m)
        return -ENOMEM;
    for (size_t q = 0; q < nmo->n_offsets; q++)
        half_m[q] = m->half_offset_m[m->offset[q % m->n_pairs]];
    nmo->half_offset_m = half_m;
    nmo->shift_s = cfg->statics->shift_s;
    int err = nmo_create(&s->nmo, nmo);
    free(half_m);
    return err;
}

static int create_moveout(struct midpoint_stack *s,
                          const struct midpoint_stack_config *cfg, const char **why)
{
    if (cfg->dip && cfg->midpoints->n_places > 1) {
        *why = "a stage that stands at each position for dip moveout";
        return -ENOTSUP;
    }
    if (cfg->dip) {
        const struct zero_offset_config z = {
            .geometry = cfg->geometry,
            .in = cfg->in,
            .band_hz = {cfg->band_hz[0], cfg->band_hz[1]},
            .mute_s = cfg->mute_s,
            .out = cfg->out,
            .pool = cfg->pool,
        };
        return zero_offset_create(&s->zero_offset, &z, why);
    }
    struct nmo_config nmo = {
        .sound_speed_m_s = cfg->geometry->sound_speed_m_s,
        .in = cfg->in,
        .out = cfg->out,
        .mute_s = cfg->mute_s,
        .band_hz = cfg->band_hz[1] - cfg->band_hz[0],
        .n_offsets = cfg->midpoints->n_offsets,
        .half_offset_m = cfg->midpoints->half_offset_m,
    };
    return cfg->statics ? create_shifted(s, cfg, &nmo) : nmo_create(&s->nmo, &nmo);
}

static int allocate(struct midpoint_stack *s)
{
    s->gather = calloc(cells(s) * s->n_out, sizeof *s->gather);
    s->fold = calloc(s->n_lines * s->midpoints->ny, sizeof *s->fold);
    s->weight = calloc(cells(s), sizeof *s->weight);
    s->locks = malloc(s->n_lines * sizeof *s->locks);
    for (size_t x = 0; s->locks && x < s->n_lines; x++)
        pthread_mutex_init(&s->locks[x], NULL);
    if (s->zero_offset)
        s->turned = malloc(cells(s) * s->n_out * sizeof *s->turned);
    return s->gather && s->fold && s->weight && s->locks && (s->turned || s->nmo)
               ? 0
               : -ENOMEM;
}

int midpoint_stack_create(struct midpoint_stack **out,
                          const struct midpoint_stack_config *cfg, const char **why)
{
    struct midpoint_stack *s = calloc(1, sizeof *s);
    if (!s)
        return -ENOMEM;
    s->midpoints = cfg->midpoints;
    s->statics = cfg->statics;
    s->n_lines = s->midpoints->nx / s->midpoints->n_places;
    s->n_microphones = cfg->geometry->n_microphones;
    s->n_in = cfg->in.n_samples;
    s->n_out = cfg->out.n_samples;
    int err = create_moveout(s, cfg, why);
    if (!err)
        err = allocate(s);
    if (err) {
        midpoint_stack_destroy(s);
        return err;
    }
    *out = s;
    return 0;
}

void midpoint_stack_destroy(struct midpoint_stack *s)
{
    if (!s)
        return;
    for (size_t x = 0; s->locks && x < s->n_lines; x++)
        pthread_mutex_destroy(&s->locks[x]);
    free(s->locks);
    free(s->gather);
    free(s->turned);
    free(s->fold);
    free(s->weight);
    nmo_destroy(s->nmo);
    zero_offset_destroy(s->zero_offset);
    free(s);
}

void midpoint_stack_add(struct midpoint_stack *s, size_t position, size_t speaker,
                        const float complex *traces, const bool *masked)
{
    const struct midpoints *m = s->midpoints;
    if (s->zero_offset) {
        zero_offset_add(s->zero_offset, position, speaker, traces, masked);
        return;
    }
    for (size_t i = 0; i < s->n_microphones; i++) {
        if (masked && masked[i])
            continue;
        size_t pair = speaker * s->n_microphones + i;
        size_t moveout = s->statics ? statics_group(s->statics, position) + pair
                                    : m->offset[pair];
        size_t x = m->ix[position * m->n_pairs + pair], line = x % s->n_lines;
        size_t y = m->iy[position * m->n_pairs + pair];
        pthread_mutex_lock(&s->locks[line]);
        nmo_stack(s->nmo, moveout, traces + i * s->n_in,
                  s->gather + (x * m->ny + y) * s->n_out);
        s->fold[line * m->ny + y] += 1.0f;
        pthread_mutex_unlock(&s->locks[line]);
    }
}

/* Its stack counts each midpoint once. */
static void finish_dip(struct midpoint_stack *s)
{
    size_t nx = s->midpoints->nx, ny = s->midpoints->ny, n = s->n_out;
    zero_offset_stack(s->zero_offset, (float *)s->turned);
    for (size_t q = 0; q < nx * ny; q++) {
        memcpy(s->gather + q * n, s->turned + (q % ny * nx + q / ny) * n,
               n * sizeof *s->gather);
        s->weight[q] = 1.0f;
    }
}

void midpoint_stack_finish(struct midpoint_stack *s, const float complex **gather,
                           const float **weight)
{
    if (s->zero_offset)
        finish_dip(s);
    size_t n = s->n_lines * s->midpoints->ny;
    for (size_t q = 0; !s->zero_offset && q < cells(s); q++)
        s->weight[q] = s->fold[q % n] > 0.0f ? 1.0f / s->fold[q % n] : 0.0f;
    *gather = s->gather;
    *weight = s->weight;
}

void midpoint_stack_reset(struct midpoint_stack *s)
{
    if (s->zero_offset)
        zero_offset_reset(s->zero_offset);
    memset(s->gather, 0, cells(s) * s->n_out * sizeof *s->gather);
    memset(s->fold, 0, s->n_lines * s->midpoints->ny * sizeof *s->fold);
}
