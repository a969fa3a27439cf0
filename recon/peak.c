#include "recon/peak.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#define WIDTH_SIGMAS                                                                     \
    3.3302 /* -6 dB (a factor of 4) width of a Gaussian over its sigma                   \
            */

static double level(const struct grid *g, const float *v, const size_t at[3],
                    const int d[3])
{
    size_t x = at[0] + (size_t)d[0], y = at[1] + (size_t)d[1], z = at[2] + (size_t)d[2];
    return log(fmax(v[(z * g->n[1] + y) * g->n[0] + x], 1e-37));
}

static bool inside(const struct grid *g, const size_t at[3], int axis)
{
    return at[axis] > 0 && at[axis] + 1 < g->n[axis];
}

static double mixed_slope(const struct grid *g, const float *v, const size_t at[3], int a,
                          int b)
{
    int d[4][3] = {{0}};
    static const int sign[4][2] = {{1, 1}, {-1, -1}, {1, -1}, {-1, 1}};
    double sum = 0.0;
    for (int q = 0; q < 4; q++) {
        d[q][a] = sign[q][0];
        d[q][b] = sign[q][1];
        sum += (q < 2 ? 0.25 : -0.25) * level(g, v, at, d[q]);
    }
    return sum;
}

/* Inverse of a symmetric positive definite matrix; false: it is not. */
static bool invert(const double m[3][3], double out[3][3])
{
    double c00 = m[1][1] * m[2][2] - m[1][2] * m[1][2];
    double c01 = m[0][2] * m[1][2] - m[0][1] * m[2][2];
    double c02 = m[0][1] * m[1][2] - m[0][2] * m[1][1];
    double det = m[0][0] * c00 + m[0][1] * c01 + m[0][2] * c02;
    double minor = m[0][0] * m[1][1] - m[0][1] * m[0][1];
    if (!(m[0][0] > 0.0) || !(minor > 0.0) || !(det > 0.0))
        return false;
    out[0][0] = c00 / det;
    out[0][1] = out[1][0] = c01 / det;
    out[0][2] = out[2][0] = c02 / det;
    out[1][1] = (m[0][0] * m[2][2] - m[0][2] * m[0][2]) / det;
    out[1][2] = out[2][1] = (m[0][1] * m[0][2] - m[0][0] * m[1][2]) / det;
    out[2][2] = minor / det;
    return true;
}

void peak_fit(const struct grid *g, const float *v, size_t voxel, double snr,
              struct peak_fit *out)
{
    size_t at[3] = {voxel % g->n[0], voxel / g->n[0] % g->n[1],
                    voxel / (g->n[0] * g->n[1])};
    double curvature[3][3] = {{0}}, slope[3] = {0}, c[3][3];
    bool fitted[3];
    for (int a = 0; a < 3; a++) {
        int up[3] = {0}, down[3] = {0}, here[3] = {0};
        up[a] = 1;
        down[a] = -1;
        double bend = 0.0;
        if (inside(g, at, a)) {
            double high = level(g, v, at, up), low = level(g, v, at, down);
            bend = 2.0 * level(g, v, at, here) - high - low;
            slope[a] = 0.5 * (high - low);
        }
        fitted[a] = bend > 1e-6;
        curvature[a][a] = fitted[a] ? bend : WIDTH_SIGMAS * WIDTH_SIGMAS;
        slope[a] = fitted[a] ? slope[a] : 0.0;
        out->width_m[a] = g->step_m[a] * WIDTH_SIGMAS / sqrt(curvature[a][a]);
    }
    for (int a = 0; a < 3; a++)
        for (int b = a + 1; b < 3; b++)
            if (fitted[a] && fitted[b])
                curvature[a][b] = curvature[b][a] = -mixed_slope(g, v, at, a, b);
    if (!invert(curvature, c)) {
        memset(c, 0, sizeof c);
        for (int a = 0; a < 3; a++)
            c[a][a] = 1.0 / curvature[a][a];
    }
    /* A point's image is tilted towards the array: the top lies where all slopes vanish
     * together, not axis by axis.  Not farther than the next voxel, but towards it: what
     * is long and tilted would be left otherwise. */
    double shift[3], longest = 1.0;
    for (int a = 0; a < 3; a++) {
        shift[a] = c[a][0] * slope[0] + c[a][1] * slope[1] + c[a][2] * slope[2];
        longest = fmax(longest, fabs(shift[a]));
    }
    for (int a = 0; a < 3; a++)
        out->position_m[a] = g->origin_m[a] +
                             g->step_m[a] * ((double)at[a] + shift[a] / longest);
    double scale = 1.0 / fmax(snr, 1.0);
    for (int a = 0, q = 0; a < 3; a++)
        for (int b = a; b < 3; b++, q++)
            out->covariance_m2[q] = scale * c[a][b] * g->step_m[a] * g->step_m[b];
}
