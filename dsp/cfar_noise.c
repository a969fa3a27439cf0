#include "dsp/cfar_noise.h"

#include <gsl/gsl_cdf.h>
#include <gsl/gsl_randist.h>
#include <gsl/gsl_sf_psi.h>
#include <math.h>
#include <stdlib.h>

#define MIN_SHAPE   0.2
#define MAX_SHAPE   64.0
#define QUADRATURE  96 /* points of the integral over an ordered statistic */
#define LEAST       1e-12
#define MOST_FACTOR 1e9
#define MOST_POWER  1e4
#define LEAST_TAIL  1e-300
#define TAIL        64   /* powers to fit it to... */
#define TAIL_PART   0.05 /* ...and not more than this part of all */
#define CHANCE      4.0  /* standard deviations of a count */

/* Where a function of positive numbers that falls is `value`: GSL's own inverses do not
 * converge for every shape. */
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
    return gsl_cdf_gamma_Q(x, *(const double *)shape, 1.0);
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

    return gsl_cdf_beta_Q(factor / (m->n + factor), m->shape, m->n * m->shape);
}

double cfar_noise_averaging(double shape, size_t n, double rate)
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

void cfar_noise_curve(struct cfar_noise_curve *out, double shape)
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
        out->weight[i] = gsl_ran_beta_pdf(u, a, b);
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

double cfar_noise_ordered(const struct cfar_noise_curve *curve, size_t n, size_t k,
                          double rate)
{
    struct levels levels;

    ordered_levels(&levels, curve, n, k);
    return invert(ordered_rate, &levels, rate, MOST_FACTOR);
}

double cfar_noise_over_rank(double shape, double rank)
{
    return shape / invert(tail, &shape, 1.0 - rank, MOST_POWER);
}

/* log mean - mean log of a gamma distribution. */
static double deficit(const void *state, double shape)
{
    (void)state;
    return log(shape) - gsl_sf_psi(shape);
}

double cfar_noise_shape(const float *x, size_t n)
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

void cfar_noise_fit_tail(struct cfar_noise *out, float *x, size_t n,
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

double cfar_noise_tail_factor(const struct cfar_noise *noise, const float *x, size_t n,
                              double rate)
{
    if (rate >= noise->part)
        return (double)x[(size_t)(rate * (double)n)];
    double over = log(noise->part / rate);
    double far = fabs(noise->index) < 1e-6 ? over
                                           : expm1(noise->index * over) / noise->index;

    return fmin(noise->from + noise->scale * far, MOST_FACTOR);
}
