#include "hal/room/world.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/random.h"
#include "hal/room/vector.h"
#include "hal/survey/place.h"

#define FACETS_PER_WAVELENGTH 2.8 /* of the highest frequency; 2 is the limit */
#define WALL_REACH_M          1.5 /* clutter on the wall, from the array's foot point */

enum { STREAM_CLUTTER = 1, STREAM_WALL = 2 };

struct builder {
    struct world *world;
    const struct scene *scene;
    const struct survey *survey;
    double centre[3]; /* of the array */
    double image[3];  /* the same behind the wall */
    double pitch_m;
};

static void array_centre(const struct survey *s, double out[3])
{
    double stage = 0;
    memset(out, 0, 3 * sizeof *out);
    for (size_t i = 0; i < s->n_speakers; i++)
        vector_add(out, 0.5 / (double)s->n_speakers, s->speakers_m[i], out);
    for (size_t i = 0; i < s->n_microphones; i++)
        vector_add(out, 0.5 / (double)s->n_microphones, s->microphones_m[i], out);
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
    static const char *const kinds[] = {"point", "rectangle", "polygon", "letter",
                                        "corner"};
    const struct survey *s = b->survey;
    *out = (struct room_object){.name = ""};
    snprintf(out->name, sizeof out->name, "%s", o->name);
    snprintf(out->kind, sizeof out->kind, "%s", kinds[o->kind]);
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

static int add_object(const struct builder *b, const struct scene_object *o,
                      struct room_object *truth)
{
    struct scatter_plane plane;
    struct scatter_shape shape;
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

static int add_objects(const struct builder *b, const char *path, struct complaint *why)
{
    struct world *w = b->world;
    char key[48];
    if (!(before_wall(b, b->centre) > 0.01))
        return yaml_complain(why, -EINVAL, path, "wall.distance_m",
                             "the wall goes through the array");
    for (unsigned i = 0; i < b->scene->n_objects; i++) {
        const struct scene_object *o = &b->scene->objects[i];
        snprintf(key, sizeof key, "objects[%u].position_m", i);
        double before_m = before_wall(b, o->position_m);
        if (before_m <= 0)
            return yaml_complain(why, -EINVAL, path, key,
                                 "%s is %.3f m behind the wall; positions are where "
                                 "objects really are, on the array's side",
                                 o->name, -before_m);
        if (add_object(b, o, &w->objects[w->n_objects]) < 0)
            return complain(why, -ENOMEM, "%s: out of memory", path);
        w->n_objects++;
    }
    return 0;
}

/* Diffuse patches around the point of the wall that is nearest to the array. */
static int add_wall_clutter(const struct builder *b)
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
        if (scatter_add_point(&b->world->clutter, p,
                              wall->scattering_length_m * random_normal(&r)) < 0)
            return -ENOMEM;
    }
    return 0;
}

/* Anywhere around the array at a distance of near_m to far_m, before the wall. */
static int add_room_clutter(const struct builder *b)
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

int world_create(struct world *out, const struct scene *scene, const struct survey *s,
                 const char *path, struct complaint *why)
{
    struct builder b = {.world = out, .scene = scene, .survey = s};
    *out = (struct world){.n_objects = 0};
    out->objects = calloc(scene->n_objects + 1, sizeof *out->objects);
    if (!out->objects)
        return complain(why, -ENOMEM, "%s: out of memory", path);
    array_centre(s, b.centre);
    vector_mirror(s->wall_normal, s->wall_distance_m, b.centre, b.image);
    b.pitch_m = s->sound_speed_m_s / fmax(s->chirp_start_hz, s->chirp_stop_hz) /
                FACETS_PER_WAVELENGTH;
    int err = add_objects(&b, path, why);
    if (!err && (add_wall_clutter(&b) < 0 || add_room_clutter(&b) < 0))
        err = complain(why, -ENOMEM, "%s: out of memory", path);
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
    *w = (struct world){.n_objects = 0};
}
