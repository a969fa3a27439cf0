/* SPDX-License-Identifier: MIT */
#include "recon/ego.h"

#include <errno.h>
#include <math.h>

bool ego_motion_is_plausible(const struct ego_motion *m)
{
    return fabs(m->speed_m_s) <= EGO_FASTEST_M_S &&
           fabs(m->yaw_rate_rad_s) <= EGO_FASTEST_RAD_S; /* not of NaN */
}

/* -- steps ------------------------------------------------------------------------------
 */

void ego_motion_step(const struct ego_motion *m, double dt_s, struct ego_step *out)
{
    double turn = m->yaw_rate_rad_s * dt_s, half = 0.5 * turn;
    double chord_m = m->speed_m_s * dt_s * (half != 0.0 ? sin(half) / half : 1.0);
    *out = (struct ego_step){chord_m * cos(half), chord_m * sin(half), turn};
}

void ego_step_join(const struct ego_step *a, const struct ego_step *b,
                   struct ego_step *out)
{
    double c = cos(a->dyaw), s = sin(a->dyaw);
    *out = (struct ego_step){a->dx_m + c * b->dx_m - s * b->dy_m,
                             a->dy_m + s * b->dx_m + c * b->dy_m, a->dyaw + b->dyaw};
}

void ego_step_turn(const struct ego_step *s, const double from[3], double to[3])
{
    double cosine = cos(s->dyaw), sine = sin(s->dyaw), x = from[0], y = from[1];
    to[0] = cosine * x + sine * y;
    to[1] = cosine * y - sine * x;
    to[2] = from[2];
}

void ego_step_point(const struct ego_step *s, const double from[3], double to[3])
{
    const double way[3] = {from[0] - s->dx_m, from[1] - s->dy_m, from[2]};
    ego_step_turn(s, way, to);
}

/* -- path -------------------------------------------------------------------------------
 */

/* Motion number `age`, counted back from the newest. */
static size_t held(const struct ego_path *p, size_t age)
{
    return (p->newest + EGO_PATH_MOTIONS - age) % EGO_PATH_MOTIONS;
}

int ego_path_add(struct ego_path *p, int64_t stamp_ns, const struct ego_motion *m)
{
    if (!ego_motion_is_plausible(m) || (p->n && stamp_ns <= p->stamp_ns[p->newest]))
        return -EINVAL;
    p->newest = p->n ? (p->newest + 1) % EGO_PATH_MOTIONS : 0;
    p->n += p->n < EGO_PATH_MOTIONS;
    p->stamp_ns[p->newest] = stamp_ns;
    p->motion[p->newest] = *m;
    return 0;
}

/* The age (number) of the last motion at or before an instant; n: there is none. */
static size_t find(const struct ego_path *p, int64_t at_ns)
{
    size_t age = 0;
    while (age < p->n && p->stamp_ns[held(p, age)] > at_ns)
        age++;
    return age;
}

/* An instant from the motion `age` on to the next one. */
static struct ego_motion blend(const struct ego_path *p, size_t age, int64_t at_ns)
{
    size_t k = held(p, age);
    if (age == 0)
        return p->motion[k];
    size_t next = held(p, age - 1);
    double part = (double)(at_ns - p->stamp_ns[k]) /
                  (double)(p->stamp_ns[next] - p->stamp_ns[k]);
    const struct ego_motion *a = &p->motion[k], *b = &p->motion[next];
    return (struct ego_motion){a->speed_m_s + part * (b->speed_m_s - a->speed_m_s),
                               a->yaw_rate_rad_s +
                                   part * (b->yaw_rate_rad_s - a->yaw_rate_rad_s)};
}

static bool is_known(const struct ego_path *p, size_t age, int64_t at_ns)
{
    return age < p->n && at_ns - p->stamp_ns[held(p, age)] <= EGO_MAX_AGE_NS;
}

int ego_path_at(const struct ego_path *p, int64_t at_ns, struct ego_motion *out)
{
    size_t age = find(p, at_ns);
    *out = (struct ego_motion){0.0, 0.0};
    if (!is_known(p, age, at_ns))
        return -ENODATA;
    *out = blend(p, age, at_ns);
    return 0;
}

/* from_ns <= to_ns. */
static int walk(const struct ego_path *p, int64_t from_ns, int64_t to_ns,
                struct ego_step *out)
{
    size_t age = find(p, from_ns);
    if (!is_known(p, age, from_ns))
        return -ENODATA;
    *out = (struct ego_step){0.0, 0.0, 0.0};
    while (from_ns < to_ns) {
        bool last = age == 0 || p->stamp_ns[held(p, age - 1)] >= to_ns;
        int64_t end_ns = last ? to_ns : p->stamp_ns[held(p, age - 1)];
        if (end_ns - p->stamp_ns[held(p, age)] > EGO_MAX_AGE_NS)
            return -ENODATA;
        struct ego_motion mean = blend(p, age, from_ns + (end_ns - from_ns) / 2);
        struct ego_step part;
        ego_motion_step(&mean, 1e-9 * (double)(end_ns - from_ns), &part);
        ego_step_join(out, &part, out);
        from_ns = end_ns;
        age -= !last;
    }
    return 0;
}

static void turn_back(struct ego_step *s)
{
    const double origin[3] = {0.0, 0.0, 0.0};
    double back[3];
    ego_step_point(s, origin, back);
    *s = (struct ego_step){back[0], back[1], -s->dyaw};
}

int ego_path_between(const struct ego_path *p, int64_t from_ns, int64_t to_ns,
                     struct ego_step *out)
{
    int err = from_ns <= to_ns ? walk(p, from_ns, to_ns, out)
                               : walk(p, to_ns, from_ns, out);
    if (err)
        *out = (struct ego_step){0.0, 0.0, 0.0};
    else if (from_ns > to_ns)
        turn_back(out);
    return err;
}
