/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"

static int take_wall(struct wall_gate *out, const Anlos__Wall *m, struct error *why)
{
    if (!m->normal)
        return error_say(why, -EINVAL, "a wall without id, normal or distance");
    if (m->n_covariance != 0 && m->n_covariance != 6)
        return error_say(why, -EINVAL, "wall %u has a covariance that is none", m->id);
    if (m->n_ends_m != 0 && m->n_ends_m != 2)
        return error_say(why, -EINVAL, "wall %u has %zu ends, expected 2 or none", m->id,
                         m->n_ends_m);
    *out =
        (struct wall_gate){.id = m->id,
                           .plane = {.normal = {m->normal->x, m->normal->y, m->normal->z},
                                     .distance_m = m->distance_m},
                           .gate_m = {m->gate_near_m, m->gate_far_m}};
    if (m->n_covariance)
        memcpy(out->plane.covariance, m->covariance, sizeof out->plane.covariance);
    if (m->n_ends_m)
        memcpy(out->plane.ends_m, m->ends_m, sizeof out->plane.ends_m);
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
    if (wall_ends(&from->plane)) {
        m->n_ends_m = 2;
        m->ends_m = (double *)(uintptr_t)from->plane.ends_m;
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

/* -- what arrived of a ping -------------------------------------------------------------
 */

void returns_room_clear(struct returns_room *room)
{
    free(room->at);
    free(room->heard);
    free(room->arrivals);
    free(room->path_m);
    free(room->amplitude);
    *room = (struct returns_room){.n = 0};
}

static int make_room(struct returns_room *room, size_t n)
{
    if (room->n >= n)
        return 0;
    returns_room_clear(room);
    room->at = calloc(n, sizeof *room->at);
    room->heard = calloc(n, sizeof *room->heard);
    room->arrivals = calloc(n, sizeof *room->arrivals);
    room->path_m = calloc(n, WALL_PEAKS * sizeof *room->path_m);
    room->amplitude = calloc(n, WALL_PEAKS * sizeof *room->amplitude);
    if (!room->at || !room->heard || !room->arrivals || !room->path_m ||
        !room->amplitude) {
        returns_room_clear(room);
        return -ENOMEM;
    }
    room->n = n;
    return 0;
}

int returns_to_message(const struct wall_returns *r, struct returns_room *room,
                       Anlos__Echoes *m)
{
    size_t n = r->usable ? r->n_microphones : 0, total = 0;
    int err = make_room(room, n);

    if (err)
        return err;
    for (size_t i = 0; i < n; i++) {
        room->heard[i] = r->at[i].heard;
        room->arrivals[i] = r->at[i].n;
        for (size_t k = 0; k < r->at[i].n; k++, total++) {
            room->path_m[total] = r->at[i].peaks[k].path_m;
            room->amplitude[total] = r->at[i].peaks[k].amplitude;
        }
    }
    anlos__echoes__init(m);
    m->survey_id = r->ping.survey_id;
    m->scan = r->ping.scan;
    m->pass = r->ping.pass == PASS_BACKGROUND ? ANLOS__PASS__BACKGROUND
                                              : ANLOS__PASS__SCENE;
    m->position = r->ping.position;
    m->speaker = r->ping.speaker;
    m->down = r->ping.down;
    m->frame = r->ping.frame;
    m->usable = r->usable;
    m->n_heard = m->n_arrivals = n;
    m->heard = room->heard;
    m->arrivals = room->arrivals;
    m->n_path_m = m->n_amplitude = total;
    m->path_m = room->path_m;
    m->amplitude = room->amplitude;
    return 0;
}

static bool holds(const Anlos__Echoes *m)
{
    size_t total = 0;

    for (size_t i = 0; i < m->n_arrivals; i++) {
        if (m->arrivals[i] > WALL_PEAKS)
            return false;
        total += m->arrivals[i];
    }
    for (size_t k = 0; k < m->n_path_m && k < m->n_amplitude; k++)
        if (!isfinite(m->path_m[k]) || !(m->amplitude[k] > 0.0) ||
            !isfinite(m->amplitude[k]))
            return false;
    return m->n_heard == m->n_arrivals && m->n_path_m == total && m->n_amplitude == total;
}

int returns_from_message(struct wall_returns *r, struct returns_room *room,
                         const Anlos__Echoes *m, int64_t capture_ns)
{
    size_t n = m->n_heard, next = 0;
    int err = holds(m) ? make_room(room, n) : -EINVAL;

    if (err)
        return err;
    for (size_t i = 0; i < n; i++) {
        struct wall_arrivals *a = &room->at[i];
        *a = (struct wall_arrivals){.heard = m->heard[i], .n = m->arrivals[i]};
        for (size_t k = 0; k < a->n; k++, next++)
            a->peaks[k] = (struct wall_echo_peak){m->path_m[next], m->amplitude[next]};
    }
    *r = (struct wall_returns){.ping = {.survey_id = m->survey_id,
                                        .capture_ns = capture_ns,
                                        .scan = m->scan,
                                        .frame = m->frame,
                                        .pass = m->pass == ANLOS__PASS__BACKGROUND
                                                    ? PASS_BACKGROUND
                                                    : PASS_SCENE,
                                        .position = m->position,
                                        .speaker = m->speaker,
                                        .down = m->down,
                                        .valid = m->usable},
                               .usable = m->usable,
                               .n_microphones = n,
                               .at = room->at};
    return 0;
}
