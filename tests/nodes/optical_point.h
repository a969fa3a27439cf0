/* SPDX-License-Identifier: MIT */
/* tests/nodes/optical_point.h -- counts of an optical scan of one retroreflecting point
 * in closed form. */
#ifndef ANLOS_TESTS_NODES_OPTICAL_POINT_H
#define ANLOS_TESTS_NODES_OPTICAL_POINT_H

#include <math.h>

enum { PLACES = 16, BINS = 300 };

static const double half_side_m = 0.3, bin_s = 16e-12;
static const double at_m[3] = {0.07, -0.11, 0.5}; /* seen from the wall: x right, y up */

/* out [BINS][PLACES][PLACES]: pulses of 60 ps that fade as 1 / r^2, and direct light that
 * dies away.  The file's x and y fall along its indices. */
static inline void optical_point_fill(double *out)
{
    const double light_m_s = 299792458.0, pitch_m = 2.0 * half_side_m / (PLACES - 1);

    for (int i = 0; i < PLACES * PLACES * BINS; i++) {
        double x = half_side_m - (i % PLACES) * pitch_m;
        double y = half_side_m - (i / PLACES % PLACES) * pitch_m;
        int bin = i / (PLACES * PLACES);
        double r = sqrt(pow(x - at_m[0], 2) + pow(y - at_m[1], 2) + at_m[2] * at_m[2]);
        double late_s = bin * bin_s - 2.0 * r / light_m_s;
        out[i] = 200.0 * pow(r, -2.0) * exp(-0.5 * pow(late_s / 25e-12, 2.0)) +
                 5000.0 * exp(-bin / 8.0) + 3.0;
    }
}

#endif
