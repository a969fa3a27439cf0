#include "recon/detect.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "recon/peak.h"

#define NOISE_SAMPLES 65536
#define SIDELOBE_DB   18.0 /* worst sidelobe of a lone point (fast, 16 x 32 array) */
#define REGION_DB     6.0  /* an object's region: what is this far below its peak */
#define MODEL_RANGE   1e-3 /* speed of sound known to 0.1 % */
#define MODEL_GRID    0.1  /* of a voxel */
#define MODEL_EXTENT  0.05 /* of an extended object's size */
#define POINT_VOXELS  4.0  /* that a point is wide when nothing better is known */
#define POINT_WIDTHS  1.6  /* regions up to this many point widths are points */

struct region { /* voxels that hang together around a peak */
    size_t peak;
    size_t low[3], high[3];           /* of its body */
    size_t halo_low[3], halo_high[3]; /* with the smear around it */
    double sum, moment[3];            /* of intensity over the region */
};

struct search {
    const struct detect_config *cfg;
    const struct grid *grid;
    const float *volume;
    double floor; /* mean of the noise */
    double threshold;
    uint32_t *owner; /* [voxels] region number + 1, 0: none */
    uint32_t *stack; /* [voxels] */
    struct region *regions;
    size_t n_regions, capacity;
};

void detect_config_default(struct detect_config *cfg)
{
    *cfg = (struct detect_config){
        .threshold_db = 13.0, .dynamic_range_db = 15.0, .cluster_m = 0.10};
}

