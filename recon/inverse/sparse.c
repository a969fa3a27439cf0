/* SPDX-License-Identifier: MIT */
/* recon/inverse/sparse.c -- `--method sparse`: the few complex amplitudes x whose echoes
 * explain the recording,
 *
 *   minimise 1/2 |K x - y|^2 + sum of lambda w |x|,
 *
 * K the coherent operator from points to all traces (recon/inverse/sparse_operator):
 * points closer than the diffraction limit come apart.  Only voxels that are bright in
 * the image of a base method are candidates; everything else becomes 0.  For isolated
 * scatterers, not for plates. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/imaging/method.h"
#include "recon/inverse/sparse_operator.h"

/* -- the solver -------------------------------------------------------------------------
 */

/* Weights w are made smaller where something stands, in rounds (Candes 2008).  While
 * there are many points, FISTA (Beck 2009) with restarts (O'Donoghue 2015) drops those
 * that stay 0; when few are left, coordinate descent on their Gram matrix (Wu 2008) goes
 * on to the end, some 1000 times as fast. */
struct solver_config {
    struct pool *pool;             /* not owned, nor is */
    struct sparse_operator *model; /* which works in it */
    size_t max_points;
    double l1;         /* lambda over the largest of |K' y| */
    double tolerance;  /* relative change that ends a round */
    size_t iterations; /* at most, of each kind and round */
};

struct solution {
    size_t iterations; /* of all rounds and kinds */
    double change;     /* by the last one, relative */
    bool converged;    /* the last round has */
};

#define ROUNDS          4   /* of weights */
#define SHARPNESS       0.1 /* of the weights: relative amplitude where they are halved */
#define POWER_STEPS     6
#define STEP_MARGIN     1.1 /* over what the power method found */
#define CHECK_EVERY     10  /* iterations between the prunings */
#define PRUNE           0.7 /* of its weight: a gradient below it keeps a 0 where it is */
#define GRAM_POINTS     512 /* at most, for the matrix */
#define SWEEP_TOLERANCE 0.1 /* of a sweep, which is a smaller step than an iteration */
#define SWEEPS          10  /* of coordinate descent for each iteration that is allowed */

struct solver {
    struct solver_config cfg;
    struct sparse_operator *model;
    size_t n;
    size_t *which; /* [max_points]: points that are left, rising */
    size_t *kept;
    float *data, *x, *before, *momentum, *image_of; /* [max_points] re im */
    float *weight;                                  /* [max_points] */
    float *gram; /* [GRAM_POINTS][re, im][GRAM_POINTS] */
    struct solution result;
};

static void solver_destroy(struct solver *s)
{
    if (!s)
        return;
    float *const all[] = {s->data,     s->x,      s->before, s->momentum,
                          s->image_of, s->weight, s->gram};
    for (size_t a = 0; a < sizeof all / sizeof *all; a++)
        free(all[a]);
    free(s->which);
    free(s->kept);
    free(s);
}

/* 0, -ENOMEM. */
static int solver_create(struct solver **out, const struct solver_config *cfg)
{
    struct solver *s = calloc(1, sizeof *s);
    if (!s)
        return -ENOMEM;
    s->cfg = *cfg;
    s->model = cfg->model;
    size_t n = cfg->max_points, gram = n < GRAM_POINTS ? n : GRAM_POINTS;
    float **const vectors[] = {&s->data, &s->x, &s->before, &s->momentum, &s->image_of};
    s->which = malloc(n * sizeof *s->which);
    s->kept = malloc(n * sizeof *s->kept);
    s->weight = malloc(n * sizeof *s->weight);
    s->gram = malloc(2 * gram * gram * sizeof *s->gram);
    int err = s->which && s->kept && s->weight && s->gram ? 0 : -ENOMEM;
    for (size_t v = 0; v < sizeof vectors / sizeof *vectors; v++)
        if (!(*vectors[v] = malloc(2 * n * sizeof(float))))
            err = -ENOMEM;
    if (err) {
        solver_destroy(s);
        return err;
    }
    *out = s;
    return 0;
}

