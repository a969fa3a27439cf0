/* SPDX-License-Identifier: MIT */
#include "nodes/foxglove/channels.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "foxglove/figures.pb-c.h"
#include "foxglove/image.pb-c.h"
#include "foxglove/log.pb-c.h"
#include "foxglove/transforms.pb-c.h"
#include "msgs/bag/schemas.h"
#include "msgs/convert.h"
#include "msgs/detections.pb-c.h"
#include "msgs/log.pb-c.h"
#include "msgs/stage.pb-c.h"
#include "nodes/foxglove/image.h"
#include "nodes/rt/export_projection.h"
#include "nodes/rt/list_figures.h"
#include "nodes/rt/names.h"
#include "recon/detection/objects.h"
#include "recon/inverse/symmetric.h"

#define FRAME_VEHICLE "vehicle"
#define FRAME_ARRAY   "array"
#define FRAME_STAGE   "stage"

/* -- messages of ours in schemas of Foxglove ----------------------------------------- */

#define MAX_POINTS 100000u
#define N_FIELDS   4u

static const char *const names[N_FIELDS] = {"x", "y", "z", "intensity"};

/* Where a voxel really is. */
static void place(const struct image *image, size_t x, size_t y, size_t z, float out[3])
{
    const size_t index[3] = {x, y, z};
    double p[3];

    for (int a = 0; a < 3; a++)
        p[a] = image->grid.origin_m[a] + (double)index[a] * image->grid.step_m[a];
    if (image->wall)
        wall_mirror(image->wall, p, p);
    for (int a = 0; a < 3; a++)
        out[a] = (float)p[a];
}

static size_t put_points(const struct image *image, float (*out)[N_FIELDS])
{
    const struct grid *g = &image->grid;
    const float *v = image->intensity;
    size_t n = 0;

    for (size_t z = 0; z < g->n[2]; z++) {
        for (size_t y = 0; y < g->n[1]; y++) {
            for (size_t x = 0; x < g->n[0]; x++, v++) {
                if (!(*v >= image->levels.threshold && *v <= image->levels.brightest))
                    continue;
                place(image, x, y, z, out[n]);
                out[n++][3] = level_db(&image->levels, *v, -(float)LEVEL_RANGE_DB);
            }
        }
    }
    return n;
}

/* "volume" to foxglove.PointCloud: x, y, z in m and intensity in dB of the brightest
 * voxel, of those that stand out. */
static int convert_cloud(struct arena *a, const struct setting *s,
                         const struct foxglove_message *m, ProtobufCMessage **out)
{
    static const double origin[3] = {0.0, 0.0, 0.0};
    Foxglove__PointCloud *cloud = arena_one(a, sizeof *cloud);
    struct image image;
    int err = image_open(&image, s, m, MAX_POINTS);

    if (err)
        return err;
    float(*points)[N_FIELDS] = arena_array(a, image.levels.n, sizeof *points);
    foxglove__point_cloud__init(cloud);
    cloud->timestamp = part_time(a, m->capture_ns ? m->capture_ns : m->publish_ns);
    cloud->frame_id = arena_print(a, FRAME_ARRAY);
    cloud->pose = part_pose(a, origin, NULL);
    cloud->point_stride = sizeof *points;
    cloud->fields = part_fields(a, names, N_FIELDS);
    cloud->n_fields = cloud->fields ? N_FIELDS : 0;
    if (points) {
        cloud->data.len = put_points(&image, points) * sizeof *points;
        cloud->data.data = (uint8_t *)points;
    }
    *out = &cloud->base;
    return a->failed ? -ENOMEM : 0;
}

static Foxglove__Log__Level level_of(Anlos__Log__Level level)
{
    switch (level) {
    case ANLOS__LOG__LEVEL__DEBUG:
        return FOXGLOVE__LOG__LEVEL__DEBUG;
    case ANLOS__LOG__LEVEL__INFO:
        return FOXGLOVE__LOG__LEVEL__INFO;
    case ANLOS__LOG__LEVEL__WARNING:
        return FOXGLOVE__LOG__LEVEL__WARNING;
    case ANLOS__LOG__LEVEL__ERROR:
        return FOXGLOVE__LOG__LEVEL__ERROR;
    default:
        return FOXGLOVE__LOG__LEVEL__UNKNOWN;
    }
}

