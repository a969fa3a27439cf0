/* SPDX-License-Identifier: MIT */
/* recon/coherent/fast.c -- `--method fast`: every pair's trace is moved out to its
 * midpoint with its phase and stacked with equal weight for each midpoint
 * (recon/coherent/midpoint_stack), and the co-located traces are migrated
 * (recon/coherent/fk).  Dip moveout costs time and memory, and is done where echoes from
 * aside would come out of step without it: for targets nearer than about four times the
 * longest half-offset.  Elements a little beside a line take static corrections
 * (recon/coherent/statics). */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "recon/coherent/fk.h"
#include "recon/coherent/midpoint.h"
#include "recon/coherent/midpoint_stack.h"
#include "recon/imaging/fold.h"
#include "recon/imaging/method.h"
#include "recon/planning/moveout_error.h"

#define RATE_MARGIN 1.2 /* sampling rate of co-located traces over the band's width */

struct fast {
    struct statics *statics; /* of elements beside a line; else NULL */
    struct midpoints *midpoints;
    struct midpoint_stack *stack;
    struct fk *fk;
    bool dip; /* moveout */
};

/* Width of the band that traces hold, as much above their carrier as below, which may be
 * more than is imaged: what is sampled too coarsely would fold into the image. */
static double held_hz(const struct imager_config *cfg)
{
    double low_hz = cfg->band_hz[0];
    return fmax(cfg->band_hz[1] - low_hz, 2.0 * (cfg->format.carrier_hz - low_hz));
}

static int colocated_format(struct trace_format *out, const struct imager_config *cfg,
                            const struct midpoints *m, const char **why)
{
    double span_s[2];
    int err = method_span(span_s, cfg, m->half_offset_m[m->n_offsets - 1], why);
    if (err)
        return err;
    out->rate_hz = fmin(RATE_MARGIN * held_hz(cfg), cfg->format.rate_hz);
    out->carrier_hz = cfg->format.carrier_hz;
    out->t0_s = span_s[0];
    out->n_samples = method_samples(span_s, out->rate_hz, FK_MIN_SAMPLES);
    return 0;
}

/* Do the corners of the image's middle plane need dip moveout? */
static int needs_dip(const struct imager_config *cfg, bool *out)
{
    const struct grid *g = &cfg->grid;
    double centre_hz = 0.5 * (cfg->band_hz[0] + cfg->band_hz[1]);
    float *weight;
    int err = fold_weights(cfg->geometry, &weight);
    *out = false;
    for (size_t corner = 0; !err && !*out && corner < 4; corner++) {
        double rest_rad = 0.0, shift_m[3], at_m[3];
        const size_t index[3] = {corner % 2 ? g->n[0] - 1 : 0,
                                 corner / 2 ? g->n[1] - 1 : 0, g->n[2] / 2};
        for (int a = 0; a < 3; a++)
            at_m[a] = g->origin_m[a] + g->step_m[a] * (double)index[a];
        moveout_error(cfg->geometry, weight, at_m, centre_hz, shift_m, &rest_rad);
        *out = rest_rad > MOVEOUT_FALLS_APART;
    }
    free(weight);
    return err;
}

static int create_stack(struct fast *f, const struct imager_config *cfg,
                        const struct trace_format *colocated, const char **why)
{
    int dmo = cfg->options ? cfg->options->dmo : -1;
    bool dip = dmo > 0;
    int err = dmo < 0 && !f->statics ? needs_dip(cfg, &dip) : 0;
    if (f->statics && dip) {
        *why = "elements on lines for dip moveout";
        return -ENOTSUP;
    }
    struct midpoint_stack_config stack = {
        .geometry = cfg->geometry,
        .midpoints = f->midpoints,
        .statics = f->statics,
        .in = cfg->format,
        .out = *colocated,
        .band_hz = {cfg->band_hz[0], cfg->band_hz[1]},
        .mute_s = 2.0 * cfg->gate_m[0] / cfg->geometry->sound_speed_m_s,
        .dip = dip,
        .pool = cfg->pool,
    };
    if (!err)
        err = midpoint_stack_create(&f->stack, &stack, why);
    if (err == -ENOTSUP && dmo < 0) { /* lines that are not even: as well as it goes */
        stack.dip = false;
        err = midpoint_stack_create(&f->stack, &stack, why);
    }
    f->dip = stack.dip;
    return err;
}

