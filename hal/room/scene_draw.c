/* SPDX-License-Identifier: MIT */
/* hal/room/scene_draw.c -- what another draw of a scene changes of where its wall stands
 * and how its objects go. */
#include <math.h>
#include <string.h>

#include "hal/random.h"
#include "hal/room/scene.h"
#include "hal/room/vector.h"

enum { STREAM_WALL = 14, STREAM_PATH = 15 };

void scene_up(const struct survey *s, double up[3])
{
    static const double array_up[3] = {0, 1, 0};
    double z_axis[3];
    memcpy(up, array_up, sizeof array_up);
    if (!s->has_mount)
        return;
    vector_cross(s->mount_x_axis, s->mount_y_axis, z_axis);
    up[0] = s->mount_x_axis[2];
    up[1] = s->mount_y_axis[2];
    up[2] = z_axis[2];
    vector_normalize(up);
}

static double around(struct random *r, double most)
{
    return most * (2 * random_even(r) - 1);
}

/* Turns v around a unit axis (Rodrigues). */
static void turn(const double axis[3], double angle, double v[3])
{
    double across[3], along = vector_dot(axis, v);
    vector_cross(axis, v, across);
    for (int k = 0; k < 3; k++)
        v[k] = cos(angle) * v[k] + sin(angle) * across[k] +
               (1 - cos(angle)) * along * axis[k];
}

static void draw_wall(const struct scene_drawn *drawn, const double up[3], uint32_t seed,
                      struct survey *s)
{
    struct random r;
    random_seed(&r, (uint64_t[]){seed, STREAM_WALL}, 2);
    s->wall_distance_m += around(&r, drawn->wall_m);
    turn(up, around(&r, drawn->wall_deg) * M_PI / 180, s->wall_normal);
    if (s->n_walls) {
        s->walls[0].distance_m = s->wall_distance_m;
        memcpy(s->walls[0].normal, s->wall_normal, sizeof s->wall_normal);
    }
}

/* In the middle between the farthest knots along each axis. */
static void middle_of(const struct scene_object *o, double out[3])
{
    for (int a = 0; a < 3; a++) {
        double from = o->path[0].position_m[a], to = from;
        for (unsigned k = 1; k < o->n_path; k++) {
            from = fmin(from, o->path[k].position_m[a]);
            to = fmax(to, o->path[k].position_m[a]);
        }
        out[a] = (from + to) / 2;
    }
}

static double leg_m(const struct scene_knot *from, const struct scene_knot *to)
{
    double way[3];
    vector_add(to->position_m, -1, from->position_m, way);
    return sqrt(vector_dot(way, way));
}

/* Each leg takes as long as its speed says; where nobody goes, as long as before. */
static void set_speed(struct scene_object *o, double speed_m_s)
{
    double before_s = o->path[0].t_s;
    for (unsigned k = 1; k < o->n_path; k++) {
        double way_m = leg_m(&o->path[k - 1], &o->path[k]);
        double takes_s = o->path[k].t_s - before_s;
        before_s = o->path[k].t_s;
        o->path[k].t_s = o->path[k - 1].t_s + (way_m > 0 ? way_m / speed_m_s : takes_s);
    }
}

double scene_path_ends_s(const struct scene_object *o, double speed_m_s)
{
    double end_s = o->path[0].t_s;
    for (unsigned k = 1; k < o->n_path; k++) {
        double way_m = leg_m(&o->path[k - 1], &o->path[k]);
        end_s += way_m > 0 ? way_m / speed_m_s : o->path[k].t_s - o->path[k - 1].t_s;
    }
    return end_s;
}

static void draw_path(struct scene_object *o, const double up[3], uint32_t seed,
                      unsigned number)
{
    const struct scene_drawn_path *drawn = o->drawn;
    struct random r;
    double middle[3], shift[3];
    random_seed(&r, (uint64_t[]){seed, STREAM_PATH, number}, 3);
    middle_of(o, middle);
    double angle = around(&r, drawn->turn_deg) * M_PI / 180;
    if (random_even(&r) < 0.5 && drawn->reversed)
        angle += M_PI;
    for (int k = 0; k < 3; k++)
        shift[k] = around(&r, drawn->shift_m[k]);
    for (unsigned k = 0; k < o->n_path; k++) {
        double *p = o->path[k].position_m;
        vector_add(p, -1, middle, p);
        turn(up, angle, p);
        vector_add(p, 1, middle, p);
        vector_add(p, 1, shift, p);
    }
    memcpy(o->position_m, o->path[0].position_m, sizeof o->path[0].position_m);
    double part = random_even(&r);
    if (drawn->speed_m_s)
        set_speed(o, drawn->speed_m_s[0] +
                         part * (drawn->speed_m_s[1] - drawn->speed_m_s[0]));
}

void scene_draw(struct scene *s, struct survey *survey)
{
    double up[3];
    scene_up(survey, up);
    if (s->drawn)
        draw_wall(s->drawn, up, s->seed, survey);
    for (unsigned i = 0; i < s->n_objects; i++)
        if (s->objects[i].drawn)
            draw_path(&s->objects[i], up, s->seed, i);
}
