/* SPDX-License-Identifier: MIT */
#include "dsp/cfar.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/rank.h"
#include "dsp/special.h"
#include "dsp/vector.h"

/* How bright noise gets, as powers x over their level.
 * The body is a gamma distribution of some shape.  Clutter has a tail that no such shape
 * has; where more or fewer powers are high than chance allows, they are counted, and the
 * tail beyond the highest of them is a generalised Pareto distribution, fitted by
 * probability-weighted moments (Hosking and Wallis 1987).  These are few on purpose: the
 * tail of single scatterers begins where a hundredth of the powers is left, and a fit to
 * more of them is one to the noise between. */
#define CFAR_NOISE_POINTS 4096 /* factors are right to 1e-3 */
#define MIN_SHAPE         0.2
#define MAX_SHAPE         64.0
#define QUADRATURE        96 /* points of the integral over an ordered statistic */
#define LEAST             1e-12
#define MOST_FACTOR       1e9
#define MOST_POWER        1e4
#define LEAST_TAIL        1e-300
#define NARROWED          40 /* steps at most, for a root known to... */
#define NARROW            1e-12
#define NEAR_GUESS        0.05 /* of a logarithm: factors for nearly as many cells */
#define TAIL              64   /* powers to fit it to... */
#define TAIL_PART         0.05 /* ...and not more than this part of all */
#define CHANCE            4.0  /* standard deviations of a count */

/* The tail of a shape as a table, over the logarithm of the power: the factor of an
 * ordered statistic takes thousands of its values. */
struct cfar_noise_curve {
    double log_tail[CFAR_NOISE_POINTS];
};

/* Brings two logarithms between which a function falls past `value` nearer to each other,
 * by a chord through its logarithm, the end that stays counting half each time (the
 * Illinois way).  As far as it gets: for functions with a step, not far.  false: it does
 * not fall past it there. */
static bool narrow(double (*falling)(const void *state, double x), const void *state,
                   double value, double at[2])
{
    double f[2] = {log(fmax(falling(state, exp(at[0])), LEAST_TAIL) / value),
                   log(fmax(falling(state, exp(at[1])), LEAST_TAIL) / value)};

    if (!(f[0] > 0.0 && f[1] < 0.0))
        return false;
    for (int i = 0, last = -1; i < NARROWED && at[1] - at[0] > NARROW; i++) {
        double to = at[0] + (at[1] - at[0]) * f[0] / (f[0] - f[1]);
        double margin = 0.25 * NARROW;
        to = fmin(fmax(to, at[0] + margin), at[1] - margin);
        double found = falling(state, exp(to));
        int side = found > value ? 0 : 1;
        at[side] = to;
        f[side] = log(fmax(found, LEAST_TAIL) / value);
        f[1 - side] *= side == last ? 0.5 : 1.0;
        last = side;
    }
    return true;
}

/* Where a function of positive numbers that falls is `value`: halving always converges,
 * whatever the shape.  What a chord has found spares most of its steps, and a good guess
 * (0: there is none) most of the chords. */
static double invert(double (*falling)(const void *state, double x), const void *state,
                     double value, double most, double guess)
{
    double low = log(LEAST), high = log(most), known[2] = {low, high}, near[2];

    near[0] = fmax(log(guess) - NEAR_GUESS, low);
    near[1] = fmin(log(guess) + NEAR_GUESS, high);
    if (guess > 0.0 && narrow(falling, state, value, near))
        memcpy(known, near, sizeof known);
    else
        narrow(falling, state, value, known);
    for (int i = 0; i < 48; i++) {
        double middle = 0.5 * (low + high);
        bool above = middle <= known[0] ||
                     (middle < known[1] && falling(state, exp(middle)) > value);
        if (above)
            low = middle;
        else
            high = middle;
    }
    return exp(high);
}

static double tail(const void *shape, double x)
{
    return special_gamma_q(*(const double *)shape, x);
}

double cfar_noise_tail(double shape, double x)
{
    return x > 0.0 ? tail(&shape, shape * x) : 1.0;
}

struct mean {
    double shape, n;
};