static int create_stages(struct fast *f, const struct imager_config *cfg,
                         const char **why)
{
    const struct midpoints *m = f->midpoints;
    struct trace_format colocated;
    int err = colocated_format(&colocated, cfg, m, why);
    if (!err)
        err = create_stack(f, cfg, &colocated, why);
    if (err)
        return err;
    const struct fk_config fk = {
        .sound_speed_m_s = cfg->geometry->sound_speed_m_s,
        .nx = m->nx,
        .ny = m->ny,
        .x_m = m->x_m,
        .y_m = m->y_m,
        .copies = m->n_places,
        .x_range = (const size_t(*)[2])m->x_range,
        .plane_z_m = m->plane_z_m,
        .trace = colocated,
        .band_hz = {cfg->band_hz[0], cfg->band_hz[1]},
        .grid = cfg->grid,
        .sharpen = cfg->options ? cfg->options->sharpen : 0.0,
        .taper = cfg->options && cfg->options->taper,
        .pool = cfg->pool,
    };
    err = fk_create(&f->fk, &fk);
    if (err == -EINVAL)
        *why = "a volume wholly before the array (z_m beyond the elements)";
    return err == -EINVAL ? -ENOTSUP : err;
}

static void fast_destroy(void *state)
{
    struct fast *f = state;
    if (!f)
        return;
    fk_destroy(f->fk);
    midpoint_stack_destroy(f->stack);
    midpoints_destroy(f->midpoints);
    statics_destroy(f->statics);
    free(f);
}

/* With static corrections for the middle of what is imaged. */
static int create_line(struct fast *f, const struct imager_config *cfg, const char **why)
{
    double middle_m[3];
    for (int a = 0; a < 3; a++)
        middle_m[a] = cfg->grid.origin_m[a] +
                      0.5 * cfg->grid.step_m[a] * (double)(cfg->grid.n[a] - 1);
    int err = statics_create(&f->statics, cfg->geometry, middle_m, why);
    return err ? err : midpoints_create(&f->midpoints, &f->statics->line, why);
}

static int fast_create(void **state, const struct imager_config *cfg, const char **why)
{
    struct fast *f = calloc(1, sizeof *f);
    if (!f)
        return -ENOMEM;
    int err = midpoints_create(&f->midpoints, cfg->geometry, why);
    if (err == -ENOTSUP)
        err = create_line(f, cfg, why);
    if (!err)
        err = create_stages(f, cfg, why);
    if (err) {
        fast_destroy(f);
        return err;
    }
    *state = f;
    return 0;
}

static void fast_add(void *state, size_t position, size_t speaker,
                     const float complex *traces, const bool *masked)
{
    const struct fast *f = state;
    midpoint_stack_add(f->stack, position, speaker, traces, masked);
}

static void fast_image(void *state, float *intensity)
{
    const struct fast *f = state;
    const float complex *gather;
    const float *weight;
    midpoint_stack_finish(f->stack, &gather, &weight);
    fk_migrate(f->fk, gather, weight, intensity);
}

static void fast_describe(const void *state, struct imager_outcome *out)
{
    const struct fast *f = state;
    out->choice = "dmo";
    out->chosen = f->dip;
}

static void fast_reset(void *state)
{
    const struct fast *f = state;
    midpoint_stack_reset(f->stack);
}

const struct imager_method method_fast = {
    .name = "fast",
    .continuous = true,
    .adds = true,
    .create = fast_create,
    .add = fast_add,
    .image = fast_image,
    .describe = fast_describe,
    .reset = fast_reset,
    .destroy = fast_destroy,
};
