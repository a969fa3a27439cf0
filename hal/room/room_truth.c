/* SPDX-License-Identifier: MIT */
/* hal/room/room_truth.c -- a room at a time: where everything is, what is in view and
 * until when. */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "hal/room/motion.h"
#include "hal/room/room_state.h"
#include "hal/room/vector.h"

enum { SIGHT_STEPS = 20000 };
#define NS_PER_S     1e9
#define SIGHT_STEP_S 0.005

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

/* Twice the area of the triangle p, q, r: above 0 when they turn left. */
static double turn(const double p[2], const double q[2], const double r[2])
{
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
}

static bool cross(const double a[2], const double b[2], const double p[2],
                  const double q[2])
{
    return (turn(a, b, p) > 0) != (turn(a, b, q) > 0) &&
           (turn(p, q, a) > 0) != (turn(p, q, b) > 0);
}

/* Does the straight line from a to b pass an outline of n >= 3 corners x, z?  Seen from
 * above: y does not count.  n = 0: nothing is in the way. */
static bool sight_clear(const double (*outline)[2], size_t n, const double a[3],
                        const double b[3])
{
    const double from[2] = {a[0], a[2]}, to[2] = {b[0], b[2]};
    for (size_t i = 0, j = n - 1; i < n; j = i++)
        if (cross(from, to, outline[j], outline[i]))
            return false;
    return true;
}

/* Does nothing stand between an object's centre and the array's? */
static bool sees(const struct room *r, size_t object, double t_s)
{
    struct drive_frame frame;
    double array[3], centre[3], velocity[3], extent[3];
    drive_frame(&r->drive, t_s, &frame);
    world_array_centre(&r->survey, array);
    drive_to_ground(&frame, array, array);
    traffic_object(&r->traffic, object, t_s, centre, velocity, extent);
    return sight_clear((const double(*)[2])r->scene->building, r->scene->n_building,
                       array, centre);
}

static int add_span(struct sight_spans *s, double from_s, double to_s)
{
    if (s->n == s->room) {
        size_t room = s->room ? 2 * s->room : 4;
        struct sight_span *p = realloc(s->spans, room * sizeof *p);
        if (!p)
            return -ENOMEM;
        s->spans = p;
        s->room = room;
    }
    s->spans[s->n++] = (struct sight_span){from_s, to_s};
    return 0;
}

/* When the answer changes between two times that have different ones. */
static double change_s(bool (*in_view)(void *ctx, double t_s), void *ctx, double a_s,
                       double b_s)
{
    bool before = in_view(ctx, a_s);
    for (int i = 0; i < 30; i++) {
        double middle_s = (a_s + b_s) / 2;
        if (in_view(ctx, middle_s) == before)
            a_s = middle_s;
        else
            b_s = middle_s;
    }
    return (a_s + b_s) / 2;
}

/* Asks in_view(ctx, t) at steps from one time to another and halves the steps where the
 * answer changes.  Adds to *out.  0, -ENOMEM. */
static int scan_sight(struct sight_spans *out, bool (*in_view)(void *ctx, double t_s),
                      void *ctx, double from_s, double to_s, double step_s)
{
    double begun_s = from_s, last_s = from_s;
    bool seen = in_view(ctx, from_s);
    while (last_s < to_s) {
        double t_s = fmin(last_s + step_s, to_s);
        if (in_view(ctx, t_s) != seen) {
            double at_s = change_s(in_view, ctx, last_s, t_s);
            if (seen && add_span(out, begun_s, at_s) < 0)
                return -ENOMEM;
            begun_s = at_s;
            seen = !seen;
        }
        last_s = t_s;
    }
    return seen ? add_span(out, begun_s, to_s) : 0;
}

/* Seconds from t until a span begins; 0 within one, NaN when none comes. */
static double until_sight_s(const struct sight_spans *s, double t_s)
{
    for (size_t i = 0; i < s->n; i++)
        if (t_s < s->spans[i].to_s)
            return fmax(s->spans[i].from_s - t_s, 0);
    return NAN;
}

struct watch { /* an object, from the array */
    const struct room *room;
    size_t object;
};

static bool is_in_view(void *ctx, double t_s)
{
    const struct watch *w = ctx;
    return sees(w->room, w->object, t_s);
}

int room_set_sights(struct room *r)
{
    const struct scene_drive *drive = r->scene->drive;
    int err = 0;
    r->sights = calloc(r->world.n_objects + 1, sizeof *r->sights);
    if (!r->sights)
        return -ENOMEM;
    for (size_t i = 0; i < r->world.n_objects && drive && !err; i++) {
        const double *present_s = r->scene->objects[i].present_s;
        struct watch w = {r, i};
        err = scan_sight(&r->sights[i], is_in_view, &w, present_s ? present_s[0] : 0,
                         present_s ? present_s[1] : drive->period_s,
                         fmax(SIGHT_STEP_S, drive->period_s / SIGHT_STEPS));
    }
    return err;
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
    out->line_of_sight = sees(r, object, t_s);
    out->until_sight_s = out->line_of_sight ? 0
                         : r->scene->drive  ? until_sight_s(&r->sights[object], t_s)
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
