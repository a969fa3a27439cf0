#include "nodes/view/plan.h"

#include <math.h>
#include <string.h>

#include "nodes/rt/export.h"
#include "nodes/view/names.h"
#include "recon/wall.h"

#define SHARE_95 2.447746830680816 /* sqrt(-2 ln 0.05) */

void plan_point(bool in_vehicle_frame, const double p[3], double out[2])
{
    out[0] = in_vehicle_frame ? -p[1] : p[0];
    out[1] = in_vehicle_frame ? p[0] : p[2];
}

void plan_ellipse(bool in_vehicle_frame, const double c[6], struct plan_ellipse *out)
{
    double xx = in_vehicle_frame ? c[3] : c[0];
    double yy = in_vehicle_frame ? c[0] : c[5];
    double xy = in_vehicle_frame ? -c[1] : c[2];
    double mean = 0.5 * (xx + yy), half = hypot(0.5 * (xx - yy), xy);

    out->major_m = SHARE_95 * sqrt(fmax(mean + half, 0.0));
    out->minor_m = SHARE_95 * sqrt(fmax(mean - half, 0.0));
    out->angle_rad = 0.5 * atan2(2.0 * xy, xx - yy);
}

/* How the array's x, y, z turn into the frame of the positions. */
static void turn(const struct survey *s, const double v[3], double out[3])
{
    static const double zero[3] = {0.0, 0.0, 0.0};
    double origin[3];

    survey_to_vehicle(s, zero, origin);
    survey_to_vehicle(s, v, out);
    for (int i = 0; i < 3; i++)
        out[i] -= origin[i];
}

bool plan_wall(const struct survey *s, double point[2], double direction[2])
{
    static const double zero[3] = {0.0, 0.0, 0.0};
    double normal[3], level[2], origin[3], start[2];

    if (!s->has_wall)
        return false;
    turn(s, s->wall_normal, normal);
    plan_point(s->has_mount, normal, level);
    double square = level[0] * level[0] + level[1] * level[1];
    if (square < 1e-3) /* within 2 degrees of lying flat */
        return false;
    survey_to_vehicle(s, zero, origin);
    plan_point(s->has_mount, origin, start);
    double length = sqrt(square);
    for (int i = 0; i < 2; i++)
        point[i] = start[i] + level[i] * s->wall_distance_m / square;
    direction[0] = -level[1] / length;
    direction[1] = level[0] / length;
    return true;
}

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

json_t *plan_scene_json(const struct survey *s)
{
    double point[2], direction[2];
    json_t *wall =
        plan_wall(s, point, direction)
            ? json_pack("{so so}", "point", pair(point), "direction", pair(direction))
            : json_null();

    return json_pack(
        "{ss ss ss so so sf so si si si}", "type", "scene", "frame",
        s->has_mount ? "vehicle" : "array", "source", name_of_source(s->source), "wall",
        wall, "array", array_json(s), "sound_speed_m_s", s->sound_speed_m_s,
        "temperature_c", export_real(s->temperature_c), "speakers", (int)s->n_speakers,
        "microphones", (int)s->n_microphones, "positions", (int)s->n_positions);
}

static json_t *vec3(const Anlos__Vec3 *v)
{
    const double p[3] = {v ? v->x : NAN, v ? v->y : NAN, v ? v->z : NAN};
    return export_reals(p, 3);
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
        sd[0] = sqrt(d->covariance_m2[0]);
        sd[1] = sqrt(d->covariance_m2[3]);
        sd[2] = sqrt(d->covariance_m2[5]);
    }
    return json_pack(
        "{si so so so so so so so so so}", "id", (int)d->id, "position_m",
        export_reals(p, 3), "sd_m", export_reals(sd, 3), "virtual_m", vec3(d->virtual_m),
        "extent_m", vec3(d->extent_m), "at", pair(at), "size", pair(size), "ellipse",
        export_reals((double[3]){e.major_m, e.minor_m, e.angle_rad}, 3), "existence",
        export_real(d->existence), "level_db", export_real(d->level_db));
}

json_t *plan_objects_json(const Anlos__DetectionList *list)
{
    json_t *items = json_array();

    for (size_t i = 0; i < list->n_detections; i++)
        json_array_append_new(items,
                              object_json(list->in_vehicle_frame, list->detections[i]));
    return json_pack("{ss si sb sb ss ss so}", "type", "objects", "scan", (int)list->scan,
                     "preview", list->preview, "mirrored", list->mirrored, "frame",
                     list->in_vehicle_frame ? "vehicle" : "array", "source",
                     name_of_source(list->source), "items", items);
}

json_t *plan_footprint_json(const struct survey *s, const struct grid *grid)
{
    static const int corners[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    json_t *all = json_array();
    struct wall wall = {.distance_m = s->wall_distance_m};

    memcpy(wall.normal, s->wall_normal, sizeof wall.normal);
    for (int c = 0; c < 4; c++) {
        double p[3], real[3], there[3], on_plan[2];
        for (int a = 0; a < 3; a++) {
            double far = a == 1 ? 0.5 : corners[c][a == 2];
            p[a] = grid->origin_m[a] + grid->step_m[a] * ((double)grid->n[a] * far - 0.5);
        }
        memcpy(real, p, sizeof real);
        if (s->has_wall)
            wall_mirror(&wall, p, real);
        survey_to_vehicle(s, real, there);
        plan_point(s->has_mount, there, on_plan);
        json_array_append_new(all, pair(on_plan));
    }
    return all;
}
