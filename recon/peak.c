#include "recon/peak.h"

#include <math.h>
#include <string.h>

#include "recon/symmetric.h"

/* -6 dB (a factor of 4) width of a Gaussian over its sigma. */
#define WIDTH_SIGMAS 3.3302
#define LEAST_BEND   1e-6 /* below it rounding decides where the top is */
#define FLAT_GRIDS   3.0 /* a peak that is wider than so many grids is flat in this one */

struct surroundings {
    const struct grid *grid;
    const float *v;
    size_t at[3];
};

static double intensity(const struct surroundings *s, const int d[3])
{
    size_t x = s->at[0] + (size_t)d[0], y = s->at[1] + (size_t)d[1];
    size_t z = s->at[2] + (size_t)d[2];
    return s->v[(z * s->grid->n[1] + y) * s->grid->n[0] + x];
}

static double level(const struct surroundings *s, const int d[3])
{
    return log(fmax(intensity(s, d), 1e-37));
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

enum known { FITTED, TO_A_VOXEL, NOT_AT_ALL };

static enum known examine(const struct surroundings *s, int axis, bool gated,
                          unsigned *at_border)
{
    enum known known = FITTED;

    if (s->grid->n[axis] == 1)
        return NOT_AT_ALL;
    for (int far = 0; far <= 1; far++) {
        bool edge = is_edge(s, axis, far);
        bool empty = !edge && is_empty(s, axis, far);
        if (edge || (empty && gated)) {
            *at_border |= PEAK_BORDER(axis, far);
            known = NOT_AT_ALL;
        } else if (empty && known == FITTED) {
            known = TO_A_VOXEL;
        }
    }
    return known;
}

static double mixed_slope(const struct surroundings *s, int a, int b)
{
    int d[4][3] = {{0}};
    static const int sign[4][2] = {{1, 1}, {-1, -1}, {1, -1}, {-1, 1}};
    double sum = 0.0;
    for (int q = 0; q < 4; q++) {
        d[q][a] = sign[q][0];
        d[q][b] = sign[q][1];
        sum += (q < 2 ? 0.25 : -0.25) * level(s, d[q]);
    }
    return sum;
}

/* Of a symmetric matrix as xx xy xz yy yz zz. */
static const int element[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};

/* Of the logarithm of the intensity, in voxels; curvature is counted downwards.  Axes
 * that are not fitted have none. */
static void measure_bend(const struct surroundings *s, const enum known known[3],
                         double slope[3], double curvature[6])
{
    static const int here[3] = {0, 0, 0};

    memset(slope, 0, 3 * sizeof *slope);
    memset(curvature, 0, 6 * sizeof *curvature);
    for (int a = 0; a < 3; a++) {
        if (known[a] != FITTED)
            continue;
        int up[3] = {0}, down[3] = {0};
        up[a] = 1;
        down[a] = -1;
        double high = level(s, up), low = level(s, down);
        curvature[element[a][a]] = 2.0 * level(s, here) - high - low;
        slope[a] = 0.5 * (high - low);
        for (int b = a + 1; b < 3; b++)
            if (known[b] == FITTED)
                curvature[element[a][b]] = -mixed_slope(s, a, b);
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

/* Which axis a direction is, of those that are not fitted: the curvature has no elements
 * there, so that its eigenvectors lie along them exactly. */
static int unfitted_axis(const enum known known[3], const double axis[3])
{
    for (int a = 0; a < 3; a++)
        if (known[a] != FITTED && fabs(axis[a]) > 0.5)
            return a;
    return -1;
}

/* A point's image is tilted towards the array: the top lies where all slopes vanish
 * together, not axis by axis. */
static void solve(const struct grid *g, const enum known known[3], const double slope[3],
                  const double curvature[6], double snr, const double body_m[3],
                  double shift[3], double covariance_m2[6])
{
    const double voxels[3] = {(double)g->n[0], (double)g->n[1], (double)g->n[2]};
    double bend[3], axes[3][3];

    symmetric_axes(curvature, bend, axes);
    for (int i = 0; i < 3; i++) {
        int unfitted = unfitted_axis(known, axes[i]);
        double least = WIDTH_SIGMAS / (FLAT_GRIDS * across(voxels, axes[i]));
        if (unfitted < 0 && bend[i] > LEAST_BEND) {
            double along = 0.0;
            for (int a = 0; a < 3; a++)
                along += axes[i][a] * slope[a] / bend[i];
            for (int a = 0; a < 3; a++)
                shift[a] += along * axes[i][a];
        }
        if (unfitted < 0 && bend[i] > fmax(LEAST_BEND, least * least))
            add_variance(g, axes[i], 1.0 / (fmax(snr, 1.0) * bend[i]), covariance_m2);
        else if (unfitted >= 0 && known[unfitted] == TO_A_VOXEL)
            add_variance(g, axes[i], 1.0 / 12.0, covariance_m2);
        else
            add_unknown(g, axes[i], unfitted < 0 ? body_m : NULL, covariance_m2);
    }
}

static double width_m(const struct grid *g, int axis, enum known known, double bend)
{
    double length_m = g->step_m[axis] * (double)g->n[axis];

    if (known == TO_A_VOXEL)
        return g->step_m[axis];
    if (known == NOT_AT_ALL || bend <= 0.0)
        return length_m;
    return fmin(g->step_m[axis] * WIDTH_SIGMAS / sqrt(bend), length_m);
}

void peak_fit(const struct grid *g, const float *v, size_t voxel, double snr, bool gated,
              const double body_m[3], struct peak_fit *out)
{
    struct surroundings s = {.grid = g, .v = v};
    enum known known[3];
    double slope[3], curvature[6], shift[3] = {0}, longest = 1.0;

    *out = (struct peak_fit){.at_border = 0};
    grid_place(g, voxel, s.at);
    for (int a = 0; a < 3; a++)
        known[a] = examine(&s, a, gated, &out->at_border);
    measure_bend(&s, known, slope, curvature);
    solve(g, known, slope, curvature, snr, body_m, shift, out->covariance_m2);
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
