/* SPDX-License-Identifier: MIT */
#include "recon/detection/clean.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/rank.h"
#include "recon/detection/plane.h"
#include "recon/inverse/sparse_operator.h"

/* Of a fit: places, and pairs times places. */
#define MOST_PLACES  1024
#define LEAST_PLACES 128
#define MOST_TERMS   (1u << 21)
#define STEPS        6
#define ENOUGH       1e-3 /* of the gradient's energy */
#define WORTH_DB     8.0  /* that what is hidden may lie above what the noise hides */
#define SHELL_DB     20.0 /* what is left at a strong one's range is its own, if fainter */
#define LEAST        0.05 /* existence that is worth a line */
#define TAIL         64 /* brightest maxima of a residual that tell how bright others are */

/* Of the grid of the image that came first; both [nz][ny][nx]. */
struct rest {
    float *residual; /* the image of what is left */
    bool *explained; /* bright in the first image, or near a place that is */
};

struct fit { /* vectors [n] re im */
    struct sparse_operator *model;
    struct pool *pool;
    size_t n;
    float *x, *rest, *step, *image;
};

static double energy(const float *v, size_t n)
{
    double sum = 0.0;

    for (size_t i = 0; i < 2 * n; i++)
        sum += (double)v[i] * v[i];
    return sum;
}

/* K' K x = K' y; stopped early, it leaves out what the data tell badly. */
static void solve(struct fit *f)
{
    memset(f->x, 0, 2 * f->n * sizeof *f->x);
    sparse_operator_data(f->model, f->rest);
    memcpy(f->step, f->rest, 2 * f->n * sizeof *f->step);
    double left = energy(f->rest, f->n), enough = ENOUGH * left;
    for (size_t i = 0; i < STEPS && left > enough && !pool_stopped(f->pool); i++) {
        double along = 0.0, before = left;
        sparse_operator_normal(f->model, f->step, f->image);
        for (size_t v = 0; v < 2 * f->n; v++)
            along += (double)f->step[v] * f->image[v];
        if (!(along > 0.0))
            return;
        float alpha = (float)(left / along);
        for (size_t v = 0; v < 2 * f->n; v++) {
            f->x[v] += alpha * f->step[v];
            f->rest[v] -= alpha * f->image[v];
        }
        left = energy(f->rest, f->n);
        float beta = (float)(left / before);
        for (size_t v = 0; v < 2 * f->n; v++)
            f->step[v] = f->rest[v] + beta * f->step[v];
    }
}

static int brightest_first(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;

    return (x < y) - (x > y);
}

static float brightest(const float *intensity, size_t voxels)
{
    float most = 0.0f;

    for (size_t v = 0; v < voxels; v++)
        most = fmaxf(most, intensity[v]);
    return most;
}

/* -- places ----------------------------------------------------------------------------
 */

/* Every voxel above the level; of too many every second along each axis, and of these
 * still too many the brightest. */
static int choose(const struct grid *g, const float *intensity, float level, size_t most,
                  size_t *which, size_t *n)
{
    size_t voxels = grid_size(g), count = 0, stride, kept = 0, at[3];
    float *levels;

    for (size_t v = 0; v < voxels; v++)
        count += intensity[v] > level;
    levels = malloc((count ? count : 1) * sizeof *levels);
    if (!levels)
        return -ENOMEM;
    stride = count > most ? 2 : 1;
    for (int pass = 0; pass < 2; pass++) {
        kept = 0;
        for (size_t v = 0; v < voxels; v++) {
            if (!(intensity[v] > level))
                continue;
            grid_place(g, v, at);
            if ((at[0] % stride && g->n[0] > 1) || (at[1] % stride && g->n[1] > 1) ||
                (at[2] % stride && g->n[2] > 1))
                continue;
            if (kept < most)
                which[kept] = v;
            levels[kept++] = intensity[v];
        }
        if (kept <= most)
            break;
        level = rank_smallest(levels, kept, kept - most);
    }
    free(levels);
    *n = kept < most ? kept : most;
    return 0;
}

