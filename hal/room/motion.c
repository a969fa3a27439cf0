/* SPDX-License-Identifier: MIT */
#include "hal/room/motion.h"

#include <string.h>

#include "hal/room/vector.h"

#define TURN_S 0.25 /* a body turns while it goes round a knot, not at it */

bool motion_present(const struct scene_object *o, double t_s)
{
    return !o->present_s || (t_s >= o->present_s[0] && t_s < o->present_s[1]);
}

/* The leg from knot k to k + 1 that a time is in; n_path - 1 or more: after them all. */
static unsigned leg_at(const struct scene_object *o, double t_s)
{
    unsigned k = 0;
    while (k < o->n_path && t_s >= o->path[k].t_s)
        k++;
    return k ? k - 1 : o->n_path;
}

static void position_at(const struct scene_object *o, double t_s, double out[3])
{
    unsigned k = leg_at(o, t_s);
    if (!o->n_path || k == o->n_path) {
        memcpy(out, o->position_m, 3 * sizeof *out);
        return;
    }
    const struct scene_knot *a = &o->path[k], *b = a + (k + 1 < o->n_path);
    double part = b == a ? 0 : (t_s - a->t_s) / (b->t_s - a->t_s);
    for (int i = 0; i < 3; i++)
        out[i] = a->position_m[i] + part * (b->position_m[i] - a->position_m[i]);
}

/* The horizontal part of b - a with length 1; false: there is none. */
static bool direction(const double a[3], const double b[3], const double up[3],
                      double out[3])
{
    double way[3];
    vector_add(b, -1, a, way);
    vector_add(way, -vector_dot(way, up), up, way);
    if (vector_normalize(way) < 1e-6)
        return false;
    memcpy(out, way, sizeof way);
    return true;
}

static void set_heading(const struct scene_object *o, const double up[3], double t_s,
                        double out[3])
{
    double before[3], after[3];
    memset(out, 0, 3 * sizeof *out);
    position_at(o, t_s - TURN_S, before);
    position_at(o, t_s + TURN_S, after);
    if (direction(before, after, up, out))
        return;
    bool found = false;
    for (unsigned k = 1; k < o->n_path && !(found && o->path[k - 1].t_s > t_s); k++)
        found |= direction(o->path[k - 1].position_m, o->path[k].position_m, up, out);
}

void motion_at(const struct scene_object *o, const double up[3], double t_s,
               struct motion *out)
{
    unsigned now = leg_at(o, t_s);
    *out = (struct motion){.walked_m = 0};
    position_at(o, t_s, out->position_m);
    set_heading(o, up, t_s, out->heading);
    for (unsigned k = 0; k + 1 < o->n_path; k++) {
        const struct scene_knot *a = &o->path[k], *b = a + 1;
        double way[3], end[3];
        if (t_s < a->t_s)
            break;
        memcpy(end, k == now ? out->position_m : b->position_m, sizeof end);
        vector_add(end, -1, a->position_m, way);
        out->walked_m += sqrt(vector_dot(way, way));
        for (int i = 0; k == now && i < 3; i++)
            out->velocity_m_s[i] = (b->position_m[i] - a->position_m[i]) /
                                   (b->t_s - a->t_s);
    }
}
