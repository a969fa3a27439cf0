/* nodes/anlos/mat_truncation.h -- MATLAB v5 files that end too early: libmatio reads what
 * is missing as zeros, without an error, so their elements are walked over here
 * (MAT-File Format, MathWorks R2023a, 1-9). */
#ifndef ANLOS_NODES_ANLOS_MAT_TRUNCATION_H
#define ANLOS_NODES_ANLOS_MAT_TRUNCATION_H

#include <stdbool.h>

/* Does the last element reach beyond the file's end?  Of files that are not v5 nothing is
 * said: false.  Does not move the file's position. */
bool mat_truncation_check(int fd);

#endif
