/* SPDX-License-Identifier: MIT */
/* hal/room/room_truth.c -- a room at a time: where everything is, and what is in view. */
#include <math.h>
#include <string.h>

#include "hal/room/motion.h"
#include "hal/room/room_state.h"
#include "hal/room/vector.h"

#define NS_PER_S 1e9

bool room_is_drive(const struct room *r)
{
    return r->scene->drive;
}

double room_period_s(const struct room *r)
{
    return r->scene->drive ? r->scene->drive->period_s : 0;
}

double room_time_s(const struct room *r, int64_t wall_ns)
{
    if (!r->scene->drive)
        return 0;
    int64_t period_ns = llround(r->scene->drive->period_s * NS_PER_S);
    int64_t t_ns = wall_ns % period_ns;
    return (double)(t_ns < 0 ? t_ns + period_ns : t_ns) / NS_PER_S;
}

/* The middle of the array's elements over ground. */
static void array_centre(const struct room *r, const struct drive_frame *frame,
                         double out[3])
{
    const struct survey *s = &r->survey;
    double p[3] = {0, 0, 0};
    for (size_t i = 0; i < s->n_speakers; i++)
        vector_add(p, 0.5 / (double)s->n_speakers, s->speakers_m[i], p);
    for (size_t i = 0; i < s->n_microphones; i++)
        vector_add(p, 0.5 / (double)s->n_microphones, s->microphones_m[i], p);
    drive_to_ground(frame, p, out);
}

bool room_sees(const struct room *r, size_t object, double t_s)
{
    struct drive_frame frame;
    double array[3], centre[3], velocity[3], extent[3];
    drive_frame(&r->drive, t_s, &frame);
    array_centre(r, &frame, array);
    traffic_object(&r->traffic, object, t_s, centre, velocity, extent);
    return sight_clear((const double(*)[2])r->scene->building, r->scene->n_building,
                       array, centre);
}

/* A direction of the array frame in the vehicle's. */
static void turn_to_vehicle(const struct survey *s, const double v[3], double out[3])
{
    static const double nowhere[3] = {0, 0, 0};
    double origin[3];
    survey_to_vehicle(s, nowhere, origin);
    survey_to_vehicle(s, v, out);
    vector_add(out, -1, origin, out);
}

/* A size along axes: of the box around the turned box. */
static void turn_extent(const struct room *r, const struct drive_frame *frame,
                        const double extent[3], double out[3])
{
    memset(out, 0, 3 * sizeof *out);
    for (int a = 0; a < 3; a++) {
        double edge[3] = {0, 0, 0};
        edge[a] = extent[a];
        drive_turn_from_ground(frame, edge, edge);
        turn_to_vehicle(&r->survey, edge, edge);
        for (int k = 0; k < 3; k++)
            out[k] += fabs(edge[k]);
    }
}

static void tell(const struct room *r, size_t object, double t_s, struct room_truth *out)
{
    const struct survey *s = &r->survey;
    struct drive_frame frame;
    double centre[3], velocity[3], extent[3], p[3];
    drive_frame(&r->drive, t_s, &frame);
    traffic_object(&r->traffic, object, t_s, centre, velocity, extent);
    *out = (struct room_truth){.object = object};
    memcpy(out->name, r->world.objects[object].name, sizeof out->name);
    memcpy(out->kind, r->world.objects[object].kind, sizeof out->kind);
    drive_from_ground(&frame, centre, p);
    survey_to_vehicle(s, p, out->position_m);
    drive_turn_from_ground(&frame, velocity, p);
    turn_to_vehicle(s, p, out->velocity_m_s);
    turn_extent(r, &frame, extent, out->extent_m);
    vector_mirror(s->wall_normal, s->wall_distance_m, centre, p);
    drive_from_ground(&frame, p, out->virtual_m);
    out->line_of_sight = room_sees(r, object, t_s);
    out->until_sight_s = out->line_of_sight ? 0
                         : r->scene->drive  ? sight_until_s(&r->sights[object], t_s)
                                            : NAN;
}

size_t room_truth(const struct room *r, double t_s, struct room_truth *out, size_t max)
{
    size_t n = 0;
    t_s = drive_time_s(&r->drive, t_s);
    for (size_t i = 0; i < r->world.n_objects; i++) {
        if (!motion_present(&r->scene->objects[i], t_s))
            continue;
        if (n < max)
            tell(r, i, t_s, &out[n]);
        n++;
    }
    return n;
}

void room_ego(const struct room *r, double t_s, struct room_ego *out)
{
    drive_ego(&r->drive, drive_time_s(&r->drive, t_s), out);
}

void room_wall(const struct room *r, double t_s, double normal[3], double *distance_m)
{
    const struct survey *s = &r->survey;
    struct drive_frame frame;
    drive_frame(&r->drive, drive_time_s(&r->drive, t_s), &frame);
    *distance_m = s->wall_distance_m - vector_dot(s->wall_normal, frame.origin_m);
    drive_turn_from_ground(&frame, s->wall_normal, normal);
}

void room_vehicle_wall(const struct room *r, double t_s, double normal[3],
                       double *distance_m)
{
    static const double zero[3] = {0.0, 0.0, 0.0};
    double n[3], origin[3], tip[3];

    room_wall(r, t_s, n, distance_m);
    survey_to_vehicle(&r->survey, zero, origin);
    survey_to_vehicle(&r->survey, n, tip);
    for (int a = 0; a < 3; a++)
        normal[a] = tip[a] - origin[a];
    *distance_m += vector_dot(normal, origin);
}
