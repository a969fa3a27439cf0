/* SPDX-License-Identifier: MIT */
#include "hal/room/reach.h"

#include <math.h>
#include <string.h>

#include "hal/room/vector.h"

#define STEP_S      0.02
#define STEPS       5000
#define EGO_MAX_M_S 30.0 /* hal/room/scene_drive.c */

static double distance_m(const double a[3], const double b[3])
{
    double way[3];
    vector_add(a, -1, b, way);
    return sqrt(vector_dot(way, way));
}

/* The farthest that any element gets from the first speaker at the first position. */
static double array_reach_m(struct pose *pose, double first[3])
{
    const struct survey *s = pose->survey;
    double reach = 0;
    for (size_t k = 0; k < s->n_positions; k++) {
        pose_move(pose, k);
        if (k == 0)
            memcpy(first, pose->speakers_m[0], 3 * sizeof *first);
        for (size_t i = 0; i < s->n_speakers; i++)
            reach = fmax(reach, distance_m(pose->speakers_m[i], first));
        for (size_t i = 0; i < s->n_microphones; i++)
            reach = fmax(reach, distance_m(pose->microphones_m[i], first));
    }
    return reach;
}

static double farthest_m(const struct scatter *s, const double from[3])
{
    double farthest = 0;
    for (size_t i = 0; i < s->n; i++) {
        farthest = fmax(farthest, distance_m(s->pieces[i].in, from));
        farthest = fmax(farthest, distance_m(s->pieces[i].out, from));
    }
    return farthest;
}

double reach_longest_path_m(struct pose *pose, const struct world *world)
{
    const struct survey *s = pose->survey;
    double first[3], image[3];
    double reach = array_reach_m(pose, first);
    reach += fabs(survey_speed_m_s(s)) * survey_duration_s(s) / (double)s->n_positions;
    vector_mirror(s->wall_normal, s->wall_distance_m, first, image);
    double far =
        fmax(farthest_m(&world->points, image), farthest_m(&world->facets, image));
    far = fmax(far, farthest_m(&world->mirrored, image));
    far = fmax(far, farthest_m(&world->clutter, first));
    far = fmax(far, distance_m(first, image) / 2); /* the wall's echo */
    return 2 * (far + reach);
}

/* Of a moment of a drive: from the first speaker or its image to anything. */
static double reach_now_m(const struct survey *s, const double first[3],
                          const struct traffic *traffic)
{
    double image[3], far;
    vector_mirror(s->wall_normal, s->wall_distance_m, first, image);
    far = distance_m(first, image) / 2; /* the wall's echo */
    for (size_t i = 0; i < traffic->n; i++) {
        far = fmax(far, distance_m(traffic->pieces[i].in.at_m, image));
        far = fmax(far, distance_m(traffic->pieces[i].out.at_m, image));
    }
    far = fmax(far, farthest_m(&traffic->world->mirrored, image));
    return fmax(far, farthest_m(&traffic->world->clutter, first));
}

double reach_longest_drive_m(struct pose *pose, const struct drive *drive,
                             struct traffic *traffic)
{
    double first[3], at[3], reach = array_reach_m(pose, first), far = 0;
    double step_s = fmax(STEP_S, drive->scene->period_s / STEPS), speed_m_s = 0;
    for (double t_s = 0; t_s < drive->scene->period_s; t_s += step_s) {
        struct drive_frame frame;
        traffic_set(traffic, t_s);
        drive_frame(drive, t_s, &frame);
        drive_to_ground(&frame, first, at);
        far = fmax(far, reach_now_m(pose->survey, at, traffic));
        for (size_t i = 0; i < traffic->n; i++) {
            const double *v = traffic->pieces[i].in.velocity_m_s;
            speed_m_s = fmax(speed_m_s, sqrt(vector_dot(v, v)));
        }
    }
    return 2 * (far + reach + (speed_m_s + EGO_MAX_M_S) * step_s);
}
