/* SPDX-License-Identifier: MIT */
#include "recon/walls/field_of_view.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "recon/mount.h"

#define PI          3.14159265358979323846
#define MAX_WALLS   16 /* known and lost ones */
#define MAX_CORNERS 40 /* of a box that is cut by all there is */
#define MAX_BOUNDS  (4 + MAX_WALLS * 6 + MAX_WALLS * (MAX_WALLS - 1) / 2)
#define CHORD_RAD   0.4  /* of a circle: at most 2 % of the range is lost */
#define LEAST_UP    0.5  /* of a normal in the plane; less: a floor, a ceiling */
#define LEAST_M     1e-6 /* from the array to a wall that it is not in */
#define LEAST_RAD   1e-9
#define LEAST_M2    0.01 /* nobody stands on less */

struct point { /* of the array's plane */
    double x, z;
};

struct polygon {
    size_t n;
    struct point at[MAX_CORNERS];
};

struct mirror { /* a wall as a line: { q : normal . q = distance_m > 0 } */
    struct point normal, along;
    double distance_m;
    double ends_m[2]; /* of along . q; infinite where it is endless */
    double gate_m[2];
    uint32_t id;
    bool shows;
};

struct bound { /* a direction in which something may change */
    double azimuth;
    bool crossed[MAX_WALLS]; /* walls whose lines another one's crosses there */
};

struct plan {
    size_t n;
    struct mirror mirrors[MAX_WALLS];
    struct polygon image, ways; /* to the image, from the array */
    double azimuth[2];          /* of the image */
    double far_m;
};

static double dot(struct point a, struct point b)
{
    return a.x * b.x + a.z * b.z;
}

static struct point towards(double azimuth)
{
    return (struct point){sin(azimuth), cos(azimuth)};
}

static double azimuth_of(struct point p)
{
    return atan2(p.x, p.z);
}

static struct point on_line(const struct mirror *m, double along_m)
{
    return (struct point){m->distance_m * m->normal.x + along_m * m->along.x,
                          m->distance_m * m->normal.z + along_m * m->along.z};
}

/* Keeps the part with n . q <= d (Sutherland and Hodgman 1974). */
static void cut(struct polygon *p, struct point n, double d)
{
    struct polygon out = {.n = 0};

    for (size_t i = 0; i < p->n; i++) {
        struct point a = p->at[i], b = p->at[(i + 1) % p->n];
        double over_a = dot(n, a) - d, over_b = dot(n, b) - d;
        if (over_a <= 0.0)
            out.at[out.n++] = a;
        if ((over_a < 0.0 && over_b > 0.0) || (over_a > 0.0 && over_b < 0.0)) {
            double s = over_a / (over_a - over_b);
            out.at[out.n++] =
                (struct point){a.x + s * (b.x - a.x), a.z + s * (b.z - a.z)};
        }
    }
    *p = out;
}

static void cut_beyond(struct polygon *p, struct point n, double d)
{
    cut(p, (struct point){-n.x, -n.z}, -d);
}

/* Less than half a turn wide. */
static void cut_wedge(struct polygon *p, double from, double to)
{
    struct point a = towards(from), b = towards(to);

    cut(p, (struct point){-a.z, a.x}, 0.0);
    cut(p, (struct point){b.z, -b.x}, 0.0);
}

static void cut_far(struct polygon *p, double from, double to, double far_m)
{
    double n = ceil((to - from) / CHORD_RAD), half = 0.5 * (to - from) / n;

    for (double k = 0.0; k < n; k++)
        cut(p, towards(from + (2.0 * k + 1.0) * half), far_m * cos(half));
}

static bool set_mirror(struct mirror *m, const struct wall_gate *w, bool shows)
{
    struct wall plane = w->plane;
    double upright[3], level[3];

    wall_face(&plane);
    wall_axes(&plane, upright, level);
    double length = hypot(plane.normal[0], plane.normal[2]);
    if (length < LEAST_UP || plane.distance_m < LEAST_M)
        return false;
    bool ends = wall_ends(&plane);
    *m = (struct mirror){
        .normal = {plane.normal[0] / length, plane.normal[2] / length},
        .along = {level[0], level[2]},
        .distance_m = plane.distance_m / length,
        .ends_m = {ends ? plane.ends_m[0] : -INFINITY, ends ? plane.ends_m[1] : INFINITY},
        .gate_m = {w->gate_m[0], w->gate_m[1]},
        .id = w->id,
        .shows = shows};
    return true;
}

