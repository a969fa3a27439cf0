/* SPDX-License-Identifier: MIT */
#include "nodes/view/plan.h"

#include <math.h>
#include <string.h>

#include "nodes/rt/export.h"
#include "nodes/rt/names.h"
#include "recon/detection/objects.h"

static json_t *pair(const double p[2])
{
    return export_reals(p, 2);
}

/* The elements' places at both ends of the stage, on the plan. */
static json_t *array_json(const struct survey *s)
{
    json_t *all = json_array();
    const double(*lists[2])[3] = {(const double(*)[3])s->speakers_m,
                                  (const double(*)[3])s->microphones_m};
    size_t counts[2] = {s->n_speakers, s->n_microphones};
    double ends[2] = {s->n_positions ? s->stage_positions_m[0] : 0.0,
                      s->n_positions ? s->stage_positions_m[s->n_positions - 1] : 0.0};

    for (int end = 0; end < 2; end++) {
        for (int k = 0; k < 2; k++) {
            for (size_t i = 0; i < counts[k]; i++) {
                double at[3], there[3], on_plan[2];
                for (int a = 0; a < 3; a++)
                    at[a] = lists[k][i][a] + ends[end] * s->stage_axis[a];
                survey_to_vehicle(s, at, there);
                plan_point(s->has_mount, there, on_plan);
                json_array_append_new(all, pair(on_plan));
            }
        }
    }
    return all;
}

/* Where it ends, at the height of its foot; null: it is not known to end. */
static json_t *ends_json(const struct survey *s, const struct wall *w)
{
    double upright[3], level[3], end[3], on_plan[2];
    json_t *both = json_array();

    if (!wall_ends(w)) {
        json_decref(both);
        return json_null();
    }
    wall_axes(w, upright, level);
    for (int k = 0; k < 2; k++) {
        for (int a = 0; a < 3; a++)
            end[a] = w->distance_m * w->normal[a] + w->ends_m[k] * level[a];
        survey_to_vehicle(s, end, end);
        plan_point(s->has_mount, end, on_plan);
        json_array_append_new(both, pair(on_plan));
    }
    return both;
}

/* NULL: it has no line. */
static json_t *wall_json(const struct survey *s, const struct wall_gate *w)
{
    double point[2], direction[2];

    if (!plan_wall(s, &w->plane, point, direction))
        return NULL;
    return json_pack("{si so so so so so}", "id", (int)w->id, "point", pair(point),
                     "direction", pair(direction), "ends", ends_json(s, &w->plane),
                     "sd_m", export_real(sqrt(w->plane.covariance[5])), "sd_rad",
                     export_real(sqrt(w->plane.covariance[0])));
}

json_t *plan_scene_json(const struct survey *s)
{
    struct walls walls;
    json_t *all = json_array();

    walls_from_survey(&walls, s);
    for (size_t i = 0; i < walls.n; i++) {
        json_t *wall = wall_json(s, &walls.list[i]);
        if (wall)
            json_array_append_new(all, wall);
    }
    return json_pack("{ss ss ss so so sf so si si si}", "type", "scene", "frame",
                     s->has_mount ? "vehicle" : "array", "source",
                     name_of_source((Anlos__Source)s->source), "walls", all, "array",
                     array_json(s), "sound_speed_m_s", s->sound_speed_m_s,
                     "temperature_c", export_real(s->temperature_c), "speakers",
                     (int)s->n_speakers, "microphones", (int)s->n_microphones,
                     "positions", (int)s->n_positions);
}

json_t *plan_walls_json(const struct survey *s, const Anlos__WallList *list,
                        const struct walls *walls)
{
    json_t *all = json_array();

    for (size_t i = 0; i < walls->n; i++) {
        const Anlos__Wall *m = list->walls[i];
        json_t *wall = wall_json(s, &walls->list[i]);
        if (!wall)
            continue;
        json_object_set_new(wall, "origin", json_string(name_of_wall_origin(m->origin)));
        json_object_set_new(wall, "existence", export_real(m->existence));
        json_object_set_new(wall, "unseen_s", export_real(m->unseen_s));
        json_array_append_new(all, wall);
    }
    return json_pack("{ss so ss}", "type", "walls", "items", all, "text", list->text);
}

static json_t *vec3(const Anlos__Vec3 *v)
{
    const double p[3] = {v ? v->x : NAN, v ? v->y : NAN, v ? v->z : NAN};
    return export_reals(p, 3);
}

static json_t *trail_json(bool in_vehicle_frame, const struct trail *k)
{
    json_t *all = json_array();

    for (size_t i = 0; k && i < k->n; i++) {
        double at[2];
        plan_point(in_vehicle_frame, k->points[i].at_m, at);
        json_array_append_new(all, pair(at));
    }
    return all;
}

