/* SPDX-License-Identifier: MIT */
#include "recon/walls/walls.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "recon/mount.h"

#define EXACT 1e-12 /* of a length that is 1 but for rounding */

static const double array_up[3] = {0.0, 1.0, 0.0};

void walls_from_survey(struct walls *out, const struct survey *s)
{
    *out = (struct walls){.n = s->n_walls};
    for (size_t i = 0; i < s->n_walls; i++) {
        struct wall_gate *w = &out->list[i];
        w->id = (uint32_t)i + 1;
        memcpy(w->plane.ends_m, s->wall_ends_m[i], sizeof w->plane.ends_m);
        out->existence[i] = 1.0;
        w->plane.distance_m = s->walls[i].distance_m;
        memcpy(w->plane.normal, s->walls[i].normal, sizeof w->plane.normal);
        memcpy(w->gate_m, s->walls[i].gate_m, sizeof w->gate_m);
    }
    if (!s->has_wall || s->n_walls)
        return;
    out->n = 1;
    out->existence[0] = 1.0;
    out->list[0] = (struct wall_gate){
        .id = 1,
        .plane = {.distance_m = s->wall_distance_m},
        .gate_m = {0.0, WALLS_FAR_M},
    };
    memcpy(out->list[0].plane.normal, s->wall_normal, sizeof s->wall_normal);
    memcpy(out->list[0].plane.ends_m, s->wall_ends_m[0], sizeof s->wall_ends_m[0]);
}

void walls_step(struct walls *w, const struct survey *s, const struct ego_step *step)
{
    struct mount mount;
    double r[3][3], t[3];

    mount_of_survey(s, &mount);
    mount_step(&mount, step, r, t);
    for (size_t i = 0; i < w->n; i++)
        wall_move(&w->list[i].plane, array_up, (const double(*)[3])r, t,
                  &w->list[i].plane);
}

/* Positive semidefinite, up to rounding: all principal minors of a scaled copy. */
static bool is_covariance(const double c[6])
{
    for (int q = 0; q < 6; q++)
        if (!(fabs(c[q]) <= 1e6))
            return false;
    if (c[0] < 0.0 || c[3] < 0.0 || c[5] < 0.0)
        return false;
    double a = sqrt(c[0]), b = sqrt(c[3]), d = sqrt(c[5]);
    double ab = a * b > 0.0 ? c[1] / (a * b) : 0.0;
    double ad = a * d > 0.0 ? c[2] / (a * d) : 0.0;
    double bd = b * d > 0.0 ? c[4] / (b * d) : 0.0;
    const double least = -1e-6;
    return 1.0 - ab * ab >= least && 1.0 - ad * ad >= least && 1.0 - bd * bd >= least &&
           1.0 + 2.0 * ab * ad * bd - ab * ab - ad * ad - bd * bd >= least;
}

static int check_wall(const struct wall_gate *w, struct error *why)
{
    const double *n = w->plane.normal;
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    if (!w->id || !isfinite(w->plane.distance_m))
        return error_say(why, -EINVAL, "a wall without id, normal or distance");
    if (!(fabs(length - 1.0) <= SURVEY_UNIT_TOLERANCE))
        return error_say(why, -EINVAL,
                         "wall %u has a normal of the length %g, expected 1", w->id,
                         length);
    if (!is_covariance(w->plane.covariance))
        return error_say(why, -EINVAL, "wall %u has a covariance that is none", w->id);
    if (wall_ends(&w->plane) &&
        !(w->plane.ends_m[0] < w->plane.ends_m[1] && isfinite(w->plane.ends_m[0]) &&
          isfinite(w->plane.ends_m[1])))
        return error_say(why, -EINVAL,
                         "wall %u ends at %g and %g m along it, expected from < to",
                         w->id, w->plane.ends_m[0], w->plane.ends_m[1]);
    if (!(w->gate_m[0] >= 0.0 && w->gate_m[0] <= w->gate_m[1]))
        return error_say(why, -EINVAL,
                         "wall %u has the gate %g to %g m, expected 0 <= near "
                         "<= far",
                         w->id, w->gate_m[0], w->gate_m[1]);
    return 0;
}

int walls_check(const struct walls *w, struct error *why)
{
    if (w->n > WALLS_MAX || w->n_corners > WALLS_MAX_CORNERS)
        return error_say(why, -EINVAL,
                         "%zu walls and %zu corners of free view, expected at most %d "
                         "and %d",
                         w->n, w->n_corners, WALLS_MAX, WALLS_MAX_CORNERS);
    for (size_t i = 0; i < w->n_corners; i++)
        if (!isfinite(w->free_view_m[i][0]) || !isfinite(w->free_view_m[i][1]))
            return error_say(why, -EINVAL, "free view has a corner that is no number");
    for (size_t i = 0; i < w->n; i++) {
        int err = check_wall(&w->list[i], why);
        if (err)
            return err;
    }
    return 0;
}

void walls_normalise(struct walls *w)
{
    for (size_t i = 0; i < w->n; i++) {
        double *n = w->list[i].plane.normal;
        double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        for (int a = 0; a < 3 && fabs(length - 1.0) > EXACT; a++)
            n[a] /= length;
    }
}

void walls_to_array(struct walls *w, const struct survey *s)
{
    static const double vehicle_up[3] = {0.0, 0.0, 1.0};
    static const double vehicle_origin[3] = {0.0, 0.0, 0.0};
    struct mount mount;
    double shift[3];

    mount_of_survey(s, &mount);
    mount_to_array(&mount, vehicle_origin, shift);
    for (size_t i = 0; i < w->n; i++) {
        struct wall *plane = &w->list[i].plane;
        wall_move(plane, vehicle_up, (const double(*)[3])mount.axes, shift, plane);
        wall_face(plane);
    }
}

/* A line from p to infinity crosses the border an odd number of times (Shimrat 1962). */
bool walls_in_free_view(const struct walls *w, const double p[3])
{
    bool inside = false;

    for (size_t i = 0, k = w->n_corners - 1; i < w->n_corners; k = i++) {
        const double *a = w->free_view_m[i], *b = w->free_view_m[k];
        if ((a[1] > p[2]) != (b[1] > p[2]) &&
            p[0] < a[0] + (b[0] - a[0]) * (p[2] - a[1]) / (b[1] - a[1]))
            inside = !inside;
    }
    return inside;
}