/* The text, and what the sender says of lines that it did not send. */
static char *text_of(struct arena *a, const Anlos__Log *l)
{
    const char *ago = l->repeats_ago_s >= 1.0
                          ? arena_print(a, ", last %.0f s ago", l->repeats_ago_s)
                          : "";
    const char *repeats = l->repeats
                              ? arena_print(a, " (%" PRIu64 " times more in %.0f s%s)",
                                            l->repeats, l->repeats_s, ago)
                              : "";
    const char *left_out =
        l->left_out
            ? arena_print(a, " (%" PRIu64 " lines before it are left out)", l->left_out)
            : "";
    size_t size = strlen(l->text) + strlen(repeats) + strlen(left_out) + 1;
    char *text = arena_array(a, size, 1);

    if (text)
        strcat(strcat(strcpy(text, l->text), repeats), left_out);
    return text;
}

/* "detections" to anlos.Figures, for plots (nodes/rt/list_figures.h). */
static int convert_figures(struct arena *a, const struct setting *s,
                           const struct foxglove_message *m, ProtobufCMessage **out)
{
    const struct list_figures f = list_figures((const Anlos__DetectionList *)m->content,
                                               m->capture_ns, m->publish_ns);
    Anlos__Figures *figures = arena_one(a, sizeof *figures);

    (void)s;
    anlos__figures__init(figures);
    figures->timestamp = part_time(a, m->capture_ns ? m->capture_ns : m->publish_ns);
    figures->snr_db = f.snr_db;
    figures->latency_ms = 1e3 * f.latency_s;
    figures->objects = f.n_objects;
    *out = &figures->base;
    return a->failed ? -ENOMEM : 0;
}

/* "log" to foxglove.Log. */
static int convert_log(struct arena *a, const struct setting *s,
                       const struct foxglove_message *m, ProtobufCMessage **out)
{
    const Anlos__Log *l = (const Anlos__Log *)m->content;
    Foxglove__Log *log = arena_one(a, sizeof *log);

    (void)s;
    foxglove__log__init(log);
    log->timestamp = part_time(a, l->stamp_ns ? l->stamp_ns : m->publish_ns);
    log->level = level_of(l->level);
    log->message = text_of(a, l);
    log->name = l->node;
    *out = &log->base;
    return a->failed ? -ENOMEM : 0;
}

#define DOT_M      0.06
#define DEVIATIONS 2.0 /* from the centre of the ellipsoid to its surface */
#define DRAWN_M    4.0 /* at most: what is not known has no end */
#define LABEL_UP_M 0.12
#define ARROW_M    0.03
#define STANDS_M_S 0.05 /* slower than that it has no arrow */
#define FACTS      9

static const double amber[3] = {1.0, 0.72, 0.2}, green[3] = {0.25, 0.9, 0.45},
                    blue[3] = {0.4, 0.7, 1.0};

static bool take(const Anlos__Vec3 *v, double out[3])
{
    if (!v || !isfinite(v->x) || !isfinite(v->y) || !isfinite(v->z))
        return false;
    out[0] = v->x;
    out[1] = v->y;
    out[2] = v->z;
    return true;
}

/* From amber, which may be noise, to green. */
static Foxglove__Color *likely(struct arena *a, double existence, double alpha)
{
    double t = fmin(fmax(existence, 0.0), 1.0), rgb[3];

    for (int i = 0; i < 3; i++)
        rgb[i] = amber[i] + t * (green[i] - amber[i]);
    return part_colour(a, rgb, alpha);
}

static void add_ellipsoid(struct arena *a, Foxglove__SceneEntity *e,
                          const Anlos__Detection *d, const double position[3])
{
    double axes[3][3], variance[3], size[3];

    for (size_t i = 0; i < d->n_covariance_m2; i++)
        if (!isfinite(d->covariance_m2[i]))
            return;
    if (d->n_covariance_m2 != 6)
        return;
    symmetric_axes(d->covariance_m2, variance, axes);
    for (int i = 0; i < 3; i++)
        size[i] = fmin(2.0 * DEVIATIONS * sqrt(fmax(variance[i], 0.0)), DRAWN_M);
    part_add_sphere(a, e, part_pose(a, position, (const double(*)[3])axes), size,
                    part_colour(a, blue, 0.35));
}

static void add_facts(struct arena *a, Foxglove__SceneEntity *e,
                      const Anlos__DetectionList *list, const Anlos__Detection *d)
{
    part_add_fact(a, e, "existence", arena_print(a, "%.3f", d->existence));
    part_add_fact(a, e, "level_db", arena_print(a, "%.1f", d->level_db));
    part_add_fact(a, e, "mirrored_at_wall",
                  arena_print(a, "%s", list->mirrored ? "true" : "false"));
    part_add_fact(a, e, "scan", arena_print(a, "%u", list->scan));
    part_add_fact(a, e, "source", arena_print(a, "%s", name_of_source(list->source)));
}

