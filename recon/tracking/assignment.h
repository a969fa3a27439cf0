/* SPDX-License-Identifier: MIT */
/* recon/tracking/assignment.h -- who belongs to whom at the least total cost: shortest
 * augmenting paths with dual variables (Jonker and Volgenant 1987, "A shortest augmenting
 * path algorithm for dense and sparse linear assignment problems", without its
 * initialising steps). */
#ifndef ANLOS_RECON_TRACKING_ASSIGNMENT_H
#define ANLOS_RECON_TRACKING_ASSIGNMENT_H

#include <stddef.h>

#define ASSIGNMENT_ROWS    64
#define ASSIGNMENT_COLUMNS 128

/* Every row gets a column of its own: column[n_rows].  cost [n_rows][n_columns], finite;
 * n_rows <= ASSIGNMENT_ROWS, n_rows <= n_columns <= ASSIGNMENT_COLUMNS.  Returns the
 * total cost.  O(n_rows^2 n_columns): 64 x 128 takes under a millisecond. */
double assignment_solve(size_t n_rows, size_t n_columns, const double *cost,
                        size_t *column);

#endif
