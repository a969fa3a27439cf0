/* nodes/anlos/bench/poisson.h -- what a count tells of the rate behind it. */
#ifndef ANLOS_NODES_ANLOS_BENCH_POISSON_H
#define ANLOS_NODES_ANLOS_BENCH_POISSON_H

#include <stddef.h>

/* The largest mean with which up to n events still come with a probability of
 * 1 - confidence: the rate is below it, as sure as that (Garwood 1936, one-sided).  Of
 * none at 95 %: 3.0.  0 < confidence < 1. */
double poisson_bound(size_t n, double confidence);

#endif
