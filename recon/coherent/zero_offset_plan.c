#include "recon/coherent/zero_offset_plan.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/lines.h"
#include "recon/coherent/midpoint.h"

#define SAME_M       1e-3 /* half-offsets closer than this are one */
#define UNEVEN       0.05 /* of a pitch, that a line may be off the lattice */
#define MAX_LINES    4096
#define MAX_INPUTS   65536
#define SINE_MAX     0.5 /* of the dips that must be right: 30 degrees */
#define X_NEGLIGIBLE 0.1 /* of a sample: what dip in x may be off by when left out */
#define CROSS_MAX    1.0 /* of a sample: see recon/coherent/dmo.h */

/* -- lattice ----------------------------------------------------------------------------
 */

/* The evenly spaced lines, gaps filled, on which all given ones stand; also the number of
 * each. */
static int fit_axis(struct zero_offset_lattice *l, int axis, const double *lines,
                    size_t n, uint32_t *number)
{
    double gap = INFINITY;
    for (size_t i = 1; i < n; i++)
        gap = fmin(gap, lines[i] - lines[i - 1]);
    double across = lines[n - 1] - lines[0];
    double steps = n > 1 ? rint(across / gap) : 0.0;
    if (!(steps < MAX_LINES))
        return -ENOTSUP;
    l->first_m[axis] = lines[0];
    l->n[axis] = (size_t)steps + 1;
    l->pitch_m[axis] = n > 1 ? across / steps : 0.0;
    for (size_t i = 0; i < n; i++) {
        double at = n > 1 ? (lines[i] - lines[0]) / l->pitch_m[axis] : 0.0;
        number[i] = (uint32_t)lrint(at);
        if (fabs(at - rint(at)) > UNEVEN)
            return -ENOTSUP;
    }
    return 0;
}

/* -- offsets ----------------------------------------------------------------------------
 */

static double half_offset(const struct geometry *g, size_t pair, int axis)
{
    return 0.5 * fabs(g->speakers_m[pair / g->n_microphones][axis] -
                      g->microphones_m[pair % g->n_microphones][axis]);
}

/* Lines of half-offsets along an axis and each pair's place on them. */
static size_t sort_axis(const struct geometry *g, int axis, double *values,
                        uint32_t *place)
{
    size_t n_pairs = g->n_speakers * g->n_microphones;
    for (size_t q = 0; q < n_pairs; q++)
        values[q] = half_offset(g, q, axis);
    size_t n = lines_merge(values, n_pairs, SAME_M);
    for (size_t q = 0; q < n_pairs; q++)
        place[q] = lines_nearest(values, n, half_offset(g, q, axis));
    return n;
}

/* What follows from a half-offset h and slopes up to SINE_MAX at the earliest time; what
 * is nearer than the pair is long needs other methods anyway. */
static double dip_shift_s(double hx, double hy, double c, double first_s)
{
    double t = fmax(first_s, 4.0 * hypot(hx, hy) / c);
    return 2.0 * hx * hy * SINE_MAX * SINE_MAX / (c * c * t);
}

struct keys { /* while inputs are numbered */
    size_t n_pairs, n_hx, n_hy;
    double *hx, *hy;
    uint32_t *pair_hx, *pair_hy; /* [pair] */
    uint32_t *number;            /* [n_hx][n_hy][ny]: 1 + input; 0: none */
    uint32_t *offset;            /* [n_hx][n_hy]: 1 + offset; 0: none */
};

static void keys_clear(struct keys *k)
{
    free(k->hx);
    free(k->hy);
    free(k->pair_hx);
    free(k->pair_hy);
    free(k->number);
    free(k->offset);
}

static int keys_create(struct keys *k, const struct geometry *g, size_t ny)
{
    k->n_pairs = g->n_speakers * g->n_microphones;
    k->hx = malloc(k->n_pairs * sizeof *k->hx);
    k->hy = malloc(k->n_pairs * sizeof *k->hy);
    k->pair_hx = malloc(k->n_pairs * sizeof *k->pair_hx);
    k->pair_hy = malloc(k->n_pairs * sizeof *k->pair_hy);
    if (!k->hx || !k->hy || !k->pair_hx || !k->pair_hy)
        return -ENOMEM;
    k->n_hx = sort_axis(g, 0, k->hx, k->pair_hx);
    k->n_hy = sort_axis(g, 1, k->hy, k->pair_hy);
    k->number = calloc(k->n_hx * k->n_hy * ny, sizeof *k->number);
    k->offset = calloc(k->n_hx * k->n_hy, sizeof *k->offset);
    return k->number && k->offset ? 0 : -ENOMEM;
}

static size_t key_of(const struct keys *k, size_t pair)
{
    return k->pair_hx[pair] * k->n_hy + k->pair_hy[pair];
}

/* Numbers what occurs, in the order of the keys: hx first. */
static void number_keys(struct zero_offset_plan *p, const struct keys *k,
                        const uint32_t *y, size_t n)
{
    size_t ny = p->lattice.n[1], n_keys = k->n_hx * k->n_hy;
    for (size_t q = 0; q < n; q++) {
        k->number[key_of(k, q % k->n_pairs) * ny + y[q]] = 1;
        k->offset[key_of(k, q % k->n_pairs)] = 1;
    }
    for (size_t i = 0; i < n_keys; i++)
        if (k->offset[i])
            k->offset[i] = (uint32_t)++p->n_offsets;
    for (size_t i = 0; i < n_keys * ny; i++)
        if (k->number[i])
            k->number[i] = (uint32_t)++p->n_inputs;
}