static bool has_velocity(const Anlos__DetectionList *list, const Anlos__Detection *d)
{
    return list->in_vehicle_frame && d->n_velocity_m_s == 2 &&
           isfinite(d->velocity_m_s[0]) && isfinite(d->velocity_m_s[1]);
}

static bool is_predicted(const Anlos__Detection *d)
{
    return d->measurement == ANLOS__MEASUREMENT__PREDICTED;
}

/* The motion of a second. */
static void add_arrow(struct arena *a, Foxglove__SceneEntity *e,
                      const Anlos__DetectionList *list, const Anlos__Detection *d,
                      const double position[3])
{
    if (!has_velocity(list, d))
        return;
    const double way[3] = {d->velocity_m_s[0], d->velocity_m_s[1], 0.0};
    if (hypot(way[0], way[1]) > STANDS_M_S)
        part_add_arrow(a, e, position, way, ARROW_M,
                       part_colour(a, green, is_predicted(d) ? 0.4 : 1.0));
}

/* "3  extended  99%  1.2 m/s", of what is unseen for how long; without tracks the level
 * stands for what is known of the motion. */
static char *label(struct arena *a, const Anlos__DetectionList *list,
                   const Anlos__Detection *d)
{
    const char *mirrored = list->mirrored ? "" : "  mirrored";
    const char *shape = name_of_shape(d->shape), *gap = shape[0] ? "  " : "";

    if (!list->tracked)
        return arena_print(a, "%u  %.0f%%  %.0f dB%s", d->id, 100.0 * d->existence,
                           d->level_db, mirrored);
    char speed[48] = "", unseen[48] = "";
    if (has_velocity(list, d))
        snprintf(speed, sizeof speed, "  %.1f m/s",
                 hypot(d->velocity_m_s[0], d->velocity_m_s[1]));
    if (is_predicted(d))
        snprintf(unseen, sizeof unseen, "  unseen %.1f s", d->unseen_s);
    return arena_print(a, "%u%s%s  %.0f%%%s%s%s", d->id, gap, shape, 100.0 * d->existence,
                       speed, unseen, mirrored);
}

static void add_track_facts(struct arena *a, Foxglove__SceneEntity *e,
                            const Anlos__Detection *d)
{
    part_add_fact(a, e, "shape", arena_print(a, "%s", name_of_shape(d->shape)));
    part_add_fact(a, e, "age_s", arena_print(a, "%.1f", d->age_s));
    part_add_fact(a, e, "unseen_s", arena_print(a, "%.1f", d->unseen_s));
    part_add_fact(a, e, "wall", arena_print(a, "%u", d->wall));
}

/* NULL: it has no place. */
static Foxglove__SceneEntity *object(struct arena *a, const Anlos__DetectionList *list,
                                     const Anlos__Detection *d, int64_t t_ns)
{
    static const struct part_room room = {
        .arrows = 1, .cubes = 1, .spheres = 2, .texts = 1, .metadata = FACTS};
    const double dot[3] = {DOT_M, DOT_M, DOT_M};
    double position[3], size[3];

    if (d->measurement == ANLOS__MEASUREMENT__DELETED || !take(d->position_m, position))
        return NULL;
    Foxglove__SceneEntity *e =
        part_entity(a, arena_print(a, "object %u", d->id),
                    list->in_vehicle_frame ? FRAME_VEHICLE : FRAME_ARRAY, t_ns, &room);
    part_add_sphere(a, e, part_pose(a, position, NULL), dot,
                    likely(a, d->existence, is_predicted(d) ? 0.4 : 1.0));
    add_ellipsoid(a, e, d, position);
    add_arrow(a, e, list, d, position);
    if (take(d->extent_m, size) && size[0] + size[1] + size[2] > 0.0)
        part_add_cube(a, e, part_pose(a, position, NULL), size,
                      part_colour(a, green, 0.2));
    position[list->in_vehicle_frame ? 2 : 1] += LABEL_UP_M; /* that axis points up */
    part_add_text(a, e, position, label(a, list, d));
    add_facts(a, e, list, d);
    if (list->tracked)
        add_track_facts(a, e, d);
    return e;
}

/* "detections" to foxglove.SceneUpdate: for each object a dot, an ellipsoid of two
 * standard deviations, a box of its size, a label, and of one that moves an arrow as long
 * as it goes over ground in a second. */
