/* SPDX-License-Identifier: MIT */
#include "recon/detection/detect.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/list.h"
#include "recon/detection/detect_learn.h"
#include "recon/detection/peak.h"
#include "recon/imaging/imager.h"

#define BODY_DB       6.0 /* an object's body: what is this far below its peak */
#define NOISE_SAMPLES 65536
#define LEAST_IMAGED  0.2  /* of a volume */
#define SIDELOBE_DB   18.0 /* worst sidelobe of a lone point (fast, 16 x 32 array) */
#define MODEL_RANGE   1e-3 /* speed of sound known to 0.1 % */
#define MODEL_GRID    0.1  /* of a voxel */
#define MODEL_EXTENT  0.05 /* of an extended object's size */
#define MODEL_POWER   0.05 /* of a width in an image of power; `paper`: 0.04 to 0.06 */
#define POINT_VOXELS  4.0  /* that a point is wide when nothing better is known */
#define POINT_WIDTHS  1.6  /* regions up to this many point widths are points */
#define GUARD_WIDTHS  1.5  /* of a point, where its image has not faded into the noise */
#define GUARD_M       0.25 /* half of the largest object that must not hide itself */
#define TOUCH         1.01 /* steps from a voxel to its farthest neighbour, and rounding */
#define MAP_NOISE     1.5  /* what a map knows of noise alone is less, times its mean */
#define MAP_FACTOR    4.0  /* over what else it knows */
#define PROVEN        0.95 /* that pings show something which their sum does not */
#define PROVEN_M      0.5  /* from the middle of an object */
#define FAINT         2.0  /* over the noise, in that sum */
#define FAINT_M       0.3  /* at most from where the pings show it */
#define RANK          0.75 /* of the ordered training cells: a quarter may be objects */

/* -- bright places: voxels that hang together around a peak, from the strongest down ----
 */

struct region {
    size_t peak;                      /* voxel */
    size_t low[3], high[3];           /* of its body: what is within 6 dB of the peak */
    size_t halo_low[3], halo_high[3]; /* with the smear around it */
    double sum, moment[3];            /* of the body's intensity, in voxels */
    double second[6];                 /* xx xy xz yy yz zz, likewise, about voxel 0 */
};

struct regions {
    struct region *at; /* [n], strongest first */
    size_t n;
};

/* Is a local maximum a peak?  NULL: each is. */
typedef bool (*regions_judge)(void *state, size_t voxel);

struct growth {
    const struct grid *grid;
    const float *volume;
    double threshold, cluster_m;
    regions_judge judge;
    void *judge_state;
    uint32_t *owner; /* [voxels] region number + 1, 0: none */
    uint32_t *stack; /* [voxels] */
};

static void include(struct growth *s, struct region *r, size_t voxel)
{
    size_t at[3];
    grid_place(s->grid, voxel, at);
    double v = s->volume[voxel];
    r->sum += v;
    for (int a = 0; a < 3; a++) {
        r->low[a] = at[a] < r->low[a] ? at[a] : r->low[a];
        r->high[a] = at[a] > r->high[a] ? at[a] : r->high[a];
        r->moment[a] += v * (double)at[a];
    }
    for (int a = 0, e = 0; a < 3; a++)
        for (int b = a; b < 3; b++)
            r->second[e++] += v * (double)(at[a] * at[b]);
}

/* Grows a region around its peak over all free voxels within BODY_DB of it. */
static void grow(struct growth *s, struct region *r, uint32_t number)
{
    double limit = fmax(s->threshold, s->volume[r->peak] * pow(10.0, -0.1 * BODY_DB));
    size_t depth = 0;
    s->stack[depth++] = (uint32_t)r->peak;
    s->owner[r->peak] = number;
    while (depth) {
        size_t voxel = s->stack[--depth], near[26];
        include(s, r, voxel);
        size_t n = grid_neighbours(s->grid, voxel, near);
        for (size_t q = 0; q < n; q++) {
            if (!s->owner[near[q]] && s->volume[near[q]] >= limit) {
                s->owner[near[q]] = number;
                s->stack[depth++] = (uint32_t)near[q];
            }
        }
    }
}

