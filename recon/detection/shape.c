/* SPDX-License-Identifier: MIT */
#include "recon/detection/shape.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "recon/inverse/psf.h"

/* A Gaussian image, cut off where its intensity is a quarter, has this variance along
 * each axis over the square of its width there: in two and in three dimensions. */
#define POINT_VARIANCE_2 (0.5379 / (3.3302 * 3.3302))
#define POINT_VARIANCE_3 (0.4633 / (3.3302 * 3.3302))

/* Sizes are over a point's.  A segment as long as a point is wide has 1.65, and is as
 * likely called a point as not; half as long, 1.2. */
#define EVEN_SIZE  1.65
#define SIZE_SIGMA 0.15 /* of the logarithm, for what noise and speckle do */

#define WIDTH_SIGMAS 2.3548 /* psf_axes: widths over the roots of the variances */

static double long_probability(double size)
{
    return 1.0 / (1.0 + exp(-log(fmax(size, 1e-3) / EVEN_SIZE) / SIZE_SIGMA));
}

/* The sizes along the principal axes, longest first; how many axes there are. */
static int sizes(const double variance_m2[6], const double resolution_m[3], double out[3])
{
    static const int element[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    struct psf whitened = {.peak = 1.0};
    double axes[3][3];
    bool counts[3];
    int n = 0;

    for (int a = 0; a < 3; a++) {
        counts[a] = resolution_m[a] > 0.0 && isfinite(resolution_m[a]) &&
                    variance_m2[element[a][a]] > 0.0;
        n += counts[a];
    }
    for (int a = 0; a < 3; a++)
        for (int b = a; b < 3; b++)
            if (counts[a] && counts[b])
                whitened.covariance_m2[element[a][b]] =
                    variance_m2[element[a][b]] / (resolution_m[a] * resolution_m[b]);
    psf_axes(&whitened, out, axes);
    for (int i = 0; i < 3; i++)
        out[i] /= WIDTH_SIGMAS * sqrt(n == 3 ? POINT_VARIANCE_3 : POINT_VARIANCE_2);
    return n;
}

struct shape_guess shape_guess(const double variance_m2[6], const double resolution_m[3])
{
    struct shape_guess best = {SHAPE_UNKNOWN, 0.0};
    double size[3];
    int n = sizes(variance_m2, resolution_m, size);

    if (n < 2)
        return best;
    double longest = long_probability(size[0]), across = long_probability(size[n - 1]);
    const double probability[] = {
        [SHAPE_UNKNOWN] = 0.0,
        [SHAPE_POINT] = 1.0 - longest,
        [SHAPE_PLATE] = longest * (1.0 - across),
        [SHAPE_EXTENDED] = longest * across,
    };
    for (enum shape s = SHAPE_POINT; s <= SHAPE_EXTENDED; s++)
        if (probability[s] > best.probability)
            best = (struct shape_guess){s, probability[s]};
    return best;
}