/* A cell's part of the sum of itself and n others is beta distributed. */
static double averaging_rate(const void *mean, double factor)
{
    const struct mean *m = mean;

    return special_beta_q(factor / (m->n + factor), m->shape, m->n * m->shape);
}

/* The factor over the level that noise of a shape passes at a rate: over the mean of n
 * training cells, or the k-th smallest of them. */
static double cfar_noise_averaging(double shape, size_t n, double rate)
{
    const struct mean mean = {shape, (double)n};

    return invert(averaging_rate, &mean, rate, MOST_FACTOR, 0.0);
}

/* What a level may be, and how likely: a training cell in its order, whose place in the
 * distribution is beta distributed. */
struct levels {
    const struct cfar_noise_curve *curve;
    double log_at[QUADRATURE], weight[QUADRATURE];
};

static double point(double i)
{
    return log(LEAST) + i * log(MOST_POWER / LEAST) / (CFAR_NOISE_POINTS - 1);
}

static void cfar_noise_curve(struct cfar_noise_curve *out, double shape)
{
    for (int i = 0; i < CFAR_NOISE_POINTS; i++)
        out->log_tail[i] = log(fmax(tail(&shape, exp(point(i))), LEAST_TAIL));
}

static double curve_tail(const struct cfar_noise_curve *c, double log_x)
{
    double at = (log_x - point(0)) * (CFAR_NOISE_POINTS - 1) / log(MOST_POWER / LEAST);

    if (at <= 0.0)
        return 1.0;
    if (at >= CFAR_NOISE_POINTS - 1)
        return 0.0;
    int i = (int)at;
    return exp(c->log_tail[i] + (at - i) * (c->log_tail[i + 1] - c->log_tail[i]));
}

/* The logarithm of the power that a part of the noise is brighter than. */
static double curve_log_power(const struct cfar_noise_curve *c, double part)
{
    double value = log(part);
    int low = 0, high = CFAR_NOISE_POINTS - 1;

    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (c->log_tail[middle] > value)
            low = middle;
        else
            high = middle;
    }
    double fall = c->log_tail[low] - c->log_tail[high];
    return point(low + (fall > 0.0 ? (c->log_tail[low] - value) / fall : 1.0));
}

static void ordered_levels(struct levels *out, const struct cfar_noise_curve *curve,
                           size_t n, size_t k)
{
    double a = (double)k, b = (double)(n + 1) - a, sum = 0.0;
    double sigma = sqrt(a * b / (a + b + 1.0)) / (a + b), middle = a / (a + b);
    double low = fmax(middle - 8.0 * sigma, 0.0), high = fmin(middle + 8.0 * sigma, 1.0);

    out->curve = curve;
    for (int i = 0; i < QUADRATURE; i++) {
        double u = low + (high - low) * (i + 0.5) / QUADRATURE;
        out->log_at[i] = curve_log_power(curve, 1.0 - u);
        out->weight[i] = special_beta_density(u, a, b);
        sum += out->weight[i];
    }
    for (int i = 0; i < QUADRATURE; i++)
        out->weight[i] /= sum;
}

static double ordered_rate(const void *levels, double factor)
{
    const struct levels *l = levels;
    double log_factor = log(factor), sum = 0.0;

    for (int i = 0; i < QUADRATURE; i++)
        sum += l->weight[i] * curve_tail(l->curve, log_factor + l->log_at[i]);
    return sum;
}

static double cfar_noise_ordered(const struct cfar_noise_curve *curve, size_t n, size_t k,
                                 double rate, double guess)
{
    struct levels levels;

    ordered_levels(&levels, curve, n, k);
    return invert(ordered_rate, &levels, rate, MOST_FACTOR, guess);
}

/* The mean over the level that has a part `rank` of the noise below it. */
static double cfar_noise_over_rank(double shape, double rank)
{
    return shape / invert(tail, &shape, 1.0 - rank, MOST_POWER, 0.0);
}

/* log mean - mean log of a gamma distribution. */
static double deficit(const void *state, double shape)
{
    (void)state;
    return log(shape) - special_digamma(shape);
}

