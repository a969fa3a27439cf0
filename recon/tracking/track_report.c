/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/tracking/track_state.h"

/* An echo may come from any height of a body: by how much bodies differ in the mean of
 * all is less.  The mean square of it over an array at 0.4 m is 0.26 m2, give or take
 * 0.05, of an adult, 0.03 of a child: of people 0.16 m2, one sigma, of the 0.64 m2 of a
 * single echo (recon/detection/objects.c). */
#define BODIES_DIFFER 0.06

#define REACH_M 1.0 /* existence is that of something so near */

static struct track_mirror in_vehicle(const struct ego_step *pose,
                                      const struct track_mirror *m)
{
    struct track_mirror out = *m;

    out.distance_m -= m->normal[0] * pose->dx_m + m->normal[1] * pose->dy_m;
    track_turn(-pose->dyaw, m->normal, out.normal);
    return out;
}

/* What is measured there is before its mirror: its filter, or what is taken to belong to
 * it, is where it cannot be. */
static void keep_before(const struct track_mirror *m, double p_m[3])
{
    double beyond_m = track_mirror_beyond_m(m, p_m);

    for (int a = 0; a < 3 && beyond_m > 0.0; a++)
        p_m[a] -= beyond_m * m->normal[a];
}

/* All looks at a body are wrong alike by what its height is not as assumed.  Its filter
 * has that as noise, unless it walks. */
static void add_height(const struct track *k, double covariance_m2[2][2])
{
    for (int a = 0; a < 2 && track_outline_may_walk(k); a++)
        for (int b = 0; b < 2; b++)
            covariance_m2[a][b] += BODIES_DIFFER * k->height_m2[a][b];
}

/* Of what is predicted: that it is within reach of where it is told, by what its filter
 * knows and how much faster or slower what is heard of it may be.  (Of a normal
 * distribution in the plane, as if it were round.) */
static double still_there(const struct tracker *t, const struct track *k)
{
    const struct track_filter *f = &k->filter;
    double faster_m2_s2[2][2] = {{0.0}};
    double unseen_s = 1e-9 * (double)(t->stamp_ns - k->seen_ns);

    if (k->state != TRACK_PREDICTED)
        return 1.0;
    track_outline_uncertain_velocity(k, faster_m2_s2);
    double m2 = 0.5 * (f->covariance[0][0] + f->covariance[1][1]) +
                0.5 * unseen_s * unseen_s * (faster_m2_s2[0][0] + faster_m2_s2[1][1]);
    return 1.0 - exp(-0.5 * REACH_M * REACH_M / m2);
}

static void report(const struct tracker *t, const struct track *k,
                   struct track_report *out)
{
    const struct track_filter *f = &k->filter;
    const struct track_outline *o = &k->outline;
    const double heard_m[3] = {f->state[0] + o->heard_m[0], f->state[1] + o->heard_m[1],
                               f->height_m};
    const double at_m[3] = {f->state[0] + o->middle_m[0], f->state[1] + o->middle_m[1],
                            f->height_m};
    double block[2][2], turned[2][2], size_m[2], yaw = t->pose.dyaw;

    memset(out, 0, sizeof *out);
    out->id = k->id;
    out->state = k->state;
    ego_step_point(&t->pose, at_m, out->position_m);
    ego_step_point(&t->pose, heard_m, out->heard_m);
    out->mirror = in_vehicle(&t->pose, &k->mirror);
    out->placed = k->placed;
    keep_before(&out->mirror, out->position_m);
    track_turn(-yaw, f->state + 2, out->velocity_m_s);
    for (int i = 0; i < 2; i++)
        memcpy(block[i], f->covariance[i], sizeof block[i]);
    track_outline_uncertain(k, block);
    add_height(k, block);
    track_turn_matrix(-yaw, (const double(*)[2])block, turned);
    out->covariance_m2[0] = turned[0][0];
    out->covariance_m2[1] = turned[0][1];
    out->covariance_m2[3] = turned[1][1];
    out->covariance_m2[5] = f->height_m2;
    for (int i = 0; i < 2; i++)
        memcpy(block[i], f->covariance[2 + i] + 2, sizeof block[i]);
    track_outline_uncertain_velocity(k, block);
    track_turn_matrix(-yaw, (const double(*)[2])block, turned);
    out->velocity_m2_s2[0] = turned[0][0];
    out->velocity_m2_s2[1] = turned[0][1];
    out->velocity_m2_s2[2] = turned[1][1];
    track_outline_size(k, yaw, size_m);
    memcpy(out->extent_m, k->extent_m, sizeof out->extent_m);
    for (int i = 0; i < 2; i++)
        out->extent_m[i] = fmax(out->extent_m[i], size_m[i]);
    out->existence = k->life.existence * still_there(t, k);
    out->motion = k->motion;
    out->age_s = 1e-9 * (double)(t->stamp_ns - k->first_ns);
    out->unseen_s = 1e-9 * (double)(t->stamp_ns - k->seen_ns);
    out->detection = k->detection;
}

static int by_existence(const void *a, const void *b)
{
    const struct track_report *x = a, *y = b;

    if (x->existence != y->existence)
        return x->existence < y->existence ? 1 : -1;
    return x->id < y->id ? -1 : x->id > y->id;
}

size_t tracker_report(const struct tracker *t, struct track_report out[TRACKS_MAX])
{
    size_t n = 0;

    for (size_t i = 0; i < t->n; i++)
        if (t->tracks[i].id)
            report(t, &t->tracks[i], &out[n++]);
    qsort(out, n, sizeof *out, by_existence);
    return n;
}
