/* SPDX-License-Identifier: MIT */
#include "dsp/time_zero.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "dsp/rank.h"

#define BIWEIGHT     4.685 /* spreads; 95 % efficient for Gaussian errors */
#define LEAST_SPREAD 2e-7  /* s: arrivals agree no better than they are computed */
#define ITERATIONS   30

static double residual(const struct time_zero *z, const struct time_zero_pair *p)
{
    return p->arrival_s - z->latency_s - p->distance_m / z->speed_m_s;
}

/* Median residual into the latency, where it is asked for; deviations into the spread. */
static void measure_spread(struct time_zero *z, const struct time_zero_pair *pairs,
                           size_t n, double *scratch, bool centre)
{
    size_t m = 0;
    for (size_t i = 0; i < n; i++)
        if (!isnan(pairs[i].arrival_s))
            scratch[m++] = residual(z, &pairs[i]);
    z->n_heard = m;
    if (centre)
        z->latency_s += rank_median(scratch, m);
    m = 0;
    for (size_t i = 0; i < n; i++)
        if (!isnan(pairs[i].arrival_s))
            scratch[m++] = fabs(residual(z, &pairs[i]));
    z->spread_s = 1.4826 * rank_median(scratch, m);
}

static double weight(const struct time_zero *z, const struct time_zero_pair *p)
{
    if (isnan(p->arrival_s))
        return 0.0;
    double x = residual(z, p) / (BIWEIGHT * fmax(z->spread_s, LEAST_SPREAD));
    return fabs(x) < 1.0 ? (1.0 - x * x) * (1.0 - x * x) : 0.0;
}

struct sums {
    double w, d, dd, r, dr; /* weighted sums of 1, distance, residual */
    double rr;
    size_t n_used;
};

static struct sums sum_up(const struct time_zero *z, const struct time_zero_pair *pairs,
                          size_t n)
{
    struct sums s = {0};
    for (size_t i = 0; i < n; i++) {
        double w = weight(z, &pairs[i]), d = pairs[i].distance_m;
        if (!(w > 0.0))
            continue;
        double r = residual(z, &pairs[i]);
        s.w += w;
        s.d += w * d;
        s.dd += w * d * d;
        s.r += w * r;
        s.dr += w * d * r;
        s.rr += w * r * r;
        s.n_used++;
    }
    return s;
}

/* One step of weighted least squares; false: the distances do not tell the speed. */
static bool step(struct time_zero *z, const struct sums *s, bool fit_speed)
{
    double mean = s->d / s->w, across = s->dd / s->w - mean * mean;
    double slope = 0.0;
    if (fit_speed) {
        if (!(across > 1e-12))
            return false;
        slope = (s->dr / s->w - mean * s->r / s->w) / across;
        double slowness = 1.0 / z->speed_m_s + slope;
        if (!(slowness > 0.0))
            return false;
        z->speed_m_s = 1.0 / slowness;
    }
    z->latency_s += s->r / s->w - slope * mean;
    return true;
}

/* Variances of a weighted fit whose weights are the inverse variances up to a factor. */
static void set_sigmas(struct time_zero *z, const struct sums *s, bool fit_speed)
{
    double unknowns = fit_speed ? 2.0 : 1.0;
    double left = (double)s->n_used - unknowns;
    double variance = left > 0.0 ? s->rr / s->w * (double)s->n_used / left : INFINITY;
    double mean = s->d / s->w, across = s->dd / s->w - mean * mean;
    double n = (double)s->n_used;
    z->n_used = s->n_used;
    z->speed_sigma_m_s = 0.0;
    z->latency_sigma_s = sqrt(variance / n);
    if (!fit_speed)
        return;
    double slowness_sigma = sqrt(variance / (n * across));
    z->speed_sigma_m_s = slowness_sigma * z->speed_m_s * z->speed_m_s;
    z->latency_sigma_s = sqrt(variance / n * (1.0 + mean * mean / across));
}

static int fit(struct time_zero *z, const struct time_zero_pair *pairs, size_t n,
               bool fit_speed)
{
    struct sums s = {0};
    double *scratch = malloc((n + 1) * sizeof *scratch);
    int err = 0;
    if (!scratch)
        return -ENOMEM;
    measure_spread(z, pairs, n, scratch, true);
    for (int k = 0; k < ITERATIONS && !err; k++) {
        s = sum_up(z, pairs, n);
        if (s.n_used < (fit_speed ? 3 : 1) || !step(z, &s, fit_speed))
            err = -ENODATA;
        else
            measure_spread(z, pairs, n, scratch, false);
    }
    if (!err) {
        s = sum_up(z, pairs, n);
        set_sigmas(z, &s, fit_speed);
    }
    free(scratch);
    return err;
}

static size_t count_heard(const struct time_zero_pair *pairs, size_t n)
{
    size_t heard = 0;
    for (size_t i = 0; i < n; i++)
        heard += !isnan(pairs[i].arrival_s);
    return heard;
}

int time_zero_fit(struct time_zero *out, const struct time_zero_pair *pairs, size_t n,
                  double speed_m_s)
{
    *out = (struct time_zero){.speed_m_s = speed_m_s};
    return count_heard(pairs, n) ? fit(out, pairs, n, false) : -ENODATA;
}

int time_zero_fit_speed(struct time_zero *out, const struct time_zero_pair *pairs,
                        size_t n, double start_m_s)
{
    *out = (struct time_zero){.speed_m_s = start_m_s};
    return count_heard(pairs, n) >= 3 ? fit(out, pairs, n, true) : -ENODATA;
}
