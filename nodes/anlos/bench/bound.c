#include "nodes/anlos/bench/bound.h"

#include <errno.h>
#include <math.h>
#include <string.h>

/* Adds (x - from) / |x - from| / c to the gradient of the delay. */
static void add_gradient(double g[3], const double x[3], const double from[3], double c)
{
    double d[3], r = 0.0;
    for (int a = 0; a < 3; a++) {
        d[a] = x[a] - from[a];
        r += d[a] * d[a];
    }
    for (int a = 0; a < 3; a++)
        g[a] += d[a] / (sqrt(r) * c);
}

/* Diagonal of the inverse of a symmetric positive definite matrix. */
static int invert_diagonal(const double m[3][3], double out[3])
{
    double det = 0.0, minor[3];
    for (int a = 0; a < 3; a++) {
        int b = (a + 1) % 3, c = (a + 2) % 3;
        minor[a] = m[b][b] * m[c][c] - m[b][c] * m[c][b];
        det += m[0][a] * (m[1][(a + 1) % 3] * m[2][(a + 2) % 3] -
                          m[1][(a + 2) % 3] * m[2][(a + 1) % 3]);
    }
    double scale = m[0][0] * m[1][1] * m[2][2];
    if (!(det > 1e-12 * scale))
        return -EDOM;
    for (int a = 0; a < 3; a++)
        out[a] = minor[a] / det;
    return 0;
}

int bench_bound(struct bench_bound *out, const struct geometry *g, const double at_m[3],
                const double band_hz[2], bool phase_known, const double *snr)
{
    double f0 = band_hz[0], f1 = band_hz[1], middle = 0.5 * (f0 + f1);
    double square = (f0 * f0 + f0 * f1 + f1 * f1) / 3.0;
    double j[3][3] = {{0}}, b[3] = {0}, weight = 0.0, variance[3];
    size_t n_m = g->n_microphones, pairs = g->n_speakers * n_m;
    for (size_t p = 0; p < pairs * g->n_positions; p++) {
        double s[3], m[3], d[3] = {0}, w = snr[p] * 4.0 * M_PI * M_PI;
        geometry_speaker(g, p / pairs, p % pairs / n_m, s);
        geometry_microphone(g, p / pairs, p % n_m, m);
        add_gradient(d, at_m, s, g->sound_speed_m_s);
        add_gradient(d, at_m, m, g->sound_speed_m_s);
        weight += w;
        for (int a = 0; a < 3; a++) {
            b[a] += w * middle * d[a];
            for (int c = 0; c < 3; c++)
                j[a][c] += w * square * d[a] * d[c];
        }
    }
    for (int a = 0; a < 3 && !phase_known; a++)
        for (int c = 0; c < 3; c++)
            j[a][c] -= b[a] * b[c] / weight;
    if (invert_diagonal((const double(*)[3])j, variance))
        return -EDOM;
    out->lateral_m = sqrt(variance[0] + variance[1]);
    out->depth_m = sqrt(variance[2]);
    return 0;
}