/* -- FISTA ------------------------------------------------------------------------------
 */

/* Largest eigenvalue of K'K, from the data outwards: with columns of length 1 it is at
 * most the number of points. */
static double measure_step(struct solver *s)
{
    double largest = 1.0;
    memcpy(s->momentum, s->data, 2 * s->n * sizeof(float));
    for (int step = 0; step < POWER_STEPS && !pool_stopped(s->cfg.pool); step++) {
        double in = 0.0, out = 0.0;
        sparse_operator_normal(s->model, s->momentum, s->image_of);
        for (size_t i = 0; i < 2 * s->n; i++) {
            in += (double)s->momentum[i] * (double)s->momentum[i];
            out += (double)s->image_of[i] * (double)s->image_of[i];
        }
        if (!(in > 0.0) || !(out > 0.0))
            return 1.0;
        largest = sqrt(out / in);
        for (size_t i = 0; i < 2 * s->n; i++)
            s->momentum[i] = (float)((double)s->image_of[i] / sqrt(out));
    }
    return STEP_MARGIN * largest;
}

/* x <- shrink(momentum - gradient / L); the change, and whether momentum points uphill.
 */
static double step(struct solver *s, double lipschitz, double lambda, bool *uphill)
{
    double change = 0.0, size = 0.0, ahead = 0.0;
    for (size_t i = 0; i < s->n; i++) {
        float re = s->momentum[2 * i], im = s->momentum[2 * i + 1];
        float gr = s->image_of[2 * i] - s->data[2 * i];
        float gi = s->image_of[2 * i + 1] - s->data[2 * i + 1];
        float xr = re - gr / (float)lipschitz, xi = im - gi / (float)lipschitz;
        float length = sqrtf(xr * xr + xi * xi);
        float kappa = (float)(lambda * s->weight[i] / lipschitz);
        float keep = length > kappa ? 1.0f - kappa / length : 0.0f;
        xr *= keep;
        xi *= keep;
        float dr = xr - s->x[2 * i], di = xi - s->x[2 * i + 1];
        ahead += (double)(re - xr) * dr + (double)(im - xi) * di;
        change += (double)dr * dr + (double)di * di;
        size += (double)xr * xr + (double)xi * xi;
        s->before[2 * i] = s->x[2 * i];
        s->before[2 * i + 1] = s->x[2 * i + 1];
        s->x[2 * i] = xr;
        s->x[2 * i + 1] = xi;
    }
    *uphill = ahead > 0.0;
    return size > 0.0 ? sqrt(change / size) : 0.0;
}

/* Drops points that are 0 and whose gradient is far from moving them.  Weights only fall
 * where something stands, so that they would stay 0 in the rounds to come. */
static void prune(struct solver *s, double lambda)
{
    size_t n = 0;
    for (size_t i = 0; i < s->n; i++) {
        float gr = s->image_of[2 * i] - s->data[2 * i];
        float gi = s->image_of[2 * i + 1] - s->data[2 * i + 1];
        bool zero = s->x[2 * i] == 0.0f && s->x[2 * i + 1] == 0.0f;
        if (!zero || hypot(gr, gi) > PRUNE * lambda * s->weight[i])
            s->kept[n++] = i;
    }
    if (n == s->n)
        return;
    float *const vectors[] = {s->data, s->x, s->before, s->momentum};
    for (size_t i = 0; i < n; i++) {
        size_t from = s->kept[i];
        for (size_t q = 0; q < sizeof vectors / sizeof *vectors; q++) {
            vectors[q][2 * i] = vectors[q][2 * from];
            vectors[q][2 * i + 1] = vectors[q][2 * from + 1];
        }
        s->which[i] = s->which[from];
        s->weight[i] = s->weight[from];
    }
    sparse_operator_keep(s->model, n, s->kept);
    s->n = n;
}