/* Of equal ones it is the first. */
static bool yields(const struct growth *s, size_t voxel, size_t other)
{
    return s->volume[other] > s->volume[voxel] ||
           (s->volume[other] == s->volume[voxel] && other < voxel);
}

/* Most voxels, of which x is the place in their row, are none by one of the next in it or
 * in depth. */
static bool is_peak(const struct growth *s, size_t voxel, size_t x)
{
    size_t near[26], n;
    size_t plane = s->grid->n[0] * s->grid->n[1];
    if ((x && yields(s, voxel, voxel - 1)) ||
        (x + 1 < s->grid->n[0] && yields(s, voxel, voxel + 1)) ||
        (voxel >= plane && yields(s, voxel, voxel - plane)) ||
        (voxel + plane < grid_size(s->grid) && yields(s, voxel, voxel + plane)))
        return false;
    n = grid_neighbours(s->grid, voxel, near);
    for (size_t q = 0; q < n; q++)
        if (yields(s, voxel, near[q]))
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

static int find_peaks(const struct growth *s, struct peak **out, size_t *n)
{
    size_t room = 0;
    *out = NULL;
    *n = 0;
    for (size_t v = 0, x = 0; v < grid_size(s->grid); v++, x++) {
        x = x == s->grid->n[0] ? 0 : x;
        if (s->volume[v] < s->threshold || !is_peak(s, v, x) ||
            (s->judge && !s->judge(s->judge_state, v)))
            continue;
        if (list_grow(out, *n, &room, sizeof **out))
            return -ENOMEM;
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
    for (int e = 0; e < 6; e++)
        into->second[e] += r->second[e];
}

/* A fainter neighbour is the smear around an object, not a part of its body. */
static bool belongs(const struct growth *s, const struct region *to,
                    const struct region *r)
{
    return s->volume[r->peak] >= s->volume[to->peak] * pow(10.0, -0.1 * BODY_DB);
}

/* The stronger object that a region belongs to; NULL: it is one of its own. */
static struct region *owner_of(const struct growth *s, struct regions *found,
                               const struct region *r)
{
    for (size_t near = 0; near < found->n; near++)
        if (gap(s->grid, &found->at[near], r) <= s->cluster_m)
            return &found->at[near];
    return NULL;
}

static void take(struct growth *s, struct regions *found, size_t peak)
{
    struct region r = {.peak = peak, .low = {SIZE_MAX, SIZE_MAX, SIZE_MAX}};
    grow(s, &r, (uint32_t)found->n + 1);
    struct region *owner = owner_of(s, found, &r);
    if (!owner) {
        memcpy(r.halo_low, r.low, sizeof r.low);
        memcpy(r.halo_high, r.high, sizeof r.high);
        found->at[found->n++] = r;
        return;
    }
    widen(owner->halo_low, owner->halo_high, &r);
    if (belongs(s, owner, &r))
        join(owner, &r);
}

/* intensity [nz][ny][nx].  Peaks below threshold are none, nor those that judge rejects.
 * A region closer than cluster_m to a stronger one joins it: its body where it is nearly
 * as strong, else its halo. 0, -ENOMEM; free with regions_clear. */
static int regions_find(struct regions *out, const struct grid *grid,
                        const float *intensity, double threshold, double cluster_m,
                        regions_judge judge, void *state)
{
    size_t voxels = grid_size(grid), n = 0;
    struct growth s = {.grid = grid,
                       .volume = intensity,
                       .threshold = threshold,
                       .cluster_m = cluster_m,
                       .judge = judge,
                       .judge_state = state};
    struct peak *peaks = NULL;
    memset(out, 0, sizeof *out);
    s.owner = calloc(voxels, sizeof *s.owner);
    s.stack = malloc(voxels * sizeof *s.stack);
    int err = s.owner && s.stack ? find_peaks(&s, &peaks, &n) : -ENOMEM;
    if (!err && n) {
        out->at = calloc(n, sizeof *out->at);
        err = out->at ? 0 : -ENOMEM;
    }
    for (size_t p = 0; !err && p < n; p++)
        if (!s.owner[peaks[p].voxel])
            take(&s, out, peaks[p].voxel);
    free(peaks);
    free(s.owner);
    free(s.stack);
    return err;
}

static void regions_clear(struct regions *r)
{
    free(r->at);
    memset(r, 0, sizeof *r);
}

/* -- those that are objects -------------------------------------------------------------
 */

struct search {
    const struct detect_config *cfg;
    const struct grid *grid;
    const float *volume;
    double floor; /* mean of the noise, where no cfar tells it */
    bool gated;   /* where it is 0 nothing was imaged */
};

void detect_config_default(struct detect_config *cfg)
{
    *cfg = (struct detect_config){.threshold_db = 13.0,
                                  .learns = true,
                                  .multipath = true,
                                  .dynamic_range_db = 15.0,
                                  .cluster_m = 0.10};
}

void detect_config_method(struct detect_config *cfg, const char *method,
                          const struct grid *grid)
{
    double touch_m = 0.0;

    cfg->clipped = imager_clips(method);
    if (!imager_isolates(method))
        return;
    for (int a = 0; a < 3; a++)
        touch_m = hypot(touch_m, grid->n[a] > 1 ? grid->step_m[a] : 0.0);
    cfg->cluster_m = fmin(cfg->cluster_m, TOUCH * touch_m);
    cfg->multipath = false;
}

static int by_value(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static float sample(const float *volume, size_t n, size_t i, size_t count)
{
    if (count == n)
        return volume[i];
    return volume[(size_t)((double)i * (double)n / (double)count)];
}

/* What is beyond the gate is 0 and no noise; where hardly anything is left, it is an
 * image without noise. */
static bool is_gated(const float *volume, size_t n)
{
    size_t count = n < NOISE_SAMPLES ? n : NOISE_SAMPLES, imaged = 0;

    for (size_t i = 0; i < count; i++)
        imaged += sample(volume, n, i, count) > 0.0f;
    return (double)imaged >= LEAST_IMAGED * (double)count;
}

/* Noise intensity is exponentially distributed: its mean is the median / ln 2. */
static int noise_floor(const float *volume, size_t n, bool gated, double *out)
{
    size_t count = n < NOISE_SAMPLES ? n : NOISE_SAMPLES, zeros = 0;
    float *samples = malloc(count * sizeof *samples);
    if (!samples)
        return -ENOMEM;
    for (size_t i = 0; i < count; i++) {
        samples[i] = sample(volume, n, i, count);
        zeros += gated && samples[i] == 0.0f;
    }
    qsort(samples, count, sizeof *samples, by_value);
    *out = samples[zeros + (count - zeros) / 2] / M_LN2;
    free(samples);
    return 0;
}

/* Is all 0 from beside the region to the grid's end, along a line through its peak: does
 * what was imaged end with it? */
static bool ends_with(const struct search *s, const struct region *r, int axis, int far)
{
    const struct grid *g = s->grid;
    const size_t stride[3] = {1, g->n[0], g->n[0] * g->n[1]};
    size_t at[3];

    grid_place(g, r->peak, at);
    size_t line = r->peak - at[axis] * stride[axis];
    size_t first = far ? r->high[axis] + 1 : 0, end = far ? g->n[axis] : r->low[axis];
    for (size_t i = first; i < end; i++)
        if (s->volume[line + i * stride[axis]] > 0.0f)
            return false;
    return first == end || (s->gated && !s->cfg->followed);
}

/* An object of many voxels stands in the middle of what is seen of it; where that goes on
 * beyond the grid it is no middle, and along the other axes anywhere in it. */
static void place_extended(const struct search *s, const struct region *r,
                           struct detection *d)
{
    static const int diagonal[3] = {0, 3, 5};
    const struct grid *g = s->grid;

    memset(d->covariance_m2, 0, sizeof d->covariance_m2);
    for (int a = 0; a < 3; a++)
        for (int far = 0; far <= 1; far++)
            if (g->n[a] > 1 && ends_with(s, r, a, far))
                d->at_border |= PEAK_BORDER(a, far);
    for (int a = 0; a < 3; a++) {
        bool known = g->n[a] > 1 &&
                     !(d->at_border & (PEAK_BORDER(a, 0) | PEAK_BORDER(a, 1)));
        double middle = a < 2 ? 0.5 * (double)(r->low[a] + r->high[a])
                              : r->moment[a] / r->sum;
        d->position_m[a] = g->origin_m[a] + g->step_m[a] * middle;
        d->extent_m[a] = g->step_m[a] * (double)(r->high[a] - r->low[a] + 1);
        double within_m = d->at_border && !s->cfg->followed ? d->extent_m[a]
                                                            : g->step_m[a];
        d->covariance_m2[diagonal[a]] = known ? within_m * within_m / 12.0
                                              : PEAK_UNKNOWN_M * PEAK_UNKNOWN_M;
    }
}

static void find_middle(const struct search *s, const struct region *r,
                        struct detection *d)
{
    const struct grid *g = s->grid;

    for (int a = 0; a < 3; a++)
        d->middle_m[a] = g->origin_m[a] + g->step_m[a] * r->moment[a] / r->sum;
}

/* Somewhere in what is seen, uniformly distributed over its length. */
static void place_seen(const struct search *s, const struct region *r,
                       struct detection *d)
{
    static const int element[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};

    for (int a = 0; a < 3; a++) {
        double seen_m = s->grid->step_m[a] * (double)(r->high[a] - r->low[a] + 1);
        if (!(d->at_border & (PEAK_BORDER(a, 0) | PEAK_BORDER(a, 1))))
            continue;
        for (int b = 0; b < 3; b++)
            d->covariance_m2[element[a][b]] = 0.0;
        d->covariance_m2[element[a][a]] = seen_m * seen_m / 12.0;
    }
}

/* What stands beyond an end in depth shows where the front of its echo crosses that: so
 * far aside as a sphere falls back by a point's depth. */
static void open_sideways(const struct search *s, struct detection *d)
{
    double depth_m = s->cfg->resolution_m[2] > 0.0 ? s->cfg->resolution_m[2]
                                                   : POINT_VOXELS * s->grid->step_m[2];
    double range_m = hypot(hypot(d->position_m[0], d->position_m[1]), d->position_m[2]);

    if (!(d->at_border & (PEAK_BORDER(2, 0) | PEAK_BORDER(2, 1))))
        return;
    d->covariance_m2[0] += 2.0 * range_m * depth_m;
    d->covariance_m2[3] += 2.0 * range_m * depth_m;
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

/* Noise alone may be as bright somewhere; so may a sidelobe of the strongest. */
static double existence(const struct search *s, double peak, double floor,
                        double strongest)
{
    double tail = s->cfg->cfar
                      ? cfar_noise_tail(cfar_noise(s->cfg->cfar)->shape, peak / floor)
                      : exp(-peak / floor);
    double noise = fmin((double)grid_size(s->grid) * tail, 1.0);
    double margin_db = 10.0 * log10(peak / strongest) + SIDELOBE_DB;
    double sidelobe = peak == strongest ? 0.0 : 1.0 / (1.0 + pow(10.0, margin_db / 5.0));
    return (1.0 - noise) * (1.0 - sidelobe);
}

static struct shape_guess guess_shape(const struct search *s, const struct region *r)
{
    double variance_m2[6], width_m[3];

    for (int a = 0, e = 0; a < 3; a++) {
        width_m[a] = s->cfg->resolution_m[a] > 0.0 ? s->cfg->resolution_m[a]
                                                   : POINT_VOXELS * s->grid->step_m[a];
        for (int b = a; b < 3; b++, e++)
            variance_m2[e] = (r->second[e] / r->sum -
                              r->moment[a] / r->sum * (r->moment[b] / r->sum)) *
                             s->grid->step_m[a] * s->grid->step_m[b];
    }
    return shape_guess(variance_m2, width_m);
}

/* What a map knows to be there mostly, but for the noise around it. */
static double residue(const struct search *s, size_t voxel, double noise)
{
    return s->cfg->map ? fmax(cfar_map_at(s->cfg->map, voxel) - MAP_NOISE * noise, 0.0)
                       : 0.0;
}

static void describe(const struct search *s, const struct region *r, double strongest,
                     struct detection *d)
{
    const struct grid *g = s->grid;
    double peak = s->volume[r->peak], floor = s->floor;
    memset(d, 0, sizeof *d);
    if (s->cfg->cfar)
        floor = cfar_at(s->cfg->cfar, s->volume, r->peak).noise;
    static const int diagonal[3] = {0, 3, 5};
    struct peak_fit fit;
    double body_m[3];
    bool point = true;
    enum peak_zero zero = !s->gated         ? PEAK_ZERO_EMPTY
                          : s->cfg->clipped ? PEAK_ZERO_CLIPPED
                                            : PEAK_ZERO_UNSEEN;
    for (int a = 0; a < 3; a++) {
        double width_m = s->cfg->resolution_m[a] > 0.0 ? s->cfg->resolution_m[a]
                                                       : POINT_VOXELS * g->step_m[a];
        body_m[a] = g->step_m[a] * (double)(r->high[a] - r->low[a] + 1);
        point = point && body_m[a] < POINT_WIDTHS * width_m + 2.0 * g->step_m[a];
        if (!s->cfg->followed && (r->low[a] == 0 || r->high[a] + 1 == g->n[a]))
            body_m[a] = INFINITY;
    }
    peak_fit(g, s->volume, r->peak, peak / floor, zero, body_m, &fit);
    memcpy(d->position_m, fit.position_m, sizeof d->position_m);
    memcpy(d->covariance_m2, fit.covariance_m2, sizeof d->covariance_m2);
    d->at_border = fit.at_border;
    if (!point)
        place_extended(s, r, d);
    find_middle(s, r, d);
    if (s->cfg->followed)
        place_seen(s, r, d);
    else
        open_sideways(s, d);
    add_model_errors(s, d);
    for (int a = 0; a < 3 && s->cfg->clipped; a++) {
        double power_m = MODEL_POWER * fit.width_m[a];
        d->covariance_m2[diagonal[a]] += power_m * power_m;
    }
    d->level_db = 10.0 * log10(peak / floor);
    d->existence = existence(s, peak, floor + residue(s, r->peak, floor), strongest);
    d->shape = guess_shape(s, r);
}

static void ask_pings(const struct search *s, struct detection *d)
{
    const struct occupancy *o = s->cfg->occupied;

    d->proven = o ? occupancy_near(o, d->position_m, PROVEN_M) : 0.0;
    d->lately = o ? occupancy_lately(o, d->position_m, FAINT_M) : -1.0;
}

/* The brightest voxel about a spot; false: none is over the noise. */
static bool find_faint(const struct search *s, const double at_m[3], size_t *voxel)
{
    const struct grid *g = s->grid;
    float brightest = 0.0f;

    for (size_t v = 0; v < grid_size(g); v++) {
        size_t at[3];
        double away2 = 0.0;
        if (!(s->volume[v] > brightest))
            continue;
        grid_place(g, v, at);
        for (int a = 0; a < 3; a++) {
            double off = g->origin_m[a] + g->step_m[a] * (double)at[a] - at_m[a];
            away2 += off * off;
        }
        if (away2 > FAINT_M * FAINT_M)
            continue;
        brightest = s->volume[v];
        *voxel = v;
    }
    if (!(brightest > 0.0f))
        return false;
    double noise = cfar_at(s->cfg->cfar, s->volume, *voxel).noise;
    return noise > 0.0 && (double)brightest > FAINT * noise + residue(s, *voxel, noise);
}

/* What single pings have shown, and their sum does not yet. */
static size_t add_faint(const struct search *s, double strongest, struct detection *out,
                        size_t n, size_t max)
{
    struct occupancy_spot spots[16];
    size_t found = occupancy_spots(s->cfg->occupied, PROVEN, 2.0 * PROVEN_M, spots, 16);
    size_t seen = n;

    for (size_t k = 0; k < found && n < max; k++) {
        struct region r = {.sum = 0.0};
        bool known = false;
        for (size_t i = 0; i < seen; i++)
            known |= geometry_distance(out[i].position_m, spots[k].at_m) < 2.0 * PROVEN_M;
        if (known || !find_faint(s, spots[k].at_m, &r.peak))
            continue;
        grid_place(s->grid, r.peak, r.low);
        memcpy(r.high, r.low, sizeof r.high);
        r.sum = (double)s->volume[r.peak];
        for (int a = 0, e = 0; a < 3; a++) {
            r.moment[a] = r.sum * (double)r.low[a];
            for (int b = a; b < 3; b++, e++)
                r.second[e] = r.sum * (double)r.low[a] * (double)r.low[b];
        }
        describe(s, &r, strongest, &out[n]);
        out[n].existence = spots[k].probability;
        n++;
    }
    return n;
}

static bool stands_out(void *state, size_t voxel)
{
    const struct search *s = state;

    if (!cfar_stands_out(s->cfg->cfar, s->volume, voxel))
        return false;
    if (!s->cfg->map)
        return true;
    struct cfar_level level = cfar_at(s->cfg->cfar, s->volume, voxel);
    return (double)s->volume[voxel] >
           level.threshold + MAP_FACTOR * residue(s, voxel, level.noise);
}

/* What a peak has to be at least, wherever it is. */
static double least(const struct search *s, double strongest)
{
    double faintest = strongest * pow(10.0, -0.1 * s->cfg->dynamic_range_db);

    if (s->cfg->cfar)
        return faintest;
    return fmax(s->floor * pow(10.0, 0.1 * s->cfg->threshold_db), faintest);
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
    if (!(strongest > 0.0f))
        return 0;
    int err = 0;
    s.gated = is_gated(intensity, voxels);
    if (!cfg->cfar)
        err = noise_floor(intensity, voxels, s.gated, &s.floor);
    else if (cfg->learns)
        err = detect_learn(cfg->cfar, grid, intensity, cfg->known);
    /* Half of the volume empty: a noiseless one.  Any floor below all of it will do. */
    s.floor = fmax(s.floor, 1e-9 * strongest);
    if (err)
        return err;
    if (cfg->cfar)
        cfar_look(cfg->cfar, intensity);
    struct regions found;
    err = regions_find(&found, grid, intensity, least(&s, strongest), cfg->cluster_m,
                       cfg->cfar ? stands_out : NULL, &s);
    for (size_t r = 0; !err && r < found.n && *n < max; r++)
        describe(&s, &found.at[r], strongest, &out[(*n)++]);
    if (!err && cfg->cfar && cfg->occupied)
        *n = add_faint(&s, strongest, out, *n, max);
    for (size_t i = 0; !err && i < *n; i++)
        ask_pings(&s, &out[i]);
    regions_clear(&found);
    return err;
}

int detect_cfar(struct cfar **out, enum cfar_kind kind, double false_alarm_rate,
                const struct grid *grid, const double resolution_m[3])
{
    static const size_t training[3] = {6, 2, 10};
    struct cfar_config cfg = {
        .kind = kind, .false_alarm_rate = false_alarm_rate, .rank = RANK};

    for (int a = 0; a < 3; a++) {
        double width = resolution_m[a] > 0.0 ? resolution_m[a] / grid->step_m[a]
                                             : POINT_VOXELS;
        double most = (double)grid->n[a];
        cfg.n[a] = grid->n[a];
        cfg.pitch[a] = (size_t)fmin(fmax(round(width), 1.0), most);
        cfg.guard[a] = (size_t)fmin(
            ceil(fmax(GUARD_WIDTHS * width, GUARD_M / grid->step_m[a])), most);
        cfg.training[a] = training[a];
    }
    return cfar_create(out, &cfg);
}
