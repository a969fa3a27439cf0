#include "recon/inverse/iterative_slabs.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "dsp/fft.h"
#include "recon/inverse/psf.h"

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
static void slab_place(const struct iterative_slab *slab, const struct imager_config *cfg,
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

static int plan_functions(struct iterative_slabs *s, const struct imager_config *cfg,
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
    }
    if (err == -ERANGE) {
        *why = "an aperture that resolves all axes, or a measured PSF";
        err = -ENOTSUP;
    }
    return err;
}

int iterative_slabs_create(struct iterative_slabs *s, const struct imager_config *cfg,
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

void iterative_slabs_clear(struct iterative_slabs *s)
{
    free(s->all);
}