/* Those of the list before go first: Foxglove deletes before it adds. */
static int convert_objects(struct arena *a, const struct setting *s,
                           const struct foxglove_message *m, ProtobufCMessage **out)
{
    const Anlos__DetectionList *list = (const Anlos__DetectionList *)m->content;
    Foxglove__SceneUpdate *u = arena_one(a, sizeof *u);
    Foxglove__SceneEntityDeletion *old = arena_one(a, sizeof *old);
    size_t n = list->n_detections < OBJECTS_MAX ? list->n_detections : OBJECTS_MAX;

    (void)s;
    foxglove__scene_update__init(u);
    foxglove__scene_entity_deletion__init(old);
    old->timestamp = part_time(a, m->publish_ns);
    old->type = FOXGLOVE__SCENE_ENTITY_DELETION__TYPE__ALL;
    u->deletions = arena_array(a, 1, sizeof *u->deletions);
    u->entities = arena_array(a, n, sizeof *u->entities);
    if (!u->deletions || !u->entities)
        return -ENOMEM;
    u->deletions[u->n_deletions++] = old;
    for (size_t i = 0; i < n; i++) { /* track finds no more */
        Foxglove__SceneEntity *e = object(a, list, list->detections[i], m->publish_ns);
        if (e)
            u->entities[u->n_entities++] = e;
    }
    *out = &u->base;
    return a->failed ? -ENOMEM : 0;
}

/* A picture is of the image as it is: it needs no survey. */
static int convert(struct arena *a, size_t which, const char *frame,
                   const struct foxglove_message *m, ProtobufCMessage **out)
{
    Foxglove__CompressedImage *c = arena_one(a, sizeof *c);
    struct grid grid;
    const float *intensity = volume_grid((const Anlos__Volume *)m->content, &grid);
    uint8_t *png = NULL;
    size_t size = 0;

    if (!intensity)
        return -EINVAL;
    if (export_projection_png(which, &grid, intensity, NULL, &png, &size))
        return -ENOMEM;
    foxglove__compressed_image__init(c);
    c->timestamp = part_time(a, m->capture_ns ? m->capture_ns : m->publish_ns);
    c->frame_id = arena_print(a, "%s", frame);
    c->format = arena_print(a, "png");
    c->data.data = arena_array(a, size, 1);
    if (c->data.data)
        memcpy(c->data.data, png, c->data.len = size);
    free(png);
    *out = &c->base;
    return a->failed ? -ENOMEM : 0;
}

/* "volume" to foxglove.CompressedImage: its maxima as imaged (mirrored), as a PNG with
 * axes in m, seen from the front, from above, from the side. */
static int convert_front(struct arena *a, const struct setting *s,
                         const struct foxglove_message *m, ProtobufCMessage **out)
{
    (void)s;
    return convert(a, 0, "front", m, out);
}

static int convert_top(struct arena *a, const struct setting *s,
                       const struct foxglove_message *m, ProtobufCMessage **out)
{
    (void)s;
    return convert(a, 1, "top", m, out);
}

static int convert_side(struct arena *a, const struct setting *s,
                        const struct foxglove_message *m, ProtobufCMessage **out)
{
    (void)s;
    return convert(a, 2, "side", m, out);
}

#define MAX_ELEMENTS 1024u /* that are drawn of each kind */
#define ELEMENT_M    0.025

static const double wall_size_m[3] = {4.0, 2.5, 0.02};

/* A usual car: 0.9 m from the rear axle, where the frame begins, to the rear bumper. */
static const double car_size_m[3] = {4.5, 1.8, 1.5}, car_centre_m[3] = {1.35, 0.0, 0.75};

static const double grey[3] = {0.75, 0.75, 0.8}, steel[3] = {0.35, 0.5, 0.7},
                    orange[3] = {1.0, 0.5, 0.1}, cyan[3] = {0.2, 0.85, 0.95};

/* The middle of the elements, half way along the stage. */
static void middle(const struct survey *s, double out[3])
{
    double n = (double)(s->n_speakers + s->n_microphones), along = 0.0;

    if (s->n_positions)
        along = 0.5 *
                (s->stage_positions_m[0] + s->stage_positions_m[s->n_positions - 1]);
    for (int a = 0; a < 3; a++) {
        out[a] = 0.0;
        for (size_t i = 0; i < s->n_speakers; i++)
            out[a] += s->speakers_m[i][a] / n;
        for (size_t i = 0; i < s->n_microphones; i++)
            out[a] += s->microphones_m[i][a] / n;
        out[a] += along * s->stage_axis[a];
    }
}

/* Axes with the wall's normal as the third and the first as level as the array's x (or z,
 * when the wall stands across the stage). */
static void axes_of_wall(const double n[3], double axes[3][3])
{
    int level = fabs(n[0]) < 0.9 ? 0 : 2;
    double length = sqrt(1.0 - n[level] * n[level]);

    for (int i = 0; i < 3; i++) {
        axes[0][i] = ((i == level) - n[level] * n[i]) / length;
        axes[2][i] = n[i];
    }
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        axes[1][i] = axes[2][j] * axes[0][k] - axes[2][k] * axes[0][j];
    }
}

