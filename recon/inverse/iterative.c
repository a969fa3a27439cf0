/* SPDX-License-Identifier: MIT */
/* recon/inverse/iterative.c -- `--method iterative`: the image of another method,
 * sharpened by ADMM (recon/inverse/admm) with the point spread function, L1 and total
 * variation (Lindell 2019, 3.3); with base "lct" the light-cone operator itself.
 *
 * What is blurred is the amplitude, the root of the intensity: parts of one object add up
 * in amplitude.  A point's image widens with range, so depth is taken in slabs, each with
 * the function of its middle; they overlap by more than that function reaches.  Weights
 * are relative to the brightest voxel of all: a slab that holds nothing above the L1
 * weight is 0 in the optimum, and is not computed. */
#include "recon/inverse/iterative.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/fft.h"
#include "dsp/vector.h"
#include "recon/coherent/zero_offset.h"
#include "recon/imaging/imager.h"
#include "recon/imaging/method.h"
#include "recon/imaging/resample.h"
#include "recon/inverse/admm.h"
#include "recon/inverse/psf.h"
#include "recon/power/lightcone.h"

/* -- slabs of depth, each with the point spread function of its middle as a Gaussian ----
 */

struct slab {
    size_t first, core;   /* planes of the image that are its own */
    double covariance[6]; /* of the function, voxels^2: xx xy xz yy yz zz */
};

struct slabs {
    size_t n;
    struct slab *all; /* [n] */
    size_t margin;    /* planes shared with each neighbour */
    size_t size[3];   /* voxels of a slab with margins and with room for the widest
                       * function */
};

#define REACH_SIGMAS 3.0 /* of the point spread function that count */
#define SLAB_M       0.2 /* of depth, without what it shares with its neighbours */
#define SLACK        1.1 /* of the transforms' sizes */
#define PSF_PAIRS    512
#define NEAREST_M    0.25 /* a slab nearer to the array takes the function from here */

/* Of an extended mirror-like object the image is sharper than of points: too narrow a
 * function sharpens less, too wide a one eats the object (referee's letters: 0.5 to 0.7
 * is best). */
#define WIDTH 0.6

static const int row[6] = {0, 0, 0, 1, 1, 2}, column[6] = {0, 1, 2, 1, 2, 2};
static const int diagonal[3] = {0, 3, 5};

/* A measured function widens across, not along depth, with the distance. */
static void scale_measured(const struct psf *measured, double plane_z_m, double at_z_m,
                           double covariance[6])
{
    double near_m = fmax(fabs(measured->centre_m[2] - plane_z_m), NEAREST_M);
    double s = fmax(fabs(at_z_m - plane_z_m), NEAREST_M) / near_m;
    const double factor[6] = {s * s, s * s, s, s * s, s, 1.0};
    for (int q = 0; q < 6; q++)
        covariance[q] = measured->covariance_m2[q] * factor[q];
}

/* The place of a slab's function: the middle of its planes, before the array. */
static void slab_place(const struct slab *slab, const struct imager_config *cfg,
                       double plane_z_m, struct psf_config *out)
{
    const struct grid *g = &cfg->grid;
    *out = (struct psf_config){.geometry = cfg->geometry,
                               .band_hz = {cfg->band_hz[0], cfg->band_hz[1]},
                               .n_pairs = PSF_PAIRS};
    for (int a = 0; a < 2; a++)
        out->at_m[a] = g->origin_m[a] + 0.5 * g->step_m[a] * (double)(g->n[a] - 1);
    out->at_m[2] = g->origin_m[2] + g->step_m[2] * (double)(slab->first + slab->core / 2);
    if (fabs(out->at_m[2] - plane_z_m) < NEAREST_M)
        out->at_m[2] = plane_z_m + NEAREST_M;
}

/* A fit over the curvature in closed form: hardly depends on the place. */
static int fit_correction(const struct psf_config *at, double correction[6])
{
    double closed[6];
    struct psf fit;
    int err = psf_curvature(at, closed);
    if (!err)
        err = psf_compute(&fit, at, NULL, NULL);
    for (int q = 0; !err && q < 6; q++) {
        double r = fit.covariance_m2[diagonal[row[q]]] / closed[diagonal[row[q]]];
        double c = fit.covariance_m2[diagonal[column[q]]] / closed[diagonal[column[q]]];
        correction[q] = sqrt(r * c);
    }
    return err;
}

/* The function within the volume: along an axis of one voxel nothing is known of where it
 * goes on, and taken as zeros that would be what it contradicts.  What is left is its
 * section there (Schur's complement), which is 0 along that axis. */
