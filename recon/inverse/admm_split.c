/* SPDX-License-Identifier: MIT */
/* recon/inverse/admm_split.c -- the voxel-by-voxel half of an iteration in one pass over
 * memory: differences, shrinkage, dual, and the right-hand side of the next step.
 *
 * A plane needs the shrunk differences of the plane before it.  Threads take runs of
 * planes and do that one plane twice rather than wait for each other. */

#include <string.h>

#include "dsp/vector.h"
#include "recon/inverse/admm_shrink.h"

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

size_t admm_split_scratch(const struct admm *a)
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
    struct admm_part_row parts[ADMM_PARTS];
    struct admm_norms elsewhere = {0};
    const float *x = a->x + z * a->plane + y * a->nx;
    size_t at = z * a->plane + y * a->nx;
    for (size_t d = 0; d < a->parts; d++) {
        float *carried = row_of(a, s, ROWS_NEW + FIELDS * d);
        size_t row = a->nx + VECTOR_LANES;
        parts[d] = (struct admm_part_row){
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
    admm_shrink_row(a, parts);
    if (a->check)
        admm_compare_row(a, parts, norms ? norms : &elsewhere);
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
            norms->change += admm_squares(spare, a->nx);
            gather(a, s, FIELD_DUAL, y, spare);
            norms->dual += admm_squares(spare, a->nx);
        }
        p->emit(a, z, thread);
    }
}

void admm_split(struct admm *a, void (*emit)(struct admm *a, size_t z, size_t thread))
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

void admm_split_norms(const struct admm *a, struct admm_norms *out)
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