static void count(struct solver *s, double change, bool converged)
{
    s->result.iterations++;
    s->result.change = change;
    s->result.converged = converged;
}

static void fista(struct solver *s, double lipschitz, double lambda, size_t iterations)
{
    double t = 1.0;
    memcpy(s->momentum, s->x, 2 * s->n * sizeof(float));
    for (size_t i = 1; i <= iterations && s->n && !pool_stopped(s->cfg.pool); i++) {
        bool uphill;
        sparse_operator_normal(s->model, s->momentum, s->image_of);
        double change = step(s, lipschitz, lambda, &uphill);
        count(s, change, i > 1 && change < s->cfg.tolerance);
        if (uphill)
            t = 1.0;
        double next = 0.5 * (1.0 + sqrt(1.0 + 4.0 * t * t));
        float ahead = (float)((t - 1.0) / next);
        for (size_t q = 0; q < 2 * s->n; q++)
            s->momentum[q] = s->x[q] + ahead * (s->x[q] - s->before[q]);
        t = next;
        if (s->result.converged)
            return;
        if (i % CHECK_EVERY == 0)
            prune(s, lambda);
        if (s->n <= GRAM_POINTS)
            return;
    }
}

/* Halved where the amplitude is SHARPNESS of the largest. */
static void reweigh(struct solver *s)
{
    double largest = 0.0;
    for (size_t i = 0; i < s->n; i++)
        largest = fmax(largest, hypot(s->x[2 * i], s->x[2 * i + 1]));
    for (size_t i = 0; largest > 0.0 && i < s->n; i++) {
        double level = hypot(s->x[2 * i], s->x[2 * i + 1]) / largest;
        s->weight[i] = (float)(SHARPNESS / (SHARPNESS + level));
    }
}

/* -- few points -------------------------------------------------------------------------
 */

/* residual (re, then im) -= change of one point times its row, conjugated: its column. */
VECTOR_CLONES
static void subtract(size_t n, const float *restrict row_re, const float *restrict row_im,
                     float re, float im, float *restrict to_re, float *restrict to_im)
{
    for (size_t v = 0; v < n; v++) {
        to_re[v] -= row_re[v] * re + row_im[v] * im;
        to_im[v] -= row_re[v] * im - row_im[v] * re;
    }
}

static const float *gram_row(const struct solver *s, size_t i)
{
    return s->gram + 2 * i * s->n;
}

/* Largest change of one sweep, over the largest amplitude. */
static double sweep(struct solver *s, double lambda)
{
    float *r_re = s->before, *r_im = s->before + s->n;
    double change = 0.0, largest = 0.0;
    for (size_t i = 0; i < s->n; i++) {
        const float *row = gram_row(s, i);
        float own = row[i];
        if (!(own > 0.0f))
            continue;
        float re = s->x[2 * i], im = s->x[2 * i + 1];
        float xr = re + r_re[i] / own, xi = im + r_im[i] / own;
        float length = sqrtf(xr * xr + xi * xi);
        float kappa = (float)lambda * s->weight[i] / own;
        float keep = length > kappa ? 1.0f - kappa / length : 0.0f;
        xr *= keep;
        xi *= keep;
        largest = fmax(largest, (double)(xr * xr + xi * xi));
        if (xr == re && xi == im)
            continue;
        change = fmax(change, pow(xr - re, 2.0) + pow(xi - im, 2.0));
        subtract(s->n, row, row + s->n, xr - re, xi - im, r_re, r_im);
        s->x[2 * i] = xr;
        s->x[2 * i + 1] = xi;
    }
    return largest > 0.0 ? sqrt(change / largest) : 0.0;
}

