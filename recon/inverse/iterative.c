/* recon/inverse/iterative.c -- `--method iterative`: the image of another method,
 * sharpened by ADMM (recon/inverse/admm) with the point spread function, L1 and total
 * variation (Lindell 2019, 3.3); with base "lct" the light-cone operator itself
 * (recon/inverse/iterative_lightcone).
 *
 * What is blurred is the amplitude, the root of the intensity: parts of one object add up
 * in amplitude.  A point's image widens with range, so depth is taken in slabs, each with
 * the function of its middle; they overlap by more than that function reaches.  Weights
 * are relative to the brightest voxel of all: a slab that holds nothing above the L1
 * weight is 0 in the optimum, and is not computed. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/inverse/admm.h"
#include "recon/inverse/iterative.h"
#include "recon/inverse/iterative_slabs.h"
#include "recon/imaging/method.h"

struct iterative {
    struct imager *base;
    struct iterative_lightcone *lightcone; /* NULL: sharpen base's image */
    struct grid grid;
    struct pool *pool;
    struct iterative_slabs slabs;
    struct admm *admm;
    double l1;
    float *amplitude, *sharp; /* of a padded slab */
    float *image;             /* of the base, [grid] */
    struct imager_outcome outcome;
};

static void iterative_destroy(void *state)
{
    struct iterative *it = state;
    if (!it)
        return;
    iterative_lightcone_destroy(it->lightcone);
    imager_destroy(it->base);
    admm_destroy(it->admm);
    iterative_slabs_clear(&it->slabs);
    free(it->amplitude);
    free(it->image);
    free(it->sharp);
    free(it);
}

/* -- planning ---------------------------------------------------------------------------
 */

static int plan_blur(struct iterative *it, const struct imager_config *cfg,
                     const struct imager_options *o, const char **why)
{
    struct imager_config base = *cfg;
    base.method = o->base;
    int err = imager_create(&it->base, &base, why);
    if (err == -ENOENT) {
        *why = "the base to be another method's name, or lct";
        err = -ENOTSUP;
    }
    if (!err)
        err = iterative_slabs_create(&it->slabs, cfg, o->psf, why);
    if (err)
        return err;
    struct admm_config admm = {
        .n = {it->slabs.size[0], it->slabs.size[1], it->slabs.size[2]},
        .l1 = o->l1,
        .tv = o->tv,
        .tv_isotropic = o->tv_isotropic,
        .rho = o->rho,
        .iterations = o->iterations,
        .tolerance = o->tolerance,
        .pool = cfg->pool};
    size_t size = it->slabs.size[0] * it->slabs.size[1] * it->slabs.size[2];
    it->amplitude = malloc(size * sizeof *it->amplitude);
    it->sharp = malloc(size * sizeof *it->sharp);
    it->image = malloc(grid_size(&cfg->grid) * sizeof *it->image);
    return it->amplitude && it->sharp && it->image ? admm_create(&it->admm, &admm)
                                                   : -ENOMEM;
}

static int iterative_create(void **state, const struct imager_config *cfg,
                            const char **why)
{
    struct imager_options defaults;
    const struct imager_options *o = cfg->options;
    if (!o) {
        imager_options_default(&defaults);
        o = &defaults;
    }
    if (!o->base || !strcmp(o->base, "iterative")) {
        *why = "a base other than itself";
        return -ENOTSUP;
    }
    struct iterative *it = calloc(1, sizeof *it);
    if (!it)
        return -ENOMEM;
    it->grid = cfg->grid;
    it->pool = cfg->pool;
    it->l1 = o->l1;
    int err = strcmp(o->base, "lct")
                  ? plan_blur(it, cfg, o, why)
                  : iterative_lightcone_create(&it->lightcone, cfg, o, why);
    if (err) {
        iterative_destroy(it);
        return err;
    }
    *state = it;
    return 0;
}

/* -- imaging ----------------------------------------------------------------------------
 */

