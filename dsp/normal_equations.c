/* SPDX-License-Identifier: MIT */
#include "dsp/normal_equations.h"

#include <math.h>

/* Column p below the diagonal becomes 0. */
static void eliminate(size_t n, size_t p, double *restrict a, double *restrict x)
{
    for (size_t r = p + 1; r < n; r++) {
        double f = a[r * n + p] / a[p * n + p];
        for (size_t c = p + 1; c < n; c++)
            a[r * n + c] -= f * a[p * n + c];
        x[r] -= f * x[p];
    }
}

size_t normal_equations_solve(size_t n, double *restrict a, double *restrict x,
                              double least)
{
    size_t left_out = 0;
    for (size_t p = 0; p < n; p++) {
        double own = a[p * n + p]; /* with what the pivots before took off it */
        for (size_t q = 0; q < p; q++)
            own += a[q * n + p] * a[q * n + p] / a[q * n + q];
        if (!(a[p * n + p] > least * own)) {
            a[p * n + p] = INFINITY; /* divided by it, everything else is 0 */
            left_out++;
        }
        eliminate(n, p, a, x);
    }
    for (size_t p = n; p-- > 0;) {
        for (size_t c = p + 1; c < n; c++)
            x[p] -= a[p * n + c] * x[c];
        x[p] /= a[p * n + p];
    }
    return left_out;
}
