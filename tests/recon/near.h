/* SPDX-License-Identifier: MIT */
/* tests/recon/near.h -- cmocka with what it needs before it, and numbers that are near.
 */
#ifndef ANLOS_TESTS_RECON_NEAR_H
#define ANLOS_TESTS_RECON_NEAR_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

/* Fails on NaN too. */
#define assert_near(actual, expected, tolerance)                                         \
    near_check(actual, expected, tolerance, #actual, __FILE__, __LINE__)
#define assert_below(actual, limit) near_below(actual, limit, #actual, __FILE__, __LINE__)

static inline void near_check(double actual, double expected, double tolerance,
                              const char *what, const char *file, int line)
{
    if (fabs(actual - expected) <= tolerance)
        return;
    print_error("%s is %.9g, not within %.3g of %.9g\n", what, actual, tolerance,
                expected);
    _fail(file, line);
}

static inline void near_below(double actual, double limit, const char *what,
                              const char *file, int line)
{
    if (actual < limit)
        return;
    print_error("%s is %.9g, not below %.9g\n", what, actual, limit);
    _fail(file, line);
}

#endif
