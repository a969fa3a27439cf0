#include <errno.h>
#include <math.h>
#include <string.h>

#include "msgs/convert.h"

static int take_wall(struct wall_gate *out, const Anlos__Wall *m, struct error *why)
{
    if (!m->normal)
        return error_say(why, -EINVAL, "a wall without id, normal or distance");
    if (m->n_covariance != 0 && m->n_covariance != 6)
        return error_say(why, -EINVAL, "wall %u has a covariance that is none", m->id);
    *out =
        (struct wall_gate){.id = m->id,
                           .plane = {.normal = {m->normal->x, m->normal->y, m->normal->z},
                                     .distance_m = m->distance_m},
                           .gate_m = {m->gate_near_m, m->gate_far_m}};
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
    for (size_t i = 0; i < m->n_free_view_m; i++)
        out->free_view_m[i / 2][i % 2] = m->free_view_m[i];
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
        w.unseen_s[i] = m->walls[i]->unseen_s;
        w.origin[i] = (enum wall_origin)m->walls[i]->origin;
    }
    if (!err)
        err = walls_check(&w, why);
    if (err)
        return err;
    walls_normalise(&w);
    *out = w;
    return 0;
}

static Anlos__Wall *set_wall(const struct walls *w, size_t i, struct walls_view *view)
{
    const struct wall_gate *from = &w->list[i];
    Anlos__Vec3 *normal = &view->normals[i];
    Anlos__Wall *m = &view->walls[i];

    anlos__vec3__init(normal);
    normal->x = from->plane.normal[0];
    normal->y = from->plane.normal[1];
    normal->z = from->plane.normal[2];
    anlos__wall__init(m);
    m->id = from->id;
    m->origin = (Anlos__Wall__Origin)w->origin[i];
    m->normal = normal;
    m->distance_m = from->plane.distance_m;
    m->gate_near_m = from->gate_m[0];
    m->gate_far_m = from->gate_m[1];
    m->existence = w->existence[i];
    m->unseen_s = w->unseen_s[i];
    if (w->origin[i] != WALL_CONFIGURED) {
        m->n_covariance = 6;
        m->covariance =
            (double *)(uintptr_t)from->plane.covariance; /* packing only reads */
    }
    return m;
}

void walls_to_message(const struct walls *w, const char *text, struct walls_view *view,
                      Anlos__WallList *m)
{
    anlos__wall_list__init(m);
    for (size_t i = 0; i < w->n; i++)
        view->each[i] = set_wall(w, i, view);
    m->n_walls = w->n;
    m->walls = view->each;
    m->text = (char *)(uintptr_t)text; /* packing only reads */
    m->n_free_view_m = 2 * w->n_corners;
    m->free_view_m = (double *)(uintptr_t)w->free_view_m;
}
