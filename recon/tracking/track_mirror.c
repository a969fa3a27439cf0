/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "recon/tracking/track_state.h"

#define BODY_M 0.05 /* the middle of nothing is nearer to a wall */
#define SIGMAS 3.0  /* by more a mirror does not move what it mirrors by its error */
#define JUMP_M 1.0  /* by more it is another place: no detection is near to both */

void track_mirror_point(const struct track_mirror *m, const double p[3], double out[3])
{
    double beyond_m = -m->distance_m;

    for (int a = 0; a < 3; a++)
        beyond_m += m->normal[a] * p[a];
    for (int a = 0; a < 3; a++)
        out[a] = p[a] - (m->id ? 2.0 * beyond_m * m->normal[a] : 0.0);
}

double track_mirror_beyond_m(const struct track_mirror *m, const double p[3])
{
    if (!m->id)
        return -INFINITY;
    return m->normal[0] * p[0] + m->normal[1] * p[1] + m->normal[2] * p[2] -
           m->distance_m + BODY_M;
}

struct track_mirror track_mirror_after(const struct ego_step *step,
                                       const struct track_mirror *m)
{
    struct track_mirror out = *m;

    out.distance_m -= m->normal[0] * step->dx_m + m->normal[1] * step->dy_m;
    ego_step_turn(step, m->normal, out.normal);
    return out;
}

static struct track_mirror over_ground(const struct ego_step *pose,
                                       const struct track_mirror *m)
{
    struct track_mirror out = *m;

    track_turn(pose->dyaw, m->normal, out.normal);
    out.distance_m += out.normal[0] * pose->dx_m + out.normal[1] * pose->dy_m;
    return out;
}

/* -- a track from mirror to mirror ------------------------------------------------------
 */

/* A vector v goes to by v; axes are turned, and turned over by a single mirror. */
struct passage {
    double by[2][2];
    bool turned_over;
};

/* Where a place of the mirror `from` is by way of the mirror `to`. */
static void pass_point(const struct track_mirror *from, const struct track_mirror *to,
                       const double p[3], double out[3])
{
    double imaged_m[3];

    track_mirror_point(from, p, imaged_m);
    track_mirror_point(to, imaged_m, out);
}

static struct passage passage_between(const struct track_mirror *from,
                                      const struct track_mirror *to)
{
    static const double zero[3] = {0.0, 0.0, 0.0};
    struct passage w;
    double origin_m[3], moved_m[3];

    pass_point(from, to, zero, origin_m);
    for (int a = 0; a < 2; a++) {
        const double unit[3] = {a == 0, a == 1, 0.0};
        pass_point(from, to, unit, moved_m);
        for (int b = 0; b < 2; b++)
            w.by[b][a] = moved_m[b] - origin_m[b];
    }
    w.turned_over = w.by[0][0] * w.by[1][1] < w.by[0][1] * w.by[1][0];
    return w;
}

static void pass_vector(const struct passage *w, double v[2])
{
    double x = v[0], y = v[1];

    for (int a = 0; a < 2; a++)
        v[a] = w->by[a][0] * x + w->by[a][1] * y;
}

static void pass_filter(const struct passage *w, const double at_m[3],
                        struct track_filter *f)
{
    double half[4][4];

    f->state[0] = at_m[0];
    f->state[1] = at_m[1];
    f->height_m = at_m[2];
    pass_vector(w, f->state + 2);
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            half[i][j] = w->by[i % 2][0] * f->covariance[i - i % 2][j] +
                         w->by[i % 2][1] * f->covariance[i - i % 2 + 1][j];
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            f->covariance[i][j] = half[i][j - j % 2] * w->by[j % 2][0] +
                                  half[i][j - j % 2 + 1] * w->by[j % 2][1];
}

static void pass_outline(const struct passage *w, struct track_outline *o)
{
    double low_m = o->low_m[1];

    pass_vector(w, o->heard_m);
    pass_vector(w, o->middle_m);
    if (!w->turned_over) /* left of its way stays left */
        return;
    o->low_m[1] = -o->high_m[1];
    o->high_m[1] = -low_m;
}

/* It is along the axes of the vehicle, which has turned by yaw over ground. */
static void pass_extent(const struct passage *w, double yaw, double extent_m[3])
{
    double x = extent_m[0], y = extent_m[1], by[2][2];

    track_turn_matrix(-yaw, w->by, by);
    for (int a = 0; a < 2; a++)
        extent_m[a] = fabs(by[a][0]) * x + fabs(by[a][1]) * y;
}

/* What is at rest is heard at rest, mirrored or not: k->rest stays. */
static void pass_track(struct track *k, const struct track_mirror *to, double yaw)
{
    const struct passage w = passage_between(&k->mirror, to);
    struct track_filter *filters[TRACK_FILTERS];
    size_t n = track_filters(k, filters);

    for (size_t i = 0; i < n; i++) {
        const struct track_filter *f = filters[i];
        const double at_m[3] = {f->state[0], f->state[1], f->height_m};
        double there_m[3];
        pass_point(&k->mirror, to, at_m, there_m);
        pass_filter(&w, there_m, filters[i]);
    }
    for (size_t i = 0; i < k->body.n; i++)
        pass_vector(&w, k->body.parts[i].offset_m);
    pass_vector(&w, k->body.sight);
    pass_outline(&w, &k->outline);
    pass_extent(&w, yaw, k->extent_m);
    k->mirror = *to;
}

/* -- when mirrors change ----------------------------------------------------------------
 */

/* By how much the errors of a mirror move what it mirrors there, one sigma: its turn
 * about the array moves it about the foot of the perpendicular from there
 * (recon/walls/wall.h).
 */
