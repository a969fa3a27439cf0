/* SPDX-License-Identifier: MIT */
/* tests/worse.h -- the largest of many errors.  fmax passes over what is no number, and a
 * test that asks only that the largest be small would pass with it. */
#ifndef ANLOS_TESTS_WORSE_H
#define ANLOS_TESTS_WORSE_H

#include <math.h>

/* The larger one; once an error was not finite, NaN, which is below no limit and above
 * none. */
static inline double worse(double worst, double error)
{
    if (!isfinite(error))
        return NAN;
    return error > worst ? error : worst;
}

#endif
