/* SPDX-License-Identifier: MIT */
/* recon/power/paper.c -- `--method paper`: the whole chain of Lindell 2019, 3.3, on
 * powers: squared magnitude, gain (t c)^2, midpoint and offset, normal and dip moveout,
 * stack (recon/coherent/zero_offset), then the light-cone transform where the object is
 * not specular. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "recon/coherent/zero_offset.h"
#include "recon/imaging/method.h"
#include "recon/imaging/resample.h"
#include "recon/planning/scattering.h"
#include "recon/power/lightcone.h"

#define FALLOFF 2.0 /* of a point's power after the gain */

/* Of the Wiener filter.  What is not of its model is no noise, but as loud as the echoes
 * themselves: powers of many points beat with each other, and what does not scatter all
 * around ends within the aperture.  Measured: at 30 dB and at -15 dB raw signal to noise
 * a point is as exact and as wide; 1 or 10 change its place by 0.05 cm and its sidelobes
 * by 2 dB. */
#define SNR 3.2

/* Measured: mirrors bend below 0.1, letters smaller than a Fresnel zone 0.5, points and
 * corners 0.95; a mirror that faces the array shifts 2 cm, one tilted by 5 degrees 20. */

struct paper {
    struct pool *pool;
    struct zero_offset *zero_offset;
    int migrate;   /* imager_options.lightcone */
    bool migrated; /* the image */
    struct scattering_config scattering;
    struct lightcone *lightcone;
    struct resample *resample;
    size_t cells, n_ranges; /* midpoints, samples */
    float *power;           /* [ny][nx][n_ranges] */
    float *volume;          /* [n_ranges][ny][nx] */
    float *scratch;         /* [2][ny][nx] */
    struct grid grid;       /* of the image */
};

static void paper_destroy(void *state)
{
    struct paper *p = state;
    if (!p)
        return;
    zero_offset_destroy(p->zero_offset);
    lightcone_destroy(p->lightcone);
    resample_destroy(p->resample);
    free(p->power);
    free(p->volume);
    free(p->scratch);
    free(p);
}

static int plan_lightcone(struct paper *p, const struct imager_config *cfg)
{
    const struct scattering_config *s = &p->scattering;
    struct lightcone_config lightcone = {
        .nx = s->nx,
        .ny = s->ny,
        .pitch_x_m = s->pitch_x_m,
        .pitch_y_m = s->pitch_y_m,
        .nt = s->n_ranges,
        .range_m = s->range_m,
        .range_step_m = s->range_step_m,
        .falloff = FALLOFF,
        .snr = SNR,
        .pool = cfg->pool,
    };
    return lightcone_create(&p->lightcone, &lightcone);
}

static int plan_image(struct paper *p, const struct imager_config *cfg,
                      const struct grid *volume, double range_m)
{
    p->scattering = (struct scattering_config){
        volume->n[0], volume->n[1], volume->step_m[0], volume->step_m[1],
        volume->n[2], range_m,      volume->step_m[2]};
    p->cells = volume->n[0] * volume->n[1];
    p->n_ranges = volume->n[2];
    p->power = malloc(grid_size(volume) * sizeof *p->power);
    p->volume = malloc(grid_size(volume) * sizeof *p->volume);
    p->scratch = malloc(2 * p->cells * sizeof *p->scratch);
    if (!p->power || !p->volume || !p->scratch)
        return -ENOMEM;
    int err = p->migrate ? plan_lightcone(p, cfg) : 0;
    return err ? err
               : resample_create(&p->resample, volume, &cfg->grid, RESAMPLE_CUBIC,
                                 cfg->pool);
}

static int plan_options(const struct imager_config *cfg)
{
    struct imager_options defaults;
    imager_options_default(&defaults);
    return (cfg->options ? cfg->options : &defaults)->lightcone;
}

static int paper_create(void **state, const struct imager_config *cfg, const char **why)
{
    struct paper *p = calloc(1, sizeof *p);
    if (!p)
        return -ENOMEM;
    struct grid volume;
    double range_m;
    p->pool = cfg->pool;
    p->migrate = plan_options(cfg);
    p->grid = cfg->grid;
    int err = zero_offset_of_image(&p->zero_offset, &volume, &range_m, cfg, why);
    if (!err)
        err = plan_image(p, cfg, &volume, range_m);
    if (err) {
        paper_destroy(p);
        return err;
    }
    *state = p;
    return 0;
}

static void paper_add(void *state, size_t position, size_t speaker,
                      const float complex *traces, const bool *masked)
{
    struct paper *p = state;
    zero_offset_add(p->zero_offset, position, speaker, traces, masked);
}

/* Only mirrors that face the array stand in the stack where they are (Lindell 2019,
 * 3.2); what scatters, or is seen at a slant, must be migrated. */
static bool is_specular(const struct paper *p)
{
    struct scattering s;
    scattering_measure(&p->scattering, p->power, p->scratch, &s);
    return scattering_is_specular(&s);
}

static void paper_image(void *state, float *intensity)
{
    struct paper *p = state;
    zero_offset_stack(p->zero_offset, p->power);
    p->migrated = p->migrate > 0 || (p->migrate < 0 && !is_specular(p));
    if (p->migrated)
        lightcone_inverse(p->lightcone, p->power, p->volume);
    else
        method_planes(p->pool, p->n_ranges, p->cells, p->power, p->volume);
    resample_volume(p->resample, p->volume, intensity);
    method_clip(p->pool, &p->grid, intensity);
}

static void paper_describe(const void *state, struct imager_outcome *out)
{
    const struct paper *p = state;
    out->choice = "lightcone";
    out->chosen = p->migrated;
}

static void paper_reset(void *state)
{
    struct paper *p = state;
    zero_offset_reset(p->zero_offset);
}

const struct imager_method method_paper = {
    .name = "paper",
    .clips = true,
    .create = paper_create,
    .add = paper_add,
    .image = paper_image,
    .describe = paper_describe,
    .reset = paper_reset,
    .destroy = paper_destroy,
};
