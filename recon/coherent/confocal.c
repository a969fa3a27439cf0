/* SPDX-License-Identifier: MIT */
/* recon/coherent/confocal.c -- the two methods that use co-located pairs only
 * (recon/coherent/colocated).
 *
 * `--method confocal` shows the measurements as they are, at (x, y, t c / 2): right for
 * an object that sends back only what meets it at a right angle (Lindell 2019 Eq. 8).
 * `--method lct` inverts the light-cone transform of their power: right for points that
 * scatter evenly and for retroreflectors (Eq. 9). */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "recon/coherent/colocated.h"
#include "recon/imaging/method.h"
#include "recon/imaging/resample.h"
#include "recon/power/lightcone.h"

#define TAPER   0.1 /* of the aperture, at each rim */
#define FALLOFF 2.0 /* of a point's power after what colocated.h makes up for */

struct confocal {
    struct colocated *colocated;
    struct colocated_lattice lattice;
    struct lightcone *lightcone; /* NULL: as measured */
    struct resample *resample;
    struct pool *pool;
    float *power;     /* [ny][nx][n_ranges] */
    float *volume;    /* [n_ranges][ny][nx] */
    struct grid grid; /* of the image */
};

static void confocal_destroy(void *state)
{
    struct confocal *c = state;
    if (!c)
        return;
    resample_destroy(c->resample);
    lightcone_destroy(c->lightcone);
    colocated_destroy(c->colocated);
    free(c->power);
    free(c->volume);
    free(c);
}

static int plan_lightcone(struct confocal *c, const struct imager_config *cfg)
{
    struct imager_options defaults;
    const struct imager_options *o = cfg->options;
    if (!o) {
        imager_options_default(&defaults);
        o = &defaults;
    }
    struct lightcone_config lightcone = {
        .nx = c->lattice.nx,
        .ny = c->lattice.ny,
        .pitch_x_m = c->lattice.pitch_x_m,
        .pitch_y_m = c->lattice.pitch_y_m,
        .nt = c->lattice.n_ranges,
        .range_m = c->lattice.range_m,
        .range_step_m = c->lattice.range_step_m,
        .falloff = FALLOFF,
        .taper = TAPER,
        .snr = pow(10.0, 0.1 * o->snr_db),
        .pool = cfg->pool,
    };
    return lightcone_create(&c->lightcone, &lightcone);
}

static int plan_volume(struct confocal *c, const struct imager_config *cfg)
{
    const struct colocated_lattice *l = &c->lattice;
    const struct grid volume = {
        {l->x_m, l->y_m, l->plane_z_m + l->range_m},
        {l->pitch_x_m, l->pitch_y_m, l->range_step_m},
        {l->nx, l->ny, l->n_ranges},
    };
    c->power = malloc(grid_size(&volume) * sizeof *c->power);
    c->volume = malloc(grid_size(&volume) * sizeof *c->volume);
    if (!c->power || !c->volume)
        return -ENOMEM;
    return resample_create(&c->resample, &volume, &cfg->grid, RESAMPLE_CUBIC, cfg->pool);
}

static int create(void **state, const struct imager_config *cfg, const char **why,
                  bool with_lightcone)
{
    struct confocal *c = calloc(1, sizeof *c);
    if (!c)
        return -ENOMEM;
    c->pool = cfg->pool;
    c->grid = cfg->grid;
    int err = colocated_create(&c->colocated, cfg, why);
    if (!err) {
        colocated_lattice(c->colocated, &c->lattice);
        err = plan_volume(c, cfg);
    }
    if (!err && with_lightcone)
        err = plan_lightcone(c, cfg);
    if (err) {
        confocal_destroy(c);
        return err;
    }
    *state = c;
    return 0;
}

static int confocal_create(void **state, const struct imager_config *cfg,
                           const char **why)
{
    return create(state, cfg, why, false);
}

static int lct_create(void **state, const struct imager_config *cfg, const char **why)
{
    return create(state, cfg, why, true);
}

static void confocal_add(void *state, size_t position, size_t speaker,
                         const float complex *traces, const bool *masked)
{
    struct confocal *c = state;
    colocated_add(c->colocated, position, speaker, traces, masked);
}

static void confocal_image(void *state, float *intensity)
{
    struct confocal *c = state;
    colocated_power(c->colocated, c->power);
    if (c->lightcone)
        lightcone_inverse(c->lightcone, c->power, c->volume);
    else
        method_planes(c->pool, c->lattice.n_ranges, c->lattice.nx * c->lattice.ny,
                      c->power, c->volume);
    resample_volume(c->resample, c->volume, intensity);
    method_clip(c->pool, &c->grid, intensity);
}

static void confocal_reset(void *state)
{
    struct confocal *c = state;
    colocated_reset(c->colocated);
}

const struct imager_method method_confocal = {
    .name = "confocal",
    .clips = true,
    .create = confocal_create,
    .add = confocal_add,
    .image = confocal_image,
    .reset = confocal_reset,
    .destroy = confocal_destroy,
};

const struct imager_method method_lct = {
    .name = "lct",
    .clips = true,
    .create = lct_create,
    .add = confocal_add,
    .image = confocal_image,
    .reset = confocal_reset,
    .destroy = confocal_destroy,
};
