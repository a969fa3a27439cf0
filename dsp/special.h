/* SPDX-License-Identifier: MIT */
/* dsp/special.h -- the distributions that false-alarm rates are made of, in double
 * precision (relative errors under 1e-9 where the result is above 1e-290; compared in
 * the tests with their finite sums). */
#ifndef ANLOS_DSP_SPECIAL_H
#define ANLOS_DSP_SPECIAL_H

/* Upper regularised gamma function Q(a, x): the part of a gamma distribution of shape
 * a > 0 and scale 1 that is over x.  1 at x <= 0. */
double special_gamma_q(double a, double x);

/* Lower regularised beta function: the part of a beta distribution of a, b > 0 that is
 * below x, and the part that is over it, each exact where it is small. */
double special_beta_p(double x, double a, double b);
double special_beta_q(double x, double a, double b);

/* The beta distribution's density at 0 < x < 1. */
double special_beta_density(double x, double a, double b);

/* The digamma function at x > 0. */
double special_digamma(double x);

#endif
