/* SPDX-License-Identifier: MIT */
#include "recon/lines.h"

#include <stdlib.h>

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

size_t lines_merge(double *values, size_t n, double tolerance)
{
    qsort(values, n, sizeof *values, by_value);
    size_t lines = 0;
    for (size_t i = 0; i < n;) {
        size_t first = i;
        double sum = 0.0;
        while (i < n && values[i] - values[first] <= tolerance)
            sum += values[i++];
        values[lines++] = sum / (double)(i - first);
    }
    return lines;
}

uint32_t lines_nearest(const double *lines, size_t n, double value)
{
    size_t low = 0, high = n;
    while (high - low > 1) {
        size_t middle = (low + high) / 2;
        if (value < 0.5 * (lines[middle - 1] + lines[middle]))
            high = middle;
        else
            low = middle;
    }
    return (uint32_t)low;
}
