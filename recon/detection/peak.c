/* SPDX-License-Identifier: MIT */
#include "recon/detection/peak.h"

#include <math.h>
#include <string.h>

#include "recon/inverse/psf.h"
#include "recon/inverse/symmetric.h"

/* -6 dB (a factor of 4) width of a Gaussian over its sigma. */
#define WIDTH_SIGMAS 3.3302
#define STEEP        1e-3 /* of the peak's intensity, in the next voxel */
#define LEAST_BEND   1e-6 /* below it rounding decides where the top is */
#define FLAT_GRIDS   3.0 /* a peak that is wider than so many grids is flat in this one */

struct surroundings {
    const struct grid *grid;
    const float *v;
    size_t at[3];
    double peak;
};

static double intensity(const struct surroundings *s, const int d[3])
{
    size_t x = s->at[0] + (size_t)d[0], y = s->at[1] + (size_t)d[1];
    size_t z = s->at[2] + (size_t)d[2];
    return s->v[(z * s->grid->n[1] + y) * s->grid->n[0] + x];
}

/* The logarithm, over the peak's; or what is the same to the second order around an even
 * top and stands emptiness, twice the amplitude. */
static double level(const struct surroundings *s, bool steep, const int d[3])
{
    double ratio = intensity(s, d) / s->peak;

    return steep ? 2.0 * sqrt(ratio) : log(fmax(ratio, 1e-37));
}

static bool is_edge(const struct surroundings *s, int axis, int far)
{
    return far ? s->at[axis] + 1 == s->grid->n[axis] : s->at[axis] == 0;
}

static bool is_empty(const struct surroundings *s, int axis, int far)
{
    int d[3] = {0};

    d[axis] = far ? 1 : -1;
    return intensity(s, d) <= 0.0;
}

/* From the voxel to the grid's end. */
static bool is_all_empty(const struct surroundings *s, int axis, int far)
{
    size_t left = far ? s->grid->n[axis] - 1 - s->at[axis] : s->at[axis];
    int d[3] = {0};

    for (int i = 1; (size_t)i <= left; i++) {
        d[axis] = far ? i : -i;
        if (intensity(s, d) > 0.0)
            return false;
    }
    return true;
}

static bool is_unseen(const struct surroundings *s, int axis, int far,
                      enum peak_zero zero)
{
    return zero == PEAK_ZERO_UNSEEN ||
           (zero == PEAK_ZERO_CLIPPED && is_all_empty(s, axis, far));
}

enum known { FITTED, TO_A_VOXEL, NOT_AT_ALL };

static enum known examine(const struct surroundings *s, int axis, enum peak_zero zero,
                          unsigned *at_border)
{
    enum known known = FITTED;

    if (s->grid->n[axis] == 1)
        return NOT_AT_ALL;
    for (int far = 0; far <= 1; far++) {
        bool edge = is_edge(s, axis, far);
        bool empty = !edge && is_empty(s, axis, far);
        if (edge || (empty && is_unseen(s, axis, far, zero))) {
            *at_border |= PEAK_BORDER(axis, far);
            known = NOT_AT_ALL;
        } else if (empty && known == FITTED) {
            known = TO_A_VOXEL;
        }
    }
    return known;
}

/* Of those that the paraboloid is fitted to. */
static bool is_steep(const struct surroundings *s, const enum known known[3])
{
    for (int a = 0; a < 3; a++)
        for (int b = a; b < 3; b++)
            for (int q = 0; q < 4; q++) {
                int d[3] = {0};
                if (known[a] == NOT_AT_ALL || known[b] == NOT_AT_ALL)
                    continue;
                d[a] = q & 1 ? 1 : -1;
                d[b] = q & 2 ? 1 : -1;
                if (intensity(s, d) < STEEP * s->peak)
                    return true;
            }
    return false;
}

static double mixed_slope(const struct surroundings *s, bool steep, int a, int b)
{
    int d[4][3] = {{0}};
    static const int sign[4][2] = {{1, 1}, {-1, -1}, {1, -1}, {-1, 1}};
    double sum = 0.0;
    for (int q = 0; q < 4; q++) {
        d[q][a] = sign[q][0];
        d[q][b] = sign[q][1];
        sum += (q < 2 ? 0.25 : -0.25) * level(s, steep, d[q]);
    }
    return sum;
}

/* Of a symmetric matrix as xx xy xz yy yz zz. */
static const int element[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};

/* Of the logarithm of the intensity, in voxels; curvature is counted downwards.  Axes
 * that are not fitted have none. */
static void measure_bend(const struct surroundings *s, const enum known known[3],
                         bool steep, double slope[3], double curvature[6])
{
    static const int here[3] = {0, 0, 0};

    memset(slope, 0, 3 * sizeof *slope);
    memset(curvature, 0, 6 * sizeof *curvature);
    for (int a = 0; a < 3; a++) {
        if (known[a] == NOT_AT_ALL)
            continue;
        int up[3] = {0}, down[3] = {0};
        up[a] = 1;
        down[a] = -1;
        double high = level(s, steep, up), low = level(s, steep, down);
        curvature[element[a][a]] = 2.0 * level(s, steep, here) - high - low;
        slope[a] = 0.5 * (high - low);
        for (int b = a + 1; b < 3; b++)
            if (known[b] != NOT_AT_ALL)
                curvature[element[a][b]] = -mixed_slope(s, steep, a, b);
    }
}

