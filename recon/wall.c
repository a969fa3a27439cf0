#include "recon/wall.h"

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

void wall_mirror(const struct wall *w, const double p[3], double out[3])
{
    double beyond_m = dot(w->normal, p) - w->distance_m;
    for (int a = 0; a < 3; a++)
        out[a] = p[a] - 2.0 * beyond_m * w->normal[a];
}

void wall_mirror_covariance(const struct wall *w, const double c[6], double out[6])
{
    const double full[3][3] = {
        {c[0], c[1], c[2]}, {c[1], c[3], c[4]}, {c[2], c[4], c[5]}};
    double columns[3][3]; /* mirrored covariance = H full H, H = I - 2 n n' */
    for (int a = 0; a < 3; a++) {
        double along = 2.0 * dot(w->normal, full[a]);
        for (int b = 0; b < 3; b++)
            columns[a][b] = full[a][b] - along * w->normal[b];
    }
    double mirrored[3][3];
    for (int b = 0; b < 3; b++) {
        double column[3] = {columns[0][b], columns[1][b], columns[2][b]};
        double along = 2.0 * dot(w->normal, column);
        for (int a = 0; a < 3; a++)
            mirrored[a][b] = column[a] - along * w->normal[a];
    }
    out[0] = mirrored[0][0];
    out[1] = mirrored[0][1];
    out[2] = mirrored[0][2];
    out[3] = mirrored[1][1];
    out[4] = mirrored[1][2];
    out[5] = mirrored[2][2];
}