static void descend(struct solver *s, double lambda)
{
    float *r_re = s->before, *r_im = s->before + s->n;
    for (size_t i = 0; i < s->n; i++) {
        r_re[i] = s->data[2 * i];
        r_im[i] = s->data[2 * i + 1];
    }
    for (size_t i = 0; i < s->n; i++)
        subtract(s->n, gram_row(s, i), gram_row(s, i) + s->n, s->x[2 * i],
                 s->x[2 * i + 1], r_re, r_im);
    for (size_t k = 0; k < SWEEPS * s->cfg.iterations && !pool_stopped(s->cfg.pool);
         k++) {
        double change = sweep(s, lambda);
        count(s, change, change < SWEEP_TOLERANCE * s->cfg.tolerance);
        if (s->result.converged)
            return;
    }
}

/* -- all of it --------------------------------------------------------------------------
 */

static size_t solver_run(struct solver *s, size_t n, const size_t **which,
                         const float **x, struct solution *result)
{
    double largest = 0.0, lipschitz = 0.0;
    s->n = n;
    s->result = (struct solution){.converged = true};
    sparse_operator_data(s->model, s->data);
    for (size_t i = 0; i < n; i++) {
        largest = fmax(largest, hypot(s->data[2 * i], s->data[2 * i + 1]));
        s->weight[i] = 1.0f;
        s->which[i] = i;
    }
    memset(s->x, 0, 2 * n * sizeof(float));
    if (n > GRAM_POINTS)
        lipschitz = measure_step(s);
    bool few = false;
    for (int round = 0; round < ROUNDS && !pool_stopped(s->cfg.pool); round++) {
        if (s->n > GRAM_POINTS)
            fista(s, lipschitz, s->cfg.l1 * largest, s->cfg.iterations);
        if (!few && s->n <= GRAM_POINTS)
            sparse_operator_gram(s->model, s->gram);
        few = s->n <= GRAM_POINTS;
        if (few)
            descend(s, s->cfg.l1 * largest);
        reweigh(s);
    }
    *which = s->which;
    *x = s->x;
    *result = s->result;
    return s->n;
}

/* -- the method -------------------------------------------------------------------------
 */

#define CANDIDATE_DB 13.0 /* below the brightest; sidelobes start at about -18 */
#define MAX_POINTS   2000
#define MIN_POINTS   64
#define TABLE_BYTES  ((size_t)96 << 20) /* the operator's, at most */

struct sparse {
    struct imager *base;
    struct sparse_operator *model;
    struct solver *solver;
    struct grid grid;
    size_t max_points;
    size_t n;      /* candidates */
    size_t *voxel; /* [max_points], rising */
    double (*at_m)[3];
    struct solution result;
};

static void sparse_destroy(void *state)
{
    struct sparse *s = state;
    if (!s)
        return;
    imager_destroy(s->base);
    solver_destroy(s->solver);
    sparse_operator_destroy(s->model);
    free(s->voxel);
    free(s->at_m);
    free(s);
}

/* The image that candidates are taken from: the faster one where it can. */
static int create_base(struct sparse *s, const struct imager_config *cfg,
                       const char **why)
{
    struct imager_config base = *cfg;
    base.method = "fast";
    int err = imager_create(&s->base, &base, why);
    if (err == -ENOTSUP) {
        base.method = "backprojection";
        err = imager_create(&s->base, &base, why);
    }
    return err;
}

static int sparse_create(void **state, const struct imager_config *cfg, const char **why)
{
    struct imager_options defaults;
    const struct imager_options *o = cfg->options;
    struct sparse *s = calloc(1, sizeof *s);
    if (!s)
        return -ENOMEM;
    imager_options_default(&defaults);
    if (!o)
        o = &defaults;
    const struct geometry *g = cfg->geometry;
    size_t elements = g->n_positions * (g->n_speakers + g->n_microphones);
    size_t most = TABLE_BYTES / (elements * 3 * sizeof(float));
    s->max_points = most < MIN_POINTS   ? MIN_POINTS
                    : most < MAX_POINTS ? most
                                        : MAX_POINTS;
    s->grid = cfg->grid;
    s->voxel = malloc(s->max_points * sizeof *s->voxel);
    s->at_m = malloc(s->max_points * sizeof *s->at_m);
    int err = s->voxel && s->at_m ? 0 : -ENOMEM;
    if (!err)
        err = create_base(s, cfg, why);
    if (!err)
        err = sparse_operator_create(&s->model, cfg, s->max_points);
    if (!err) {
        const struct solver_config solver = {cfg->pool, s->model,     s->max_points,
                                             o->l1,     o->tolerance, o->iterations};
        err = solver_create(&s->solver, &solver);
    }
    if (err) {
        sparse_destroy(s);
        return err;
    }
    *state = s;
    return 0;
}

