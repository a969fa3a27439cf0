/* SPDX-License-Identifier: MIT */
#include "hal/room/world.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/random.h"
#include "hal/room/figure.h"
#include "hal/room/vector.h"
#include "hal/yaml_file.h"

#define FACETS_PER_WAVELENGTH 2.8  /* of the highest frequency; 2 is the limit */
#define WALL_REACH_M          1.5  /* on the wall, from the array's foot point */
#define TURN_S                0.25 /* a body turns while it goes round a knot, not at it */

enum { STREAM_CLUTTER = 1, STREAM_WALL = 2 };

/* -- where an object is at a time: its path, straight from knot to knot ----------------
 */

struct motion {
    double position_m[3], velocity_m_s[3];
    double heading[3]; /* unit, horizontal: where it goes, a quarter of a second before
                          and after; where it stands, where it last went or will go; 0
                          when it never moves */
    double walked_m;   /* from the beginning of the path on */
};

bool world_has(const struct scene_object *o, double t_s)
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

static void set_direction(const struct scene_object *o, const double up[3], double t_s,
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

/* At a time of the drive; up: unit, the direction that headings leave out. */
static void motion_at(const struct scene_object *o, const double up[3], double t_s,
                      struct motion *out)
{
    unsigned now = leg_at(o, t_s);
    *out = (struct motion){.walked_m = 0};
    position_at(o, t_s, out->position_m);
    set_direction(o, up, t_s, out->heading);
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

/* -- everything as at time 0 -----------------------------------------------------------
 */

struct builder {
    struct world *world;
    const struct scene *scene;
    const struct survey *survey;
    double centre[3]; /* of the array */
    double image[3];  /* the same behind the wall */
    double pitch_m;
};

void world_array_centre(const struct survey *s, double out[3])
{
    memset(out, 0, 3 * sizeof *out);
    for (size_t i = 0; i < s->n_speakers; i++)
        vector_add(out, 0.5 / (double)s->n_speakers, s->speakers_m[i], out);
    for (size_t i = 0; i < s->n_microphones; i++)
        vector_add(out, 0.5 / (double)s->n_microphones, s->microphones_m[i], out);
}

/* The same over all of the stage. */
static void scan_centre(const struct survey *s, double out[3])
{
    double stage = 0;
    world_array_centre(s, out);
    for (size_t k = 0; k < s->n_positions; k++)
        stage += s->stage_positions_m[k] / (double)s->n_positions;
    vector_add(out, stage, s->stage_axis, out);
}

static void plane_of(const struct builder *b, const struct scene_object *o,
                     struct scatter_plane *plane)
{
    static const double array_up[3] = {0, 1, 0};
    double facing[3], up[3];
    if (o->facing)
        memcpy(facing, o->facing, sizeof facing);
    else
        vector_add(b->image, -1, o->position_m, facing);
    memcpy(up, o->up ? o->up : array_up, sizeof up);
    vector_normalize(facing);
    vector_normalize(up);
    scatter_plane_set(plane, o->position_m, facing, up);
}

static void shape_of(const struct scene_object *o, struct scatter_shape *shape)
{
    *shape = (struct scatter_shape){.kind = SHAPE_RECTANGLE};
    for (int a = 0; a < 2 && o->size_m; a++) {
        shape->max[a] = o->size_m[a] / 2;
        shape->min[a] = -shape->max[a];
    }
    if (o->kind == SCENE_LETTER) {
        shape->kind = SHAPE_LETTER;
        shape->letter = o->letter[0];
        shape->stroke_m = *o->stroke_m;
    }
    if (o->kind == SCENE_POLYGON) {
        shape->kind = SHAPE_POLYGON;
        shape->outline = (const double(*)[2])o->outline_m;
        shape->n_outline = o->n_outline;
        for (int a = 0; a < 2; a++)
            shape->min[a] = shape->max[a] = o->outline_m[0][a];
        for (unsigned i = 0; i < o->n_outline; i++)
            for (int a = 0; a < 2; a++) {
                shape->min[a] = fmin(shape->min[a], o->outline_m[i][a]);
                shape->max[a] = fmax(shape->max[a], o->outline_m[i][a]);
            }
    }
    if (o->kind == SCENE_CORNER) {
        /* Seen along its axis a trihedral with edges L returns what enters an area of
         * L^2 / sqrt(3); what enters on one side of the apex leaves on the other. */
        double radius = *o->side_m / sqrt(sqrt(3) * M_PI);
        shape->kind = SHAPE_DISC;
        shape->max[0] = shape->max[1] = radius;
        shape->min[0] = shape->min[1] = -radius;
    }
}

static void describe(const struct builder *b, const struct scene_object *o,
                     const struct scatter_plane *plane, const struct scatter_shape *shape,
                     struct room_object *out)
{
    const struct survey *s = b->survey;
    *out = (struct room_object){.name = ""};
    snprintf(out->name, sizeof out->name, "%s", o->name);
    snprintf(out->kind, sizeof out->kind, "%s", scene_kind_name(o->kind));
    memcpy(out->position_m, o->position_m, sizeof out->position_m);
    if (shape) {
        double middle[2] = {(shape->min[0] + shape->max[0]) / 2,
                            (shape->min[1] + shape->max[1]) / 2};
        double size[2] = {shape->max[0] - shape->min[0], shape->max[1] - shape->min[1]};
        vector_add(out->position_m, middle[0], plane->u, out->position_m);
        vector_add(out->position_m, middle[1], plane->v, out->position_m);
        for (int a = 0; a < 3; a++)
            out->extent_m[a] = fabs(plane->u[a]) * size[0] + fabs(plane->v[a]) * size[1];
    }
    vector_mirror(s->wall_normal, s->wall_distance_m, out->position_m, out->virtual_m);
}

/* Where it goes, or looks, or to the mirrored array. */
static void set_heading(const struct builder *b, const struct scene_object *o,
                        double heading[3])
{
    struct motion motion;
    motion_at(o, b->world->up, 0, &motion);
    memcpy(heading, motion.heading, sizeof motion.heading);
    if (vector_dot(heading, heading) > 0)
        return;
    if (o->facing)
        memcpy(heading, o->facing, 3 * sizeof *heading);
    else
        vector_add(b->image, -1, o->position_m, heading);
    vector_add(heading, -vector_dot(heading, b->world->up), b->world->up, heading);
    if (vector_normalize(heading) < 1e-6) { /* it looks up */
        static const double spare[3] = {1, 0, 0};
        vector_cross(b->world->up, spare, heading);
        vector_normalize(heading);
    }
}

/* A body's pieces; parts: all 0 of one that is seen through. */
static void set_pieces(const struct scene_object *o, const struct figure_pose *pose,
                       struct scatter_piece *pieces, struct glint_part *parts)
{
    double length = o->scattering_length_m ? *o->scattering_length_m
                                           : figure_scattering_length_m(o->kind);
    memset(parts, 0, FIGURE_MAX * sizeof *parts);
    if (o->opaque)
        figure_set_opaque(o->kind, pose, length, pieces, parts);
    else
        figure_set(o->kind, pose, length, pieces);
}

static int add_figure(const struct builder *b, const struct scene_object *o,
                      struct room_object *truth)
{
    struct scatter_piece pieces[FIGURE_MAX];
    struct glint_part parts[FIGURE_MAX];
    struct figure_pose pose = {.walked_m = 0};
    double *heading = b->world->parts[b->world->n_objects].heading;
    set_heading(b, o, heading);
    memcpy(pose.centre_m, o->position_m, sizeof pose.centre_m);
    memcpy(pose.heading, heading, sizeof pose.heading);
    memcpy(pose.up, b->world->up, sizeof pose.up);
    set_pieces(o, &pose, pieces, parts);
    describe(b, o, NULL, NULL, truth);
    figure_extent(o->kind, &pose, truth->extent_m);
    for (size_t i = 0; i < figure_size(o->kind, o->opaque); i++)
        if (scatter_add(&b->world->points, &pieces[i]) < 0)
            return -ENOMEM;
    return 0;
}

static int add_object(const struct builder *b, const struct scene_object *o,
                      struct room_object *truth)
{
    struct scatter_plane plane;
    struct scatter_shape shape;
    if (figure_size(o->kind, false))
        return add_figure(b, o, truth);
    if (o->kind == SCENE_POINT) {
        describe(b, o, NULL, NULL, truth);
        return scatter_add_point(&b->world->points, o->position_m,
                                 *o->scattering_length_m);
    }
    plane_of(b, o, &plane);
    shape_of(o, &shape);
    describe(b, o, &plane, &shape, truth);
    return scatter_add_shape(&b->world->facets, &plane, &shape, b->pitch_m,
                             o->reflectivity ? *o->reflectivity : 1,
                             o->kind == SCENE_CORNER);
}

/* How far a point is in front of the wall, on the array's side. */
static double before_wall(const struct builder *b, const double p[3])
{
    const struct survey *s = b->survey;
    double array_side = vector_dot(s->wall_normal, b->centre) - s->wall_distance_m;
    double side = vector_dot(s->wall_normal, p) - s->wall_distance_m;
    return array_side < 0 ? -side : side;
}

static int check_place(const struct builder *b, const char *name, const double p[3],
                       const char *path, const char *key, struct error *why)
{
    double before_m = before_wall(b, p);
    if (before_m > 0)
        return 0;
    return yaml_error_say(why, -EINVAL, path, key,
                          "%s is %.3f m behind the wall; positions are where objects "
                          "really are, on the array's side",
                          name, -before_m);
}

static int add_objects(const struct builder *b, const char *path, struct error *why)
{
    struct world *w = b->world;
    char key[48];
    if (!(before_wall(b, b->centre) > 0.01))
        return yaml_error_say(why, -EINVAL, path, "wall.distance_m",
                              "the wall goes through the array");
    for (unsigned i = 0; i < b->scene->n_objects; i++) {
        const struct scene_object *o = &b->scene->objects[i];
        snprintf(key, sizeof key, "objects[%u].position_m", i);
        int err = check_place(b, o->name, o->position_m, path, key, why);
        for (unsigned k = 0; k < o->n_path && !err; k++) {
            snprintf(key, sizeof key, "objects[%u].path[%u].position_m", i, k);
            err = check_place(b, o->name, o->path[k].position_m, path, key, why);
        }
        if (err)
            return err;
        struct world_part *part = &w->parts[w->n_objects];
        part->point = w->points.n;
        part->facet = w->facets.n;
        if (add_object(b, o, &w->objects[w->n_objects]) < 0)
            return error_say(why, -ENOMEM, "%s: out of memory", path);
        part->n_points = w->points.n - part->point;
        part->n_facets = w->facets.n - part->facet;
        w->n_objects++;
    }
    return 0;
}

/* Diffuse patches around the point of the wall that is nearest to the array. */
static int add_patches(const struct builder *b)
{
    const struct scene_wall *wall = b->scene->wall_sound;
    const struct survey *s = b->survey;
    static const double up[3] = {0, 1, 0};
    struct scatter_plane plane;
    struct random r;
    double foot[3];
    random_seed(&r, (uint64_t[]){b->scene->seed, STREAM_WALL}, 2);
    vector_add(b->centre, s->wall_distance_m - vector_dot(s->wall_normal, b->centre),
               s->wall_normal, foot);
    scatter_plane_set(&plane, foot, s->wall_normal, up);
    for (uint32_t i = 0; i < wall->patches; i++) {
        double p[3];
        vector_add(foot, WALL_REACH_M * (2 * random_even(&r) - 1), plane.u, p);
        vector_add(p, WALL_REACH_M * (2 * random_even(&r) - 1), plane.v, p);
        vector_add(p, wall->roughness_m * random_normal(&r), s->wall_normal, p);
        double length_m = wall->scattering_length_m * random_normal(&r);
        if (mirror_is_at(&b->world->mirror, p) &&
            scatter_add_point(&b->world->clutter, p, length_m) < 0)
            return -ENOMEM;
    }
    return 0;
}

/* Anywhere around the array at a distance of near_m to far_m, before the wall. */
static int add_surroundings(const struct builder *b)
{
    const struct scene_clutter *c = b->scene->clutter;
    const struct survey *s = b->survey;
    struct random r;
    random_seed(&r, (uint64_t[]){b->scene->seed, STREAM_CLUTTER}, 2);
    for (uint32_t i = 0; i < c->points; i++) {
        double p[3], way[3] = {random_normal(&r), random_normal(&r), random_normal(&r)};
        vector_normalize(way);
        vector_add(b->centre, c->near_m + (c->far_m - c->near_m) * random_even(&r), way,
                   p);
        if (before_wall(b, p) < 0)
            vector_mirror(s->wall_normal, s->wall_distance_m, p, p);
        if (scatter_add_point(&b->world->clutter, p,
                              c->scattering_length_m * random_normal(&r)) < 0)
            return -ENOMEM;
    }
    return 0;
}

/* What is heard without the wall's mirror: the roughness of the wall itself, and what
 * stands around, which the wall may mirror, too. */
static int add_clutter(const struct builder *b)
{
    struct world *w = b->world;
    int err = add_patches(b);
    size_t n_patches = w->clutter.n;
    if (!err)
        err = add_surroundings(b);
    if (!err && b->scene->clutter->mirrored && w->clutter.n)
        w->mirrored = (struct scatter){.n = w->clutter.n - n_patches,
                                       .pieces = w->clutter.pieces + n_patches};
    return err;
}

int world_create(struct world *out, const struct scene *scene, const struct survey *s,
                 const char *path, struct error *why)
{
    struct builder b = {.world = out, .scene = scene, .survey = s};
    *out = (struct world){.n_objects = 0};
    out->objects = calloc(scene->n_objects + 1, sizeof *out->objects);
    out->parts = calloc(scene->n_objects + 1, sizeof *out->parts);
    if (!out->objects || !out->parts) {
        world_clear(out);
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    }
    scene_up(s, out->up);
    scan_centre(s, b.centre);
    vector_mirror(s->wall_normal, s->wall_distance_m, b.centre, b.image);
    b.pitch_m = s->sound_speed_m_s / fmax(s->chirp_start_hz, s->chirp_stop_hz) /
                FACETS_PER_WAVELENGTH;
    mirror_set(&out->mirror, s, scene->wall_sound, out->up);
    int err = add_objects(&b, path, why);
    if (!err && add_clutter(&b) < 0)
        err = error_say(why, -ENOMEM, "%s: out of memory", path);
    if (err)
        world_clear(out);
    return err;
}

void world_clear(struct world *w)
{
    scatter_clear(&w->points);
    scatter_clear(&w->facets);
    scatter_clear(&w->clutter);
    free(w->objects);
    free(w->parts);
    *w = (struct world){.n_objects = 0};
}

/* -- the hidden objects of a drive at a time -------------------------------------------
 */

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

/* A body's points at the beginning of the span, and their secants over it. */
static void add_moving_figure(struct traffic *t, size_t object, double from_s, double t_s)
{
    const struct world_part *part = &t->world->parts[object];
    const struct scene_object *o = &t->scene->objects[object];
    struct scatter_piece now[FIGURE_MAX], a[FIGURE_MAX], b[FIGURE_MAX];
    struct glint_part parts[FIGURE_MAX], ignored[FIGURE_MAX];
    struct figure_pose pose;
    pose_at(t, object, t_s, &pose);
    set_pieces(o, &pose, now, parts);
    pose_at(t, object, from_s, &pose);
    set_pieces(o, &pose, a, ignored);
    pose_at(t, object, from_s + TRAFFIC_SPAN_S, &pose);
    set_pieces(o, &pose, b, ignored);
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
static void add_moving_thing(struct traffic *t, size_t object, double from_s, double t_s)
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
        if (!world_has(&t->scene->objects[i], t_s))
            continue;
        if (figure_size(t->scene->objects[i].kind, false))
            add_moving_figure(t, i, from_s, t_s);
        else
            add_moving_thing(t, i, from_s, t_s);
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
