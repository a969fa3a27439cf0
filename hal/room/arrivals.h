/* SPDX-License-Identifier: MIT */
/* hal/room/arrivals.h -- impulses at any time onto a grid of samples, band-limited. */
#ifndef ANLOS_HAL_ROOM_ARRIVALS_H
#define ANLOS_HAL_ROOM_ARRIVALS_H

#include <stddef.h>

enum { ARRIVALS_TAPS = 12, ARRIVALS_PHASES = 4096 };

struct arrivals {
    float weights[ARRIVALS_PHASES + 1][ARRIVALS_TAPS];
};

/* The table, for signals in the lower half of the grid's band.  free() it; NULL: no
 * memory. */
struct arrivals *arrivals_create(void);

/* Adds an impulse at sample t of h[n]; one that does not fit with its taps is left out.
 */
static inline void arrivals_add(const struct arrivals *a, float *restrict h, size_t n,
                                double t, float amplitude)
{
    const double before = ARRIVALS_TAPS / 2 - 1;
    if (!(t >= before) || t + ARRIVALS_TAPS / 2 >= (double)n)
        return;
    size_t i = (size_t)t;
    const float *w = a->weights[(size_t)((t - (double)i) * ARRIVALS_PHASES + 0.5)];
    h += i - (ARRIVALS_TAPS / 2 - 1);
    for (int k = 0; k < ARRIVALS_TAPS; k++)
        h[k] += amplitude * w[k];
}

#endif
