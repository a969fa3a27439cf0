/* SPDX-License-Identifier: MIT */
#include "recon/walls/wall.h"

#include <math.h>
#include <string.h>

#define NEARLY_UP 0.99985 /* the cosine of 1 degree */

static const double array_up[3] = {0.0, 1.0, 0.0};

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

void wall_unfold(const double c[6], double out[3][3])
{
    static const int at[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            out[a][b] = c[at[a][b]];
}

/* out += j c j' */
static void add_propagated(const double j[3][3], const double c[6], double out[6])
{
    double full[3][3];
    wall_unfold(c, full);
    for (int a = 0, q = 0; a < 3; a++)
        for (int b = a; b < 3; b++, q++)
            for (int i = 0; i < 3; i++)
                out[q] += j[a][i] * dot(full[i], j[b]);
}

void wall_axes_about(const double normal[3], const double up[3], double upright[3],
                     double level[3])
{
    double reference[3] = {up[0], up[1], up[2]};
    if (fabs(dot(normal, up)) > NEARLY_UP)
        for (int a = 0; a < 3; a++) /* x, unless up itself is along it */
            reference[a] = fabs(up[0]) > 0.5 ? a == 2 : a == 0;
    double along = dot(normal, reference);
    for (int a = 0; a < 3; a++)
        upright[a] = reference[a] - along * normal[a];
    double length = sqrt(dot(upright, upright));
    for (int a = 0; a < 3; a++)
        upright[a] /= length;
    cross(normal, upright, level);
}

void wall_axes(const struct wall *w, double upright[3], double level[3])
{
    wall_axes_about(w->normal, array_up, upright, level);
}

bool wall_end_at(struct wall *w, const double a[3], const double b[3])
{
    const double *points[2] = {a, b};
    double upright[3], level[3], at_m[2];

    wall_axes(w, upright, level);
    for (int k = 0; k < 2; k++)
        at_m[k] = 1e-6 * round(1e6 * (level[0] * points[k][0] + level[1] * points[k][1] +
                                      level[2] * points[k][2]));
    w->ends_m[0] = fmin(at_m[0], at_m[1]);
    w->ends_m[1] = fmax(at_m[0], at_m[1]);
    return w->ends_m[0] < w->ends_m[1];
}

bool wall_ends(const struct wall *w)
{
    return w->ends_m[0] != 0.0 || w->ends_m[1] != 0.0;
}

double wall_beyond_end_m(const struct wall *w, const double p[3])
{
    double upright[3], level[3];
    if (!wall_ends(w))
        return -INFINITY;
    wall_axes(w, upright, level);
    double at_m = dot(level, p); /* the foot is at 0 */
    return fmax(w->ends_m[0] - at_m, at_m - w->ends_m[1]);
}

/* Where the ends are along the level axis after a move: around, of a wall whose level
 * axis became `turned`.  An axis that turned about the normal is seen from the side, and
 * one that points the other way exchanges the ends. */
static void move_ends(const struct wall *w, const double turned[3],
                      const double around[3], const double t[3], double out[2])
{
    double along = dot(turned, around), shift_m = dot(t, around);
    bool flips = along < 0.0;
    for (int k = 0; k < 2; k++)
        out[k] = w->ends_m[flips ? 1 - k : k] * along + shift_m;
}

void wall_turn(const struct wall *w, const double change[3], struct wall *out)
{
    double upright[3], level[3];
    wall_axes(w, upright, level);
    double angle = hypot(change[0], change[1]);
    double part = angle > 0.0 ? sin(angle) / angle : 1.0;
    *out = *w;
    /* upright x normal = -level, level x normal = upright */
    for (int a = 0; a < 3; a++)
        out->normal[a] = cos(angle) * w->normal[a] +
                         part * (change[1] * upright[a] - change[0] * level[a]);
    double length = sqrt(dot(out->normal, out->normal));
    for (int a = 0; a < 3; a++)
        out->normal[a] /= length;
    out->distance_m += change[2];
}

void wall_difference(const struct wall *from, const struct wall *to, double change[3])
{
    double upright[3], level[3];
    wall_axes(from, upright, level);
    double a = -dot(to->normal, level), b = dot(to->normal, upright);
    double sine = hypot(a, b), angle = atan2(sine, dot(from->normal, to->normal));
    double scale = sine > 0.0 ? angle / sine : 1.0;
    change[0] = scale * a;
    change[1] = scale * b;
    change[2] = to->distance_m - from->distance_m;
}

void wall_move(const struct wall *w, const double up[3], const double r[3][3],
               const double t[3], struct wall *out)
{
    struct wall moved = {.distance_m = w->distance_m};
    double axes[2][3], turned[2][3], around[2][3], j[3][3] = {{0.0}};
    wall_axes_about(w->normal, up, axes[0], axes[1]);
    for (int a = 0; a < 3; a++) {
        moved.normal[a] = dot(r[a], w->normal);
        for (int k = 0; k < 2; k++)
            turned[k][a] = dot(r[a], axes[k]);
    }
    moved.distance_m += dot(moved.normal, t);
    wall_axes(&moved, around[0], around[1]);
    for (int k = 0; k < 2; k++) { /* a turn about axis k, in the new terms */
        double shift[3];
        cross(turned[k], moved.normal, shift);
        j[0][k] = dot(around[0], turned[k]);
        j[1][k] = dot(around[1], turned[k]);
        j[2][k] = dot(shift, t);
    }
    j[2][2] = 1.0;
    add_propagated((const double(*)[3])j, w->covariance, moved.covariance);
    if (wall_ends(w))
        move_ends(w, turned[1], around[1], t, moved.ends_m);
    *out = moved;
}

void wall_face(struct wall *w)
{
    if (w->distance_m >= 0.0)
        return;
    w->distance_m = -w->distance_m;
    for (int a = 0; a < 3; a++)
        w->normal[a] = -w->normal[a];
    w->covariance[1] = -w->covariance[1]; /* level and distance change their signs, */
    w->covariance[2] = -w->covariance[2]; /* upright stays */
    if (!wall_ends(w))
        return;
    double from_m = w->ends_m[0];
    w->ends_m[0] = -w->ends_m[1];
    w->ends_m[1] = -from_m;
}

void wall_mirror(const struct wall *w, const double p[3], double out[3])
{
    double beyond_m = dot(w->normal, p) - w->distance_m;
    for (int a = 0; a < 3; a++)
        out[a] = p[a] - 2.0 * beyond_m * w->normal[a];
}

void wall_mirror_covariance(const struct wall *w, const double p[3], const double c[6],
                            double out[6])
{
    const double *n = w->normal;
    double h[3][3], j[3][3], axes[2][3];
    double beyond_m = dot(n, p) - w->distance_m;
    wall_axes(w, axes[0], axes[1]);
    for (int k = 0; k < 2; k++) {
        double shift[3]; /* of the normal, for a turn about axis k */
        cross(axes[k], n, shift);
        for (int a = 0; a < 3; a++)
            j[a][k] = -2.0 * (dot(shift, p) * n[a] + beyond_m * shift[a]);
    }
    for (int a = 0; a < 3; a++) {
        j[a][2] = 2.0 * n[a];
        for (int b = 0; b < 3; b++)
            h[a][b] = (a == b ? 1.0 : 0.0) - 2.0 * n[a] * n[b];
    }
    double sum[6] = {0.0}; /* out may be c */
    add_propagated((const double(*)[3])h, c, sum);
    add_propagated((const double(*)[3])j, w->covariance, sum);
    memcpy(out, sum, sizeof sum);
}

bool wall_crosses(const struct wall *w, const double from[3], const double to[3],
                  double *along)
{
    double before_m = dot(w->normal, from) - w->distance_m;
    double after_m = dot(w->normal, to) - w->distance_m;
    if (before_m * after_m >= 0.0)
        return false;
    *along = before_m / (before_m - after_m);
    return true;
}

/* How far beyond its ends the way to p crosses a wall; INFINITY: it does not. */
static double crosses_beyond_m(const struct wall *w, const double from[3],
                               const double p[3], double *along)
{
    double at[3];
    if (!wall_crosses(w, from, p, along))
        return INFINITY;
    for (int a = 0; a < 3; a++)
        at[a] = from[a] + *along * (p[a] - from[a]);
    return wall_beyond_end_m(w, at);
}

size_t wall_that_mirrored(const struct wall_gate *walls, size_t n, const double from[3],
                          const double p[3])
{
    size_t best = n, aside = n;
    double first = 2.0, first_aside = 2.0, along;
    double range_m = sqrt((p[0] - from[0]) * (p[0] - from[0]) +
                          (p[1] - from[1]) * (p[1] - from[1]) +
                          (p[2] - from[2]) * (p[2] - from[2]));
    for (size_t i = 0; i < n; i++) {
        if (range_m < walls[i].gate_m[0] || range_m > walls[i].gate_m[1])
            continue;
        double beyond_m = crosses_beyond_m(&walls[i].plane, from, p, &along);
        if (beyond_m <= 0.0 && along < first) {
            best = i;
            first = along;
        } else if (beyond_m > 0.0 && beyond_m <= WALL_END_MARGIN_M &&
                   along < first_aside) {
            aside = i;
            first_aside = along;
        }
    }
    return best < n ? best : aside;
}