static int by_value(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* Noise intensity is exponentially distributed: its mean is the median / ln 2. */
static int noise_floor(const float *volume, size_t n, double *out)
{
    size_t count = n < NOISE_SAMPLES ? n : NOISE_SAMPLES;
    float *sample = malloc(count * sizeof *sample);
    if (!sample)
        return -ENOMEM;
    for (size_t i = 0; i < count; i++)
        sample[i] = volume[(size_t)((double)i * (double)n / (double)count)];
    qsort(sample, count, sizeof *sample, by_value);
    *out = sample[count / 2] / M_LN2;
    free(sample);
    return 0;
}

static void place(const struct grid *g, size_t voxel, size_t at[3])
{
    at[0] = voxel % g->n[0];
    at[1] = voxel / g->n[0] % g->n[1];
    at[2] = voxel / (g->n[0] * g->n[1]);
}

/* Neighbours in the 26 directions; returns how many. */
static size_t neighbours(const struct grid *g, size_t voxel, size_t out[26])
{
    size_t at[3], n = 0;
    place(g, voxel, at);
    for (int dz = -1; dz <= 1; dz++) {
        for (int dy = -1; dy <= 1; dy++) {
            for (int dx = -1; dx <= 1; dx++) {
                size_t x = at[0] + (size_t)dx, y = at[1] + (size_t)dy,
                       z = at[2] + (size_t)dz;
                if ((dx || dy || dz) && x < g->n[0] && y < g->n[1] && z < g->n[2])
                    out[n++] = (z * g->n[1] + y) * g->n[0] + x;
            }
        }
    }
    return n;
}

static void include(struct search *s, struct region *r, size_t voxel)
{
    size_t at[3];
    place(s->grid, voxel, at);
    double v = s->volume[voxel];
    r->sum += v;
    for (int a = 0; a < 3; a++) {
        r->low[a] = at[a] < r->low[a] ? at[a] : r->low[a];
        r->high[a] = at[a] > r->high[a] ? at[a] : r->high[a];
        r->moment[a] += v * (double)at[a];
    }
}

/* Grows a region around its peak over all free voxels within REGION_DB of it. */
static void grow(struct search *s, struct region *r, uint32_t number)
{
    double limit = fmax(s->threshold, s->volume[r->peak] * pow(10.0, -0.1 * REGION_DB));
    size_t depth = 0;
    s->stack[depth++] = (uint32_t)r->peak;
    s->owner[r->peak] = number;
    while (depth) {
        size_t voxel = s->stack[--depth], near[26];
        include(s, r, voxel);
        size_t n = neighbours(s->grid, voxel, near);
        for (size_t q = 0; q < n; q++) {
            if (!s->owner[near[q]] && s->volume[near[q]] >= limit) {
                s->owner[near[q]] = number;
                s->stack[depth++] = (uint32_t)near[q];
            }
        }
    }
}

static bool is_peak(const struct search *s, size_t voxel)
{
    size_t near[26], n = neighbours(s->grid, voxel, near);
    for (size_t q = 0; q < n; q++)
        if (s->volume[near[q]] > s->volume[voxel] ||
            (s->volume[near[q]] == s->volume[voxel] && near[q] < voxel))
            return false;
    return true;
}

struct peak {
    float value;
    uint32_t voxel;
};

static int strongest_first(const void *a, const void *b)
{
    const struct peak *x = a, *y = b;
    if (x->value != y->value)
        return x->value < y->value ? 1 : -1;
    return (x->voxel > y->voxel) - (x->voxel < y->voxel);
}

static int find_peaks(const struct search *s, struct peak **out, size_t *n)
{
    size_t capacity = 0;
    *out = NULL;
    *n = 0;
    for (size_t v = 0; v < grid_size(s->grid); v++) {
        if (s->volume[v] < s->threshold || !is_peak(s, v))
            continue;
        if (*n == capacity) {
            capacity = capacity ? 2 * capacity : 64;
            struct peak *grown = realloc(*out, capacity * sizeof **out);
            if (!grown)
                return -ENOMEM;
            *out = grown;
        }
        (*out)[(*n)++] = (struct peak){s->volume[v], (uint32_t)v};
    }
    if (*n)
        qsort(*out, *n, sizeof **out, strongest_first);
    return 0;
}

/* Gap in m between an object with its halo and a region; 0 when they touch. */
static double gap(const struct grid *g, const struct region *a, const struct region *b)
{
    double sum = 0.0;
    for (int i = 0; i < 3; i++) {
        double d = fmax((double)a->halo_low[i] - (double)b->high[i],
                        (double)b->low[i] - (double)a->halo_high[i]);
        d = fmax(d, 0.0) * g->step_m[i];
        sum += d * d;
    }
    return sqrt(sum);
}

static void widen(size_t low[3], size_t high[3], const struct region *r)
{
    for (int a = 0; a < 3; a++) {
        low[a] = r->low[a] < low[a] ? r->low[a] : low[a];
        high[a] = r->high[a] > high[a] ? r->high[a] : high[a];
    }
}

static void join(struct region *into, const struct region *r)
{
    widen(into->low, into->high, r);
    into->sum += r->sum;
    for (int a = 0; a < 3; a++)
        into->moment[a] += r->moment[a];
}

/* A fainter neighbour is the smear around an object, not a part of its body. */
static bool belongs(const struct search *s, const struct region *to,
                    const struct region *r)
{
    return s->volume[r->peak] >= s->volume[to->peak] * pow(10.0, -0.1 * REGION_DB);
}

/* Regions from the strongest peak down; one close to a stronger one is no object of its
 * own. */
static int find_regions(struct search *s)
{
    struct peak *peaks;
    size_t n;
    int err = find_peaks(s, &peaks, &n);
    if (!err && n) {
        s->regions = calloc(n, sizeof *s->regions);
        err = s->regions ? 0 : -ENOMEM;
    }
    for (size_t p = 0; !err && p < n; p++) {
        if (s->owner[peaks[p].voxel])
            continue;
        struct region r = {.peak = peaks[p].voxel, .low = {SIZE_MAX, SIZE_MAX, SIZE_MAX}};
        grow(s, &r, (uint32_t)s->n_regions + 1);
        size_t near = 0;
        while (near < s->n_regions &&
               gap(s->grid, &s->regions[near], &r) > s->cfg->cluster_m)
            near++;
        if (near == s->n_regions) {
            memcpy(r.halo_low, r.low, sizeof r.low);
            memcpy(r.halo_high, r.high, sizeof r.high);
            s->regions[s->n_regions++] = r;
            continue;
        }
        struct region *object = &s->regions[near];
        widen(object->halo_low, object->halo_high, &r);
        if (belongs(s, object, &r))
            join(object, &r);
    }
    free(peaks);
    return err;
}

/* An object of many voxels stands in the middle of what is seen of it. */
static void place_extended(const struct search *s, const struct region *r,
                           struct detection *d)
{
    const struct grid *g = s->grid;
    for (int a = 0; a < 3; a++) {
        double middle = a < 2 ? 0.5 * (double)(r->low[a] + r->high[a])
                              : r->moment[a] / r->sum;
        d->position_m[a] = g->origin_m[a] + g->step_m[a] * middle;
        d->extent_m[a] = g->step_m[a] * (double)(r->high[a] - r->low[a] + 1);
    }
}

static void add_model_errors(const struct search *s, struct detection *d)
{
    static const int diagonal[3] = {0, 3, 5};
    double range_m = hypot(hypot(d->position_m[0], d->position_m[1]), d->position_m[2]);
    for (int a = 0; a < 3; a++) {
        double grid_m = MODEL_GRID * s->grid->step_m[a];
        double size_m = MODEL_EXTENT * d->extent_m[a];
        d->covariance_m2[diagonal[a]] += grid_m * grid_m + size_m * size_m;
        for (int b = a; b < 3; b++)
            d->covariance_m2[diagonal[a] + b - a] += MODEL_RANGE * MODEL_RANGE *
                                                     d->position_m[a] * d->position_m[b] *
                                                     (range_m > 0.0 ? 1.0 : 0.0);
    }
}

static double existence(const struct search *s, double peak, double strongest)
{
    double cells = (double)grid_size(s->grid);
    double noise = fmin(cells * exp(-peak / s->floor), 1.0);
    double margin_db = 10.0 * log10(peak / strongest) + SIDELOBE_DB;
    double sidelobe = peak == strongest ? 0.0 : 1.0 / (1.0 + pow(10.0, margin_db / 5.0));
    return (1.0 - noise) * (1.0 - sidelobe);
}

static void describe(const struct search *s, const struct region *r, double strongest,
                     struct detection *d)
{
    const struct grid *g = s->grid;
    double peak = s->volume[r->peak];
    memset(d, 0, sizeof *d);
    struct peak_fit fit;
    peak_fit(g, s->volume, r->peak, peak / s->floor, &fit);
    bool point = true;
    for (int a = 0; a < 3; a++) {
        double size_m = g->step_m[a] * (double)(r->high[a] - r->low[a] + 1);
        double width_m = s->cfg->resolution_m[a] > 0.0 ? s->cfg->resolution_m[a]
                                                       : POINT_VOXELS * g->step_m[a];
        point = point && size_m < POINT_WIDTHS * width_m + 2.0 * g->step_m[a];
    }
    memcpy(d->position_m, fit.position_m, sizeof d->position_m);
    memcpy(d->covariance_m2, fit.covariance_m2, sizeof d->covariance_m2);
    if (!point)
        place_extended(s, r, d);
    add_model_errors(s, d);
    d->level_db = 10.0 * log10(peak / s->floor);
    d->existence = existence(s, peak, strongest);
}

int detect_objects(const struct detect_config *cfg, const struct grid *grid,
                   const float *intensity, struct detection *out, size_t max, size_t *n)
{
    size_t voxels = grid_size(grid);
    struct search s = {.cfg = cfg, .grid = grid, .volume = intensity};
    float strongest = 0.0f;
    *n = 0;
    for (size_t v = 0; v < voxels; v++)
        strongest = intensity[v] > strongest ? intensity[v] : strongest;
    int err = noise_floor(intensity, voxels, &s.floor);
    if (err || !(strongest > 0.0f))
        return err;
    /* Half of the volume empty: a noiseless one.  Any floor below all of it will do. */
    s.floor = fmax(s.floor, 1e-9 * strongest);
    s.threshold = fmax(s.floor * pow(10.0, 0.1 * cfg->threshold_db),
                       strongest * pow(10.0, -0.1 * cfg->dynamic_range_db));
    s.owner = calloc(voxels, sizeof *s.owner);
    s.stack = malloc(voxels * sizeof *s.stack);
    err = s.owner && s.stack ? find_regions(&s) : -ENOMEM;
    for (size_t r = 0; !err && r < s.n_regions && *n < max; r++)
        describe(&s, &s.regions[r], strongest, &out[(*n)++]);
    free(s.owner);
    free(s.stack);
    free(s.regions);
    return err;
}