/* How far off a wall is hit; INFINITY: it is not.  margin_m: also so far past its ends.
 */
static double hit_m(const struct mirror *m, struct point u, double margin_m)
{
    double nearing = dot(m->normal, u);

    if (nearing <= 0.0)
        return INFINITY;
    double range_m = m->distance_m / nearing, at_m = range_m * dot(m->along, u);
    bool between = at_m >= m->ends_m[0] - margin_m && at_m <= m->ends_m[1] + margin_m;
    return between ? range_m : INFINITY;
}

/* The wall that is hit first; n: none is. */
static size_t first_hit(const struct plan *p, double azimuth, double margin_m)
{
    size_t best = p->n;
    double least_m = INFINITY;

    for (size_t i = 0; i < p->n; i++) {
        double range_m = hit_m(&p->mirrors[i], towards(azimuth), margin_m);
        if (range_m < least_m) {
            best = i;
            least_m = range_m;
        }
    }
    return best;
}

static void add_bound(struct bound *b, size_t *n, struct point at)
{
    b[(*n)++] = (struct bound){.azimuth = azimuth_of(at)};
}

static size_t list_bounds(const struct plan *p, struct bound *b)
{
    size_t n = 0;

    for (size_t i = 0; i < p->n; i++) {
        const struct mirror *m = &p->mirrors[i];
        add_bound(b, &n, m->along);
        add_bound(b, &n, (struct point){-m->along.x, -m->along.z});
        for (int k = 0; k < 2 && isfinite(m->ends_m[0]); k++) {
            double past_m = k ? WALL_END_MARGIN_M : -WALL_END_MARGIN_M;
            add_bound(b, &n, on_line(m, m->ends_m[k]));
            add_bound(b, &n, on_line(m, m->ends_m[k] + past_m));
        }
        for (size_t j = 0; j < i; j++) {
            const struct mirror *o = &p->mirrors[j];
            double nearing = dot(o->normal, m->along);
            if (fabs(nearing) < LEAST_RAD)
                continue;
            struct point foot = on_line(m, 0.0);
            double at_m = (o->distance_m - dot(o->normal, foot)) / nearing;
            add_bound(b, &n, on_line(m, at_m));
            b[n - 1].crossed[i] = b[n - 1].crossed[j] = true;
        }
    }
    return n;
}

static int compare_bounds(const void *a, const void *b)
{
    const struct bound *x = a, *y = b;

    return (x->azimuth > y->azimuth) - (x->azimuth < y->azimuth);
}

/* Rising, within the image, its own limits at the ends, and of those that are one only
 * one. */
static size_t order_bounds(const struct plan *p, struct bound *b, size_t n)
{
    size_t kept = 0;

    for (int k = 0; k < 2; k++)
        b[n++] = (struct bound){.azimuth = p->azimuth[k]};
    qsort(b, n, sizeof *b, compare_bounds);
    for (size_t i = 0; i < n; i++) {
        if (b[i].azimuth < p->azimuth[0] || b[i].azimuth > p->azimuth[1])
            continue;
        if (!kept || b[i].azimuth - b[kept - 1].azimuth > LEAST_RAD)
            b[kept++] = b[i];
        else
            for (size_t k = 0; k < MAX_WALLS; k++)
                b[kept - 1].crossed[k] |= b[i].crossed[k];
    }
    return kept;
}

static double area_m2(const struct polygon *p)
{
    double sum = 0.0;

    for (size_t i = 0; i < p->n; i++) {
        struct point a = p->at[i], b = p->at[(i + 1) % p->n];
        sum += a.x * b.z - a.z * b.x;
    }
    return 0.5 * sum;
}