static Foxglove__SceneEntity *draw_wall(struct arena *a, const struct setting *s,
                                        const struct wall *wall, const char *id,
                                        const char *text, int64_t t_ns)
{
    static const struct part_room room = {.cubes = 1, .texts = 1, .metadata = 4};
    Foxglove__SceneEntity *e = part_entity(a, id, FRAME_ARRAY, t_ns, &room);
    double place[3], mirrored[3], axes[3][3];

    middle(&s->survey, place);
    wall_mirror(wall, place, mirrored);
    for (int i = 0; i < 3; i++)
        place[i] = 0.5 * (place[i] + mirrored[i]);
    axes_of_wall(wall->normal, axes);
    part_add_cube(a, e, part_pose(a, place, (const double(*)[3])axes), wall_size_m,
                  part_colour(a, grey, 0.35));
    for (int i = 0; i < 3; i++)
        place[i] += 0.5 * wall_size_m[1] * axes[1][i];
    part_add_text(a, e, place, text);
    return e;
}

/* That of the survey, as long as node wall says nothing better (view/walls). */
static Foxglove__SceneEntity *draw_given_wall(struct arena *a, const struct setting *s,
                                              int64_t t_ns)
{
    const struct wall *wall = s->has_walls ? NULL : setting_wall(s);

    return wall ? draw_wall(a, s, wall, "wall", "wall", t_ns) : NULL;
}

static Foxglove__SceneEntity *draw_vehicle(struct arena *a, int64_t t_ns)
{
    static const struct part_room room = {.cubes = 1, .texts = 1};
    static const double roof[3] = {1.35, 0.0, 1.6};
    Foxglove__SceneEntity *e = part_entity(a, "vehicle", FRAME_VEHICLE, t_ns, &room);

    part_add_cube(a, e, part_pose(a, car_centre_m, NULL), car_size_m,
                  part_colour(a, steel, 0.3));
    part_add_text(a, e, roof, "vehicle");
    return e;
}

static void draw_elements(struct arena *a, Foxglove__SceneEntity *e,
                          const double (*places)[3], size_t n, const double rgb[3])
{
    const double size[3] = {ELEMENT_M, ELEMENT_M, ELEMENT_M};

    for (size_t i = 0; i < n && i < MAX_ELEMENTS; i++)
        part_add_sphere(a, e, part_pose(a, places[i], NULL), size,
                        part_colour(a, rgb, 1.0));
}

/* They move with the stage; a table of pings has no elements that could be drawn. */
static Foxglove__SceneEntity *draw_array(struct arena *a, const struct survey *s,
                                         int64_t t_ns)
{
    const struct part_room room = {.spheres = s->n_speakers + s->n_microphones,
                                   .texts = 1};
    Foxglove__SceneEntity *e = part_entity(a, "array", FRAME_STAGE, t_ns, &room);

    e->frame_locked = true;
    draw_elements(a, e, (const double(*)[3])s->speakers_m, s->n_speakers, orange);
    draw_elements(a, e, (const double(*)[3])s->microphones_m, s->n_microphones, cyan);
    return e;
}

static void add(struct arena *a, Foxglove__SceneUpdate *u, Foxglove__SceneEntity *e,
                const char *id, int64_t t_ns)
{
    if (e) {
        u->entities[u->n_entities++] = e;
        return;
    }
    Foxglove__SceneEntityDeletion *gone = arena_one(a, sizeof *gone);
    foxglove__scene_entity_deletion__init(gone);
    gone->timestamp = part_time(a, t_ns);
    gone->type = FOXGLOVE__SCENE_ENTITY_DELETION__TYPE__MATCHING_ID;
    gone->id = arena_print(a, "%s", id);
    u->deletions[u->n_deletions++] = gone;
}

/* "survey" to foxglove.SceneUpdate: the vehicle, the speakers and microphones, and the
 * wall that the survey was given, as long as no "wall" came. */
static int convert_scene(struct arena *a, const struct setting *s,
                         const struct foxglove_message *m, ProtobufCMessage **out)
{
    const struct survey *survey = &s->survey;
    Foxglove__SceneUpdate *u = arena_one(a, sizeof *u);

    if (!s->has_survey)
        return -EAGAIN;
    foxglove__scene_update__init(u);
    u->entities = arena_array(a, 3, sizeof *u->entities);
    u->deletions = arena_array(a, 3, sizeof *u->deletions);
    if (!u->entities || !u->deletions)
        return -ENOMEM;
    add(a, u, draw_given_wall(a, s, m->publish_ns), "wall", m->publish_ns);
    add(a, u, survey->has_mount ? draw_vehicle(a, m->publish_ns) : NULL, "vehicle",
        m->publish_ns);
    add(a, u, survey->pings_m ? NULL : draw_array(a, survey, m->publish_ns), "array",
        m->publish_ns);
    *out = &u->base;
    return a->failed ? -ENOMEM : 0;
}

