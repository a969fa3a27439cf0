#include "nodes/anlos/bench/set_distance.h"

#include <math.h>
#include <stdbool.h>

#include "recon/assignment.h"

_Static_assert(BENCH_SET_MAX <= ASSIGNMENT_ROWS, "");

static double distance_m(const double a[2], const double b[2])
{
    return hypot(a[0] - b[0], a[1] - b[1]);
}

/* The least sum of min(d, c)^p; rows are the smaller set. */
static double assign(const double (*rows)[2], size_t n_rows, const double (*columns)[2],
                     size_t n_columns, double cutoff_m, double order, size_t *column)
{
    double cost[BENCH_SET_MAX * BENCH_SET_MAX];

    for (size_t r = 0; r < n_rows; r++)
        for (size_t c = 0; c < n_columns; c++)
            cost[r * n_columns + c] =
                pow(fmin(distance_m(rows[r], columns[c]), cutoff_m), order);
    return assignment_solve(n_rows, n_columns, cost, column);
}

void bench_set_distance(struct bench_set_distance *out, const double (*truth_m)[2],
                        size_t n_truth, const double (*found_m)[2], size_t n_found,
                        double cutoff_m, double order)
{
    bool fewer_found = n_found < n_truth;
    size_t n = fewer_found ? n_found : n_truth, m = fewer_found ? n_truth : n_found;
    size_t column[ASSIGNMENT_ROWS], n_pairs = 0;
    double full = pow(cutoff_m, order);
    double sum = fewer_found ? assign(found_m, n, truth_m, m, cutoff_m, order, column)
                             : assign(truth_m, n, found_m, m, cutoff_m, order, column);

    *out = (struct bench_set_distance){0};
    for (size_t i = 0; i < n_truth; i++)
        out->match[i] = BENCH_NOBODY;
    for (size_t r = 0; r < n; r++) {
        size_t truth = fewer_found ? column[r] : r, found = fewer_found ? r : column[r];
        double d_m = distance_m(truth_m[truth], found_m[found]);
        if (d_m >= cutoff_m)
            continue;
        out->match[truth] = found;
        out->localisation += pow(d_m, order);
        n_pairs++;
    }
    out->n_missed = n_truth - n_pairs;
    out->n_false = n_found - n_pairs;
    out->missed = 0.5 * full * (double)out->n_missed;
    out->false_ones = 0.5 * full * (double)out->n_false;
    out->gospa_m = pow(out->localisation + out->missed + out->false_ones, 1.0 / order);
    if (m)
        out->ospa_m = pow((sum + full * (double)(m - n)) / (double)m, 1.0 / order);
}
