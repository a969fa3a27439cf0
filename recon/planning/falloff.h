/* SPDX-License-Identifier: MIT */
/* recon/planning/falloff.h -- how received power falls off with distance: a straight line
 * through (log distance, log power), Lindell 2019, section 5 and Fig. 4. */
#ifndef ANLOS_RECON_PLANNING_FALLOFF_H
#define ANLOS_RECON_PLANNING_FALLOFF_H

#include <complex.h>
#include <stddef.h>

#include "dsp/pulse_compress.h"

struct falloff_fit {   /* power = power_at_1 * distance^slope */
    double slope;      /* -2: a mirror, a retroreflector; -4: a small or a rough thing */
    double sigma;      /* of the slope, from the residuals; NaN for two points */
    double power_at_1; /* at 1 m */
    size_t n;          /* points that counted: those above 0 and finite */
};

/* Least squares.  0, -EINVAL (fewer than two different distances). */
int falloff_fit(struct falloff_fit *out, const double *distance_m, const double *power,
                size_t n);

/* The strongest echo of one trace, between samples by a parabola through the logarithm of
 * the power: its delay in s and |trace|^2 there.  0, -ENODATA (silent, or not finite). */
int falloff_peak(const struct trace_format *f, const float complex *trace,
                 double *delay_s, double *power);

#endif
