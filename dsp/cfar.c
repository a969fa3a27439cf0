#include "dsp/cfar.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/rank.h"
#include "dsp/special.h"

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
#define TAIL              64   /* powers to fit it to... */
#define TAIL_PART         0.05 /* ...and not more than this part of all */
#define CHANCE            4.0  /* standard deviations of a count */

/* The tail of a shape as a table, over the logarithm of the power: the factor of an
 * ordered statistic takes thousands of its values. */
struct cfar_noise_curve {
    double log_tail[CFAR_NOISE_POINTS];
};

/* Where a function of positive numbers that falls is `value`: halving always converges,
 * whatever the shape. */
static double invert(double (*falling)(const void *state, double x), const void *state,
                     double value, double most)
{
    double low = log(LEAST), high = log(most);

    for (int i = 0; i < 48; i++) {
        double middle = 0.5 * (low + high);
        if (falling(state, exp(middle)) > value)
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

    return invert(averaging_rate, &mean, rate, MOST_FACTOR);
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
    double sum = 0.0;

    for (int i = 0; i < QUADRATURE; i++)
        sum += l->weight[i] * curve_tail(l->curve, log(factor) + l->log_at[i]);
    return sum;
}

static double cfar_noise_ordered(const struct cfar_noise_curve *curve, size_t n, size_t k,
                                 double rate)
{
    struct levels levels;

    ordered_levels(&levels, curve, n, k);
    return invert(ordered_rate, &levels, rate, MOST_FACTOR);
}

/* The mean over the level that has a part `rank` of the noise below it. */
static double cfar_noise_over_rank(double shape, double rank)
{
    return shape / invert(tail, &shape, 1.0 - rank, MOST_POWER);
}

/* log mean - mean log of a gamma distribution. */
static double deficit(const void *state, double shape)
{
    (void)state;
    return log(shape) - special_digamma(shape);
}

/* The shape, 0.2 to 64, from powers over their levels x[n] > 0: by the mean of their
 * logarithms, which a few objects do not change. */
static double cfar_noise_shape(const float *x, size_t n)
{
    double sum = 0.0, logs = 0.0;

    for (size_t i = 0; i < n; i++) {
        sum += (double)x[i];
        logs += log((double)x[i]);
    }
    double shape =
        invert(deficit, NULL, log(sum / (double)n) - logs / (double)n, MAX_SHAPE);
    return fmax(shape, MIN_SHAPE);
}

static int falling(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;

    return (x < y) - (x > y);
}

/* x falls. */
static bool is_heavy(const float *x, size_t n, const double promised[2])
{
    static const double rates[2] = {1e-2, 1e-3};
    bool heavy = false;

    for (int r = 0; r < 2; r++) {
        double expected = rates[r] * (double)n;
        size_t above = 0;
        while (above < n && (double)x[above] > promised[r])
            above++;
        heavy = heavy || fabs((double)above - expected) > CHANCE * sqrt(expected) + 2.0;
    }
    return heavy;
}

/* Is the tail of x[n] another than the factors at 1e-2 and 1e-3 promise?  Then it is
 * fitted.  Sorts x, the highest first.  Too few of them: it is not. */
static void cfar_noise_fit_tail(struct cfar_noise *out, float *x, size_t n,
                                const double promised[2])
{
    double mean = 0.0, weighted = 0.0;

    out->heavy = false;
    if ((double)n * TAIL_PART < TAIL)
        return;
    qsort(x, n, sizeof *x, falling);
    if (!is_heavy(x, n, promised) || !(x[0] > x[TAIL]))
        return;
    for (size_t i = 0; i < TAIL; i++) {
        double over = (double)x[i] - (double)x[TAIL];
        mean += over / TAIL;
        weighted += over / TAIL * (double)i / (TAIL - 1);
    }
    double spread = fmax(mean - 2.0 * weighted, 1e-6 * mean); /* 0: all alike */
    out->heavy = true;
    out->part = (double)TAIL / (double)n;
    out->from = (double)x[TAIL];
    out->index = 2.0 - mean / spread;
    out->scale = 2.0 * mean * weighted / spread;
}

/* The factor at a rate of a tail that was fitted to x[n], sorted. */
static double cfar_noise_tail_factor(const struct cfar_noise *noise, const float *x,
                                     size_t n, double rate)
{
    if (rate >= noise->part)
        return (double)x[(size_t)(rate * (double)n)];
    double over = log(noise->part / rate);
    double far = fabs(noise->index) < 1e-6 ? over
                                           : expm1(noise->index * over) / noise->index;

    return fmin(noise->from + noise->scale * far, MOST_FACTOR);
}

#define SHAPE_STEP                                                                       \
    0.05 /* of its logarithm: what is nearer is the same, factors are dear */

#define RARE     1e-4 /* how bright noise is that often, or as often as it may alarm... */
#define FAR_OVER 2.0  /* ...times this is too bright for noise */

enum { MEMORY = 32768, PARTS = 2 };

struct cfar {
    struct cfar_config cfg;
    struct cfar_noise noise;
    struct cfar_noise_curve curve; /* of ordered ones */
    double over_level;             /* the noise's mean */
    double tail_factor;            /* of a heavy tail... */
    double no_noise;               /* ...and what is brighter was no noise */
    size_t most;                   /* training cells */
    double *factor;                /* [most + 1]; NAN: not known yet */
    float *sample;                 /* [most] */
    float *ratio;  /* [MEMORY] newest powers over their levels, of noise mostly */
    float *sorted; /* [MEMORY], scratch */
    size_t n_ratios, next_ratio, images;
};

int cfar_kind_from_name(const char *name, enum cfar_kind *out)
{
    static const char *const names[] = {"off", "averaging", "ordered"};

    for (unsigned i = 0; i < sizeof names / sizeof *names; i++) {
        if (strcmp(name, names[i]) == 0) {
            *out = (enum cfar_kind)i;
            return 0;
        }
    }
    return -EINVAL;
}

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
    *c = (struct cfar){.cfg = *cfg, .most = most};
    c->factor = malloc((most + 1) * sizeof *c->factor);
    c->sample = malloc((most + 1) * sizeof *c->sample);
    c->ratio = malloc(MEMORY * sizeof *c->ratio);
    c->sorted = malloc(MEMORY * sizeof *c->sorted);
    if (!c->factor || !c->sample || !c->ratio || !c->sorted) {
        cfar_destroy(c);
        return -ENOMEM;
    }
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

static double factor_at_rate(const struct cfar *c, size_t n, double rate)
{
    return c->cfg.kind == CFAR_ORDERED
               ? cfar_noise_ordered(&c->curve, n, rank_of(c, n), rate)
               : cfar_noise_averaging(c->noise.shape, n, rate);
}

double cfar_factor(const struct cfar *c, size_t n)
{
    if (n > c->most)
        n = c->most;
    if (isnan(c->factor[n]))
        c->factor[n] = factor_at_rate(c, n, c->cfg.false_alarm_rate);
    if (!c->noise.heavy)
        return c->factor[n];
    /* Of what is rarer than one of all that was seen, the seen says little. */
    return c->cfg.false_alarm_rate * (double)c->n_ratios >= 1.0
               ? c->tail_factor
               : fmax(c->factor[n], c->tail_factor);
}

/* The training cells of a cell into c->sample, but for those that nothing was imaged in;
 * returns how many. */
static size_t train(struct cfar *c, const float *image, size_t cell)
{
    const struct cfar_config *g = &c->cfg;
    const ptrdiff_t at[3] = {(ptrdiff_t)(cell % g->n[0]),
                             (ptrdiff_t)(cell / g->n[0] % g->n[1]),
                             (ptrdiff_t)(cell / (g->n[0] * g->n[1]))};
    ptrdiff_t first[3], last[3], step[3], guard[3], stride[3] = {1, 1, 1};
    size_t n = 0;

    for (int a = 0; a < 3; a++) {
        ptrdiff_t far = (ptrdiff_t)(reach(g, a) * g->pitch[a]);
        step[a] = (ptrdiff_t)g->pitch[a];
        guard[a] = (ptrdiff_t)g->guard[a];
        first[a] = -far;
        last[a] = far;
        while (at[a] + first[a] < 0)
            first[a] += step[a];
        while (at[a] + last[a] >= (ptrdiff_t)g->n[a])
            last[a] -= step[a];
        stride[a] = a ? stride[a - 1] * (ptrdiff_t)g->n[a - 1] : 1;
    }
    for (ptrdiff_t z = first[2]; z <= last[2]; z += step[2])
        for (ptrdiff_t y = first[1]; y <= last[1]; y += step[1]) {
            bool guarded = labs(y) <= guard[1] && labs(z) <= guard[2];
            const float *row = image + ((ptrdiff_t)cell + z * stride[2] + y * stride[1]);
            for (ptrdiff_t x = first[0]; x <= last[0]; x += step[0]) {
                c->sample[n] = row[x];
                n += row[x] > 0.0f && !(guarded && labs(x) <= guard[0]);
            }
        }
    return n;
}

static double level_of(struct cfar *c, size_t n)
{
    double sum = 0.0;

    if (c->cfg.kind == CFAR_ORDERED)
        return (double)rank_smallest(c->sample, n, rank_of(c, n));
    for (size_t i = 0; i < n; i++)
        sum += (double)c->sample[i];
    return sum / (double)n;
}

struct cfar_level cfar_at(struct cfar *c, const float *image, size_t cell)
{
    struct cfar_level out = {0.0, INFINITY};
    size_t n = train(c, image, cell);

    if (n < CFAR_MIN_TRAINING)
        return out;
    double level = level_of(c, n);
    out.noise = level * c->over_level;
    out.threshold = level * cfar_factor(c, n);
    return out;
}

/* What is far over all noise is not learnt from, as far as noise is known: after the
 * first image.  A limit at the threshold itself would cut off the tail that the threshold
 * is learnt from, image by image. */
static void remember(struct cfar *c, const float *image, size_t cell)
{
    size_t n = train(c, image, cell);
    double level = n < CFAR_MIN_TRAINING ? 0.0 : level_of(c, n);
    float ratio = level > 0.0 ? (float)((double)image[cell] / level) : 0.0f;

    if (!(ratio > 0.0f && isfinite(ratio)) ||
        (c->images > 1 && (double)ratio > c->no_noise))
        return;
    c->ratio[c->next_ratio] = ratio;
    c->next_ratio = (c->next_ratio + 1) % MEMORY;
    c->n_ratios += c->n_ratios < MEMORY;
}

void cfar_learn(struct cfar *c, const float *image)
{
    const struct cfar_config *g = &c->cfg;
    size_t number = 0, part = c->images++;

    for (size_t z = 0; z < g->n[2]; z += g->pitch[2])
        for (size_t y = 0; y < g->n[1]; y += g->pitch[1])
            for (size_t x = 0; x < g->n[0]; x += g->pitch[0])
                if (part == 0 || number++ % PARTS == part % PARTS)
                    remember(c, image, (z * g->n[1] + y) * g->n[0] + x);
    if (c->n_ratios < CFAR_MIN_TRAINING)
        return;
    double shape = cfar_noise_shape(c->ratio, c->n_ratios);
    if (fabs(log(shape / c->noise.shape)) >= SHAPE_STEP)
        set_shape(c, shape);
    const double promised[2] = {factor_at_rate(c, c->most, 1e-2),
                                factor_at_rate(c, c->most, 1e-3)};
    memcpy(c->sorted, c->ratio, c->n_ratios * sizeof *c->ratio);
    cfar_noise_fit_tail(&c->noise, c->sorted, c->n_ratios, promised);
    double rare = fmin(c->cfg.false_alarm_rate, RARE);
    c->no_noise = factor_at_rate(c, c->most, rare);
    if (c->noise.heavy) {
        c->tail_factor = cfar_noise_tail_factor(&c->noise, c->sorted, c->n_ratios,
                                                c->cfg.false_alarm_rate);
        c->no_noise = cfar_noise_tail_factor(&c->noise, c->sorted, c->n_ratios, rare);
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
    free(c->sorted);
    free(c);
}
