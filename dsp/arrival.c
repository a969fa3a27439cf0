/* SPDX-License-Identifier: MIT */
#include "dsp/arrival.h"

#include <math.h>

#include "dsp/rank.h"

struct span { /* of samples that have neighbours */
    size_t first, end;
};

static struct span span_of(const struct trace_format *f, double from_s, double to_s)
{
    double first = ceil((from_s - f->t0_s) * f->rate_hz);
    double last = floor((to_s - f->t0_s) * f->rate_hz);
    struct span s = {1, f->n_samples > 1 ? f->n_samples - 1 : 1};
    if (!(last >= first))
        return (struct span){1, 1};
    if (first > 1.0)
        s.first = first < (double)s.end ? (size_t)first : s.end;
    if (last + 1.0 < (double)s.end)
        s.end = last + 1.0 > 1.0 ? (size_t)last + 1 : 1;
    return s;
}

static bool is_peak(const float complex *y, size_t i)
{
    float a = cabsf(y[i]);
    return a > 0.0f && a >= cabsf(y[i - 1]) && a > cabsf(y[i + 1]);
}

/* Around sample i, which is a peak.  The carrier turns the sample's phase to the peak's;
 * the baseband's own phase is taken along a parabola too. */
static void refine(const struct trace_format *f, const float complex *y, size_t i,
                   struct arrival *out)
{
    double complex before = y[i - 1], at = y[i], after = y[i + 1];
    double l[3] = {log(cabs(before)), log(cabs(at)), log(cabs(after))};
    double bend = l[0] - 2.0 * l[1] + l[2], x = 0.0;
    if (isfinite(bend) && bend < 0.0)
        x = 0.5 * (l[0] - l[2]) / bend;
    out->time_s = f->t0_s + ((double)i + x) / f->rate_hz;
    double complex baseband = at + 0.5 * x * (after - before) +
                              0.5 * x * x * (before - 2.0 * at + after);
    double turns = f->carrier_hz * out->time_s;
    out->peak = baseband * cexp(2.0 * M_PI * I * (turns - floor(turns)));
}

bool arrival_strongest(const struct trace_format *f, const float complex *y,
                       double from_s, double to_s, struct arrival *out)
{
    struct span s = span_of(f, from_s, to_s);
    size_t best = 0;
    for (size_t i = s.first; i < s.end; i++)
        if (is_peak(y, i) && (!best || cabsf(y[i]) > cabsf(y[best])))
            best = i;
    if (best)
        refine(f, y, best, out);
    return best > 0;
}

bool arrival_first(const struct trace_format *f, const float complex *y, double from_s,
                   double to_s, double least, struct arrival *out)
{
    struct span s = span_of(f, from_s, to_s);
    for (size_t i = s.first; i < s.end; i++) {
        if (!is_peak(y, i) || (double)cabsf(y[i]) < least)
            continue;
        refine(f, y, i, out);
        return true;
    }
    return false;
}

double arrival_power(const struct trace_format *f, const float complex *y, double from_s,
                     double to_s)
{
    double first = fmax(ceil((from_s - f->t0_s) * f->rate_hz), 0.0);
    double end = fmin(floor((to_s - f->t0_s) * f->rate_hz) + 1.0, (double)f->n_samples);
    double most = 0.0;

    for (size_t i = (size_t)fmin(first, (double)f->n_samples); (double)i < end; i++) {
        double re = crealf(y[i]), im = cimagf(y[i]);
        most = fmax(most, re * re + im * im);
    }
    return most;
}

double arrival_floor(const struct trace_format *f, const float complex *y, float *scratch)
{
    if (!f->n_samples)
        return 0.0;
    for (size_t i = 0; i < f->n_samples; i++)
        scratch[i] = cabsf(y[i]);
    return (double)rank_smallest(scratch, f->n_samples, f->n_samples / 2 + 1);
}
