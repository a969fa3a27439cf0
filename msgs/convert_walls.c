#include <errno.h>
#include <math.h>
#include <string.h>

#include "msgs/convert.h"
#include "recon/vehicle_frame.h"

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

static int take_wall(struct wall_gate *out, const Anlos__Wall *m, struct error *why)
{
    if (!m->normal || !isfinite(m->distance_m) || !m->id)
        return error_say(why, -EINVAL, "a wall without id, normal or distance");
    const double n[3] = {m->normal->x, m->normal->y, m->normal->z};
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    if (!(fabs(length - 1.0) <= SURVEY_UNIT_TOLERANCE))
        return error_say(why, -EINVAL,
                         "wall %u has a normal of the length %g, expected 1", m->id,
                         length);
    if (m->n_covariance != 0 && (m->n_covariance != 6 || !is_covariance(m->covariance)))
        return error_say(why, -EINVAL, "wall %u has a covariance that is none", m->id);
    if (!(m->gate_near_m >= 0.0 && m->gate_near_m <= m->gate_far_m))
        return error_say(why, -EINVAL,
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

static int take_corners(struct walls *out, const Anlos__WallList *m, struct error *why)
{
    if (m->n_free_view_m % 2 || m->n_free_view_m > 2 * WALLS_MAX_CORNERS)
        return error_say(why, -EINVAL,
                         "free view has %zu numbers, expected x and z of up "
                         "to %d corners",
                         m->n_free_view_m, WALLS_MAX_CORNERS);
    out->n_corners = m->n_free_view_m / 2;
    for (size_t i = 0; i < m->n_free_view_m; i++) {
        if (!isfinite(m->free_view_m[i]))
            return error_say(why, -EINVAL, "free view has a corner that is no number");
        out->free_view_m[i / 2][i % 2] = m->free_view_m[i];
    }
    return 0;
}

int walls_from_message(struct walls *out, const Anlos__WallList *m, struct error *why)
{
    struct walls w = {.n = m->n_walls};
    if (m->n_walls > WALLS_MAX)
        return error_say(why, -EINVAL, "%zu walls, expected at most %d", m->n_walls,
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
                     struct error *why)
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