/* All voxels above the level, and what is nearer to one than reach_m along each axis. */
static void mark(const struct grid *g, const float *intensity, float level,
                 double reach_m, bool *explained)
{
    size_t voxels = grid_size(g), at[3], low[3], high[3];

    memset(explained, 0, voxels * sizeof *explained);
    for (size_t v = 0; v < voxels; v++) {
        if (!(intensity[v] > level))
            continue;
        grid_place(g, v, at);
        for (int a = 0; a < 3; a++) {
            size_t reach = (size_t)(reach_m / g->step_m[a]);
            low[a] = at[a] > reach ? at[a] - reach : 0;
            high[a] = at[a] + reach < g->n[a] ? at[a] + reach : g->n[a] - 1;
        }
        for (size_t z = low[2]; z <= high[2]; z++)
            for (size_t y = low[1]; y <= high[1]; y++)
                memset(explained + (z * g->n[1] + y) * g->n[0] + low[0], true,
                       (high[0] - low[0] + 1) * sizeof *explained);
    }
}

/* -- traces ----------------------------------------------------------------------------
 */

static void add_traces(struct sparse_operator *model, const struct trace_set *set,
                       bool *masked)
{
    const struct geometry *g = set->geometry;

    for (size_t q = 0; q < g->n_positions * g->n_speakers; q++) {
        size_t first = q * g->n_microphones;
        for (size_t i = 0; i < g->n_microphones; i++)
            masked[i] = !set->heard[first + i];
        sparse_operator_add(model, q / g->n_speakers, q % g->n_speakers,
                            set->traces + first * set->format.n_samples, masked);
    }
}

/* rest: the traces without what comes from the n places. */
static int subtract(const struct trace_set *set, struct pool *pool, size_t n,
                    const double (*at_m)[3], float complex *rest)
{
    const struct imager_config cfg = {.geometry = set->geometry,
                                      .format = set->format,
                                      .band_hz = {set->band_hz[0], set->band_hz[1]},
                                      .pool = pool};
    struct fit f = {.pool = pool, .n = n};
    float *vectors = malloc(8 * n * sizeof *vectors);
    bool *masked = malloc(set->geometry->n_microphones * sizeof *masked);
    int err = vectors && masked ? sparse_operator_create(&f.model, &cfg, n) : -ENOMEM;

    if (!err) {
        f.x = vectors;
        f.rest = vectors + 2 * n;
        f.step = vectors + 4 * n;
        f.image = vectors + 6 * n;
        add_traces(f.model, set, masked);
        sparse_operator_place(f.model, n, at_m);
        solve(&f);
        sparse_operator_residual(f.model, f.x, rest);
        err = pool_stopped(pool) ? -ECANCELED : 0;
        sparse_operator_destroy(f.model);
    }
    free(masked);
    free(vectors);
    return err;
}

static int image_rest(const struct clean *c, const struct grid *grid,
                      const float *intensity, float level, float *residual)
{
    const struct trace_set *set = c->set;
    size_t traces = set->geometry->n_positions * trace_set_pairs(set), n = 0;
    size_t room = MOST_TERMS / traces, which[MOST_PLACES];
    double(*at_m)[3] = malloc(MOST_PLACES * sizeof *at_m);
    float complex *rest = malloc(traces * set->format.n_samples * sizeof *rest);
    struct trace_set left = *set;
    int err = at_m && rest ? 0 : -ENOMEM;

    room = room > MOST_PLACES ? MOST_PLACES : room < LEAST_PLACES ? LEAST_PLACES : room;
    if (!err)
        err = choose(grid, intensity, level, room, which, &n);
    for (size_t i = 0; !err && i < n; i++) {
        size_t at[3];
        grid_place(grid, which[i], at);
        for (int a = 0; a < 3; a++)
            at_m[i][a] = grid->origin_m[a] + grid->step_m[a] * (double)at[a];
    }
    if (!err)
        err = subtract(set, c->pool, n, (const double(*)[3])at_m, rest);
    if (!err) {
        left.traces = rest;
        imager_reset(c->imager);
        err = trace_set_feed(&left, c->imager, c->pool);
    }
    if (!err)
        err = imager_image(c->imager, residual);
    free(rest);
    free(at_m);
    return err;
}