static void add_track(json_t *o, const Anlos__Detection *d, const struct trail *trail,
                      bool in_vehicle_frame)
{
    json_object_set_new(o, "trail", trail_json(in_vehicle_frame, trail));
    json_object_set_new(o, "measurement",
                        json_string(name_of_measurement(d->measurement)));
    json_object_set_new(o, "age_s", export_real(d->age_s));
    json_object_set_new(o, "unseen_s", export_real(d->unseen_s));
    if (!in_vehicle_frame || d->n_velocity_m_s != 2)
        return;
    const double v[3] = {d->velocity_m_s[0], d->velocity_m_s[1], 0.0};
    double on_plan[2];
    plan_point(true, v, on_plan);
    json_object_set_new(o, "velocity", pair(on_plan));
    json_object_set_new(o, "speed_m_s", export_real(hypot(v[0], v[1])));
}

static json_t *object_json(bool in_vehicle_frame, const Anlos__Detection *d)
{
    struct plan_ellipse e = {0};
    double p[3] = {NAN, NAN, NAN}, at[2], size[2] = {0.0, 0.0}, sd[3] = {NAN, NAN, NAN};

    if (d->position_m)
        memcpy(p, (double[3]){d->position_m->x, d->position_m->y, d->position_m->z},
               sizeof p);
    plan_point(in_vehicle_frame, p, at);
    if (d->extent_m) {
        const double extent[3] = {d->extent_m->x, d->extent_m->y, d->extent_m->z};
        plan_point(in_vehicle_frame, extent, size);
        size[0] = fabs(size[0]);
    }
    if (d->n_covariance_m2 == 6) {
        plan_ellipse(in_vehicle_frame, d->covariance_m2, &e);
        static const int diagonal[3] = {0, 3, 5};
        for (int a = 0; a < 3; a++) {
            double sigma_m = sqrt(d->covariance_m2[diagonal[a]]);
            sd[a] = sigma_m < OBJECTS_KNOWN_M ? sigma_m : NAN;
        }
    }
    return json_pack("{si so so so so so so so so so ss si sb sb sb so}", "id",
                     (int)d->id, "position_m", export_reals(p, 3), "sd_m",
                     export_reals(sd, 3), "virtual_m", vec3(d->virtual_m), "extent_m",
                     vec3(d->extent_m), "at", pair(at), "size", pair(size), "ellipse",
                     export_reals((double[3]){e.major_m, e.minor_m, e.angle_rad}, 3),
                     "existence", export_real(d->existence), "level_db",
                     export_real(d->level_db), "shape", name_of_shape(d->shape), "wall",
                     (int)d->wall, "behind_no_wall", d->behind_no_wall, "in_free_view",
                     d->in_free_view, "at_border", d->at_border != 0, "multipath",
                     export_multipath(d));
}

static json_t *view_json(bool in_vehicle_frame, const Anlos__ViewArea *a)
{
    json_t *corners = json_array();

    for (size_t i = 0; i + 1 < a->n_corners_m; i += 2) {
        const double x = a->corners_m[i], y = a->corners_m[i + 1];
        const double p[3] = {x, in_vehicle_frame ? y : 0.0, in_vehicle_frame ? 0.0 : y};
        double on_plan[2];
        plan_point(in_vehicle_frame, p, on_plan);
        json_array_append_new(corners, pair(on_plan));
    }
    return json_pack("{si so}", "wall", (int)a->wall, "corners", corners);
}

json_t *plan_objects_json(const Anlos__DetectionList *list, const struct trails *trails)
{
    json_t *items = json_array(), *views = json_array();

    for (size_t i = 0; i < list->n_views; i++)
        json_array_append_new(views, view_json(list->in_vehicle_frame, list->views[i]));
    for (size_t i = 0; i < list->n_detections; i++) {
        const Anlos__Detection *d = list->detections[i];
        if (d->measurement == ANLOS__MEASUREMENT__DELETED)
            continue;
        json_t *item = object_json(list->in_vehicle_frame, d);
        if (list->tracked)
            add_track(item, d, trails_find(trails, d->id), list->in_vehicle_frame);
        json_array_append_new(items, item);
    }
    return json_pack("{ss si sb sb sb sb ss ss so so}", "type", "objects", "scan",
                     (int)list->scan, "preview", list->preview, "tracked", list->tracked,
                     "mirrored", list->mirrored, "ego_unknown", list->ego_unknown,
                     "frame", list->in_vehicle_frame ? "vehicle" : "array", "source",
                     name_of_source(list->source), "items", items, "views", views);
}

json_t *plan_footprint_json(const struct survey *s, const struct wall *wall,
                            const struct grid *grid)
{
    double corners[4][2];
    json_t *all = json_array();

    plan_footprint(s, wall, grid, corners);
    for (int c = 0; c < 4; c++)
        json_array_append_new(all, pair(corners[c]));
    return all;
}
