/* SPDX-License-Identifier: MIT */
#include "dsp/rank.h"

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "dsp/vector.h"

/* Of floats that are 0 or more. */
typedef int32_t bits __attribute__((may_alias));

VECTOR_CLONES
static void find_range(const bits *x, size_t n, int32_t *low, int32_t *high)
{
    int32_t least = INT32_MAX, most = 0;

    for (size_t i = 0; i < n; i++) {
        least = x[i] < least ? x[i] : least;
        most = x[i] > most ? x[i] : most;
    }
    *low = least;
    *high = most;
}

VECTOR_CLONES
static size_t count_up_to(const bits *x, size_t n, int32_t limit)
{
    int32_t count = 0;

    for (size_t i = 0; i < n; i++)
        count += x[i] <= limit;
    return (size_t)count;
}

VECTOR_CLONES
static int32_t most_up_to(const bits *x, size_t n, int32_t limit)
{
    int32_t most = 0;

    for (size_t i = 0; i < n; i++) {
        int32_t this = x[i] <= limit ? x[i] : 0;
        most = this > most ? this : most;
    }
    return most;
}

/* Where it lies when they are spread evenly; less than high. */
static int32_t between(int32_t low, int32_t high, size_t k, size_t n)
{
    return low + (int32_t)((double)(high - low) * (double)(k - 1) / (double)n);
}

float rank_smallest(const float *x, size_t n, size_t k)
{
    const bits *b = (const bits *)x;
    int32_t low, high;
    float out;

    find_range(b, n, &low, &high);
    size_t below = 0, up_to = n;             /* low; high */
    for (int turn = 0; low < high; turn++) { /* what is sought is in low..high */
        int32_t middle = turn % 2 ? low + (high - low) / 2
                                  : between(low, high, k - below, up_to - below);
        size_t count = count_up_to(b, n, middle);
        if (count == k) {
            low = high = most_up_to(b, n, middle);
        } else if (count > k) {
            high = middle;
            up_to = count;
        } else {
            low = middle + 1;
            below = count;
        }
    }
    memcpy(&out, &low, sizeof out);
    return out;
}

double rank_double(double *x, size_t n, size_t k)
{
    ptrdiff_t low = 0, high = (ptrdiff_t)n - 1, at = (ptrdiff_t)k - 1;

    while (low < high) {
        double pivot = x[at];
        ptrdiff_t i = low, j = high;
        while (i <= j) {
            while (x[i] < pivot)
                i++;
            while (pivot < x[j])
                j--;
            if (i > j)
                break;
            double swapped = x[i];
            x[i++] = x[j];
            x[j--] = swapped;
        }
        if (j < at)
            low = i;
        if (at < i)
            high = j;
    }
    return x[at];
}

double rank_median(double *x, size_t n)
{
    double lower = -INFINITY;

    if (!n)
        return NAN;
    double upper = rank_double(x, n, n / 2 + 1);
    if (n % 2)
        return upper;
    for (size_t i = 0; i < n / 2; i++)
        lower = fmax(lower, x[i]);
    return 0.5 * (lower + upper);
}