/* -- what stands out ------------------------------------------------------------------
 */

static bool is_maximum(const struct grid *g, const float *x, size_t voxel)
{
    size_t near[26], n = grid_neighbours(g, voxel, near);

    for (size_t q = 0; q < n; q++)
        if (x[near[q]] > x[voxel] || (x[near[q]] == x[voxel] && near[q] < voxel))
            return false;
    return x[voxel] > 0.0f;
}

/* All maxima where nothing was explained, brightest first. */
static int find_maxima(const struct rest *r, const struct grid *g, float **out, size_t *n)
{
    size_t voxels = grid_size(g);

    *n = 0;
    *out = malloc(voxels * sizeof **out);
    if (!*out)
        return -ENOMEM;
    for (size_t v = 0; v < voxels; v++)
        if (!r->explained[v] && is_maximum(g, r->residual, v))
            (*out)[(*n)++] = r->residual[v];
    qsort(*out, *n, sizeof **out, brightest_first);
    return 0;
}

/* How many maxima as bright as this one those that are fainter let expect. */
static double expected(const float *maxima, size_t n, double peak)
{
    size_t tail = n < TAIL ? n : TAIL, fainter = 0;
    double least = tail ? (double)maxima[tail - 1] : 0.0, sum = 0.0;

    if (!(least > 0.0) || peak <= least)
        return (double)n;
    for (size_t i = 0; i < tail; i++) {
        if ((double)maxima[i] >= peak * (1.0 - 1e-6))
            continue;
        sum += log((double)maxima[i] / least);
        fainter++;
    }
    double slope = ((double)fainter + 1.0) / (sum + 1.0);
    return (double)fainter * pow(peak / least, -slope);
}

static bool is_explained(const struct rest *r, const struct grid *g, const double at_m[3])
{
    size_t at[3];

    for (int a = 0; a < 3; a++) {
        double step = round((at_m[a] - g->origin_m[a]) / g->step_m[a]);
        at[a] = (size_t)fmin(fmax(step, 0.0), (double)(g->n[a] - 1));
    }
    return r->explained[(at[2] * g->n[1] + at[1]) * g->n[0] + at[0]];
}

/* What a model misses, elements that are not quite where they are thought to be, stays at
 * the range of what is strong and goes in all directions (24 dB below it with elements
 * that are off by 0.7 mm). */
static bool is_remainder(const struct trace_set *set, const struct detection *strong,
                         size_t n, const struct detection *d)
{
    double low[3], high[3], middle[3];
    double shell_m = 2.0 * set->geometry->sound_speed_m_s /
                     (set->band_hz[1] - set->band_hz[0]);

    geometry_aperture(set->geometry, low, high);
    for (int a = 0; a < 3; a++)
        middle[a] = 0.5 * (low[a] + high[a]);
    double range_m = geometry_distance(middle, d->position_m);
    for (size_t i = 0; i < n; i++) {
        double apart_m = range_m - geometry_distance(middle, strong[i].position_m);
        if (fabs(apart_m) < shell_m && d->level_db < strong[i].level_db - SHELL_DB)
            return true;
    }
    return false;
}

/* top: of the image that came first. */
static int detect_rest(const struct trace_set *set, const struct rest *r,
                       const struct detect_config *cfg, const struct grid *grid,
                       float top, struct detection *found, size_t max, size_t *n)
{
    size_t old = *n, more = 0, n_maxima = 0;
    double most = brightest(r->residual, grid_size(grid));
    float *maxima = NULL;
    int err = detect_objects(cfg, grid, r->residual, found + old, max - old, &more);

    if (err || !more)
        return err;
    err = find_maxima(r, grid, &maxima, &n_maxima);
    double most_db = found[old].level_db;
    double shift_db = found[0].level_db - most_db + 10.0 * log10(most / top);
    for (size_t i = old; !err && i < old + more; i++) {
        struct detection d = found[i];
        double peak = most * pow(10.0, 0.1 * (d.level_db - most_db));
        if (is_explained(r, grid, d.position_m))
            continue;
        d.existence *= exp(-expected(maxima, n_maxima, peak));
        d.level_db += shift_db;
        if (d.existence >= LEAST && !is_remainder(set, found, old, &d))
            found[(*n)++] = d;
    }
    free(maxima);
    return err;
}

