/* SPDX-License-Identifier: MIT */
/* tests/dsp/near.h -- comparing doubles: cmocka's assert_float_equal rounds to float,
 * takes the tolerance as a part of the number, too, and passes what is none. */
#ifndef ANLOS_TESTS_DSP_NEAR_H
#define ANLOS_TESTS_DSP_NEAR_H

#include <math.h>

#define assert_near(a, b, tolerance) assert_true(fabs((a) - (b)) <= (tolerance))

#endif
