/* recon/inverse/sparse_solver.h -- the few complex amplitudes x that explain data y,
 *
 *   minimise 1/2 |K x - y|^2 + sum of lambda w |x|,
 *
 * with weights w that are made smaller where something stands, in rounds (Candes 2008).
 * While there are many points, FISTA (Beck 2009) with restarts (O'Donoghue 2015) drops
 * those that stay 0; when few are left, coordinate descent on their Gram matrix (Wu 2008)
 * goes on to the end, some 1000 times as fast. */
#ifndef ANLOS_RECON_INVERSE_SPARSE_SOLVER_H
#define ANLOS_RECON_INVERSE_SPARSE_SOLVER_H

#include "recon/inverse/sparse_operator.h"

struct sparse_solver_config {
    struct sparse_operator *model; /* not owned */
    size_t max_points;
    double l1;         /* lambda over the largest of |K' y| */
    double tolerance;  /* relative change that ends a round */
    size_t iterations; /* at most, of each kind and round */
};

struct sparse_result {
    size_t iterations; /* of all rounds and kinds */
    double change;     /* by the last one, relative */
    bool converged;    /* the last round has */
};

struct sparse_solver;

/* 0, -ENOMEM. */
int sparse_solver_create(struct sparse_solver **out,
                         const struct sparse_solver_config *cfg);

/* For the n points and the data that the operator holds; leaves it with fewer points.
 * Returns how many are left, of which some can be 0: which [] their numbers 0..n-1,
 * rising, and x [] re im. */
size_t sparse_solver_run(struct sparse_solver *s, size_t n, const size_t **which,
                         const float **x, struct sparse_result *result);
void sparse_solver_destroy(struct sparse_solver *s);

#endif
