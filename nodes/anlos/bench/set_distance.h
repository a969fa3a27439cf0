/* nodes/anlos/bench/set_distance.h -- how far a set of reported places is from the set of
 * true ones, in the plane.
 *
 * GOSPA (Rahmathullah, Garcia-Fernandez and Svensson 2017, "Generalized optimal
 * sub-pattern assignment metric", with alpha = 2, Eq. 6): places are assigned to each
 * other where that is cheaper than a cutoff c, what is left over is missed or false,
 *
 *   ( sum over pairs d^p + c^p / 2 (missed + false) )^(1/p)
 *
 * OSPA (Schuhmacher, Vo and Vo 2008, "A consistent metric for performance evaluation of
 * multi-object filters", Eq. 3), n <= m the sizes of the sets:
 *
 *   ( 1/m ( least sum over n pairs min(d, c)^p + c^p (m - n) ) )^(1/p),  0 of empty sets
 */
#ifndef ANLOS_NODES_ANLOS_BENCH_SET_DISTANCE_H
#define ANLOS_NODES_ANLOS_BENCH_SET_DISTANCE_H

#include <stddef.h>

#define BENCH_SET_MAX 64
#define BENCH_NOBODY  ((size_t)-1)

struct bench_set_distance {
    double gospa_m, ospa_m;
    double localisation; /* m^p, the three parts of GOSPA to the power p */
    double missed, false_ones;
    size_t n_missed, n_false;
    size_t match[BENCH_SET_MAX]; /* [n_truth] the index found, or BENCH_NOBODY */
};

/* truth_m [n_truth][2], found_m [n_found][2], each at most BENCH_SET_MAX; cutoff_m > 0,
 * order >= 1. */
void bench_set_distance(struct bench_set_distance *out, const double (*truth_m)[2],
                        size_t n_truth, const double (*found_m)[2], size_t n_found,
                        double cutoff_m, double order);

#endif
