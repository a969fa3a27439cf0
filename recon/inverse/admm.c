/* SPDX-License-Identifier: MIT */
/* recon/inverse/admm.c -- the iterations: shrinkage and dual voxel by voxel, the stopping
 * rule, and rho.  The step that involves K is recon/inverse/admm_blur.c or admm_normal.c;
 * see admm_plan.h. */
#include "recon/inverse/admm_plan.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"

#define RELAXATION  1.8 /* Boyd 3.4.3 */
#define CHECK_EVERY 5   /* iterations between looks at the residuals */
#define BALANCE     3.0 /* residuals farther apart than this move rho */
#define RHO_STEP    4.0 /* at most, at once */
#define RHO_CALM                                                                         \
    1.5                /* the next change comes at so many times this iteration: their   \
                        * number is bounded, as convergence asks (Boyd 3.4.1) */
#define RHO_LEAST 1e-6 /* in units of |K|^2 */
#define RHO_MOST  1e6
#define FLOOR     1e-3 /* residuals are relative to at least this much of K' b */
#define ALIGNMENT 16   /* floats */

/* -- rows of a thread -------------------------------------------------------------------
 */

enum field { FIELD_G, FIELD_CHANGE, FIELD_DUAL, FIELDS };

/* Rows of the scratch: A x of each part, what of each part is gathered, the row before
 * along y, and what is compared. */
enum {
    ROWS_AX = 0,
    ROWS_NEW = ROWS_AX + ADMM_PARTS,
    ROWS_BEFORE = ROWS_NEW + FIELDS * ADMM_PARTS,
    ROWS_GAP = ROWS_BEFORE + FIELDS,
    ROWS_Z = ROWS_GAP + ADMM_PARTS,
    ROWS_SPARE = ROWS_Z + ADMM_PARTS,
    ROWS = ROWS_SPARE + ADMM_PARTS
};

/* Floats of a thread's rows. */
static size_t rows_size(const struct admm *a)
{
    return ROWS * (a->nx + VECTOR_LANES) + FIELDS * a->nx * a->ny;
}

static float *row_of(const struct admm *a, const struct admm_scratch *s, size_t row)
{
    return s->rows + row * (a->nx + VECTOR_LANES);
}

/* Shrunk differences along z of the plane before, [FIELDS][ny][nx]. */
static float *plane_of(const struct admm *a, const struct admm_scratch *s, size_t f)
{
    return s->rows + ROWS * (a->nx + VECTOR_LANES) + f * a->nx * a->ny;
}

/* -- create -----------------------------------------------------------------------------
 */

static bool sensible(const struct admm_config *c)
{
    bool ok = c->pool && c->n[0] && c->n[1] && c->n[2] && c->rho > 0.0;
    ok = ok && c->l1 >= 0.0 && isfinite(c->l1) && c->tv >= 0.0 && isfinite(c->tv);
    ok = ok && isfinite(c->rho) && c->tolerance >= 0.0;
    ok = ok && (c->relaxation == 0.0 || (c->relaxation >= 1.0 && c->relaxation <= 1.9));
    return ok && (!c->linear || c->linear->n_data);
}

static int allocate(struct admm *a)
{
    size_t threads = pool_threads(a->cfg.pool);
    a->scratch = calloc(threads, sizeof *a->scratch);
    a->x = fftwf_malloc(a->nz * a->plane * sizeof *a->x);
    if (!a->scratch || !a->x)
        return -ENOMEM;
    for (size_t t = 0; t < threads; t++) {
        a->scratch[t].rows = calloc(rows_size(a), sizeof(float));
        a->scratch[t].plane = fftwf_malloc(a->plane * sizeof(float));
        if (!a->scratch[t].rows || !a->scratch[t].plane)
            return -ENOMEM;
    }
    for (size_t d = 0; d < a->parts; d++)
        for (int side = 0; side < 2; side++)
            if (!(a->v[side][d] = malloc(a->nz * a->plane * sizeof(float))))
                return -ENOMEM;
    return 0;
}