/* The shape, 0.2 to 64, from powers over their levels x[n] > 0: by the mean of their
 * logarithms log_x[n], which a few objects do not change. */
static double cfar_noise_shape(const float *x, const double *log_x, size_t n)
{
    double sum = 0.0, logs = 0.0;

    for (size_t i = 0; i < n; i++) {
        sum += (double)x[i];
        logs += log_x[i];
    }
    double shape =
        invert(deficit, NULL, log(sum / (double)n) - logs / (double)n, MAX_SHAPE, 0.0);
    return fmax(shape, MIN_SHAPE);
}

static int falling(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;

    return (x < y) - (x > y);
}

static bool is_heavy(const float *x, size_t n, const double promised[2])
{
    static const double rates[2] = {1e-2, 1e-3};
    size_t above[2] = {0, 0};
    bool heavy = false;

    for (size_t i = 0; i < n; i++)
        for (int r = 0; r < 2; r++)
            above[r] += (double)x[i] > promised[r];
    for (int r = 0; r < 2; r++) {
        double expected = rates[r] * (double)n;
        heavy = heavy ||
                fabs((double)above[r] - expected) > CHANCE * sqrt(expected) + 2.0;
    }
    return heavy;
}

/* The `most` highest of x[n] > 0, n > most, the highest first.  Few are wanted of many:
 * only these are sorted. */
static void take_highest(const float *x, size_t n, float *out, size_t most)
{
    float least = rank_smallest(x, n, n - most + 1);
    size_t above = 0;

    for (size_t i = 0; i < n; i++)
        if (x[i] > least)
            out[above++] = x[i];
    qsort(out, above, sizeof *out, falling);
    while (above < most) /* those that are alike */
        out[above++] = least;
}

/* Is the tail of x[n] another than the factors at 1e-2 and 1e-3 promise?  Then it is
 * fitted to top[], the highest of them.  Too few of them: it is not. */
static void cfar_noise_fit_tail(struct cfar_noise *out, const float *x, size_t n,
                                const double promised[2], float top[TAIL + 1])
{
    double mean = 0.0, weighted = 0.0;

    out->heavy = false;
    if ((double)n * TAIL_PART < TAIL || !is_heavy(x, n, promised))
        return;
    take_highest(x, n, top, TAIL + 1);
    if (!(top[0] > top[TAIL]))
        return;
    for (size_t i = 0; i < TAIL; i++) {
        double over = (double)top[i] - (double)top[TAIL];
        mean += over / TAIL;
        weighted += over / TAIL * (double)i / (TAIL - 1);
    }
    double spread = fmax(mean - 2.0 * weighted, 1e-6 * mean); /* 0: all alike */
    out->heavy = true;
    out->part = (double)TAIL / (double)n;
    out->from = (double)top[TAIL];
    out->index = 2.0 - mean / spread;
    out->scale = 2.0 * mean * weighted / spread;
}

/* The factor at a rate of a tail that was fitted to x[n]. */
static double cfar_noise_tail_factor(const struct cfar_noise *noise, const float *x,
                                     size_t n, double rate)
{
    if (rate >= noise->part)
        return (double)rank_smallest(x, n, n - (size_t)(rate * (double)n));
    double over = log(noise->part / rate);
    double far = fabs(noise->index) < 1e-6 ? over
                                           : expm1(noise->index * over) / noise->index;

    return fmin(noise->from + noise->scale * far, MOST_FACTOR);
}

#define SHAPE_STEP                                                                       \
    0.05 /* of its logarithm: what is nearer is the same, factors are dear */

#define RARE     1e-4 /* how bright noise is that often, or as often as it may alarm... */
#define FAR_OVER 2.0  /* ...times this is too bright for noise */

enum { MEMORY = 32768, PARTS = 2, ROWS_AT_ONCE = 8 };

/* Row by row of a cell's training cells, those over a limit: rows are short and of odd
 * lengths, so that whole vectors are read, of which only the cells between count. */
struct rows {
    size_t n;                /* whole vectors */
    int32_t *whole, *beside; /* [n] of rows without and with guard cells: 1 counts */
    int32_t *over;           /* [n] */
};

