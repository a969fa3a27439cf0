#include "recon/coherent/backproject_scan_plan.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

bool backproject_scan_fits(struct backprojection *b)
{
    const struct geometry *g = &b->geometry;
    b->stride = geometry_stage_stride(g, b->grid.step_m[0]);
    if (!b->stride || g->n_positions < SCAN_LANES)
        return false;
    b->first_m = g->stage_positions_m[0];
    return true;
}

static int row_create(struct scan_row *w, const struct backprojection *b, size_t n_sum)
{
    size_t n = scan_elements(b) * SCAN_BLOCK, sums = b->stride * n_sum;
    w->delay = malloc(n * sizeof *w->delay);
    w->block = aligned_alloc(64, SCAN_BLOCK * SCAN_SUMS * b->lanes * sizeof *w->block);
    bool ok = w->delay && w->block;
    for (int a = 0; a < 2; a++)
        ok = (w->phasor[a] = malloc(n * sizeof *w->phasor[a])) && ok;
    for (int a = 0; a < SCAN_SUMS; a++)
        ok = (w->sum[a] = malloc(sums * sizeof *w->sum[a])) && ok;
    return ok ? 0 : -ENOMEM;
}

static void row_clear(struct scan_row *w)
{
    free(w->delay);
    free(w->block);
    for (int a = 0; a < 2; a++)
        free(w->phasor[a]);
    for (int a = 0; a < SCAN_SUMS; a++)
        free(w->sum[a]);
}

int backproject_scan_create(struct backprojection *b)
{
    struct scan *scan = calloc(1, sizeof *scan);
    if (!scan)
        return -ENOMEM;
    b->scratch = scan;
    scan->sweeps = calloc(pool_threads(b->pool), sizeof *scan->sweeps);
    scan->fold = calloc(backprojection_pairs(b) * b->lanes, sizeof *scan->fold);
    int err = scan->sweeps && scan->fold ? 0 : -ENOMEM;
    for (size_t t = 0; !err && t < pool_threads(b->pool); t++) {
        struct scan_sweep *s = &scan->sweeps[t];
        s->n_d = b->grid.n[0] + (b->lanes - 1) * b->stride;
        s->n_sum = (b->grid.n[0] + b->stride - 1) / b->stride + 2 * b->lanes + SCAN_LANES;
        for (size_t r = 0; !err && r < SCAN_ROWS; r++)
            err = row_create(&s->rows[r], b, s->n_sum);
    }
    return err;
}

void backproject_scan_destroy(struct backprojection *b)
{
    struct scan *scan = b->scratch;
    if (!scan)
        return;
    for (size_t t = 0; scan->sweeps && t < pool_threads(b->pool); t++)
        for (size_t r = 0; r < SCAN_ROWS; r++)
            row_clear(&scan->sweeps[t].rows[r]);
    free(scan->sweeps);
    free(scan->fold);
    free(scan);
}