/* Of its neighbours' triangle. */
static double corner_m2(const struct polygon *p, size_t i)
{
    struct polygon t = {
        .n = 3, .at = {p->at[(i + p->n - 1) % p->n], p->at[i], p->at[(i + 1) % p->n]}};
    return fabs(area_m2(&t));
}

/* A convex polygon less a corner lies inside itself. */
static void simplify(struct polygon *p)
{
    while (p->n > 3) {
        size_t least = 0;
        for (size_t i = 1; i < p->n; i++)
            if (corner_m2(p, i) < corner_m2(p, least))
                least = i;
        if (p->n <= VIEW_CORNERS && corner_m2(p, least) > LEAST_RAD)
            return;
        memmove(&p->at[least], &p->at[least + 1], (p->n - least - 1) * sizeof p->at[0]);
        p->n--;
    }
}

static void mirror_polygon(const struct mirror *m, struct polygon *p)
{
    for (size_t i = 0; i < p->n; i++) {
        double beyond_m = dot(m->normal, p->at[i]) - m->distance_m;
        p->at[i].x -= 2.0 * beyond_m * m->normal.x;
        p->at[i].z -= 2.0 * beyond_m * m->normal.z;
    }
}

/* Has a wall, between its ends, more than a point in common with a polygon? */
static bool stands_in(const struct mirror *m, const struct polygon *p)
{
    double from_m = INFINITY, to_m = -INFINITY;

    for (size_t i = 0; i < p->n; i++) {
        struct point a = p->at[i], b = p->at[(i + 1) % p->n];
        double over_a = dot(m->normal, a) - m->distance_m;
        double over_b = dot(m->normal, b) - m->distance_m;
        if (over_a * over_b > 0.0 || over_a == over_b)
            continue;
        double s = over_a / (over_a - over_b);
        double at_m = dot(m->along, a) + s * (dot(m->along, b) - dot(m->along, a));
        from_m = fmin(from_m, at_m);
        to_m = fmax(to_m, at_m);
    }
    return fmax(from_m, m->ends_m[0]) < fmin(to_m, m->ends_m[1]) - LEAST_M;
}

/* What is seen from `from` to `to` by way of a wall that is hit all along.  Sound goes on
 * from the wall through `way`; where another wall stands in that, what is on the wall's
 * side of it is seen for certain. */
static void see_mirrored(const struct plan *p, size_t i, double from, double to,
                         struct polygon *area)
{
    const struct mirror *m = &p->mirrors[i];
    double far_m = fmin(m->gate_m[1], p->far_m);
    struct point middle = towards(0.5 * (from + to));
    double at_m = m->distance_m / dot(m->normal, middle);
    struct point struck = {at_m * middle.x, at_m * middle.z};
    struct polygon way = p->ways;

    cut_far(area, from, to, far_m);
    cut_beyond(area, m->normal, m->distance_m);
    cut_beyond(area, middle, m->gate_m[0]);
    cut_wedge(&way, from, to);
    cut_far(&way, from, to, far_m);
    cut_beyond(&way, m->normal, m->distance_m);
    mirror_polygon(m, area);
    mirror_polygon(m, &way);
    for (size_t j = 0; j < p->n; j++) {
        const struct mirror *o = &p->mirrors[j];
        if (j == i || !stands_in(o, &way))
            continue;
        if (dot(o->normal, struck) <= o->distance_m)
            cut(area, o->normal, o->distance_m);
        else
            cut_beyond(area, o->normal, o->distance_m);
    }
}

static void put_area(struct field_of_view *out, const struct survey *s, uint32_t wall,
                     struct polygon *area)
{
    simplify(area);
    if (out->n == VIEW_AREAS || area->n < 3 || fabs(area_m2(area)) < LEAST_M2)
        return;
    struct view_area *v = &out->areas[out->n++];
    struct polygon placed = {.n = area->n};
    for (size_t i = 0; i < area->n; i++) {
        const double p[3] = {area->at[i].x, 0.0, area->at[i].z};
        double q[3];
        survey_to_vehicle(s, p, q);
        placed.at[i] = (struct point){q[0], s->has_mount ? q[1] : q[2]};
    }
    bool turns_left = area_m2(&placed) > 0.0;
    *v = (struct view_area){.wall = wall, .n = area->n};
    for (size_t i = 0; i < area->n; i++) {
        struct point at = placed.at[turns_left ? i : area->n - 1 - i];
        v->corners_m[i][0] = at.x;
        v->corners_m[i][1] = at.z;
    }
}

