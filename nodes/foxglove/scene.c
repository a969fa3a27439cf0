#include <errno.h>
#include <math.h>

#include "msgs/convert.h"
#include "nodes/foxglove/convert.h"
#include "nodes/foxglove/parts.h"

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
    struct wall wall;

    return !s->has_walls && setting_wall(s, &wall)
               ? draw_wall(a, s, &wall, "wall", "wall", t_ns)
               : NULL;
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

int convert_scene(struct arena *a, const struct setting *s,
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
    static const char *const origins[] = {"configured", "given", "estimated"};
    const char *origin = (unsigned)m->origin < 3 ? origins[m->origin] : "unknown";
    Foxglove__SceneEntity *e = draw_wall(
        a, s, wall, arena_print(a, "wall %u", m->id),
        arena_print(a, "wall %u  %s  %.0f%%", m->id, origin, 100.0 * m->existence), t_ns);

    part_add_fact(a, e, "origin", arena_print(a, "%s", origin));
    part_add_fact(a, e, "existence", arena_print(a, "%.3f", m->existence));
    part_add_fact(a, e, "unseen_s", arena_print(a, "%.1f", m->unseen_s));
    part_add_fact(a, e, "distance_m", arena_print(a, "%.4f", m->distance_m));
    return e;
}

int convert_walls(struct arena *a, const struct setting *s,
                  const struct foxglove_message *m, ProtobufCMessage **out)
{
    const Anlos__WallList *list = (const Anlos__WallList *)m->content;
    Foxglove__SceneUpdate *u = arena_one(a, sizeof *u);
    Foxglove__SceneEntityDeletion *old = arena_one(a, sizeof *old);
    struct complaint why;
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
