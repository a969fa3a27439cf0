/* SPDX-License-Identifier: MIT */
/* tests/dsp/echo.h -- echoes from the formula, in double, at any delay. */
#ifndef ANLOS_TESTS_DSP_ECHO_H
#define ANLOS_TESTS_DSP_ECHO_H

#include <complex.h>
#include <math.h>
#include <stddef.h>

struct sweep {
    double rate_hz, f0_hz, f1_hz, duration_s, phase_rad;
};

/* x[n] += gain * chirp(t - start_s), where the chirp is. */
static inline void echo_add(const struct sweep *s, float *x, size_t n, double start_s,
                            double gain)
{
    for (size_t i = 0; i < n; i++) {
        double t = (double)i / s->rate_hz - start_s;
        double k = (s->f1_hz - s->f0_hz) / s->duration_s;
        if (t > -1e-9 && t < s->duration_s - 1e-9)
            x[i] += (float)(gain * cos(2.0 * M_PI * (s->f0_hz * t + 0.5 * k * t * t) +
                                       s->phase_rad));
    }
}

/* The same as a converter with an ideal filter records it: the sampled chirp, delayed by
 * a fraction of a sample with nothing aliased.  Costs n times the chirp's samples. */
static inline void echo_add_filtered(const struct sweep *s, float *x, size_t n,
                                     double start_s, double gain)
{
    double start = start_s * s->rate_hz, whole = floor(start), part = start - whole;
    double k = (s->f1_hz - s->f0_hz) / s->duration_s;
    long m = lround(s->duration_s * s->rate_hz);

    for (long j = 0; j < m; j++) {
        double t = (double)j / s->rate_hz;
        double chirp = cos(2.0 * M_PI * (s->f0_hz * t + 0.5 * k * t * t) + s->phase_rad);
        for (long i = 0; i < (long)n; i++) { /* sinc(i - j - start) */
            long d = i - j - (long)whole;
            double sinc = part < 1e-9 ? (d == 0 ? 1.0 : 0.0)
                                      : (d % 2 ? -1.0 : 1.0) * sin(-M_PI * part) /
                                            (M_PI * ((double)d - part));
            x[i] += (float)(gain * chirp * sinc);
        }
    }
}

/* What a whitened band under a Hann window gives at t for a unit echo of delay tau: the
 * window's transform sin(pi x) / (pi x (1 - x^2)), x = B (t - tau), around mid-band. */
static inline double complex hann_pulse(double low_hz, double high_hz, double t)
{
    double x = (high_hz - low_hz) * t, y;

    if (fabs(x) < 1e-9)
        y = 1.0;
    else if (fabs(fabs(x) - 1.0) < 1e-9)
        y = 0.5;
    else
        y = sin(M_PI * x) / (M_PI * x * (1.0 - x * x));
    return y * cexp(2.0 * M_PI * I * 0.5 * (low_hz + high_hz) * t);
}

#endif
