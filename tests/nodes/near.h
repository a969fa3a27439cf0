/* SPDX-License-Identifier: MIT */
/* tests/nodes/near.h -- comparing doubles; cmocka 1.1.5 only knows floats.  Include after
 * cmocka.h. */
#ifndef ANLOS_TESTS_NODES_NEAR_H
#define ANLOS_TESTS_NODES_NEAR_H

#include <math.h>

#define assert_near(is, expected, tolerance)                                             \
    expect_near(is, expected, tolerance, #is, __FILE__, __LINE__)

static inline void expect_near(double is, double expected, double tolerance,
                               const char *what, const char *file, int line)
{
    if (fabs(is - expected) <= tolerance) /* false for NaN */
        return;
    print_error("%s = %.12g, expected %.12g +- %g\n", what, is, expected, tolerance);
    _fail(file, line);
}

#endif