static int list_offsets(struct zero_offset_plan *p, const struct keys *k)
{
    for (int a = 0; a < 3; a++)
        if (!(p->half_m[a] = malloc(p->n_offsets * sizeof(double))))
            return -ENOMEM;
    for (size_t i = 0; i < k->n_hx * k->n_hy; i++) {
        if (!k->offset[i])
            continue;
        size_t o = k->offset[i] - 1;
        p->half_m[0][o] = k->hx[i / k->n_hy];
        p->half_m[1][o] = k->hy[i % k->n_hy];
        p->half_m[2][o] = hypot(p->half_m[0][o], p->half_m[1][o]);
    }
    return 0;
}

static int list_inputs(struct zero_offset_plan *p, const struct keys *k,
                       const uint32_t *y, size_t n)
{
    size_t ny = p->lattice.n[1];
    p->offset = malloc(p->n_inputs * sizeof *p->offset);
    p->line = malloc(p->n_inputs * sizeof *p->line);
    p->input = malloc(n * sizeof *p->input);
    if (!p->offset || !p->line || !p->input)
        return -ENOMEM;
    for (size_t i = 0; i < k->n_hx * k->n_hy * ny; i++) {
        if (!k->number[i])
            continue;
        p->offset[k->number[i] - 1] = k->offset[i / ny] - 1;
        p->line[k->number[i] - 1] = (uint32_t)(i % ny);
    }
    for (size_t q = 0; q < n; q++)
        p->input[q] = k->number[key_of(k, q % k->n_pairs) * ny + y[q]] - 1;
    return 0;
}

/* -- parts of the offsets along x -------------------------------------------------------
 */

static int sort_parts(struct zero_offset_plan *p)
{
    p->x_part_m = malloc(p->n_offsets * sizeof *p->x_part_m);
    p->part_end = malloc(p->n_offsets * sizeof *p->part_end);
    if (!p->x_part_m || !p->part_end)
        return -ENOMEM;
    p->n_x_parts = 0;
    for (size_t q = 0; q < p->n_inputs; q++) {
        double hx = p->dip_in_x ? p->half_m[0][p->offset[q]] : 0.0;
        if (!p->n_x_parts || p->x_part_m[p->n_x_parts - 1] != hx)
            p->x_part_m[p->n_x_parts++] = hx;
        p->part_end[p->n_x_parts - 1] = q + 1;
    }
    return 0;
}

static int check_offsets(struct zero_offset_plan *p, const struct geometry *g,
                         double first_s, double sample_s, const char **why)
{
    for (size_t o = 0; o < p->n_offsets; o++) {
        double hx = p->half_m[0][o], hy = p->half_m[1][o], c = g->sound_speed_m_s;
        if (dip_shift_s(hx, hx, c, first_s) > X_NEGLIGIBLE * sample_s)
            p->dip_in_x = true;
        if (dip_shift_s(hx, hy, c, first_s) > CROSS_MAX * sample_s) {
            *why = "pairs that lie far apart along x or along y, not both";
            return -ENOTSUP;
        }
    }
    return 0;
}

static int plan_lattice(struct zero_offset_plan *p, const struct midpoints *m, size_t n,
                        uint32_t *y, const char **why)
{
    uint32_t *number = malloc((m->nx > m->ny ? m->nx : m->ny) * sizeof *number);
    p->x = malloc(n * sizeof *p->x);
    int err = number && p->x ? 0 : -ENOMEM;
    if (!err)
        err = fit_axis(&p->lattice, 0, m->x_m, m->nx, number);
    for (size_t q = 0; !err && q < n; q++)
        p->x[q] = number[m->ix[q]];
    if (!err)
        err = fit_axis(&p->lattice, 1, m->y_m, m->ny, number);
    for (size_t q = 0; !err && q < n; q++)
        y[q] = number[m->iy[q]];
    if (err == -ENOTSUP)
        *why = "midpoints on evenly spaced lines of x and y";
    p->lattice.plane_z_m = m->plane_z_m;
    free(number);
    return err;
}

int zero_offset_plan(struct zero_offset_plan *p, const struct geometry *g, double first_s,
                     double sample_s, const char **why)
{
    struct midpoints *m = NULL;
    struct keys keys = {0};
    memset(p, 0, sizeof *p);
    int err = midpoints_create(&m, g, why);
    if (err)
        return err;
    size_t n = g->n_positions * m->n_pairs;
    uint32_t *y = malloc(n * sizeof *y);
    err = y ? plan_lattice(p, m, n, y, why) : -ENOMEM;
    if (!err)
        err = keys_create(&keys, g, p->lattice.n[1]);
    if (!err) {
        number_keys(p, &keys, y, n);
        if (p->n_inputs > MAX_INPUTS) {
            *why = "fewer different offsets";
            err = -ENOTSUP;
        }
    }
    if (!err)
        err = list_offsets(p, &keys);
    if (!err)
        err = list_inputs(p, &keys, y, n);
    if (!err)
        err = check_offsets(p, g, first_s, sample_s, why);
    if (!err)
        err = sort_parts(p);
    keys_clear(&keys);
    free(y);
    midpoints_destroy(m);
    return err;
}

void zero_offset_plan_clear(struct zero_offset_plan *p)
{
    for (int a = 0; a < 3; a++)
        free(p->half_m[a]);
    free(p->x_part_m);
    free(p->offset);
    free(p->line);
    free(p->part_end);
    free(p->input);
    free(p->x);
    memset(p, 0, sizeof *p);
}
