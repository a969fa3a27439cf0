/* SPDX-License-Identifier: MIT */
/* dsp/normal_equations.h -- the small symmetric systems of least squares. */
#ifndef ANLOS_DSP_NORMAL_EQUATIONS_H
#define ANLOS_DSP_NORMAL_EQUATIONS_H

#include <stddef.h>

/* Solves a x = b by elimination with diagonal pivots: a is positive (semi)definite.  An
 * unknown of which those before it leave no more than `least` of its own diagonal, >= 0,
 * is not determined: it becomes 0, and the others are solved without it.
 *
 * a [n][n], destroyed; x [n]: b in, the solution out.  Returns how many unknowns were
 * left out; 0: a is positive definite. */
size_t normal_equations_solve(size_t n, double *restrict a, double *restrict x,
                              double least);

#endif
