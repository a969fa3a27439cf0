#include "nodes/anlos/bench/poisson.h"

#include <math.h>

/* The probability of up to n events; by logarithms, which many events do not overflow. */
static double up_to(size_t n, double mean)
{
    double sum = 0.0;

    for (size_t k = 0; k <= n; k++)
        sum += exp((double)k * log(mean) - mean - lgamma((double)k + 1.0));
    return sum;
}

double poisson_bound(size_t n, double confidence)
{
    double low = 1e-12, high = (double)n + 20.0 * sqrt((double)n + 1.0) + 50.0;

    for (int i = 0; i < 60; i++) {
        double middle = 0.5 * (low + high);
        if (up_to(n, middle) > 1.0 - confidence)
            low = middle;
        else
            high = middle;
    }
    return high;
}
