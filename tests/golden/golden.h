/* SPDX-License-Identifier: MIT */
/* tests/golden/golden.h -- the golden vectors of tests/golden/vectors, which
 * tests/golden/generate makes: named tables of numbers. */
#ifndef ANLOS_TESTS_GOLDEN_GOLDEN_H
#define ANLOS_TESTS_GOLDEN_GOLDEN_H

#include <stddef.h>

struct golden;

/* "fk_near_0.3_m"; fails the test when there is no such file or it is damaged. */
struct golden *golden_open(const char *name);

/* [*rows][*columns], owned by the golden; either may be NULL.  Fails the test when there
 * is no such table. */
const double *golden_table(const struct golden *g, const char *name, size_t *rows,
                           size_t *columns);
void golden_close(struct golden *g);

#endif
