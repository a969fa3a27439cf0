/* recon/inverse/sparse.c -- `--method sparse`: the few complex amplitudes x whose echoes
 * explain the recording,
 *
 *   minimise 1/2 |K x - y|^2 + sum of l1 w |x|  (recon/inverse/sparse_solver),
 *
 * K the coherent operator from points to all traces (recon/inverse/sparse_operator):
 * points closer than the diffraction limit come apart.  Only voxels that are bright in
 * the image of a base method are candidates; everything else becomes 0.  For isolated
 * scatterers, not for plates. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/imaging/method.h"
#include "recon/inverse/sparse_solver.h"

#define CANDIDATE_DB 13.0 /* below the brightest; sidelobes start at about -18 */
#define MAX_POINTS   2000
#define MIN_POINTS   64
#define TABLE_BYTES  ((size_t)96 << 20) /* the operator's, at most */

struct sparse {
    struct imager *base;
    struct sparse_operator *model;
    struct sparse_solver *solver;
    struct grid grid;
    size_t max_points;
    size_t n;      /* candidates */
    size_t *voxel; /* [max_points], rising */
    double (*at_m)[3];
    struct sparse_result result;
};

static void sparse_destroy(void *state)
{
    struct sparse *s = state;
    if (!s)
        return;
    imager_destroy(s->base);
    sparse_solver_destroy(s->solver);
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
        const struct sparse_solver_config solver = {s->model, s->max_points, o->l1,
                                                    o->tolerance, o->iterations};
        err = sparse_solver_create(&s->solver, &solver);
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
    imager_image(s->base, intensity);
    choose(s, intensity);
    memset(intensity, 0, grid_size(&s->grid) * sizeof *intensity);
    s->result = (struct sparse_result){.converged = true};
    if (!s->n)
        return;
    sparse_operator_place(s->model, s->n, (const double(*)[3])s->at_m);
    const size_t *which;
    const float *x;
    size_t n = sparse_solver_run(s->solver, s->n, &which, &x, &s->result);
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
    .create = sparse_create,
    .add = sparse_add,
    .image = sparse_image,
    .describe = sparse_describe,
    .reset = sparse_reset,
    .destroy = sparse_destroy,
};