int admm_create(struct admm **out, const struct admm_config *cfg)
{
    if (!sensible(cfg))
        return -EINVAL;
    struct admm *a = calloc(1, sizeof *a);
    if (!a)
        return -ENOMEM;
    a->cfg = *cfg;
    if (cfg->linear)
        a->linear = *cfg->linear;
    a->cfg.linear = NULL;
    if (a->cfg.relaxation == 0.0)
        a->cfg.relaxation = RELAXATION;
    a->nx = cfg->n[0];
    a->ny = cfg->n[1];
    a->nz = cfg->n[2];
    a->n = a->nx * a->ny * a->nz;
    a->parts = cfg->tv > 0.0 ? ADMM_PARTS : 1;
    a->plane = a->nx * a->ny;
    if (!cfg->linear) /* planes of a blur are transformed where they lie */
        a->plane = (a->plane + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    int err = allocate(a);
    if (!err)
        err = admm_blur_create(a);
    if (!err && cfg->linear)
        err = admm_normal_create(a);
    if (err) {
        admm_destroy(a);
        return err;
    }
    if (!cfg->linear) /* until one is given, nothing is blurred */
        admm_blur_gaussian(a, (const double[6]){0});
    *out = a;
    return 0;
}

void admm_destroy(struct admm *a)
{
    if (!a)
        return;
    admm_normal_destroy(a);
    admm_blur_destroy(a);
    for (size_t t = 0; a->scratch && t < pool_threads(a->cfg.pool); t++) {
        free(a->scratch[t].rows);
        fftwf_free(a->scratch[t].plane);
        fftwf_free(a->scratch[t].column);
    }
    for (size_t d = 0; d < ADMM_PARTS; d++) {
        free(a->v[0][d]);
        free(a->v[1][d]);
    }
    fftwf_free(a->x);
    free(a->scratch);
    free(a);
}

/* -- shrinkage and dual (Boyd 2011, 4.4.3 and 6.5.1) ------------------------------------
 */

/* Where a part of a row comes from and goes to, [nx] each; those of different parts do
 * not overlap.  change, dual, gap and z only count in a checked round. */
struct part_row {
    const float *ax, *before;       /* A x; v */
    float *after, *g;               /* v; 2 z - v */
    float *change, *dual, *gap, *z; /* z - the z before; u; A x - z; z */
};

VECTOR_INLINE double squares(const float *x, size_t n)
{
    double sum = 0.0;
    float lanes[VECTOR_LANES] = {0};
    size_t i = 0;
    for (; i + VECTOR_LANES <= n; i += VECTOR_LANES)
        for (size_t l = 0; l < VECTOR_LANES; l++)
            lanes[l] += x[i + l] * x[i + l];
    for (size_t l = 0; l < VECTOR_LANES; l++)
        sum += (double)lanes[l];
    for (; i < n; i++)
        sum += (double)x[i] * (double)x[i];
    return sum;
}

/* |x|^2 */
VECTOR_CLONES
static double squares_of(const float *x, size_t n)
{
    return squares(x, n);
}

VECTOR_INLINE float soft(float v, float kappa)
{
    float low = v > kappa ? kappa : v;
    return v - (low < -kappa ? -kappa : low);
}

VECTOR_INLINE float soft_positive(float v, float kappa)
{
    return v > kappa ? v - kappa : 0.0f;
}

/* x >= 0 with its L1 weight, or a difference with its weight. */
VECTOR_INLINE void shrink_part(size_t n, const float *restrict ax,
                               const float *restrict before, float *restrict after,
                               float *restrict g, float relax, float kappa, int self)
{
    for (size_t i = 0; i < n; i++) {
        float z = self ? soft_positive(before[i], kappa) : soft(before[i], kappa);
        float v = before[i] + relax * (ax[i] - z);
        z = self ? soft_positive(v, kappa) : soft(v, kappa);
        after[i] = v;
        g[i] = 2.0f * z - v;
    }
}

/* 1 - kappa / |v|, not below 0; a threshold of 0 leaves even a zero as it is. */
VECTOR_INLINE float shorten(float x, float y, float z, float kappa)
{
    float length = sqrtf(x * x + y * y + z * z);
    float factor = 1.0f - kappa / (length > FLT_MIN ? length : FLT_MIN);
    return factor > 0.0f ? factor : 0.0f;
}

VECTOR_INLINE void shrink_gradient(const struct part_row *p, size_t n, float relax,
                                   float kappa)
{
    const float *restrict xb = p[0].before, *restrict yb = p[1].before;
    const float *restrict zb = p[2].before, *restrict dx = p[0].ax;
    const float *restrict dy = p[1].ax, *restrict dz = p[2].ax;
    float *restrict xa = p[0].after, *restrict ya = p[1].after, *restrict za = p[2].after;
    float *restrict xg = p[0].g, *restrict yg = p[1].g, *restrict zg = p[2].g;
    for (size_t i = 0; i < n; i++) {
        float x = xb[i], y = yb[i], z = zb[i];
        float f = shorten(x, y, z, kappa);
        x += relax * (dx[i] - f * x);
        y += relax * (dy[i] - f * y);
        z += relax * (dz[i] - f * z);
        f = 2.0f * shorten(x, y, z, kappa) - 1.0f;
        xa[i] = x;
        ya[i] = y;
        za[i] = z;
        xg[i] = f * x;
        yg[i] = f * y;
        zg[i] = f * z;
    }
}

/* What the stopping rule looks at, from v and g = 2 z - v. */
VECTOR_INLINE void compare_part(size_t n, const float *restrict ax,
                                const float *restrict after, const float *restrict g,
                                float *restrict z, float *restrict dual,
                                float *restrict gap)
{
    for (size_t i = 0; i < n; i++) {
        z[i] = 0.5f * (g[i] + after[i]);
        dual[i] = after[i] - z[i];
        gap[i] = ax[i] - z[i];
    }
}

/* change = z - the z before. */
VECTOR_INLINE void change_part(size_t n, const float *restrict before,
                               const float *restrict z, float *restrict change,
                               float kappa, int self)
{
    for (size_t i = 0; i < n; i++)
        change[i] = z[i] -
                    (self ? soft_positive(before[i], kappa) : soft(before[i], kappa));
}

static void change_gradient(const struct part_row *p, size_t n, float kappa)
{
    for (size_t i = 0; i < n; i++) {
        float f = shorten(p[0].before[i], p[1].before[i], p[2].before[i], kappa);
        for (int d = 0; d < 3; d++)
            p[d].change[i] = p[d].z[i] - f * p[d].before[i];
    }
}

/* parts[a->parts]: after and g. */
VECTOR_CLONES
static void shrink_row(const struct admm *a, const struct part_row *p)
{
    float relax = (float)a->cfg.relaxation;
    shrink_part(a->nx, p->ax, p->before, p->after, p->g, relax, a->kappa[0], 1);
    if (a->parts > 1 && a->cfg.tv_isotropic) {
        shrink_gradient(p + 1, a->nx, relax, a->kappa[1]);
        return;
    }
    for (size_t d = 1; d < a->parts; d++)
        shrink_part(a->nx, p[d].ax, p[d].before, p[d].after, p[d].g, relax, a->kappa[1],
                    0);
}

/* What the stopping rule looks at, of rows that have been shrunk; gap, ax and z are added
 * to norms. */
VECTOR_CLONES
static void compare_row(const struct admm *a, const struct part_row *p,
                        struct admm_norms *norms)
{
    bool gradient = a->parts > 1 && a->cfg.tv_isotropic;
    for (size_t d = 0; d < a->parts; d++) {
        compare_part(a->nx, p[d].ax, p[d].after, p[d].g, p[d].z, p[d].dual, p[d].gap);
        norms->gap += squares(p[d].gap, a->nx);
        norms->ax += squares(p[d].ax, a->nx);
        norms->z += squares(p[d].z, a->nx);
        if (d == ADMM_SELF)
            change_part(a->nx, p->before, p->z, p->change, a->kappa[0], 1);
        else if (!gradient)
            change_part(a->nx, p[d].before, p[d].z, p[d].change, a->kappa[1], 0);
    }
    if (gradient)
        change_gradient(p + 1, a->nx, a->kappa[1]);
}

/* -- the voxel-by-voxel half of an iteration --------------------------------------------
 */

/* One pass over memory does differences, shrinkage, dual, and the right-hand side of the
 * next step.  A plane needs the shrunk differences of the plane before it.  Threads take
 * runs of planes and do that one plane twice rather than wait for each other. */

VECTOR_CLONES
static void differences(size_t n, const float *x, const float *x_y, const float *x_z,
                        float end, float *restrict dx, float *restrict dy,
                        float *restrict dz)
{
    for (size_t i = 0; i + 1 < n; i++)
        dx[i] = x[i + 1] - x[i];
    dx[n - 1] = end - x[n - 1];
    for (size_t i = 0; i < n; i++) {
        dy[i] = x_y[i] - x[i];
        dz[i] = x_z[i] - x[i];
    }
}

/* Behind the last voxel comes the first for a blur, which wraps around; an operator has
 * no wrap, and the difference there is 0. */
static size_t next(const struct admm *a, size_t i, size_t n)
{
    if (i + 1 < n)
        return i + 1;
    return a->linear.forward ? i : 0;
}

/* One row of all parts.  norms NULL: another run stores and counts it. */
static void do_row(struct admm *a, struct admm_scratch *s, size_t z, size_t y,
                   struct admm_norms *norms)
{
    struct part_row parts[ADMM_PARTS];
    struct admm_norms elsewhere = {0};
    const float *x = a->x + z * a->plane + y * a->nx;
    size_t at = z * a->plane + y * a->nx;
    for (size_t d = 0; d < a->parts; d++) {
        float *carried = row_of(a, s, ROWS_NEW + FIELDS * d);
        size_t row = a->nx + VECTOR_LANES;
        parts[d] = (struct part_row){
            .ax = d == ADMM_SELF ? x : row_of(a, s, ROWS_AX + d),
            .before = a->v[0][d] + at,
            /* a row that is done twice is stored once */
            .after = norms ? a->v[1][d] + at : row_of(a, s, ROWS_SPARE + d),
            .g = carried,
            .change = carried + row,
            .dual = carried + 2 * row,
            .gap = row_of(a, s, ROWS_GAP + d),
            .z = row_of(a, s, ROWS_Z + d),
        };
    }
    if (a->parts > 1)
        differences(a->nx, x, a->x + z * a->plane + next(a, y, a->ny) * a->nx,
                    a->x + next(a, z, a->nz) * a->plane + y * a->nx,
                    x[next(a, a->nx - 1, a->nx)], row_of(a, s, ROWS_AX + ADMM_X),
                    row_of(a, s, ROWS_AX + ADMM_Y), row_of(a, s, ROWS_AX + ADMM_Z));
    shrink_row(a, parts);
    if (a->check)
        compare_row(a, parts, norms ? norms : &elsewhere);
}

/* out = A' of the row's parts: self - differences of the others, backwards. */
VECTOR_CLONES
static void gather_row(size_t n, const float *self, const float *x, const float *y,
                       const float *y_before, const float *z, const float *z_before,
                       float *restrict out)
{
    out[0] = self[0] + x[n - 1] - x[0] + (y_before[0] - y[0]) + (z_before[0] - z[0]);
    for (size_t i = 1; i < n; i++)
        out[i] = self[i] + x[i - 1] - x[i] + (y_before[i] - y[i]) + (z_before[i] - z[i]);
}

/* The row of a field to out, and what the next row and plane need of it is kept. */
static void gather(struct admm *a, struct admm_scratch *s, size_t f, size_t y, float *out)
{
    const float *self = row_of(a, s, ROWS_NEW + FIELDS * ADMM_SELF + f);
    if (a->parts == 1) {
        memcpy(out, self, a->nx * sizeof *out);
        return;
    }
    const float *along_y = row_of(a, s, ROWS_NEW + FIELDS * ADMM_Y + f);
    const float *along_z = row_of(a, s, ROWS_NEW + FIELDS * ADMM_Z + f);
    float *y_before = row_of(a, s, ROWS_BEFORE + f);
    float *z_before = plane_of(a, s, f) + y * a->nx;
    gather_row(a->nx, self, row_of(a, s, ROWS_NEW + FIELDS * ADMM_X + f), along_y,
               y_before, along_z, z_before, out);
    memcpy(y_before, along_y, a->nx * sizeof *out);
    memcpy(z_before, along_z, a->nx * sizeof *out);
}

/* Fills what the first row and the first plane of a run take from the one before. */
static void before_plane(struct admm *a, struct admm_scratch *s, size_t z)
{
    for (size_t y = 0; y < a->ny; y++) {
        do_row(a, s, z, y, NULL);
        for (size_t f = 0; f < (a->check ? FIELDS : 1); f++)
            memcpy(plane_of(a, s, f) + y * a->nx,
                   row_of(a, s, ROWS_NEW + FIELDS * ADMM_Z + f), a->nx * sizeof(float));
    }
}

static void before_row(struct admm *a, struct admm_scratch *s, size_t z)
{
    do_row(a, s, z, a->ny - 1, NULL);
    for (size_t f = 0; f < (a->check ? FIELDS : 1); f++)
        memcpy(row_of(a, s, ROWS_BEFORE + f),
               row_of(a, s, ROWS_NEW + FIELDS * ADMM_Y + f), a->nx * sizeof(float));
}

struct pass {
    struct admm *a;
    size_t run; /* planes of an item */
    void (*emit)(struct admm *a, size_t z, size_t thread);
};

static void split_run(void *ctx, size_t item, size_t thread)
{
    const struct pass *p = ctx;
    struct admm *a = p->a;
    struct admm_scratch *s = &a->scratch[thread];
    struct admm_norms *norms = &a->norms[item];
    float *spare = row_of(a, s, ROWS_SPARE);
    size_t first = item * p->run;
    size_t end = first + p->run < a->nz ? first + p->run : a->nz;
    if (a->parts > 1)
        before_plane(a, s, (first + a->nz - 1) % a->nz);
    for (size_t z = first; z < end; z++) {
        if (a->parts > 1)
            before_row(a, s, z);
        for (size_t y = 0; y < a->ny; y++) {
            do_row(a, s, z, y, norms);
            gather(a, s, FIELD_G, y, s->plane + y * a->nx);
            if (!a->check)
                continue;
            gather(a, s, FIELD_CHANGE, y, spare);
            norms->change += squares_of(spare, a->nx);
            gather(a, s, FIELD_DUAL, y, spare);
            norms->dual += squares_of(spare, a->nx);
        }
        p->emit(a, z, thread);
    }
}

/* v <- v + a (A x - S(v)), then for each plane A' (2 S(v) - v) goes to `emit` (as
 * [ny][nx] in the thread's scratch->plane).  Also swaps v. */
static void split(struct admm *a, void (*emit)(struct admm *a, size_t z, size_t thread))
{
    struct pass p = {a, (a->nz + ADMM_RUNS - 1) / ADMM_RUNS, emit};
    memset(a->norms, 0, sizeof a->norms);
    pool_run(a->cfg.pool, (a->nz + p.run - 1) / p.run, split_run, &p);
    for (size_t d = 0; d < a->parts; d++) {
        float *v = a->v[0][d];
        a->v[0][d] = a->v[1][d];
        a->v[1][d] = v;
    }
}

/* The sums of the last checked round. */
static void sum_norms(const struct admm *a, struct admm_norms *out)
{
    memset(out, 0, sizeof *out);
    for (size_t r = 0; r < ADMM_RUNS; r++) {
        const struct admm_norms *n = &a->norms[r];
        out->gap += n->gap;
        out->ax += n->ax;
        out->z += n->z;
        out->change += n->change;
        out->dual += n->dual;
    }
}

/* -- another rho ------------------------------------------------------------------------
 */

/* v = z + u, and rho u stays: v <- z + (v - z) / factor. */
VECTOR_CLONES
static void rescale_plane(struct admm *a, size_t at, size_t n, float inverse)
{
    float *self = a->v[0][ADMM_SELF] + at;
    for (size_t i = 0; i < n; i++) {
        float z = self[i] - a->kappa[0] > 0.0f ? self[i] - a->kappa[0] : 0.0f;
        self[i] = z + inverse * (self[i] - z);
    }
    if (a->parts == 1)
        return;
    float *x = a->v[0][ADMM_X] + at, *y = a->v[0][ADMM_Y] + at, *w = a->v[0][ADMM_Z] + at;
    if (a->cfg.tv_isotropic) {
        for (size_t i = 0; i < n; i++) {
            float f = shorten(x[i], y[i], w[i], a->kappa[1]);
            float factor = f + inverse * (1.0f - f);
            x[i] *= factor;
            y[i] *= factor;
            w[i] *= factor;
        }
        return;
    }
    for (size_t d = ADMM_X; d < ADMM_PARTS; d++) {
        float *v = a->v[0][d] + at;
        for (size_t i = 0; i < n; i++) {
            float z = soft(v[i], a->kappa[1]);
            v[i] = z + inverse * (v[i] - z);
        }
    }
}

/* Keeps z and the unscaled dual of all voxels when rho changes. */
static void rescale(struct admm *a, double rho)
{
    float factor = (float)(rho / a->rho);
    for (size_t z = 0; z < a->nz; z++)
        rescale_plane(a, z * a->plane, a->nx * a->ny, 1.0f / factor);
    a->kappa[0] /= factor;
    a->kappa[1] /= factor;
    a->rho = rho;
}

/* -- one solve --------------------------------------------------------------------------
 */

static double largest_of(const float *x, size_t n)
{
    float largest = 0.0f;
    for (size_t i = 0; i < n; i++)
        largest = fmaxf(largest, fabsf(x[i]));
    return (double)largest;
}

/* Largest positive value and length of K' b, which stands in x. */
static void survey(const struct admm *a, double *largest, double *length)
{
    double sum = 0.0;
    float most = 0.0f;
    for (size_t z = 0; z < a->nz; z++) {
        const float *x = a->x + z * a->plane;
        for (size_t i = 0; i < a->nx * a->ny; i++) {
            most = fmaxf(most, x[i]);
            sum += (double)x[i] * (double)x[i];
        }
    }
    *largest = (double)most;
    *length = sqrt(sum);
}

struct residuals {
    double primal, dual; /* relative */
};

static struct residuals read_residuals(const struct admm *a, double length)
{
    struct admm_norms n;
    sum_norms(a, &n);
    double ax = fmax(sqrt(fmax(n.ax, n.z)), FLOOR * length);
    double dual = fmax(sqrt(n.dual), FLOOR * length / a->rho);
    return (struct residuals){sqrt(n.gap) / ax, sqrt(n.change) / dual};
}

/* The larger residual gets more weight: sqrt of their ratio, towards balance. */
static void balance(struct admm *a, const struct residuals *r)
{
    double ratio = r->primal / fmax(r->dual, DBL_MIN);
    if (ratio > 1.0 / BALANCE && ratio < BALANCE)
        return;
    double factor = fmin(fmax(sqrt(ratio), 1.0 / RHO_STEP), RHO_STEP);
    double rho = fmin(fmax(a->rho * factor, RHO_LEAST), RHO_MOST);
    if (rho != a->rho)
        rescale(a, rho);
}

static void iterate(struct admm *a, double length, struct admm_result *result)
{
    void (*emit)(struct admm *, size_t, size_t) = admm_blur_emit;
    void (*update)(struct admm *) = admm_blur_update;
    if (a->linear.forward) {
        emit = admm_normal_emit;
        update = admm_normal_update;
    }
    struct residuals r = {0};
    size_t calm = CHECK_EVERY; /* rho may change from this iteration on */
    for (size_t i = 1; i <= a->cfg.iterations && !pool_stopped(a->cfg.pool); i++) {
        a->check = i % CHECK_EVERY == 0 || i == a->cfg.iterations;
        split(a, emit);
        result->iterations = i;
        if (a->check) {
            r = read_residuals(a, length);
            result->primal = r.primal;
            result->dual = r.dual;
            result->converged = fmax(r.primal, r.dual) <= a->cfg.tolerance;
        }
        if (result->converged || i == a->cfg.iterations)
            break;
        update(a);
        if (a->check && i >= calm) {
            balance(a, &r);
            calm = (size_t)(RHO_CALM * (double)i);
        }
    }
}

static double total_variation(const struct admm *a, const float *x)
{
    double sum = 0.0;
    size_t wrap = !a->linear.forward, layer = a->nx * a->ny;
    for (size_t i = 0; i < a->n; i++) {
        size_t at[3] = {i % a->nx, i / a->nx % a->ny, i / layer};
        size_t stride[3] = {1, a->nx, layer};
        double d[3];
        for (int q = 0; q < 3; q++) {
            bool last = at[q] + 1 == a->cfg.n[q];
            size_t next = last ? (wrap ? i - at[q] * stride[q] : i) : i + stride[q];
            d[q] = (double)x[next] - (double)x[i];
        }
        sum += a->cfg.tv_isotropic ? sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
                                   : fabs(d[0]) + fabs(d[1]) + fabs(d[2]);
    }
    return sum;
}

/* The split copy of x: it is what satisfies x >= 0. */
static void take_result(const struct admm *a, float *x)
{
    for (size_t z = 0; z < a->nz; z++) {
        const float *v = a->v[0][ADMM_SELF] + z * a->plane;
        for (size_t i = 0; i < a->nx * a->ny; i++)
            x[z * a->nx * a->ny + i] = fmaxf(v[i] - a->kappa[0], 0.0f);
    }
}

static void finish(struct admm *a, const float *b, float *x, struct admm_result *result)
{
    double scale2 = a->scale * a->scale, sum = 0.0;
    double l1 = a->kappa[0] * a->rho, tv = a->kappa[1] * a->rho;
    take_result(a, x);
    result->rho = a->rho;
    result->objective = a->linear.forward ? admm_normal_misfit(a, b, x)
                                          : admm_blur_misfit(a, b, x);
    for (size_t i = 0; i < a->n; i++)
        sum += (double)x[i];
    result->objective += l1 * sum + (tv > 0.0 ? tv * total_variation(a, x) : 0.0);
    result->objective *= scale2;
    result->l1_weight = l1 * a->scale * a->gain;
    result->tv_weight = tv * a->scale * a->gain;
    for (size_t i = 0; i < a->n; i++)
        x[i] = (float)((double)x[i] * a->scale / a->gain);
}

void admm_solve(struct admm *a, const float *b, double reference, float *x,
                struct admm_result *result)
{
    struct admm_result unused;
    double largest, length;
    if (!result)
        result = &unused;
    memset(result, 0, sizeof *result);
    memset(x, 0, a->n * sizeof *x);
    a->scale = largest_of(b, a->linear.forward ? a->linear.n_data : a->n);
    if (!(a->scale >= FLT_MIN)) { /* silence */
        result->converged = true;
        return;
    }
    if (!a->linear.forward)
        admm_blur_begin(a, b);
    else
        admm_normal_begin(a, b);
    survey(a, &largest, &length);
    double unit = reference > 0.0 ? reference / (a->scale * a->gain) : largest;
    if (largest <= a->cfg.l1 * unit) { /* then 0 satisfies the optimum's conditions */
        result->converged = true;
        return;
    }
    a->rho = a->cfg.rho;
    a->kappa[0] = (float)(a->cfg.l1 * unit / a->rho);
    a->kappa[1] = (float)(a->cfg.tv * unit / a->rho);
    for (size_t d = 0; d < a->parts; d++)
        memset(a->v[0][d], 0, a->nz * a->plane * sizeof(float));
    iterate(a, length, result);
    if (!pool_stopped(a->cfg.pool))
        finish(a, b, x, result);
}