static double error_m(const struct track_mirror *m, const double array_m[2],
                      const double p_m[2])
{
    double before_m = m->distance_m - m->normal[0] * p_m[0] - m->normal[1] * p_m[1];
    double aside_m = m->normal[0] * (p_m[1] - array_m[1]) -
                     m->normal[1] * (p_m[0] - array_m[0]);

    return 2.0 * hypot(m->sigma_m, hypot(before_m, aside_m) * m->sigma_rad);
}

/* As likely it is where it was told to be as where the new mirror puts it. */
static void widen(struct track *k, const double way_m[2])
{
    struct track_filter *filters[TRACK_FILTERS];
    size_t n = track_filters(k, filters);

    for (size_t i = 0; i < n; i++)
        for (int a = 0; a < 2; a++)
            for (int b = 0; b < 2; b++)
                filters[i]->covariance[a][b] += way_m[a] * way_m[b];
}

static void mirror_anew(struct tracker *t, const struct track_scan *scan, struct track *k,
                        const struct track_mirror *to)
{
    const struct track_mirror from = k->mirror;
    const double was_m[2] = {k->filter.state[0], k->filter.state[1]};
    double array_m[2];

    pass_track(k, to, t->pose.dyaw);
    const double way_m[2] = {k->filter.state[0] - was_m[0],
                             k->filter.state[1] - was_m[1]};
    double moved_m = hypot(way_m[0], way_m[1]);
    track_to_ground(&t->pose, scan->array.at_m, array_m);
    double known_m =
        hypot(error_m(&from, array_m, was_m), error_m(to, array_m, k->filter.state));
    if (!from.id || !to->id || moved_m < fmax(SIGMAS * known_m, t->cfg.wander_m))
        return;
    t->counts.jumped++;
    k->placed = false;
    if (moved_m < JUMP_M)
        widen(k, way_m);
}

static const struct track_mirror *find(const struct track_scan *scan, uint32_t id)
{
    for (size_t i = 0; i < scan->n_mirrors; i++)
        if (scan->mirrors[i].id == id)
            return &scan->mirrors[i];
    return NULL;
}

/* The one that stands before what is imaged where the track is; else none. */
static struct track_mirror choose(const struct tracker *t, const struct track_scan *scan,
                                  const struct track *k)
{
    const double at_m[3] = {k->filter.state[0], k->filter.state[1], k->filter.height_m};
    double imaged_m[3];

    track_mirror_point(&k->mirror, at_m, imaged_m);
    ego_step_point(&t->pose, imaged_m, imaged_m);
    size_t i = scan->stands_before ? scan->stands_before(scan->context, imaged_m)
                                   : scan->n_mirrors;
    return i < scan->n_mirrors ? over_ground(&t->pose, &scan->mirrors[i])
                               : (struct track_mirror){.id = 0};
}

/* One that mirrors what is where the track is; else none. */
static struct track_mirror
that_shows(const struct tracker *t, const struct track_scan *scan, const struct track *k)
{
    const double ground_m[3] = {k->filter.state[0], k->filter.state[1],
                                k->filter.height_m};
    double at_m[3], imaged_m[3];

    ego_step_point(&t->pose, ground_m, at_m);
    for (size_t i = 0; scan->stands_before && i < scan->n_mirrors; i++) {
        track_mirror_point(&scan->mirrors[i], at_m, imaged_m);
        if (scan->stands_before(scan->context, imaged_m) == i)
            return over_ground(&t->pose, &scan->mirrors[i]);
    }
    return (struct track_mirror){.id = 0};
}

static bool is_older(const struct track *a, const struct track *b)
{
    return a->id && b->id ? a->first_ns < b->first_ns : a->id != 0;
}

/* One thing that two mirrors show was two while neither was known. */
static void join_doubles(struct tracker *t)
{
    for (size_t i = 0; i < t->n; i++)
        for (size_t j = 0; j < t->n; j++) {
            struct track *k = &t->tracks[i], *other = &t->tracks[j];
            bool apart = !k->mirror.id || !other->mirror.id ||
                         k->mirror.id == other->mirror.id || other->merged;
            double away_m = hypot(k->filter.state[0] - other->filter.state[0],
                                  k->filter.state[1] - other->filter.state[1]);
            if (i != j && !apart && !k->placed && away_m < t->cfg.join_m &&
                !is_older(k, other))
                k->merged = true;
        }
}

void track_mirror_follow(struct tracker *t, const struct track_scan *scan)
{
    for (size_t i = 0; i < t->n; i++) {
        struct track *k = &t->tracks[i];
        const struct track_mirror *same = k->mirror.id ? find(scan, k->mirror.id) : NULL;
        struct track_mirror to = same ? over_ground(&t->pose, same) : choose(t, scan, k);
        bool loses_its_own = k->placed && !same && !to.id;
        k->placed &= same != NULL;
        k->waited = k->placed || !scan->n_mirrors ? 0.0 : k->waited;
        if (loses_its_own) { /* it stays where it is, for another one to show */
            const struct track_mirror other = that_shows(t, scan, k);
            if (other.id)
                k->mirror = to = other;
        }
        if (k->mirror.id || to.id)
            mirror_anew(t, scan, k, &to);
    }
    join_doubles(t);
}

void track_mirror_measured(struct tracker *t, const struct track_scan *scan,
                           struct track *k, uint32_t id)
{
    const struct track_mirror *m = id ? find(scan, id) : NULL;

    k->mirror = m ? over_ground(&t->pose, m) : (struct track_mirror){.id = 0};
    k->placed = m != NULL;
}
