/* SPDX-License-Identifier: MIT */
#include "nodes/rt/trails.h"

#include <math.h>
#include <string.h>

void trails_init(struct trails *t, int64_t keep_ns, int64_t step_ns)
{
    memset(t, 0, sizeof *t);
    t->keep_ns = keep_ns;
    t->step_ns = step_ns;
}

void trails_ego(struct trails *t, const Anlos__EgoMotion *m, int64_t capture_ns)
{
    const struct ego_motion motion = {m->speed_m_s, m->yaw_rate_rad_s};

    if (!m->valid || !trails_stamp_holds(capture_ns))
        return;
    if (t->ego.n && capture_ns < t->ego.stamp_ns[t->ego.newest] - t->keep_ns)
        t->ego = (struct ego_path){0}; /* of another run */
    ego_path_add(&t->ego, capture_ns, &motion);
}

const struct trail *trails_find(const struct trails *t, uint32_t id)
{
    for (size_t i = 0; id && i < TRAILS_MAX; i++)
        if (t->list[i].id == id)
            return &t->list[i];
    return NULL;
}

static int64_t newest_ns(const struct trail *k)
{
    return k->n ? k->points[k->n - 1].stamp_ns : INT64_MIN;
}

/* Its own, an empty one, or that of the track that was seen longest ago. */
static struct trail *find_room(struct trails *t, uint32_t id)
{
    struct trail *oldest = &t->list[0];

    for (size_t i = 0; i < TRAILS_MAX; i++) {
        if (t->list[i].id == id)
            return &t->list[i];
        if (newest_ns(&t->list[i]) < newest_ns(oldest))
            oldest = &t->list[i];
    }
    oldest->id = id;
    oldest->n = 0;
    return oldest;
}

static void forget_points(struct trail *k, int64_t before_ns)
{
    size_t old = 0;

    while (old < k->n && k->points[old].stamp_ns < before_ns)
        old++;
    k->n -= old;
    memmove(k->points, k->points + old, k->n * sizeof k->points[0]);
}

static void forget(struct trails *t, int64_t before_ns)
{
    forget_points(&t->own, before_ns);
    for (size_t i = 0; i < TRAILS_MAX; i++) {
        forget_points(&t->list[i], before_ns);
        if (!t->list[i].n)
            t->list[i].id = 0;
    }
}

static void move_points(struct trail *k, const struct ego_step *step)
{
    for (size_t i = 0; i < k->n; i++)
        ego_step_point(step, k->points[i].at_m, k->points[i].at_m);
}

static void move_to(struct trails *t, int64_t capture_ns)
{
    struct ego_step step;

    if (ego_path_between(&t->ego, t->frame_ns, capture_ns, &step) ||
        (step.dx_m == 0.0 && step.dy_m == 0.0 && step.dyaw == 0.0))
        return;
    move_points(&t->own, &step);
    for (size_t i = 0; i < TRAILS_MAX; i++)
        move_points(&t->list[i], &step);
}

/* The newest point goes along until it is a step from the one before. */
static void add(const struct trails *t, struct trail *k, const struct trail_point *p)
{
    bool replaces = k->n > 1 &&
                    k->points[k->n - 1].stamp_ns - k->points[k->n - 2].stamp_ns <
                        t->step_ns;

    if (!replaces && k->n == TRAILS_MAX_POINTS)
        memmove(k->points, k->points + 1, --k->n * sizeof k->points[0]);
    k->n += !replaces;
    k->points[k->n - 1] = *p;
}

static void add_track(struct trails *t, const Anlos__Detection *d, int64_t capture_ns)
{
    const Anlos__Vec3 *at = d->position_m;

    if (!d->id || !at || !isfinite(at->x) || !isfinite(at->y) || !isfinite(at->z) ||
        d->measurement == ANLOS__MEASUREMENT__DELETED)
        return;
    const struct trail_point p = {.stamp_ns = capture_ns,
                                  .at_m = {at->x, at->y, at->z},
                                  .measured = d->measurement !=
                                              ANLOS__MEASUREMENT__PREDICTED};
    add(t, find_room(t, d->id), &p);
}

void trails_take(struct trails *t, const Anlos__DetectionList *list, int64_t capture_ns)
{
    if (!list->tracked || !trails_stamp_holds(capture_ns))
        return;
    if (capture_ns < t->frame_ns) {
        memset(t->list, 0, sizeof t->list);
        t->own.n = 0;
    } else if (t->frame_ns && list->in_vehicle_frame) {
        move_to(t, capture_ns);
    }
    t->frame_ns = capture_ns;
    forget(t, capture_ns - t->keep_ns);
    add(t, &t->own, &(struct trail_point){.stamp_ns = capture_ns, .measured = true});
    for (size_t i = 0; i < list->n_detections; i++)
        add_track(t, list->detections[i], capture_ns);
}
