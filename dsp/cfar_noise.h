/* dsp/cfar_noise.h -- how bright noise gets, for dsp/cfar: powers x over their level.
 * The body is a gamma distribution of some shape.  Clutter has a tail that no such shape
 * has; where more or fewer powers are high than chance allows, they are counted, and the
 * tail beyond the highest of them is a generalised Pareto distribution, fitted by
 * probability-weighted moments (Hosking and Wallis 1987).  These are few on purpose: the
 * tail of single scatterers begins where a hundredth of the powers is left, and a fit to
 * more of them is one to the noise between. */
#ifndef ANLOS_DSP_CFAR_NOISE_H
#define ANLOS_DSP_CFAR_NOISE_H

#include <stdbool.h>
#include <stddef.h>

#define CFAR_NOISE_POINTS 4096 /* factors are right to 1e-3 */

struct cfar_noise {
    double shape; /* of the gamma distribution */
    bool heavy;   /* no shape's: this part of the powers lies over... */
    double part, from, scale, index; /* ...from, and these are its scale and index */
};

/* The tail of a shape as a table, over the logarithm of the power: the factor of an
 * ordered statistic takes thousands of its values. */
struct cfar_noise_curve {
    double log_tail[CFAR_NOISE_POINTS];
};

void cfar_noise_curve(struct cfar_noise_curve *out, double shape);

/* Which part of the noise is brighter than x times its mean. */
double cfar_noise_tail(double shape, double x);

/* The factor over the level that noise of a shape passes at a rate: over the mean of n
 * training cells, or the k-th smallest of them. */
double cfar_noise_averaging(double shape, size_t n, double rate);
double cfar_noise_ordered(const struct cfar_noise_curve *curve, size_t n, size_t k,
                          double rate);

/* The mean over the level that has a part `rank` of the noise below it. */
double cfar_noise_over_rank(double shape, double rank);

/* The shape, 0.2 to 64, from powers over their levels x[n] > 0: by the mean of their
 * logarithms, which a few objects do not change. */
double cfar_noise_shape(const float *x, size_t n);

/* Is the tail of x[n] another than the factors at 1e-2 and 1e-3 promise?  Then it is
 * fitted.  Sorts x, the highest first.  Too few of them: it is not. */
void cfar_noise_fit_tail(struct cfar_noise *out, float *x, size_t n,
                         const double promised[2]);

/* The factor at a rate of a tail that was fitted to x[n], sorted. */
double cfar_noise_tail_factor(const struct cfar_noise *noise, const float *x, size_t n,
                              double rate);

#endif