static Foxglove__SceneEntity *draw_told_wall(struct arena *a, const struct setting *s,
                                             const struct wall *wall,
                                             const Anlos__Wall *m, int64_t t_ns)
{
    const char *origin = name_of_wall_origin(m->origin);
    Foxglove__SceneEntity *e = draw_wall(
        a, s, wall, arena_print(a, "wall %u", m->id),
        arena_print(a, "wall %u  %s  %.0f%%", m->id, origin, 100.0 * m->existence), t_ns);

    part_add_fact(a, e, "origin", arena_print(a, "%s", origin));
    part_add_fact(a, e, "existence", arena_print(a, "%.3f", m->existence));
    part_add_fact(a, e, "unseen_s", arena_print(a, "%.1f", m->unseen_s));
    part_add_fact(a, e, "distance_m", arena_print(a, "%.4f", m->distance_m));
    return e;
}

/* "wall" to foxglove.SceneUpdate: each wall, whence it is known and how likely it is. */
static int convert_walls(struct arena *a, const struct setting *s,
                         const struct foxglove_message *m, ProtobufCMessage **out)
{
    const Anlos__WallList *list = (const Anlos__WallList *)m->content;
    Foxglove__SceneUpdate *u = arena_one(a, sizeof *u);
    Foxglove__SceneEntityDeletion *old = arena_one(a, sizeof *old);
    struct error why;
    struct walls walls;

    if (!s->has_survey)
        return -EAGAIN;
    if (walls_from_message(&walls, list, &why))
        return -EINVAL;
    foxglove__scene_update__init(u);
    foxglove__scene_entity_deletion__init(old);
    old->timestamp = part_time(a, m->publish_ns);
    old->type = FOXGLOVE__SCENE_ENTITY_DELETION__TYPE__ALL;
    u->deletions = arena_array(a, 1, sizeof *u->deletions);
    u->entities = arena_array(a, walls.n, sizeof *u->entities);
    if (!u->deletions || !u->entities)
        return -ENOMEM;
    u->deletions[u->n_deletions++] = old;
    for (size_t i = 0; i < walls.n; i++)
        u->entities[u->n_entities++] =
            draw_told_wall(a, s, &walls.list[i].plane, list->walls[i], m->publish_ns);
    *out = &u->base;
    return a->failed ? -ENOMEM : 0;
}

static Foxglove__FrameTransform *transform(struct arena *a, int64_t t_ns,
                                           const char *parent, const char *child,
                                           const double origin[3],
                                           const double axes[3][3])
{
    Foxglove__FrameTransform *t = arena_one(a, sizeof *t);

    foxglove__frame_transform__init(t);
    t->timestamp = part_time(a, t_ns);
    t->parent_frame_id = arena_print(a, "%s", parent);
    t->child_frame_id = arena_print(a, "%s", child);
    t->translation = part_vector(a, origin);
    t->rotation = part_quaternion(a, axes);
    return t;
}

/* From where survey_to_vehicle puts the array's origin and the ends of its axes. */
static Foxglove__FrameTransform *mount(struct arena *a, const struct survey *s,
                                       int64_t t_ns)
{
    static const double zero[3] = {0.0, 0.0, 0.0};
    double origin[3], axes[3][3];

    survey_to_vehicle(s, zero, origin);
    for (int i = 0; i < 3; i++) {
        double unit[3] = {i == 0, i == 1, i == 2}, end[3], length = 0.0;
        survey_to_vehicle(s, unit, end);
        for (int k = 0; k < 3; k++)
            length += (end[k] - origin[k]) * (end[k] - origin[k]);
        for (int k = 0; k < 3; k++)
            axes[i][k] = (end[k] - origin[k]) / sqrt(length);
    }
    return transform(a, t_ns, FRAME_VEHICLE, FRAME_ARRAY, origin,
                     (const double(*)[3])axes);
}

/* "survey" and "stage/state" to foxglove.FrameTransforms: array in vehicle, stage in
 * array. */