struct cfar {
    struct cfar_config cfg;
    struct cfar_noise noise;
    struct cfar_noise_curve curve; /* of ordered ones */
    double over_level;             /* the noise's mean */
    double tail_factor;            /* of a heavy tail... */
    double no_noise;               /* ...and what is brighter was no noise */
    size_t most, known;            /* training cells; of a factor that was asked for */
    double *factor;                /* [most + 1]; NAN: not known yet */
    double promised[2], rare;      /* factors at 1e-2, 1e-3, RARE; of the shape */
    float *sample;                 /* [most], and a vector to write beyond */
    struct cfar_config thin;       /* of every pitch-th cell, which trains on these... */
    size_t n_thin, n_sums;
    float *thin_image; /* [pitch of each axis][n_thin], and what rows read beyond: an
                        * image; 0: not imaged */
    uint32_t *imaged;  /* [pitch of each axis][n_sums], of it */
    struct rows rows;
    float *ratio; /* [MEMORY] newest powers over their levels, of noise mostly */
    double *log_ratio;
    size_t n_ratios, next_ratio, images;
};

static bool is_valid(const struct cfar_config *c)
{
    bool ok = c->false_alarm_rate >= 1e-12 && c->false_alarm_rate <= 0.5;

    ok = ok && (c->kind == CFAR_AVERAGING ||
                (c->kind == CFAR_ORDERED && c->rank > 0.0 && c->rank < 1.0));
    for (int a = 0; a < 3; a++)
        ok = ok && c->n[a] && c->pitch[a] && c->guard[a] < c->n[a] + c->pitch[a] &&
             c->training[a] <= 1024;
    return ok;
}

/* Cells on either side along an axis, the guard's among them. */
static size_t reach(const struct cfar_config *c, int axis)
{
    return c->n[axis] == 1 ? 0 : c->guard[axis] / c->pitch[axis] + c->training[axis];
}

static void set_shape(struct cfar *c, double shape)
{
    c->noise.shape = shape;
    if (c->cfg.kind == CFAR_ORDERED)
        cfar_noise_curve(&c->curve, shape);
    c->over_level = c->cfg.kind == CFAR_ORDERED ? cfar_noise_over_rank(shape, c->cfg.rank)
                                                : 1.0;
    for (size_t n = 0; n <= c->most; n++)
        c->factor[n] = NAN;
    c->promised[0] = c->promised[1] = c->rare = NAN;
}

/* The same of every pitch-th cell: their training cells lie side by side. */
static struct cfar_config thinned(const struct cfar_config *cfg)
{
    struct cfar_config thin = *cfg;

    for (int a = 0; a < 3; a++) {
        thin.n[a] = (cfg->n[a] + cfg->pitch[a] - 1) / cfg->pitch[a];
        thin.guard[a] = cfg->guard[a] / cfg->pitch[a];
        thin.pitch[a] = 1;
    }
    return thin;
}

int cfar_create(struct cfar **out, const struct cfar_config *cfg)
{
    size_t most = 1;

    if (!is_valid(cfg))
        return -EINVAL;
    for (int a = 0; a < 3; a++)
        most *= 2 * reach(cfg, a) + 1;
    if (most <= CFAR_MIN_TRAINING)
        return -EINVAL;
    struct cfar *c = calloc(1, sizeof *c);
    if (!c)
        return -ENOMEM;
    *c = (struct cfar){.cfg = *cfg, .most = most, .thin = thinned(cfg)};
    c->n_thin = c->thin.n[0] * c->thin.n[1] * c->thin.n[2];
    size_t n_images = cfg->pitch[0] * cfg->pitch[1] * cfg->pitch[2];
    c->factor = malloc((most + 1) * sizeof *c->factor);
    c->sample = malloc((most + VECTOR_LANES) * sizeof *c->sample);
    c->n_sums = (c->thin.n[0] + 1) * (c->thin.n[1] + 1) * (c->thin.n[2] + 1);
    c->rows.n = 2 * reach(cfg, 0) / VECTOR_LANES * VECTOR_LANES + VECTOR_LANES;
    c->thin_image = calloc(n_images * c->n_thin + c->rows.n, sizeof *c->thin_image);
    c->imaged = calloc(n_images * c->n_sums, sizeof *c->imaged);
    c->rows.whole = calloc(3 * c->rows.n, sizeof *c->rows.whole);
    c->ratio = malloc(MEMORY * sizeof *c->ratio);
    c->log_ratio = malloc(MEMORY * sizeof *c->log_ratio);
    if (!c->factor || !c->sample || !c->thin_image || !c->imaged || !c->rows.whole ||
        !c->ratio || !c->log_ratio) {
        cfar_destroy(c);
        return -ENOMEM;
    }
    c->rows.beside = c->rows.whole + c->rows.n;
    c->rows.over = c->rows.beside + c->rows.n;
    set_shape(c, 1.0);
    c->no_noise = INFINITY;
    *out = c;
    return 0;
}