static void see(struct field_of_view *out, const struct survey *s, const struct plan *p,
                double from, double to)
{
    size_t i = first_hit(p, 0.5 * (from + to), 0.0);
    struct polygon area = p->image;
    bool direct = i == p->n;

    /* Past an end, but so little that the wall may have mirrored it: neither is sure. */
    if (direct && first_hit(p, 0.5 * (from + to), WALL_END_MARGIN_M) < p->n)
        return;
    if (!direct && !p->mirrors[i].shows)
        return;
    cut_wedge(&area, from, to);
    if (direct)
        cut_far(&area, from, to, p->far_m);
    else
        see_mirrored(p, i, from, to, &area);
    put_area(out, s, direct ? 0 : p->mirrors[i].id, &area);
}

/* Does what is seen change at a bound?  Where the line of the wall that is hit crosses
 * another it does: the other stands in the way on one side. */
static bool changes_at(const struct plan *p, const struct bound *b, double before,
                       double after)
{
    size_t i = first_hit(p, before, 0.0);

    return (i < p->n && b->crossed[i]) || i != first_hit(p, after, 0.0) ||
           (i == p->n && (first_hit(p, before, WALL_END_MARGIN_M) == p->n) !=
                             (first_hit(p, after, WALL_END_MARGIN_M) == p->n));
}

static void set_image(struct plan *p, const struct grid *g)
{
    double x[2], z[2];

    for (int k = 0; k < 2; k++) {
        x[k] = g->origin_m[0] + k * g->step_m[0] * (double)(g->n[0] - 1);
        z[k] = g->origin_m[2] + k * g->step_m[2] * (double)(g->n[2] - 1);
    }
    z[0] = fmax(z[0], LEAST_M); /* what is behind the array is heard as ahead of it */
    p->image = (struct polygon){
        .n = 4, .at = {{x[0], z[0]}, {x[1], z[0]}, {x[1], z[1]}, {x[0], z[1]}}};
    double left = fmin(x[0], 0.0), right = fmax(x[1], 0.0);
    p->ways = (struct polygon){
        .n = 4, .at = {{left, 0.0}, {right, 0.0}, {right, z[1]}, {left, z[1]}}};
    for (int k = 0; k < 2; k++) {
        double a = azimuth_of(p->image.at[k]), b = azimuth_of(p->image.at[3 - k]);
        p->azimuth[k] = k ? fmax(a, b) : fmin(a, b);
    }
}

void field_of_view_find(struct field_of_view *out, const struct survey *s,
                        const struct wall_gate *walls, size_t n_walls, size_t n_mirrors,
                        const struct grid *grid, double far_m)
{
    struct plan p = {.far_m = far_m};
    struct bound bounds[MAX_BOUNDS];

    out->n = 0;
    for (size_t i = 0; i < n_walls && p.n < MAX_WALLS; i++)
        p.n += set_mirror(&p.mirrors[p.n], &walls[i], i < n_mirrors);
    set_image(&p, grid);
    if (!(p.image.at[2].z > p.image.at[0].z))
        return;
    size_t n = order_bounds(&p, bounds, list_bounds(&p, bounds));
    double from = bounds[0].azimuth;
    for (size_t i = 1; i < n; i++) {
        double before = 0.5 * (bounds[i - 1].azimuth + bounds[i].azimuth);
        bool last = i + 1 == n;
        double after = last ? 0.0 : 0.5 * (bounds[i].azimuth + bounds[i + 1].azimuth);
        if (!last && !changes_at(&p, &bounds[i], before, after))
            continue;
        if (bounds[i].azimuth - from > LEAST_RAD)
            see(out, s, &p, from, bounds[i].azimuth);
        from = bounds[i].azimuth;
    }
}
