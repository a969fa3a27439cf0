/* SPDX-License-Identifier: MIT */
#include "recon/planning/falloff.h"

#include <errno.h>
#include <math.h>

int falloff_fit(struct falloff_fit *out, const double *distance_m, const double *power,
                size_t n)
{
    double sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0, residual2 = 0.0;
    size_t used = 0;
    for (int pass = 0; pass < 3; pass++) {
        for (size_t i = 0; i < n; i++) {
            double x = log(distance_m[i]), y = log(power[i]);
            if (!isfinite(x) || !isfinite(y))
                continue;
            if (pass == 0) {
                sx += x;
                sy += y;
                used++;
            } else if (pass == 1) {
                sxx += (x - sx) * (x - sx);
                sxy += (x - sx) * (y - sy);
            } else {
                double r = y - sy - sxy / sxx * (x - sx);
                residual2 += r * r;
            }
        }
        if (pass == 0 && used) { /* means from here on */
            sx /= (double)used;
            sy /= (double)used;
        }
        if (pass == 1 && !(sxx > 1e-12))
            return -EINVAL;
    }
    out->slope = sxy / sxx;
    out->power_at_1 = exp(sy - out->slope * sx);
    out->sigma = used > 2 ? sqrt(residual2 / (double)(used - 2) / sxx) : NAN;
    out->n = used;
    return 0;
}

int falloff_peak(const struct trace_format *f, const float complex *trace,
                 double *delay_s, double *power)
{
    size_t best = 0;
    double most = 0.0;
    for (size_t n = 0; n < f->n_samples; n++) {
        double re = (double)crealf(trace[n]), im = (double)cimagf(trace[n]);
        double p = re * re + im * im;
        if (!isfinite(p))
            return -ENODATA;
        if (p > most) {
            most = p;
            best = n;
        }
    }
    if (!(most > 0.0))
        return -ENODATA;
    double at = (double)best;
    *power = most;
    if (best > 0 && best + 1 < f->n_samples) {
        double a = 2.0 * log(fmax((double)cabsf(trace[best - 1]), 1e-30)), b = log(most);
        double c = 2.0 * log(fmax((double)cabsf(trace[best + 1]), 1e-30));
        double bend = a - 2.0 * b + c;
        double shift = bend < 0.0 ? 0.5 * (a - c) / bend : 0.0;
        at += shift;
        *power = exp(b - 0.25 * (a - c) * shift);
    }
    *delay_s = f->t0_s + at / f->rate_hz;
    return 0;
}