static size_t rank_of(const struct cfar *c, size_t n)
{
    size_t k = (size_t)ceil(c->cfg.rank * (double)n);

    return k < 1 ? 1 : k > n ? n : k;
}

static double factor_at_rate(const struct cfar *c, size_t n, double rate, double guess)
{
    return c->cfg.kind == CFAR_ORDERED
               ? cfar_noise_ordered(&c->curve, n, rank_of(c, n), rate, guess)
               : cfar_noise_averaging(c->noise.shape, n, rate);
}

double cfar_factor(struct cfar *c, size_t n)
{
    /* Of what is rarer than one of all that was seen, the seen says little. */
    if (c->noise.heavy && c->cfg.false_alarm_rate * (double)c->n_ratios >= 1.0)
        return c->tail_factor;
    if (n > c->most)
        n = c->most;
    if (isnan(c->factor[n]))
        c->factor[n] = factor_at_rate(c, n, c->cfg.false_alarm_rate, c->factor[c->known]);
    c->known = n;
    return c->noise.heavy ? fmax(c->factor[n], c->tail_factor) : c->factor[n];
}

/* row[first], row[first + step]... row[last] to out, and whole vectors where they are
 * there to be read; returns how many. */
VECTOR_INLINE size_t take_run(float *out, const float *row, ptrdiff_t first,
                              ptrdiff_t last, ptrdiff_t step, const float *end)
{
    size_t n = last < first ? 0 : (size_t)((last - first) / step) + 1;
    size_t whole = (n + VECTOR_LANES - 1) / VECTOR_LANES * VECTOR_LANES;

    row += first;
    if (step == 1 && (size_t)(end - row) >= whole)
        for (size_t i = 0; i < whole; i++)
            out[i] = row[i];
    else
        for (size_t i = 0; i < n; i++)
            out[i] = row[(ptrdiff_t)i * step];
    return n;
}

struct window { /* of a cell: its training cells, guard and itself, in cells from it */
    ptrdiff_t first[3], last[3], guard[3], stride[3];
};

VECTOR_INLINE struct window window_of(const struct cfar_config *g, const size_t at[3])
{
    struct window w = {.stride = {1, 1, 1}};

    for (int a = 0; a < 3; a++) {
        ptrdiff_t far = (ptrdiff_t)reach(g, a), step = (ptrdiff_t)g->pitch[a];
        ptrdiff_t below = (ptrdiff_t)at[a] / step;
        ptrdiff_t above = (ptrdiff_t)(g->n[a] - 1 - at[a]) / step;
        w.first[a] = -step * (below < far ? below : far);
        w.last[a] = step * (above < far ? above : far);
        w.guard[a] = (ptrdiff_t)g->guard[a] / step * step;
        w.stride[a] = a ? w.stride[a - 1] * (ptrdiff_t)g->n[a - 1] : 1;
    }
    return w;
}

VECTOR_INLINE void place_of(const struct cfar_config *g, size_t cell, size_t at[3])
{
    at[0] = cell % g->n[0];
    at[1] = cell / g->n[0] % g->n[1];
    at[2] = cell / (g->n[0] * g->n[1]);
}

struct count {
    size_t taken, imaged;
};

