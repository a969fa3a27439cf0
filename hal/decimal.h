/* SPDX-License-Identifier: MIT */
/* hal/decimal.h -- numbers as text that is short and loses nothing. */
#ifndef ANLOS_HAL_DECIMAL_H
#define ANLOS_HAL_DECIMAL_H

enum { DECIMAL_SIZE = 32 };

/* Writes the shortest decimal that reads back to the same double: 0.01, not
 * 0.010000000000000000208.  Returns out. */
const char *decimal_print(double x, char out[DECIMAL_SIZE]);

#endif
