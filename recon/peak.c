#include "recon/peak.h"

#include <math.h>
#include <stdbool.h>

#include "recon/psf.h"

/* -6 dB (a factor of 4) width of a Gaussian over its sigma. */
#define WIDTH_SIGMAS 3.3302

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

/* Of a symmetric matrix as xx xy xz yy yz zz. */
static const int element[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};

struct bend { /* of the logarithm of the intensity, in voxels */
    double slope[3];
    double curvature[6]; /* downwards; of an axis that has none: of a voxel's width */
};

static void measure_bend(struct bend *out, const struct grid *g, const float *v,
                         const size_t at[3])
{
    bool fitted[3];
    *out = (struct bend){{0}, {0}};
    for (int a = 0; a < 3; a++) {
        int up[3] = {0}, down[3] = {0}, here[3] = {0};
        up[a] = 1;
        down[a] = -1;
        double bend = 0.0;
        if (inside(g, at, a)) {
            double high = level(g, v, at, up), low = level(g, v, at, down);
            bend = 2.0 * level(g, v, at, here) - high - low;
            out->slope[a] = 0.5 * (high - low);
        }
        fitted[a] = bend > 1e-6;
        out->curvature[element[a][a]] = fitted[a] ? bend : WIDTH_SIGMAS * WIDTH_SIGMAS;
        out->slope[a] = fitted[a] ? out->slope[a] : 0.0;
    }
    for (int a = 0; a < 3; a++)
        for (int b = a + 1; b < 3; b++)
            if (fitted[a] && fitted[b])
                out->curvature[element[a][b]] = -mixed_slope(g, v, at, a, b);
}

void peak_fit(const struct grid *g, const float *v, size_t voxel, double snr,
              struct peak_fit *out)
{
    size_t at[3];
    struct bend bend;
    double inverse[6] = {0};
    grid_place(g, voxel, at);
    measure_bend(&bend, g, v, at);
    if (!psf_invert(bend.curvature, inverse))
        for (int a = 0; a < 3; a++)
            inverse[element[a][a]] = 1.0 / bend.curvature[element[a][a]];
    /* A point's image is tilted towards the array: the top lies where all slopes vanish
     * together, not axis by axis.  Not farther than the next voxel, but towards it: what
     * is long and tilted would be left otherwise. */
    double shift[3] = {0}, longest = 1.0;
    for (int a = 0; a < 3; a++) {
        for (int b = 0; b < 3; b++)
            shift[a] += inverse[element[a][b]] * bend.slope[b];
        longest = fmax(longest, fabs(shift[a]));
    }
    double scale = 1.0 / fmax(snr, 1.0);
    for (int a = 0; a < 3; a++) {
        out->width_m[a] = g->step_m[a] * WIDTH_SIGMAS /
                          sqrt(bend.curvature[element[a][a]]);
        out->position_m[a] = g->origin_m[a] +
                             g->step_m[a] * ((double)at[a] + shift[a] / longest);
        for (int b = a; b < 3; b++)
            out->covariance_m2[element[a][b]] = scale * inverse[element[a][b]] *
                                                g->step_m[a] * g->step_m[b];
    }
}
