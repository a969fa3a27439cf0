/* SPDX-License-Identifier: MIT */
#include "hal/room/world.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/random.h"
#include "hal/room/figure.h"
#include "hal/room/motion.h"
#include "hal/room/vector.h"
#include "hal/yaml_file.h"

#define FACETS_PER_WAVELENGTH 2.8 /* of the highest frequency; 2 is the limit */
#define WALL_REACH_M          1.5 /* on the wall, from the array's foot point */

enum { STREAM_CLUTTER = 1, STREAM_WALL = 2 };

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

static int add_figure(const struct builder *b, const struct scene_object *o,
                      struct room_object *truth)
{
    struct scatter_piece pieces[FIGURE_MAX];
    struct glint_part parts[FIGURE_MAX];
    struct figure_pose pose = {.walked_m = 0};
    double length = o->scattering_length_m ? *o->scattering_length_m
                                           : figure_scattering_length_m(o->kind);
    double *heading = b->world->parts[b->world->n_objects].heading;
    set_heading(b, o, heading);
    memcpy(pose.centre_m, o->position_m, sizeof pose.centre_m);
    memcpy(pose.heading, heading, sizeof pose.heading);
    memcpy(pose.up, b->world->up, sizeof pose.up);
    if (o->opaque)
        figure_set_opaque(o->kind, &pose, length, pieces, parts);
    else
        figure_set(o->kind, &pose, length, pieces);
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
