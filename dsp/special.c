/* SPDX-License-Identifier: MIT */
#include "dsp/special.h"

#include <math.h>
#include <stdbool.h>

#define CLOSE 1e-16
#define TINY  1e-300
#define TERMS 100000

/* lgamma writes a global. */
static double log_gamma(double x)
{
    int sign;

    return lgamma_r(x, &sign);
}

/* P(a, x) by its series, for x < a + 1 (Abramowitz and Stegun 6.5.29). */
static double gamma_series(double a, double x)
{
    double term = 1.0 / a, sum = term;

    for (int n = 1; n < TERMS && term > CLOSE * sum; n++) {
        term *= x / (a + n);
        sum += term;
    }
    return sum * exp(a * log(x) - x - log_gamma(a));
}

static double away_from_zero(double x)
{
    return fabs(x) < TINY ? TINY : x;
}

/* A continued fraction's step (Lentz 1976): false when it has converged. */
static bool lentz(double *f, double *c, double *d, double numerator, double denominator)
{
    *d = 1.0 / away_from_zero(denominator + numerator * *d);
    *c = away_from_zero(denominator + numerator / *c);
    *f *= *c * *d;
    return fabs(*c * *d - 1.0) > CLOSE * 2.0;
}

/* Q(a, x) for x >= a + 1 (Abramowitz and Stegun 6.5.31, even part). */
static double gamma_fraction(double a, double x)
{
    double b = x + 1.0 - a, d = 1.0 / b, c = 1.0 / TINY, f = d;

    for (int n = 1; n < TERMS; n++) {
        b += 2.0;
        if (!lentz(&f, &c, &d, n * (a - n), b))
            break;
    }
    return f * exp(a * log(x) - x - log_gamma(a));
}

double special_gamma_q(double a, double x)
{
    if (!(x > 0.0))
        return 1.0;
    return x < a + 1.0 ? 1.0 - gamma_series(a, x) : gamma_fraction(a, x);
}

/* log gamma(z) beyond (z - 1/2) log z - z + log(2 pi) / 2, for z >= 10 (Abramowitz and
 * Stegun 6.1.41). */
static double stirling_rest(double z)
{
    double y = 1.0 / (z * z);

    return (1.0 / 12 -
            y * (1.0 / 360 -
                 y * (1.0 / 1260 -
                      y * (1.0 / 1680 - y * (1.0 / 1188 - y * 691.0 / 360360))))) /
           z;
}

/* -log B(a, b).  Of a large shape log gamma(a + b) - log gamma(b) is taken in one piece:
 * at 1e4 each is 1e5, of which the last bit alone is 1e-11. */
static double log_inverse_beta(double a, double b)
{
    double small = a < b ? a : b, large = a < b ? b : a;

    if (large < 10.0)
        return log_gamma(a + b) - log_gamma(a) - log_gamma(b);
    return (large - 0.5) * log1p(small / large) + small * (log(a + b) - 1.0) +
           stirling_rest(a + b) - stirling_rest(large) - log_gamma(small);
}

/* x^a (1 - x)^b / B(a, b) */
static double beta_front(double x, double a, double b)
{
    return exp(log_inverse_beta(a, b) + a * log(x) + b * log1p(-x));
}

/* For x < (a + 1) / (a + b + 2) (Abramowitz and Stegun 26.5.8). */
static double beta_fraction(double x, double a, double b)
{
    double c = 1.0, d = 1.0 / away_from_zero(1.0 - (a + b) * x / (a + 1.0)), f = d;

    for (int m = 1; m < TERMS; m++) {
        double even = m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m));
        double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0));
        lentz(&f, &c, &d, even, 1.0);
        if (!lentz(&f, &c, &d, odd, 1.0))
            break;
    }
    return f * beta_front(x, a, b) / a;
}

double special_beta_p(double x, double a, double b)
{
    if (!(x > 0.0))
        return 0.0;
    if (x >= 1.0)
        return 1.0;
    return x < (a + 1.0) / (a + b + 2.0) ? beta_fraction(x, a, b)
                                         : 1.0 - beta_fraction(1.0 - x, b, a);
}

double special_beta_q(double x, double a, double b)
{
    if (!(x > 0.0))
        return 1.0;
    if (x >= 1.0)
        return 0.0;
    return x < (a + 1.0) / (a + b + 2.0) ? 1.0 - beta_fraction(x, a, b)
                                         : beta_fraction(1.0 - x, b, a);
}

double special_beta_density(double x, double a, double b)
{
    return x > 0.0 && x < 1.0 ? beta_front(x, a, b) / (x * (1.0 - x)) : 0.0;
}

/* Recurrence up to where the asymptotic series has converged (Abramowitz and Stegun
 * 6.3.5 and 6.3.18). */
double special_digamma(double x)
{
    double sum = 0.0;

    for (; x < 10.0; x += 1.0)
        sum -= 1.0 / x;
    double y = 1.0 / (x * x);
    return sum + log(x) - 0.5 / x -
           y * (1.0 / 12 -
                y * (1.0 / 120 -
                     y * (1.0 / 252 -
                          y * (1.0 / 240 - y * (1.0 / 132 - y * 691.0 / 32760)))));
}
