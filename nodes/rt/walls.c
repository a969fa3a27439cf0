#include "nodes/rt/walls.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "nodes/rt/vehicle_frame.h"

static const double array_up[3] = {0.0, 1.0, 0.0};

void walls_from_survey(struct walls *out, const struct survey *s)
{
    *out = (struct walls){.n = s->n_walls};
    for (size_t i = 0; i < s->n_walls; i++) {
        struct wall_gate *w = &out->list[i];
        w->id = (uint32_t)i + 1;
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

static int take_wall(struct wall_gate *out, const Anlos__Wall *m, struct complaint *why)
{
    if (!m->normal || !isfinite(m->distance_m) || !m->id)
        return complain(why, -EINVAL, "a wall without id, normal or distance");
    const double n[3] = {m->normal->x, m->normal->y, m->normal->z};
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    if (!(fabs(length - 1.0) <= SURVEY_UNIT_TOLERANCE))
        return complain(why, -EINVAL, "wall %u has a normal of the length %g, expected 1",
                        m->id, length);
    if (m->n_covariance != 0 && (m->n_covariance != 6 || !is_covariance(m->covariance)))
        return complain(why, -EINVAL, "wall %u has a covariance that is none", m->id);
    if (!(m->gate_near_m >= 0.0 && m->gate_near_m <= m->gate_far_m))
        return complain(why, -EINVAL,
                        "wall %u has the gate %g to %g m, expected 0 <= near "
                        "<= far",
                        m->id, m->gate_near_m, m->gate_far_m);
    *out = (struct wall_gate){.id = m->id,
                              .plane = {.distance_m = m->distance_m},
                              .gate_m = {m->gate_near_m, m->gate_far_m}};
    for (int a = 0; a < 3; a++)
        out->plane.normal[a] = n[a] / length;
    if (m->n_covariance)
        memcpy(out->plane.covariance, m->covariance, sizeof out->plane.covariance);
    return 0;
}

static int take_corners(struct walls *out, const Anlos__WallList *m,
                        struct complaint *why)
{
    if (m->n_free_view_m % 2 || m->n_free_view_m > 2 * WALLS_MAX_CORNERS)
        return complain(why, -EINVAL,
                        "free view has %zu numbers, expected x and z of up "
                        "to %d corners",
                        m->n_free_view_m, WALLS_MAX_CORNERS);
    out->n_corners = m->n_free_view_m / 2;
    for (size_t i = 0; i < m->n_free_view_m; i++) {
        if (!isfinite(m->free_view_m[i]))
            return complain(why, -EINVAL, "free view has a corner that is no number");
        out->free_view_m[i / 2][i % 2] = m->free_view_m[i];
    }
    return 0;
}

int walls_from_message(struct walls *out, const Anlos__WallList *m, struct complaint *why)
{
    struct walls w = {.n = m->n_walls};
    if (m->n_walls > WALLS_MAX)
        return complain(why, -EINVAL, "%zu walls, expected at most %d", m->n_walls,
                        WALLS_MAX);
    int err = take_corners(&w, m, why);
    for (size_t i = 0; !err && i < m->n_walls; i++) {
        double said = m->walls[i]->existence; /* 0: it is not */
        err = take_wall(&w.list[i], m->walls[i], why);
        w.existence[i] = said > 0.0 ? fmin(said, 1.0) : 1.0;
    }
    if (!err)
        *out = w;
    return err;
}

int walls_from_given(struct walls *out, const Anlos__WallList *m, const struct survey *s,
                     struct complaint *why)
{
    static const double vehicle_up[3] = {0.0, 0.0, 1.0};
    static const double vehicle_origin[3] = {0.0, 0.0, 0.0};
    struct mount mount;
    double shift[3];
    int err = walls_from_message(out, m, why);

    if (err)
        return err;
    vehicle_frame_mount(s, &mount);
    mount_to_array(&mount, vehicle_origin, shift);
    for (size_t i = 0; i < out->n; i++) {
        struct wall *w = &out->list[i].plane;
        wall_move(w, vehicle_up, (const double(*)[3])mount.axes, shift, w);
        wall_face(w);
    }
    return 0;
}

void walls_step(struct walls *w, const struct survey *s, const struct ego_step *step)
{
    struct mount mount;
    double r[3][3], t[3];

    vehicle_frame_mount(s, &mount);
    mount_step(&mount, step, r, t);
    for (size_t i = 0; i < w->n; i++)
        wall_move(&w->list[i].plane, array_up, (const double(*)[3])r, t,
                  &w->list[i].plane);
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