/* The training cells of a cell to sample, those that nothing was imaged in as 0. */
VECTOR_CLONES
static struct count train(const struct cfar_config *g, const float *image, size_t cell,
                          float *restrict sample)
{
    const ptrdiff_t *step = (const ptrdiff_t *)g->pitch;
    const float *end = image + g->n[0] * g->n[1] * g->n[2];
    size_t at[3], n = 0;
    int32_t imaged = 0;

    place_of(g, cell, at);
    struct window w = window_of(g, at);
    for (ptrdiff_t z = w.first[2]; z <= w.last[2]; z += step[2])
        for (ptrdiff_t y = w.first[1]; y <= w.last[1]; y += step[1]) {
            bool guarded = labs(y) <= w.guard[1] && labs(z) <= w.guard[2];
            const float *row = image +
                               ((ptrdiff_t)cell + z * w.stride[2] + y * w.stride[1]);
            ptrdiff_t left = guarded ? -w.guard[0] - step[0] : w.last[0];
            n += take_run(sample + n, row, w.first[0], left, step[0], end);
            if (guarded)
                n += take_run(sample + n, row, w.guard[0] + step[0], w.last[0], step[0],
                              end);
        }
    for (size_t i = 0; i < n; i++)
        imaged += sample[i] > 0.0f;
    return (struct count){n, (size_t)imaged};
}

/* How many cells were imaged before each corner of the cells of a thin image, along all
 * axes: [nz + 1][ny + 1][nx + 1], of which the first ones stay 0. */
static void sum_imaged(const struct cfar_config *g, const float *image, uint32_t *sums)
{
    const size_t *n = g->n;
    size_t row = n[0] + 1, plane = row * (n[1] + 1);

    for (size_t z = 0; z < n[2]; z++)
        for (size_t y = 0; y < n[1]; y++) {
            uint32_t *to = sums + (z + 1) * plane + (y + 1) * row + 1, along = 0;
            const uint32_t *beside = to - row, *below = to - plane;
            const uint32_t *beside_below = below - row;
            for (size_t x = 0; x < n[0]; x++) {
                along += *image++ > 0.0f;
                to[x] = along + beside[x] + below[x] - beside_below[x];
            }
        }
}

/* Of first..last on each axis, in cells from one of them. */
static size_t imaged_in(const struct cfar_config *g, const uint32_t *sums,
                        const size_t at[3], const ptrdiff_t first[3],
                        const ptrdiff_t last[3])
{
    size_t row = g->n[0] + 1, plane = row * (g->n[1] + 1);
    uint32_t sum = 0;

    for (int corner = 0; corner < 8; corner++) {
        size_t to[3];
        for (int a = 0; a < 3; a++)
            to[a] = at[a] + (size_t)(corner >> a & 1 ? last[a] + 1 : first[a]);
        uint32_t before = sums[to[2] * plane + to[1] * row + to[0]];
        bool added = (corner == 7 || corner == 1 || corner == 2 || corner == 4);
        sum = added ? sum + before : sum - before;
    }
    return sum;
}

/* Training cells of a thin image that were imaged. */
static size_t count_imaged(const struct cfar_config *g, const uint32_t *sums,
                           const size_t at[3])
{
    struct window w = window_of(g, at);
    ptrdiff_t first[3], last[3];

    for (int a = 0; a < 3; a++) {
        first[a] = w.first[a] > -w.guard[a] ? w.first[a] : -w.guard[a];
        last[a] = w.last[a] < w.guard[a] ? w.last[a] : w.guard[a];
    }
    return imaged_in(g, sums, at, w.first, w.last) - imaged_in(g, sums, at, first, last);
}

VECTOR_INLINE void lay_rows(const struct rows *r, const struct window *w)
{
    int32_t first = (int32_t)w->first[0], last = (int32_t)w->last[0];
    int32_t guard = (int32_t)w->guard[0];

    for (int32_t i = 0; i < (int32_t)r->n; i++) {
        int32_t x = first + i, in = x <= last;
        r->whole[i] = in;
        r->beside[i] = in & ((x < -guard) | (x > guard));
        r->over[i] = 0;
    }
}

