/* SPDX-License-Identifier: MIT */
#include "hal/room/traffic.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hal/room/figure.h"
#include "hal/room/motion.h"
#include "hal/room/vector.h"

static struct emitter_piece at_rest(const struct scatter_piece *p, bool facet)
{
    struct emitter_piece out = {.weight = p->weight, .facet = facet};
    memcpy(out.in.at_m, p->in, sizeof p->in);
    memcpy(out.out.at_m, p->out, sizeof p->out);
    memcpy(out.normal, p->normal, sizeof p->normal);
    return out;
}

int traffic_create(struct traffic *out, const struct scene *scene,
                   const struct world *world)
{
    *out = (struct traffic){.scene = scene, .world = world};
    out->pieces = calloc(world->points.n + world->facets.n + 1, sizeof *out->pieces);
    out->clutter = calloc(world->clutter.n + 1, sizeof *out->clutter);
    if (!out->pieces || !out->clutter) {
        traffic_clear(out);
        return -ENOMEM;
    }
    for (size_t i = 0; i < world->clutter.n; i++)
        out->clutter[i] = at_rest(&world->clutter.pieces[i], false);
    out->mirrored = out->clutter + world->clutter.n - world->mirrored.n;
    return 0;
}

void traffic_clear(struct traffic *t)
{
    free(t->pieces);
    free(t->clutter);
    *t = (struct traffic){.n = 0};
}

static void pose_at(const struct traffic *t, size_t object, double t_s,
                    struct figure_pose *out)
{
    struct motion motion;
    motion_at(&t->scene->objects[object], t->world->up, t_s, &motion);
    memcpy(out->centre_m, motion.position_m, sizeof out->centre_m);
    memcpy(out->heading, motion.heading, sizeof out->heading);
    memcpy(out->up, t->world->up, sizeof out->up);
    if (vector_dot(out->heading, out->heading) == 0)
        memcpy(out->heading, t->world->parts[object].heading, sizeof out->heading);
    out->walked_m = motion.walked_m;
}

/* parts: all 0 of a body that is seen through. */
static void set_pieces(const struct scene_object *o, const struct figure_pose *pose,
                       double scattering_length_m, struct scatter_piece *pieces,
                       struct glint_part *parts)
{
    memset(parts, 0, FIGURE_MAX * sizeof *parts);
    if (o->opaque)
        figure_set_opaque(o->kind, pose, scattering_length_m, pieces, parts);
    else
        figure_set(o->kind, pose, scattering_length_m, pieces);
}

/* A body's points at the beginning of the span, and their secants over it. */
static void add_figure(struct traffic *t, size_t object, double from_s, double t_s)
{
    const struct world_part *part = &t->world->parts[object];
    const struct scene_object *o = &t->scene->objects[object];
    double length = o->scattering_length_m ? *o->scattering_length_m
                                           : figure_scattering_length_m(o->kind);
    struct scatter_piece now[FIGURE_MAX], a[FIGURE_MAX], b[FIGURE_MAX];
    struct glint_part parts[FIGURE_MAX], ignored[FIGURE_MAX];
    struct figure_pose pose;
    pose_at(t, object, t_s, &pose);
    set_pieces(o, &pose, length, now, parts);
    pose_at(t, object, from_s, &pose);
    set_pieces(o, &pose, length, a, ignored);
    pose_at(t, object, from_s + TRAFFIC_SPAN_S, &pose);
    set_pieces(o, &pose, length, b, ignored);
    for (size_t i = 0; i < part->n_points; i++) {
        struct emitter_piece *p = &t->pieces[t->n++];
        *p = at_rest(&now[i], false);
        p->part = parts[i];
        p->body = object;
        for (int k = 0; k < 3; k++)
            p->in.velocity_m_s[k] = p->out.velocity_m_s[k] = (b[i].in[k] - a[i].in[k]) /
                                                             TRAFFIC_SPAN_S;
    }
}

static void add_shifted(struct traffic *t, const struct scatter_piece *piece, bool facet,
                        const double shift[3], const double velocity[3])
{
    struct emitter_piece *p = &t->pieces[t->n++];
    *p = at_rest(piece, facet);
    vector_add(p->in.at_m, 1, shift, p->in.at_m);
    vector_add(p->out.at_m, 1, shift, p->out.at_m);
    memcpy(p->in.velocity_m_s, velocity, sizeof p->in.velocity_m_s);
    memcpy(p->out.velocity_m_s, velocity, sizeof p->out.velocity_m_s);
}

/* Anything else keeps its attitude on its path. */
static void add_rigid(struct traffic *t, size_t object, double from_s, double t_s)
{
    const struct world_part *part = &t->world->parts[object];
    const struct scene_object *o = &t->scene->objects[object];
    struct motion now, a, b;
    double shift[3], velocity[3];
    motion_at(o, t->world->up, t_s, &now);
    motion_at(o, t->world->up, from_s, &a);
    motion_at(o, t->world->up, from_s + TRAFFIC_SPAN_S, &b);
    vector_add(now.position_m, -1, o->position_m, shift);
    for (int k = 0; k < 3; k++)
        velocity[k] = (b.position_m[k] - a.position_m[k]) / TRAFFIC_SPAN_S;
    for (size_t i = 0; i < part->n_points; i++)
        add_shifted(t, &t->world->points.pieces[part->point + i], false, shift, velocity);
    for (size_t i = 0; i < part->n_facets; i++)
        add_shifted(t, &t->world->facets.pieces[part->facet + i], true, shift, velocity);
}

void traffic_set(struct traffic *t, double t_s)
{
    const struct scene_drive *drive = t->scene->drive;
    double from_s = drive ? fmin(t_s, drive->period_s - TRAFFIC_SPAN_S) : t_s;
    t->n = 0;
    for (size_t i = 0; i < t->world->n_objects; i++) {
        if (!motion_present(&t->scene->objects[i], t_s))
            continue;
        if (figure_size(t->scene->objects[i].kind, false))
            add_figure(t, i, from_s, t_s);
        else
            add_rigid(t, i, from_s, t_s);
    }
}

void traffic_object(const struct traffic *t, size_t object, double t_s, double centre[3],
                    double velocity[3], double extent[3])
{
    const struct scene_object *o = &t->scene->objects[object];
    const struct room_object *rest = &t->world->objects[object];
    struct figure_pose pose;
    struct motion motion;
    double shift[3];
    motion_at(o, t->world->up, t_s, &motion);
    vector_add(motion.position_m, -1, o->position_m, shift);
    vector_add(rest->position_m, 1, shift, centre);
    memcpy(velocity, motion.velocity_m_s, sizeof motion.velocity_m_s);
    memcpy(extent, rest->extent_m, sizeof rest->extent_m);
    pose_at(t, object, t_s, &pose);
    if (figure_size(o->kind, false))
        figure_extent(o->kind, &pose, extent);
}
