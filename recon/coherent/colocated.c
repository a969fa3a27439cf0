/* SPDX-License-Identifier: MIT */
#include "recon/coherent/colocated.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "recon/coherent/midpoint.h"
#include "recon/coherent/nmo.h"
#include "recon/imaging/method.h"

#define SAME_M      1e-3 /* half-offsets that differ less are the same */
#define UNEVEN      0.02 /* pitches may differ by this part of their mean */
#define MIN_SAMPLES 16

#define NOT_OURS UINT32_MAX

struct colocated {
    size_t n_microphones, n_pairs, n_in;
    struct colocated_lattice lattice;
    uint32_t *cell; /* [position][pair]: iy * nx + ix, or NOT_OURS */
    size_t *offset; /* [pair] */
    struct nmo *nmo;
    pthread_mutex_t lock; /* of what follows */
    float complex *moved; /* [n_ranges] */
    float *sum;           /* [ny][nx][n_ranges] */
    uint32_t *count;      /* [ny][nx] */
    size_t n_positions;
};

/* -- which pairs ------------------------------------------------------------------------
 */

/* Lines that our pairs use, renumbered; must be even.  used[n]: in, place: out.  A single
 * line is as wide as alone_m. */
static int plan_axis(const double *lines_m, const bool *used, size_t n, uint32_t *place,
                     double alone_m, size_t *count, double *first_m, double *pitch_m)
{
    double last_m = 0.0;
    *count = 0;
    for (size_t i = 0; i < n; i++) {
        if (!used[i])
            continue;
        if (*count == 0)
            *first_m = lines_m[i];
        last_m = lines_m[i];
        place[i] = (uint32_t)(*count)++;
    }
    *pitch_m = *count > 1 ? (last_m - *first_m) / (double)(*count - 1) : alone_m;
    for (size_t i = 0; i < n; i++) {
        double at_m = *first_m + (double)place[i] * *pitch_m;
        if (used[i] && fabs(lines_m[i] - at_m) > UNEVEN * *pitch_m)
            return -ENOTSUP;
    }
    return 0;
}

static bool is_ours(const struct midpoints *m, size_t pair)
{
    return m->half_offset_m[m->offset[pair]] <= m->half_offset_m[0] + SAME_M;
}

static void mark_lines(const struct midpoints *m, size_t n_positions, bool *used_x,
                       bool *used_y)
{
    for (size_t q = 0; q < n_positions * m->n_pairs; q++) {
        if (is_ours(m, q % m->n_pairs)) {
            used_x[m->ix[q]] = true;
            used_y[m->iy[q]] = true;
        }
    }
}

static int plan_cells(struct colocated *c, const struct midpoints *m,
                      const double *step_m, const char **why)
{
    struct colocated_lattice *l = &c->lattice;
    bool *used_x = calloc(m->nx, sizeof *used_x), *used_y = calloc(m->ny, sizeof *used_y);
    uint32_t *x = calloc(m->nx, sizeof *x), *y = calloc(m->ny, sizeof *y);
    int err = used_x && used_y && x && y ? 0 : -ENOMEM;
    if (!err) {
        mark_lines(m, c->n_positions, used_x, used_y);
        err = plan_axis(m->x_m, used_x, m->nx, x, step_m[0], &l->nx, &l->x_m,
                        &l->pitch_x_m);
    }
    if (!err)
        err = plan_axis(m->y_m, used_y, m->ny, y, step_m[1], &l->ny, &l->y_m,
                        &l->pitch_y_m);
    if (err == -ENOTSUP)
        *why = "speakers with a microphone beside each, on a lattice of even pitch";
    for (size_t q = 0; !err && q < c->n_positions * m->n_pairs; q++)
        c->cell[q] = is_ours(m, q % m->n_pairs)
                         ? y[m->iy[q]] * (uint32_t)l->nx + x[m->ix[q]]
                         : NOT_OURS;
    free(used_x);
    free(used_y);
    free(x);
    free(y);
    return err;
}

/* -- create -----------------------------------------------------------------------------
 */

/* Ranges of the image, its margins too, from the mute on. */
static int plan_ranges(struct colocated *c, const struct imager_config *cfg,
                       const struct midpoints *m, struct trace_format *moved,
                       const char **why)
{
    const struct trace_format *in = &cfg->format;
    double speed = cfg->geometry->sound_speed_m_s;
    double span_s[2];
    int err = method_span(span_s, cfg, m->half_offset_m[0], why);
    if (err)
        return err;
    *moved = (struct trace_format){span_s[0], in->rate_hz, in->carrier_hz,
                                   method_samples(span_s, in->rate_hz, MIN_SAMPLES)};
    c->lattice.n_ranges = moved->n_samples;
    c->lattice.range_m = 0.5 * speed * span_s[0];
    c->lattice.range_step_m = 0.5 * speed / in->rate_hz;
    return 0;
}

