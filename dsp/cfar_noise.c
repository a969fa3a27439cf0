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
#define TAIL_PART   0.05
#define CHANCE      4.0 /* standard deviations of a count */
#define MIN_TAIL    50  /* powers to fit it to */

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
    double shape, at[QUADRATURE], weight[QUADRATURE];
};

static void ordered_levels(struct levels *out, double shape, size_t n, size_t k)
{
    double a = (double)k, b = (double)(n + 1) - a, sum = 0.0;
    double sigma = sqrt(a * b / (a + b + 1.0)) / (a + b), middle = a / (a + b);
    double low = fmax(middle - 8.0 * sigma, 0.0), high = fmin(middle + 8.0 * sigma, 1.0);

    out->shape = shape;
    for (int i = 0; i < QUADRATURE; i++) {
        double u = low + (high - low) * (i + 0.5) / QUADRATURE;
        out->at[i] = invert(tail, &shape, 1.0 - u, MOST_POWER);
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
        sum += l->weight[i] * tail(&l->shape, factor * l->at[i]);
    return sum;
}

double cfar_noise_ordered(double shape, size_t n, size_t k, double rate)
{
    struct levels levels;

    ordered_levels(&levels, shape, n, k);
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
        heavy = heavy || (double)above > expected + CHANCE * sqrt(expected) + 2.0;
    }
    return heavy;
}

void cfar_noise_fit_tail(struct cfar_noise *out, float *x, size_t n,
                         const double promised[2])
{
    size_t k = (size_t)(TAIL_PART * (double)n);
    double first = 0.0, second = 0.0;

    out->heavy = false;
    if (k < MIN_TAIL)
        return;
    qsort(x, n, sizeof *x, falling);
    if (!is_heavy(x, n, promised))
        return;
    for (size_t i = 0; i < k; i++) {
        double over = log((double)x[i] / (double)x[k]);
        first += over / (double)k;
        second += over * over / (double)k;
    }
    double negative = 1.0 - 0.5 / fmax(1.0 - first * first / second, 1e-6);
    out->heavy = true;
    out->part = (double)k / (double)n;
    out->from = (double)x[k];
    out->index = first + negative;
    out->scale = out->from * first * (1.0 - fmin(negative, 0.0));
}

double cfar_noise_heavy(const struct cfar_noise *noise, double rate)
{
    double over = log(fmax(noise->part / rate, 1.0));
    double far = fabs(noise->index) < 1e-6 ? over
                                           : expm1(noise->index * over) / noise->index;

    return fmin(noise->from + noise->scale * far, MOST_FACTOR);
}
