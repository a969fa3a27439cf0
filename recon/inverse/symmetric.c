/* SPDX-License-Identifier: MIT */
#include "recon/inverse/symmetric.h"

#include <math.h>
#include <string.h>

#define SWEEPS 12 /* each squares what is left beside the diagonal */

/* Rotates in the plane of axes p and q so that m[p][q] becomes 0; axes are rows. */
static void rotate(double m[3][3], double axes[3][3], int p, int q)
{
    if (m[p][q] == 0.0)
        return;
    double theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
    double t = copysign(1.0, theta) / (fabs(theta) + hypot(theta, 1.0));
    double c = 1.0 / hypot(t, 1.0), s = t * c;

    for (int i = 0; i < 3; i++) {
        double a = m[i][p], b = m[i][q];
        m[i][p] = c * a - s * b;
        m[i][q] = s * a + c * b;
    }
    for (int i = 0; i < 3; i++) {
        double a = m[p][i], b = m[q][i];
        m[p][i] = c * a - s * b;
        m[q][i] = s * a + c * b;
        a = axes[p][i], b = axes[q][i];
        axes[p][i] = c * a - s * b;
        axes[q][i] = s * a + c * b;
    }
}

/* The hand of the axes is kept: one of the two that change places turns round. */
static void exchange(double value[3], double axes[3][3], int p, int q)
{
    double v = value[p];
    value[p] = value[q];
    value[q] = v;
    for (int i = 0; i < 3; i++) {
        double a = axes[p][i];
        axes[p][i] = axes[q][i];
        axes[q][i] = -a;
    }
}

void symmetric_axes(const double c[6], double value[3], double axes[3][3])
{
    static const double unit[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    double m[3][3] = {{c[0], c[1], c[2]}, {c[1], c[3], c[4]}, {c[2], c[4], c[5]}};

    memcpy(axes, unit, sizeof unit);
    for (int i = 0; i < SWEEPS; i++) {
        rotate(m, axes, 0, 1);
        rotate(m, axes, 0, 2);
        rotate(m, axes, 1, 2);
    }
    for (int i = 0; i < 3; i++)
        value[i] = m[i][i];
    for (int p = 0; p < 2; p++)
        for (int q = p + 1; q < 3; q++)
            if (value[q] > value[p])
                exchange(value, axes, p, q);
}