static int convert_transforms(struct arena *a, const struct setting *s,
                              const struct foxglove_message *m, ProtobufCMessage **out)
{
    Foxglove__FrameTransforms *t = arena_one(a, sizeof *t);
    double along[3];

    if (!s->has_survey)
        return -EAGAIN;
    foxglove__frame_transforms__init(t);
    t->transforms = arena_array(a, 2, sizeof *t->transforms);
    if (!t->transforms)
        return -ENOMEM;
    if (s->survey.has_mount)
        t->transforms[t->n_transforms++] = mount(a, &s->survey, m->publish_ns);
    for (int i = 0; i < 3; i++)
        along[i] = s->stage_m * s->survey.stage_axis[i];
    t->transforms[t->n_transforms++] =
        transform(a, m->publish_ns, FRAME_ARRAY, FRAME_STAGE, along, NULL);
    *out = &t->base;
    return a->failed ? -ENOMEM : 0;
}

#define MAX_CELLS ((size_t)1 << 18)
#define LEAST_DB  (-40.0f)

struct cells {
    size_t n[3];    /* along x, y, z */
    size_t fold[3]; /* voxels in one */
    double size_m[3];
};

static size_t cells_count(const struct cells *c)
{
    return c->n[0] * c->n[1] * c->n[2];
}

/* Folds the axis with the shortest cells until there are few enough. */
static void cells_plan(struct cells *c, const struct grid *g)
{
    for (int a = 0; a < 3; a++) {
        c->n[a] = g->n[a];
        c->fold[a] = 1;
        c->size_m[a] = g->step_m[a];
    }
    while (cells_count(c) > MAX_CELLS) {
        int shortest = -1;
        for (int a = 0; a < 3; a++)
            if (c->n[a] > 1 && (shortest < 0 || c->size_m[a] < c->size_m[shortest]))
                shortest = a;
        c->fold[shortest]++;
        c->size_m[shortest] = (double)c->fold[shortest] * g->step_m[shortest];
        c->n[shortest] = (g->n[shortest] + c->fold[shortest] - 1) / c->fold[shortest];
    }
}

/* Maxima of `fold` values each, into those that out has. */
static void fold_row(const float *v, size_t n, size_t fold, float brightest, float *out)
{
    for (size_t x = 0; x < n; out++)
        for (size_t end = x + fold < n ? x + fold : n; x < end; x++)
            if (v[x] > *out && v[x] <= brightest)
                *out = v[x];
}

/* out [n[2]][n[1]][n[0]], zeroed, becomes maxima; mirrored: z falling. */
static void fold(const struct image *image, const struct cells *c, float *out)
{
    const struct grid *g = &image->grid;
    const float *v = image->intensity;

    for (size_t z = 0; z < g->n[2]; z++) {
        size_t slice = z / c->fold[2];
        if (image->wall)
            slice = c->n[2] - 1 - slice;
        for (size_t y = 0; y < g->n[1]; y++, v += g->n[0])
            fold_row(v, g->n[0], c->fold[0], image->levels.brightest,
                     out + (slice * c->n[1] + y / c->fold[1]) * c->n[0]);
    }
}

/* The corner that is least in all three of the box's own axes.  A mirrored box has axes
 * of the left hand; turning z around makes them those of a right one, and its corner is
 * the one that was farthest in z. */
static Foxglove__Pose *pose_of(struct arena *a, const struct image *image,
                               const struct cells *c)
{
    const struct grid *g = &image->grid;
    double corner[3], axes[3][3];

    for (int i = 0; i < 3; i++)
        corner[i] = g->origin_m[i] - 0.5 * g->step_m[i];
    if (!image->wall)
        return part_pose(a, corner, NULL);
    const struct wall around = {.normal = {image->wall->normal[0], image->wall->normal[1],
                                           image->wall->normal[2]}};
    for (int i = 0; i < 3; i++) {
        const double axis[3] = {i == 0, i == 1, i == 2 ? -1.0 : 0.0};
        wall_mirror(&around, axis, axes[i]);
    }
    corner[2] += (double)c->n[2] * c->size_m[2];
    wall_mirror(image->wall, corner, corner);
    return part_pose(a, corner, (const double(*)[3])axes);
}

/* "volume" to foxglove.VoxelGrid: intensity in dB of the brightest, each cell the maximum
 * of as many voxels as leave no more than 2^18 cells. */