/* What the plane hides or makes: near it, and behind it. */
static void mark_plane(const struct grid *g, const struct plane *plane, double reach_m,
                       bool *explained)
{
    for (size_t v = 0; v < grid_size(g); v++) {
        size_t at[3];
        double p[3];
        grid_place(g, v, at);
        for (int a = 0; a < 3; a++)
            p[a] = g->origin_m[a] + g->step_m[a] * (double)at[a];
        double behind_m = plane_behind_m(plane, p);
        explained[v] = fabs(behind_m) < reach_m ||
                       (behind_m > 0.0 && plane_covers(plane, p));
    }
}

static int find_before(const struct clean *c, const struct detect_config *cfg,
                       const struct grid *grid, const float *intensity,
                       const struct plane *plane, struct detection *found, size_t max,
                       size_t *n)
{
    const struct trace_set *set = c->set;
    size_t voxels = grid_size(grid);
    size_t samples = set->geometry->n_positions * trace_set_pairs(set) *
                     set->format.n_samples;
    float complex *rest = malloc(samples * sizeof *rest);
    struct rest image = {malloc(voxels * sizeof *image.residual),
                         malloc(voxels * sizeof *image.explained)};
    struct trace_set left = *set;
    double pulse_m = 0.5 * plane->pulse_s * set->geometry->sound_speed_m_s;
    double level_db = *n ? found[0].level_db : cfg->threshold_db;
    int err = rest && image.residual && image.explained ? 0 : -ENOMEM;

    if (!err) {
        memcpy(rest, set->traces, samples * sizeof *rest);
        plane_mute(plane, set, rest);
        mark_plane(grid, plane, fmax(cfg->cluster_m, 2.0 * pulse_m), image.explained);
        left.traces = rest;
        imager_reset(c->imager);
        err = trace_set_feed(&left, c->imager, c->pool);
    }
    if (!err)
        err = imager_image(c->imager, image.residual);
    if (!err) {
        found[0] = plane->object;
        found[0].level_db = level_db;
        *n = 1;
        err = detect_rest(set, &image, cfg, grid, brightest(intensity, voxels), found,
                          max, n);
    }
    free(image.residual);
    free(image.explained);
    free(rest);
    return err;
}

int clean_find(const struct clean *c, const struct detect_config *cfg,
               const struct grid *grid, const float *intensity, struct detection *found,
               size_t max, size_t *n)
{
    size_t voxels = grid_size(grid);
    float top = brightest(intensity, voxels);
    float level = top * (float)pow(10.0, -0.1 * cfg->dynamic_range_db);
    struct rest rest;
    struct plane plane;

    if (cfg->cfar || max < 2)
        return 0;
    int err = c->own_places ? plane_fit(&plane, c->set, c->burst) : -ERANGE;
    if (!err)
        return find_before(c, cfg, grid, intensity, &plane, found, max, n);
    if (err != -ERANGE)
        return err;
    if (c->own_places || !*n || *n >= max ||
        found[0].level_db < cfg->threshold_db + WORTH_DB)
        return 0;
    rest.residual = malloc(voxels * sizeof *rest.residual);
    rest.explained = malloc(voxels * sizeof *rest.explained);
    err = rest.residual && rest.explained ? 0 : -ENOMEM;
    if (!err) {
        mark(grid, intensity, level, cfg->cluster_m, rest.explained);
        err = image_rest(c, grid, intensity, level, rest.residual);
    }
    if (!err)
        err = detect_rest(c->set, &rest, cfg, grid, top, found, max, n);
    free(rest.residual);
    free(rest.explained);
    return err;
}