static void cut(double covariance[6], const size_t n[3])
{
    static const int at[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    for (int a = 0; a < 3; a++) {
        double own = covariance[diagonal[a]], across[3];
        if (n[a] > 1)
            continue;
        for (int b = 0; b < 3; b++)
            across[b] = covariance[at[a][b]];
        for (int q = 0; own > 0.0 && q < 6; q++)
            covariance[q] -= across[row[q]] * across[column[q]] / own;
        for (int b = 0; b < 3; b++)
            covariance[at[a][b]] = 0.0; /* but for rounding it is */
    }
}

static int plan_functions(struct slabs *s, const struct imager_config *cfg,
                          const struct psf *measured, const char **why)
{
    double low[3], high[3], correction[6];
    struct psf_config at;
    int err = 0;
    geometry_aperture(cfg->geometry, low, high);
    double plane_z_m = 0.5 * (low[2] + high[2]);
    slab_place(&s->all[s->n / 2], cfg, plane_z_m, &at);
    if (!measured)
        err = fit_correction(&at, correction);
    for (size_t i = 0; !err && i < s->n; i++) {
        double *c = s->all[i].covariance;
        slab_place(&s->all[i], cfg, plane_z_m, &at);
        if (measured)
            scale_measured(measured, plane_z_m, at.at_m[2], c);
        else
            err = psf_curvature(&at, c);
        for (int q = 0; !err && q < 6; q++)
            c[q] *= WIDTH * WIDTH * (measured ? 1.0 : correction[q]) /
                    (cfg->grid.step_m[row[q]] * cfg->grid.step_m[column[q]]);
        if (!err)
            cut(c, cfg->grid.n);
    }
    if (err == -ERANGE) {
        *why = "an aperture that resolves all axes, or a measured PSF";
        err = -ENOTSUP;
    }
    return err;
}

/* measured NULL: from the geometry.  Clear it, also after an error.  0, -ENOMEM, -ENOTSUP
 * (*why says what it needs). */
static int slabs_create(struct slabs *s, const struct imager_config *cfg,
                        const struct psf *measured, const char **why)
{
    const size_t *n = cfg->grid.n;
    size_t core = (size_t)fmax(rint(SLAB_M / cfg->grid.step_m[2]), 1.0);
    core = core < n[2] ? core : n[2];
    s->n = (n[2] + core - 1) / core;
    s->all = calloc(s->n, sizeof *s->all);
    if (!s->all)
        return -ENOMEM;
    for (size_t i = 0; i < s->n; i++) {
        s->all[i].first = i * core;
        s->all[i].core = (i + 1) * core < n[2] ? core : n[2] - i * core;
    }
    int err = plan_functions(s, cfg, measured, why);
    for (int a = 0; !err && a < 3; a++) {
        double reach = 0.0;
        for (size_t i = 0; i < s->n; i++)
            reach = fmax(reach, sqrt(fmax(s->all[i].covariance[diagonal[a]], 0.0)));
        size_t room = (size_t)fmin(ceil(REACH_SIGMAS * reach), (double)n[a]);
        if (a == 2)
            s->margin = s->n > 1 ? room : 0;
        s->size[a] = fft_size((a == 2 ? core + 2 * s->margin : n[a]) + room, SLACK);
    }
    return err;
}

static void slabs_clear(struct slabs *s)
{
    free(s->all);
}

/* -- the beam ---------------------------------------------------------------------------
 */

VECTOR_CLONES
static void smear_rows(size_t n, const float *restrict before, const float *restrict at,
                       const float *restrict after, float *restrict out)
{
    for (size_t i = 0; i < n; i++)
        out[i] = 0.75f * at[i] + 0.125f * (before[i] + after[i]);
}

/* Along an axis of n voxels that lie `stride` apart; periodic, as the blur is. */
static void smear(size_t size, size_t n, size_t stride, const float *in, float *out)
{
    for (size_t block = 0; block < size; block += n * stride)
        for (size_t k = 0; k < n; k++)
            smear_rows(stride, in + block + (k + n - 1) % n * stride,
                       in + block + k * stride, in + block + (k + 1) % n * stride,
                       out + block + k * stride);
}

void iterative_beam(const size_t n[3], float *restrict x, float *restrict spare)
{
    size_t plane = n[0] * n[1], size = plane * n[2];
    smear(size, n[0], 1, x, spare);
    smear(size, n[1], n[0], spare, x);
    smear(size, n[2], plane, x, spare);
    for (size_t i = 0; i < size; i++)
        x[i] = spare[i];
}

/* One part more of what `iterative` has done: the outcome holds for all of them. */
static void join(struct imager_outcome *out, const struct admm_result *part)
{
    out->iterations = part->iterations > out->iterations ? part->iterations
                                                         : out->iterations;
    out->residual = fmax(out->residual, fmax(part->primal, part->dual));
    out->converged = out->converged && part->converged;
}

/* -- base "lct": ADMM whose operator is the light-cone transform ------------------------
 *
 * On the powers of all pairs moved out to zero offset.  The same contract as struct
 * imager_method. */

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

static void iterative_lightcone_destroy(struct iterative_lightcone *l)
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

static int plan_operator(struct iterative_lightcone *l, const struct imager_config *cfg,
                         const struct grid *volume)
{
    const struct lightcone_config lightcone = {
        .nx = volume->n[0],
        .ny = volume->n[1],
        .pitch_x_m = volume->step_m[0],
        .pitch_y_m = volume->step_m[1],
        .nt = volume->n[2],
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

static int iterative_lightcone_create(struct iterative_lightcone **out,
                                      const struct imager_config *cfg,
                                      const struct imager_options *o, const char **why)
{
    struct iterative_lightcone *l = calloc(1, sizeof *l);
    struct grid volume;
    if (!l)
        return -ENOMEM;
    int err = zero_offset_of_image(&l->zero_offset, &volume, &l->range_m, cfg, why);
    if (!err) {
        l->range_step_m = volume.step_m[2];
        err = plan_operator(l, cfg, &volume);
    }
    if (!err)
        err = plan_admm(l, cfg, o, &volume);
    if (err) {
        iterative_lightcone_destroy(l);
        return err;
    }
    *out = l;
    return 0;
}

static void iterative_lightcone_add(struct iterative_lightcone *l, size_t position,
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

static void iterative_lightcone_image(struct iterative_lightcone *l, float *intensity)
{
    zero_offset_stack(l->zero_offset, l->power);
    amplify(l);
    admm_solve(l->admm, l->power, 0.0, l->volume, &l->result);
    iterative_beam(l->n, l->volume, l->power);
    resample_volume(l->resample, l->volume, intensity);
}

static void iterative_lightcone_describe(const struct iterative_lightcone *l,
                                         struct imager_outcome *out)
{
    out->iterates = out->converged = true;
    join(out, &l->result);
}

static void iterative_lightcone_reset(struct iterative_lightcone *l)
{
    zero_offset_reset(l->zero_offset);
}

/* -- the method -------------------------------------------------------------------------
 */

struct iterative {
    struct imager *base;
    struct iterative_lightcone *lightcone; /* NULL: sharpen base's image */
    struct grid grid;
    struct pool *pool;
    struct slabs slabs;
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
    slabs_clear(&it->slabs);
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
        err = slabs_create(&it->slabs, cfg, o->psf, why);
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
    if (!strcmp(o->base, "lct") && cfg->geometry->slot_m != 0.0) {
        *why = "a stage that stands at each position for base lct";
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
static float load(const struct iterative *it, const struct slab *s)
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

static void store(const struct iterative *it, const struct slab *s, float *out)
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

static void sharpen(struct iterative *it, float *intensity)
{
    size_t size = grid_size(&it->grid), plane = it->grid.n[0] * it->grid.n[1];
    float brightest = 0.0f;
    for (size_t v = 0; v < size; v++)
        brightest = fmaxf(brightest, it->image[v]);
    double reference = sqrt((double)brightest);
    it->outcome.iterates = it->outcome.converged = true;
    for (size_t i = 0; i < it->slabs.n && !pool_stopped(it->pool); i++) {
        const struct slab *s = &it->slabs.all[i];
        struct admm_result part;
        float largest = load(it, s);
        if (!(largest > it->l1 * reference)) {
            memset(intensity + s->first * plane, 0, s->core * plane * sizeof *intensity);
            continue;
        }
        admm_blur_gaussian(it->admm, s->covariance);
        admm_solve(it->admm, it->amplitude, reference, it->sharp, &part);
        join(&it->outcome, &part);
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
    if (imager_image(it->base, it->image))
        return;
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
    .continuous = true,
    .fits = true,
    .create = iterative_create,
    .add = iterative_add,
    .image = iterative_image,
    .describe = iterative_describe,
    .reset = iterative_reset,
    .destroy = iterative_destroy,
};