/* From one side of a box to the other along a direction of length 1. */
static double across(const double box[3], const double axis[3])
{
    double length = INFINITY;

    for (int a = 0; a < 3; a++)
        if (fabs(axis[a]) > 1e-9)
            length = fmin(length, box[a] / fabs(axis[a]));
    return length;
}

static void add_variance(const struct grid *g, const double axis[3], double variance,
                         double covariance_m2[6])
{
    for (int a = 0; a < 3; a++)
        for (int b = a; b < 3; b++)
            covariance_m2[element[a][b]] += variance * axis[a] * g->step_m[a] * axis[b] *
                                            g->step_m[b];
}

/* Somewhere in the body, if there is one: uniformly distributed over its length. */
static void add_unknown(const struct grid *g, const double axis[3],
                        const double body_m[3], double covariance_m2[6])
{
    double length = 0.0, along_m[3], sigma_m = PEAK_UNKNOWN_M;

    for (int a = 0; a < 3; a++)
        length = hypot(length, axis[a] * g->step_m[a]);
    for (int a = 0; a < 3; a++)
        along_m[a] = axis[a] * g->step_m[a] / length;
    if (body_m)
        sigma_m = fmin(across(body_m, along_m) / sqrt(12.0), PEAK_UNKNOWN_M);
    add_variance(g, axis, sigma_m * sigma_m / (length * length), covariance_m2);
}

/* Is it one of the axes that are not fitted?  The curvature has no elements there, so
 * that its eigenvectors lie along them exactly. */
static bool is_unfitted(const enum known known[3], const double axis[3])
{
    for (int a = 0; a < 3; a++)
        if (known[a] == NOT_AT_ALL && fabs(axis[a]) > 0.5)
            return true;
    return false;
}

/* A point's image is tilted towards the array: the top lies where all slopes vanish
 * together, not axis by axis; but by axes where there is no top. */
static void find_top(const struct surroundings *s, const enum known known[3],
                     double shift[3])
{
    double slope[3], curvature[6], inverse[6] = {0};

    measure_bend(s, known, false, slope, curvature);
    for (int a = 0; a < 3; a++) {
        if (curvature[element[a][a]] > LEAST_BEND)
            continue;
        slope[a] = 0.0;
        for (int b = 0; b < 3; b++)
            curvature[element[a][b]] = a == b;
    }
    if (!psf_invert(curvature, inverse))
        for (int a = 0; a < 3; a++)
            inverse[element[a][a]] = 1.0 / curvature[element[a][a]];
    for (int a = 0; a < 3; a++) {
        shift[a] = 0.0;
        for (int b = 0; b < 3; b++)
            shift[a] += inverse[element[a][b]] * slope[b];
    }
}

static void spread(const struct grid *g, const enum known known[3], const double bend[3],
                   const double axes[3][3], double snr, const double body_m[3],
                   double covariance_m2[6])
{
    const double voxels[3] = {(double)g->n[0], (double)g->n[1], (double)g->n[2]};

    for (int i = 0; i < 3; i++) {
        bool unfitted = is_unfitted(known, axes[i]);
        double least = WIDTH_SIGMAS / (FLAT_GRIDS * across(voxels, axes[i]));
        if (!unfitted && bend[i] > fmax(LEAST_BEND, least * least))
            add_variance(g, axes[i], 1.0 / (fmax(snr, 1.0) * bend[i]), covariance_m2);
        else
            add_unknown(g, axes[i], unfitted ? NULL : body_m, covariance_m2);
    }
    for (int a = 0; a < 3; a++) /* anywhere in the voxel */
        if (known[a] == TO_A_VOXEL)
            covariance_m2[element[a][a]] += g->step_m[a] * g->step_m[a] / 12.0;
}

static double width_m(const struct grid *g, int axis, enum known known, double bend)
{
    double length_m = g->step_m[axis] * (double)g->n[axis];

    if (known == NOT_AT_ALL || bend <= 0.0)
        return length_m;
    return fmin(g->step_m[axis] * WIDTH_SIGMAS / sqrt(bend), length_m);
}

void peak_fit(const struct grid *g, const float *v, size_t voxel, double snr,
              enum peak_zero zero, const double body_m[3], struct peak_fit *out)
{
    struct surroundings s = {.grid = g, .v = v};
    enum known known[3];
    double slope[3], curvature[6], bend[3], axes[3][3], shift[3], longest = 1.0;

    *out = (struct peak_fit){.at_border = 0};
    grid_place(g, voxel, s.at);
    s.peak = fmax(v[voxel], 1e-37);
    for (int a = 0; a < 3; a++)
        known[a] = examine(&s, a, zero, &out->at_border);
    if (out->at_border)
        snr = 1.0;
    find_top(&s, known, shift);
    measure_bend(&s, known, is_steep(&s, known), slope, curvature);
    symmetric_axes(curvature, bend, axes);
    spread(g, known, bend, (const double(*)[3])axes, snr, body_m, out->covariance_m2);
    /* Not farther than the next voxel, but towards the top: what is long and tilted would
     * be left otherwise. */
    for (int a = 0; a < 3; a++)
        longest = fmax(longest, fabs(shift[a]));
    for (int a = 0; a < 3; a++) {
        out->width_m[a] = width_m(g, a, known[a], curvature[element[a][a]]);
        out->position_m[a] = g->origin_m[a] +
                             g->step_m[a] * ((double)s.at[a] + shift[a] / longest);
    }
}