static int convert_voxels(struct arena *a, const struct setting *s,
                          const struct foxglove_message *m, ProtobufCMessage **out)
{
    static const char *const name = "intensity";
    Foxglove__VoxelGrid *v = arena_one(a, sizeof *v);
    struct image image;
    struct cells c;
    int err = image_open(&image, s, m, 0);

    if (err)
        return err;
    cells_plan(&c, &image.grid);
    float *data = arena_array(a, cells_count(&c), sizeof *data);
    foxglove__voxel_grid__init(v);
    v->timestamp = part_time(a, m->capture_ns ? m->capture_ns : m->publish_ns);
    v->frame_id = arena_print(a, FRAME_ARRAY);
    v->pose = pose_of(a, &image, &c);
    v->column_count = (uint32_t)c.n[0];
    v->row_count = (uint32_t)c.n[1];
    v->cell_size = part_vector(a, c.size_m);
    v->cell_stride = sizeof *data;
    v->row_stride = (uint32_t)(c.n[0] * sizeof *data);
    v->slice_stride = (uint32_t)(c.n[1] * c.n[0] * sizeof *data);
    v->fields = part_fields(a, &name, 1);
    v->n_fields = v->fields ? 1 : 0;
    if (data) {
        fold(&image, &c, data);
        for (size_t i = 0; i < cells_count(&c); i++)
            data[i] = level_db(&image.levels, data[i], LEAST_DB);
        v->data = (ProtobufCBinaryData){cells_count(&c) * sizeof *data, (uint8_t *)data};
    }
    *out = &v->base;
    return a->failed ? -ENOMEM : 0;
}

/* -- channels ------------------------------------------------------------------------ */

static const struct view {
    const char *name, *schema, *sources[CHANNEL_MAX_SOURCES];
    foxglove_convert convert;
} views[] = {
    {CHANNEL_VIEW "cloud", "foxglove.PointCloud", {"volume"}, convert_cloud},
    {CHANNEL_VIEW "voxels", "foxglove.VoxelGrid", {"volume"}, convert_voxels},
    {CHANNEL_VIEW "front", "foxglove.CompressedImage", {"volume"}, convert_front},
    {CHANNEL_VIEW "top", "foxglove.CompressedImage", {"volume"}, convert_top},
    {CHANNEL_VIEW "side", "foxglove.CompressedImage", {"volume"}, convert_side},
    {CHANNEL_VIEW "objects", "foxglove.SceneUpdate", {"detections"}, convert_objects},
    {CHANNEL_VIEW "scene", "foxglove.SceneUpdate", {"survey"}, convert_scene},
    {CHANNEL_VIEW "walls", "foxglove.SceneUpdate", {"wall"}, convert_walls},
    {CHANNEL_VIEW "frames",
     "foxglove.FrameTransforms",
     {"survey", "stage/state"},
     convert_transforms},
    {CHANNEL_VIEW "figures", "anlos.Figures", {"detections"}, convert_figures},
    {CHANNEL_VIEW "log", "foxglove.Log", {"log"}, convert_log},
};

#define N_VIEWS (sizeof views / sizeof *views)

size_t channels_count(void)
{
    return TOPICS_COUNT + N_VIEWS;
}

void channel_get(size_t index, struct channel *out)
{
    size_t n = TOPICS_COUNT;

    if (index < n) {
        const struct topic *t = &topics_all()[index];
        *out = (struct channel){t->name, bag_schema_of(t), {t}, NULL};
        return;
    }
    const struct view *v = &views[index - n];
    *out = (struct channel){.name = v->name,
                            .schema = bag_schema_find(foxglove_schema_table, v->schema),
                            .convert = v->convert};
    for (size_t i = 0; i < CHANNEL_MAX_SOURCES && v->sources[i]; i++)
        out->sources[i] = topics_find(v->sources[i]);
}

bool setting_take(struct setting *s, const struct foxglove_message *m)
{
    if (m->topic == topic_survey())
        return setting_survey(s, (const Anlos__Survey *)m->content);
    if (m->topic == topic_wall())
        setting_walls(s, (const Anlos__WallList *)m->content);
    if (m->topic == topic_stage_state()) {
        double at_m = ((const Anlos__StageState *)m->content)->position_m;
        s->stage_m = isfinite(at_m) ? at_m : s->stage_m;
    }
    return false;
}

bool channel_is_from(const struct channel *c, const struct topic *t)
{
    for (size_t i = 0; i < CHANNEL_MAX_SOURCES && c->sources[i]; i++)
        if (c->sources[i] == t)
            return true;
    return false;
}

static int pack(const ProtobufCMessage *m, uint8_t **out, size_t *size)
{
    *size = protobuf_c_message_get_packed_size(m);
    *out = malloc(*size ? *size : 1);
    if (!*out)
        return -ENOMEM;
    protobuf_c_message_pack(m, *out);
    return 0;
}

int channel_pack(const struct channel *c, const struct setting *s,
                 const struct foxglove_message *m, uint8_t **out, size_t *size)
{
    struct arena arena = {.newest = NULL};
    ProtobufCMessage *converted;
    int err;

    if (!c->convert)
        return pack(m->content, out, size);
    err = c->convert(&arena, s, m, &converted);
    if (!err)
        err = pack(converted, out, size);
    arena_clear(&arena);
    return err;
}