VECTOR_INLINE void add_over(size_t n, const int32_t *restrict counts,
                            const float *restrict row, float limit,
                            int32_t *restrict over)
{
    for (size_t i = 0; i < n; i++)
        over[i] += counts[i] & (row[i] > limit);
}

VECTOR_INLINE size_t sum_of(size_t n, const int32_t *x)
{
    int32_t sum = 0;

    for (size_t i = 0; i < n; i++)
        sum += x[i];
    return (size_t)sum;
}

/* Are more than `most` of a cell's training cells over a limit? */
VECTOR_CLONES
static bool are_over(const struct cfar_config *g, const struct rows *r,
                     const float *image, const size_t at[3], float limit, size_t most)
{
    struct window w = window_of(g, at);
    size_t n = (size_t)(w.last[0] - w.first[0]) / VECTOR_LANES * VECTOR_LANES +
               VECTOR_LANES;

    lay_rows(r, &w);
    for (ptrdiff_t z = w.first[2]; z <= w.last[2]; z++) {
        for (ptrdiff_t y = w.first[1]; y <= w.last[1]; y++) {
            bool guarded = labs(y) <= w.guard[1] && labs(z) <= w.guard[2];
            add_over(n, guarded ? r->beside : r->whole,
                     image + ((ptrdiff_t)at[0] + w.first[0] +
                              ((ptrdiff_t)at[1] + y) * w.stride[1] +
                              ((ptrdiff_t)at[2] + z) * w.stride[2]),
                     limit, r->over);
        }
        if (z % ROWS_AT_ONCE == 0 && sum_of(n, r->over) > most)
            return true;
    }
    return sum_of(n, r->over) > most;
}

static double level_of(struct cfar *c, struct count n)
{
    double sum = 0.0;

    if (c->cfg.kind == CFAR_ORDERED)
        return (double)rank_smallest(c->sample, n.taken,
                                     n.taken - n.imaged + rank_of(c, n.imaged));
    for (size_t i = 0; i < n.taken; i++)
        sum += (double)c->sample[i];
    return sum / (double)n.imaged;
}

struct cfar_level cfar_at(struct cfar *c, const float *image, size_t cell)
{
    struct cfar_level out = {0.0, INFINITY};
    struct count n = train(&c->cfg, image, cell, c->sample);

    if (n.imaged < CFAR_MIN_TRAINING)
        return out;
    double level = level_of(c, n);
    out.noise = level * c->over_level;
    out.threshold = level * cfar_factor(c, n.imaged);
    return out;
}

/* Every pitch-th cell of an image, from one of the first ones on. */
static void thin_out(struct cfar *c, const float *image, const size_t from[3])
{
    const size_t *n = c->cfg.n, *pitch = c->cfg.pitch;
    size_t part = from[0] + pitch[0] * (from[1] + pitch[1] * from[2]);
    float *out = c->thin_image + part * c->n_thin;

    for (size_t z = from[2], i = 0; z < n[2]; z += pitch[2], i++)
        for (size_t y = from[1], j = 0; y < n[1]; y += pitch[1], j++) {
            const float *row = image + (z * n[1] + y) * n[0];
            float *to = out + (i * c->thin.n[1] + j) * c->thin.n[0];
            for (size_t x = from[0]; x < n[0]; x += pitch[0])
                *to++ = row[x];
        }
}

void cfar_look(struct cfar *c, const float *image)
{
    const size_t *pitch = c->cfg.pitch;

    for (size_t z = 0; z < pitch[2]; z++)
        for (size_t y = 0; y < pitch[1]; y++)
            for (size_t x = 0; x < pitch[0]; x++) {
                size_t part = x + pitch[0] * (y + pitch[1] * z);
                thin_out(c, image, (const size_t[]){x, y, z});
                sum_imaged(&c->thin, c->thin_image + part * c->n_thin,
                           c->imaged + part * c->n_sums);
            }
}

/* The highest level that a cell stands out of. */
static float limit_of(double cell, double factor)
{
    float limit = (float)(cell / factor);

    while ((double)limit * factor >= cell && limit > 0.0f)
        limit = nextafterf(limit, 0.0f);
    while ((double)nextafterf(limit, INFINITY) * factor < cell)
        limit = nextafterf(limit, INFINITY);
    return limit;
}

