#include <errno.h>
#include <math.h>
#include <stdio.h>

#include "msgs/detections.pb-c.h"
#include "nodes/foxglove/convert.h"
#include "nodes/foxglove/parts.h"
#include "nodes/rt/objects.h"
#include "recon/symmetric.h"

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
    static const char *const sources[] = {"live", "replay", "simulation"};

    part_add_fact(a, e, "existence", arena_print(a, "%.3f", d->existence));
    part_add_fact(a, e, "level_db", arena_print(a, "%.1f", d->level_db));
    part_add_fact(a, e, "mirrored_at_wall",
                  arena_print(a, "%s", list->mirrored ? "true" : "false"));
    part_add_fact(a, e, "scan", arena_print(a, "%u", list->scan));
    part_add_fact(
        a, e, "source",
        arena_print(a, "%s",
                    (unsigned)list->source < 3 ? sources[list->source] : "unknown"));
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

static const char *shape_name(Anlos__Shape shape)
{
    static const char *const names[] = {"", "point", "plate", "extended"};
    return (unsigned)shape < 4 ? names[shape] : "";
}

/* "3  extended  99%  1.2 m/s", of what is unseen for how long; without tracks the level
 * stands for what is known of the motion. */
static char *label(struct arena *a, const Anlos__DetectionList *list,
                   const Anlos__Detection *d)
{
    const char *mirrored = list->mirrored ? "" : "  mirrored";
    const char *shape = shape_name(d->shape), *gap = shape[0] ? "  " : "";

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
    part_add_fact(a, e, "shape", arena_print(a, "%s", shape_name(d->shape)));
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

/* Those of the list before go first: Foxglove deletes before it adds. */
int convert_objects(struct arena *a, const struct setting *s,
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