static int plan_moveout(struct colocated *c, const struct imager_config *cfg,
                        const struct midpoints *m, const char **why)
{
    struct nmo_config nmo = {
        .sound_speed_m_s = cfg->geometry->sound_speed_m_s,
        .in = cfg->format,
        .mute_s = 2.0 * cfg->gate_m[0] / cfg->geometry->sound_speed_m_s,
        .band_hz = cfg->band_hz[1] - cfg->band_hz[0],
        .half_offset_m = m->half_offset_m,
    };
    while (nmo.n_offsets < m->n_offsets &&
           m->half_offset_m[nmo.n_offsets] <= m->half_offset_m[0] + SAME_M)
        nmo.n_offsets++;
    for (size_t pair = 0; pair < m->n_pairs; pair++)
        c->offset[pair] = m->offset[pair];
    int err = plan_ranges(c, cfg, m, &nmo.out, why);
    return err ? err : nmo_create(&c->nmo, &nmo);
}

static int allocate(struct colocated *c)
{
    size_t cells = c->lattice.nx * c->lattice.ny;
    c->moved = malloc(c->lattice.n_ranges * sizeof *c->moved);
    c->sum = calloc(cells * c->lattice.n_ranges, sizeof *c->sum);
    c->count = calloc(cells, sizeof *c->count);
    return c->moved && c->sum && c->count ? 0 : -ENOMEM;
}

int colocated_create(struct colocated **out, const struct imager_config *cfg,
                     const char **why)
{
    struct midpoints *m = NULL;
    struct colocated *c = calloc(1, sizeof *c);
    if (!c)
        return -ENOMEM;
    pthread_mutex_init(&c->lock, NULL);
    c->n_microphones = cfg->geometry->n_microphones;
    c->n_pairs = cfg->geometry->n_speakers * c->n_microphones;
    c->n_positions = cfg->geometry->n_positions;
    c->n_in = cfg->format.n_samples;
    c->cell = malloc(c->n_positions * c->n_pairs * sizeof *c->cell);
    c->offset = malloc(c->n_pairs * sizeof *c->offset);
    int err = c->cell && c->offset ? 0 : -ENOMEM;
    if (!err)
        err = midpoints_create(&m, cfg->geometry, why);
    if (!err) {
        c->lattice.plane_z_m = m->plane_z_m;
        err = plan_cells(c, m, cfg->grid.step_m, why);
    }
    if (!err)
        err = plan_moveout(c, cfg, m, why);
    if (!err)
        err = allocate(c);
    midpoints_destroy(m);
    if (err) {
        colocated_destroy(c);
        return err;
    }
    *out = c;
    return 0;
}

void colocated_lattice(const struct colocated *c, struct colocated_lattice *out)
{
    *out = c->lattice;
}

/* -- add --------------------------------------------------------------------------------
 */

static void add_pair(struct colocated *c, size_t pair, uint32_t cell,
                     const float complex *trace)
{
    size_t n = c->lattice.n_ranges;
    const float *moved = (const float *)c->moved;
    float *sum = c->sum + cell * n;
    memset(c->moved, 0, n * sizeof *c->moved);
    nmo_stack(c->nmo, c->offset[pair], trace, c->moved);
    for (size_t i = 0; i < n; i++)
        sum[i] += moved[2 * i] * moved[2 * i] + moved[2 * i + 1] * moved[2 * i + 1];
    c->count[cell]++;
}

void colocated_add(struct colocated *c, size_t position, size_t speaker,
                   const float complex *traces, const bool *masked)
{
    for (size_t i = 0; i < c->n_microphones; i++) {
        size_t pair = speaker * c->n_microphones + i;
        uint32_t cell = c->cell[position * c->n_pairs + pair];
        if (cell == NOT_OURS || (masked && masked[i]))
            continue;
        pthread_mutex_lock(&c->lock);
        add_pair(c, pair, cell, traces + i * c->n_in);
        pthread_mutex_unlock(&c->lock);
    }
}

void colocated_power(const struct colocated *c, float *power)
{
    size_t n = c->lattice.n_ranges;
    for (size_t cell = 0; cell < c->lattice.nx * c->lattice.ny; cell++) {
        float weight = c->count[cell] ? 1.0f / (float)c->count[cell] : 0.0f;
        for (size_t i = 0; i < n; i++)
            power[cell * n + i] = weight * c->sum[cell * n + i];
    }
}

void colocated_reset(struct colocated *c)
{
    size_t cells = c->lattice.nx * c->lattice.ny;
    memset(c->sum, 0, cells * c->lattice.n_ranges * sizeof *c->sum);
    memset(c->count, 0, cells * sizeof *c->count);
}

void colocated_destroy(struct colocated *c)
{
    if (!c)
        return;
    pthread_mutex_destroy(&c->lock);
    nmo_destroy(c->nmo);
    free(c->cell);
    free(c->offset);
    free(c->moved);
    free(c->sum);
    free(c->count);
    free(c);
}