/* Without sorting: the k-th smallest is low enough when k of them are. */
bool cfar_stands_out(struct cfar *c, const float *image, size_t cell)
{
    double value = (double)image[cell];
    size_t at[3], part = 0;

    if (c->cfg.kind != CFAR_ORDERED)
        return value > cfar_at(c, image, cell).threshold;
    place_of(&c->cfg, cell, at);
    for (int a = 2; a >= 0; a--) {
        part = part * c->cfg.pitch[a] + at[a] % c->cfg.pitch[a];
        at[a] /= c->cfg.pitch[a];
    }
    size_t n = count_imaged(&c->thin, c->imaged + part * c->n_sums, at);
    if (n < CFAR_MIN_TRAINING)
        return false;
    return !are_over(&c->thin, &c->rows, c->thin_image + part * c->n_thin, at,
                     limit_of(value, cfar_factor(c, n)), n - rank_of(c, n));
}

/* What is far over all noise is not learnt from, as far as noise is known: after the
 * first image.  A limit at the threshold itself would cut off the tail that the threshold
 * is learnt from, image by image. */
static void remember(struct cfar *c, size_t cell)
{
    struct count n = train(&c->thin, c->thin_image, cell, c->sample);
    double level = n.imaged < CFAR_MIN_TRAINING ? 0.0 : level_of(c, n);
    float ratio = level > 0.0 ? (float)((double)c->thin_image[cell] / level) : 0.0f;

    if (!(ratio > 0.0f && isfinite(ratio)) ||
        (c->images > 1 && (double)ratio > c->no_noise))
        return;
    c->ratio[c->next_ratio] = ratio;
    c->log_ratio[c->next_ratio] = log((double)ratio);
    c->next_ratio = (c->next_ratio + 1) % MEMORY;
    c->n_ratios += c->n_ratios < MEMORY;
}

static void remember_image(struct cfar *c, const float *image)
{
    size_t n = c->n_thin, part = c->images++;

    thin_out(c, image, (const size_t[]){0, 0, 0});
    for (size_t cell = 0; cell < n; cell++)
        if (part == 0 || cell % PARTS == part % PARTS)
            remember(c, cell);
}

/* They change with the shape alone. */
static void know_factors(struct cfar *c, double rare)
{
    if (!isnan(c->rare))
        return;
    c->promised[0] = factor_at_rate(c, c->most, 1e-2, 0.0);
    c->promised[1] = factor_at_rate(c, c->most, 1e-3, 0.0);
    c->rare = factor_at_rate(c, c->most, rare, 0.0);
}

void cfar_learn(struct cfar *c, const float *image)
{
    double rare = fmin(c->cfg.false_alarm_rate, RARE);
    float top[TAIL + 1];

    remember_image(c, image);
    if (c->n_ratios < CFAR_MIN_TRAINING)
        return;
    double shape = cfar_noise_shape(c->ratio, c->log_ratio, c->n_ratios);
    if (fabs(log(shape / c->noise.shape)) >= SHAPE_STEP)
        set_shape(c, shape);
    know_factors(c, rare);
    cfar_noise_fit_tail(&c->noise, c->ratio, c->n_ratios, c->promised, top);
    c->no_noise = c->rare;
    if (c->noise.heavy) {
        c->tail_factor = cfar_noise_tail_factor(&c->noise, c->ratio, c->n_ratios,
                                                c->cfg.false_alarm_rate);
        c->no_noise = cfar_noise_tail_factor(&c->noise, c->ratio, c->n_ratios, rare);
    }
    c->no_noise *= FAR_OVER;
}

bool cfar_has_learnt(const struct cfar *c)
{
    return c->images > 0;
}

const struct cfar_noise *cfar_noise(const struct cfar *c)
{
    return &c->noise;
}

void cfar_destroy(struct cfar *c)
{
    if (!c)
        return;
    free(c->factor);
    free(c->sample);
    free(c->ratio);
    free(c->thin_image);
    free(c->imaged);
    free(c->rows.whole);
    free(c->log_ratio);
    free(c);
}
