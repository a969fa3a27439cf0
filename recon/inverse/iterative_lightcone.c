/* SPDX-License-Identifier: MIT */
#include "recon/inverse/iterative.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "recon/coherent/zero_offset.h"
#include "recon/imaging/method.h"
#include "recon/imaging/resample.h"
#include "recon/inverse/admm.h"
#include "recon/power/lightcone.h"

#define MIN_SAMPLES 16

struct iterative_lightcone {
    struct zero_offset *zero_offset;
    struct lightcone *lightcone;
    struct admm *admm;
    struct resample *resample;
    size_t n[3], n_power;
    double range_m, range_step_m;
    float *power;  /* [ny][nx][n[2]] */
    float *volume; /* [n[2]][ny][nx] */
    struct admm_result result;
};

void iterative_lightcone_destroy(struct iterative_lightcone *l)
{
    if (!l)
        return;
    admm_destroy(l->admm);
    zero_offset_destroy(l->zero_offset);
    lightcone_destroy(l->lightcone);
    resample_destroy(l->resample);
    free(l->power);
    free(l->volume);
    free(l);
}

static void forward(void *ctx, const float *x, float *y)
{
    lightcone_forward(ctx, x, y);
}

static void adjoint(void *ctx, const float *y, float *x)
{
    lightcone_adjoint(ctx, y, x);
}

/* Zero-offset times of the image, its margins too. */
static int plan_times(struct trace_format *out, const struct imager_config *cfg,
                      const char **why)
{
    double rate_hz = 2.0 * (cfg->band_hz[1] - cfg->band_hz[0]), span_s[2];
    int err = method_span(span_s, cfg, 0.0, why);
    if (!err)
        *out = (struct trace_format){span_s[0], rate_hz, cfg->format.carrier_hz,
                                     method_samples(span_s, rate_hz, MIN_SAMPLES)};
    return err;
}

static int plan_operator(struct iterative_lightcone *l, const struct imager_config *cfg,
                         const struct trace_format *times, struct grid *volume)
{
    struct zero_offset_lattice lattice;
    double half_c = 0.5 * cfg->geometry->sound_speed_m_s, pitch_m[2];
    zero_offset_lattice(l->zero_offset, &lattice);
    for (int a = 0; a < 2; a++)
        pitch_m[a] = lattice.n[a] > 1 ? lattice.pitch_m[a] : cfg->grid.step_m[a];
    l->range_m = half_c * times->t0_s;
    l->range_step_m = half_c / times->rate_hz;
    *volume = (struct grid){
        {lattice.first_m[0], lattice.first_m[1], lattice.plane_z_m + l->range_m},
        {pitch_m[0], pitch_m[1], l->range_step_m},
        {lattice.n[0], lattice.n[1], times->n_samples},
    };
    const struct lightcone_config lightcone = {
        .nx = lattice.n[0],
        .ny = lattice.n[1],
        .pitch_x_m = pitch_m[0],
        .pitch_y_m = pitch_m[1],
        .nt = times->n_samples,
        .range_m = l->range_m,
        .range_step_m = l->range_step_m,
        .falloff = 0.0, /* see amplify */
        .snr = 1.0,     /* the inverse is not used */
        .pool = cfg->pool,
    };
    return lightcone_create(&l->lightcone, &lightcone);
}

static int plan_admm(struct iterative_lightcone *l, const struct imager_config *cfg,
                     const struct imager_options *o, const struct grid *volume)
{
    for (int a = 0; a < 3; a++)
        l->n[a] = volume->n[a];
    l->n_power = grid_size(volume);
    l->power = malloc(l->n_power * sizeof *l->power);
    l->volume = malloc(l->n_power * sizeof *l->volume);
    if (!l->power || !l->volume)
        return -ENOMEM;
    const struct admm_operator linear = {l->lightcone, forward, adjoint, l->n_power};
    const struct admm_config admm = {
        .n = {volume->n[0], volume->n[1], volume->n[2]},
        .l1 = o->l1,
        .tv = o->tv,
        .tv_isotropic = o->tv_isotropic,
        .rho = ITERATIVE_LIGHTCONE_RHO * o->rho,
        .iterations = o->iterations,
        .tolerance = o->tolerance,
        .linear = &linear,
        .pool = cfg->pool,
    };
    int err = admm_create(&l->admm, &admm);
    return err ? err
               : resample_create(&l->resample, volume, &cfg->grid, RESAMPLE_LINEAR,
                                 cfg->pool);
}

int iterative_lightcone_create(struct iterative_lightcone **out,
                               const struct imager_config *cfg,
                               const struct imager_options *o, const char **why)
{
    struct iterative_lightcone *l = calloc(1, sizeof *l);
    struct grid volume;
    if (!l)
        return -ENOMEM;
    struct zero_offset_config z = {
        .geometry = cfg->geometry,
        .in = cfg->format,
        .band_hz = {cfg->band_hz[0], cfg->band_hz[1]},
        .power = true,
        .mute_s = 2.0 * cfg->gate_m[0] / cfg->geometry->sound_speed_m_s,
        .pool = cfg->pool,
    };
    int err = plan_times(&z.out, cfg, why);
    if (!err)
        err = zero_offset_create(&l->zero_offset, &z, why);
    if (!err)
        err = plan_operator(l, cfg, &z.out, &volume);
    if (!err)
        err = plan_admm(l, cfg, o, &volume);
    if (err) {
        iterative_lightcone_destroy(l);
        return err;
    }
    *out = l;
    return 0;
}

void iterative_lightcone_add(struct iterative_lightcone *l, size_t position,
                             size_t speaker, const float complex *traces,
                             const bool *masked)
{
    zero_offset_add(l->zero_offset, position, speaker, traces, masked);
}

/* After the gain with the squared range a point's power still falls with it (Lindell
 * 2019, Eq. 10: of range^-4).  So that near things do not outweigh far ones, and the
 * step's preconditioner fits all depths, that is undone in the data and left out of K. */
static void amplify(struct iterative_lightcone *l)
{
    for (size_t i = 0; i < l->n_power; i++) {
        double range_m = l->range_m + (double)(i % l->n[2]) * l->range_step_m;
        l->power[i] *= (float)(range_m * range_m);
    }
}

void iterative_lightcone_image(struct iterative_lightcone *l, float *intensity)
{
    zero_offset_stack(l->zero_offset, l->power);
    amplify(l);
    admm_solve(l->admm, l->power, 0.0, l->volume, &l->result);
    iterative_beam(l->n, l->volume, l->power);
    resample_volume(l->resample, l->volume, intensity);
}

void iterative_lightcone_describe(const struct iterative_lightcone *l,
                                  struct imager_outcome *out)
{
    out->iterates = out->converged = true;
    iterative_join(out, &l->result);
}

void iterative_lightcone_reset(struct iterative_lightcone *l)
{
    zero_offset_reset(l->zero_offset);
}