/* The slab's planes and what it shares, as amplitudes, with zeros around; the largest. */
static float load(const struct iterative *it, const struct iterative_slab *s)
{
    size_t nx = it->grid.n[0], ny = it->grid.n[1];
    size_t used = s->core + 2 * it->slabs.margin;
    float largest = 0.0f;
    memset(it->amplitude, 0,
           it->slabs.size[0] * it->slabs.size[1] * it->slabs.size[2] *
               sizeof *it->amplitude);
    for (size_t k = 0; k < used; k++) {
        if (s->first + k < it->slabs.margin ||
            s->first + k - it->slabs.margin >= it->grid.n[2])
            continue;
        const float *plane = it->image + (s->first + k - it->slabs.margin) * nx * ny;
        for (size_t y = 0; y < ny; y++) {
            float *line = it->amplitude + (k * it->slabs.size[1] + y) * it->slabs.size[0];
            for (size_t x = 0; x < nx; x++) {
                line[x] = sqrtf(fmaxf(plane[y * nx + x], 0.0f));
                largest = fmaxf(largest, line[x]);
            }
        }
    }
    return largest;
}

static void store(const struct iterative *it, const struct iterative_slab *s, float *out)
{
    size_t nx = it->grid.n[0], ny = it->grid.n[1];
    for (size_t k = 0; k < s->core; k++) {
        for (size_t y = 0; y < ny; y++) {
            const float *line = it->sharp +
                                ((k + it->slabs.margin) * it->slabs.size[1] + y) *
                                    it->slabs.size[0];
            float *to = out + ((s->first + k) * ny + y) * nx;
            for (size_t x = 0; x < nx; x++)
                to[x] = line[x] * line[x];
        }
    }
}

void iterative_join(struct imager_outcome *out, const struct admm_result *part)
{
    out->iterations = part->iterations > out->iterations ? part->iterations
                                                         : out->iterations;
    out->residual = fmax(out->residual, fmax(part->primal, part->dual));
    out->converged = out->converged && part->converged;
}

static void sharpen(struct iterative *it, float *intensity)
{
    size_t size = grid_size(&it->grid), plane = it->grid.n[0] * it->grid.n[1];
    float brightest = 0.0f;
    for (size_t v = 0; v < size; v++)
        brightest = fmaxf(brightest, it->image[v]);
    double reference = sqrt((double)brightest);
    it->outcome.iterates = it->outcome.converged = true;
    for (size_t i = 0; i < it->slabs.n; i++) {
        const struct iterative_slab *s = &it->slabs.all[i];
        struct admm_result part;
        float largest = load(it, s);
        if (!(largest > it->l1 * reference)) {
            memset(intensity + s->first * plane, 0, s->core * plane * sizeof *intensity);
            continue;
        }
        admm_blur_gaussian(it->admm, s->covariance);
        admm_solve(it->admm, it->amplitude, reference, it->sharp, &part);
        iterative_join(&it->outcome, &part);
        iterative_beam(it->slabs.size, it->sharp, it->amplitude);
        store(it, s, intensity);
    }
}

static void iterative_image(void *state, float *intensity)
{
    struct iterative *it = state;
    if (it->lightcone) {
        iterative_lightcone_image(it->lightcone, intensity);
        return;
    }
    imager_image(it->base, it->image);
    imager_outcome(it->base, &it->outcome);
    sharpen(it, intensity);
}

static void iterative_add(void *state, size_t position, size_t speaker,
                          const float complex *traces, const bool *masked)
{
    struct iterative *it = state;
    if (it->lightcone)
        iterative_lightcone_add(it->lightcone, position, speaker, traces, masked);
    else
        imager_add(it->base, position, speaker, traces, masked);
}

static void iterative_describe(const void *state, struct imager_outcome *out)
{
    const struct iterative *it = state;
    if (it->lightcone)
        iterative_lightcone_describe(it->lightcone, out);
    else
        *out = it->outcome;
}

static void iterative_reset(void *state)
{
    struct iterative *it = state;
    if (it->lightcone)
        iterative_lightcone_reset(it->lightcone);
    else
        imager_reset(it->base);
}

const struct imager_method method_iterative = {
    .name = "iterative",
    .create = iterative_create,
    .add = iterative_add,
    .image = iterative_image,
    .describe = iterative_describe,
    .reset = iterative_reset,
    .destroy = iterative_destroy,
};