/* -- candidates -------------------------------------------------------------------------
 */

static size_t count_above(const float *image, size_t n, float level)
{
    size_t count = 0;
    for (size_t v = 0; v < n; v++)
        count += image[v] > level;
    return count;
}

/* Voxels above the level, or the brightest that there is room for. */
static void choose(struct sparse *s, const float *image)
{
    size_t size = grid_size(&s->grid);
    float brightest = 0.0f;
    for (size_t v = 0; v < size; v++)
        brightest = fmaxf(brightest, image[v]);
    double low_db = -CANDIDATE_DB, high_db = 0.0;
    if (count_above(image, size, brightest * (float)pow(10.0, 0.1 * low_db)) >
        s->max_points) {
        for (int step = 0; step < 20; step++) {
            double db = 0.5 * (low_db + high_db);
            float level = brightest * (float)pow(10.0, 0.1 * db);
            if (count_above(image, size, level) > s->max_points)
                low_db = db;
            else
                high_db = db;
        }
        low_db = high_db;
    }
    float level = brightest * (float)pow(10.0, 0.1 * low_db);
    s->n = 0;
    for (size_t v = 0; v < size && s->n < s->max_points; v++)
        if (image[v] > level)
            s->voxel[s->n++] = v;
    for (size_t i = 0; i < s->n; i++) {
        size_t v = s->voxel[i], nx = s->grid.n[0], ny = s->grid.n[1];
        size_t at[3] = {v % nx, v / nx % ny, v / (nx * ny)};
        for (int a = 0; a < 3; a++)
            s->at_m[i][a] = s->grid.origin_m[a] + s->grid.step_m[a] * (double)at[a];
    }
}

static void sparse_image(void *state, float *intensity)
{
    struct sparse *s = state;
    if (imager_image(s->base, intensity))
        return;
    choose(s, intensity);
    memset(intensity, 0, grid_size(&s->grid) * sizeof *intensity);
    s->result = (struct solution){.converged = true};
    if (!s->n)
        return;
    sparse_operator_place(s->model, s->n, (const double(*)[3])s->at_m);
    const size_t *which;
    const float *x;
    size_t n = solver_run(s->solver, s->n, &which, &x, &s->result);
    for (size_t i = 0; i < n; i++)
        intensity[s->voxel[which[i]]] = x[2 * i] * x[2 * i] + x[2 * i + 1] * x[2 * i + 1];
}

static void sparse_add(void *state, size_t position, size_t speaker,
                       const float complex *traces, const bool *masked)
{
    struct sparse *s = state;
    imager_add(s->base, position, speaker, traces, masked);
    sparse_operator_add(s->model, position, speaker, traces, masked);
}

static void sparse_describe(const void *state, struct imager_outcome *out)
{
    const struct sparse *s = state;
    out->iterates = true;
    out->iterations = s->result.iterations;
    out->residual = s->result.change;
    out->converged = s->result.converged;
}

static void sparse_reset(void *state)
{
    struct sparse *s = state;
    imager_reset(s->base);
    sparse_operator_reset(s->model);
}

const struct imager_method method_sparse = {
    .name = "sparse",
    .any_geometry = true,
    .isolates = true,
    .fits = true,
    .create = sparse_create,
    .add = sparse_add,
    .image = sparse_image,
    .describe = sparse_describe,
    .reset = sparse_reset,
    .destroy = sparse_destroy,
};
