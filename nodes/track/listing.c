#include "nodes/track/listing.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/rt/objects.h"

static double *numbers_create(const double *values, size_t n)
{
    double *copy = malloc(n * sizeof *copy);

    return copy ? memcpy(copy, values, n * sizeof *copy) : NULL;
}

static void remember(struct listing_memory *m, const Anlos__Detection *d)
{
    *m = (struct listing_memory){.level_db = d->level_db,
                                 .shape = d->shape,
                                 .shape_probability = d->shape_probability,
                                 .behind_no_wall = d->behind_no_wall,
                                 .in_free_view = d->in_free_view};
}

static int fill_image(Anlos__Detection *m, const struct sight *sight,
                      const struct track_report *k)
{
    double virtual_m[3];

    sight_virtual(sight, &k->mirror, k->heard_m, virtual_m);
    m->virtual_m = objects_vec3(virtual_m);
    return m->virtual_m ? 0 : -ENOMEM;
}

static int fill_place(Anlos__Detection *m, const struct sight *sight,
                      const struct track_report *k)
{
    const double virtual_m[3] = {m->virtual_m->x, m->virtual_m->y, m->virtual_m->z};
    double covariance_m2[6];

    sight_wall_error(sight, m->wall, virtual_m, covariance_m2);
    for (int i = 0; i < 6; i++)
        covariance_m2[i] += k->covariance_m2[i];
    m->position_m = objects_vec3(k->position_m);
    m->extent_m = objects_vec3(k->extent_m);
    m->covariance_m2 = numbers_create(covariance_m2, 6);
    m->velocity_m_s = numbers_create(k->velocity_m_s, 2);
    m->velocity_covariance_m2_s2 = numbers_create(k->velocity_m2_s2, 3);
    if (!m->position_m || !m->extent_m || !m->covariance_m2 || !m->velocity_m_s ||
        !m->velocity_covariance_m2_s2)
        return -ENOMEM;
    m->n_covariance_m2 = 6;
    m->n_velocity_m_s = 2;
    m->n_velocity_covariance_m2_s2 = 3;
    return 0;
}

static int fill(Anlos__Detection *m, const struct listing_memory *told,
                const struct sight *sight, const struct track_report *k, bool placed)
{
    static const Anlos__Measurement states[] = {
        [TRACK_NEW] = ANLOS__MEASUREMENT__NEW,
        [TRACK_MEASURED] = ANLOS__MEASUREMENT__MEASURED,
        [TRACK_PREDICTED] = ANLOS__MEASUREMENT__PREDICTED,
        [TRACK_DELETED] = ANLOS__MEASUREMENT__DELETED};
    static const Anlos__Motion motions[] = {
        [TRACK_MOTION_UNKNOWN] = ANLOS__MOTION__MOTION_UNKNOWN,
        [TRACK_STANDING] = ANLOS__MOTION__STANDING,
        [TRACK_MOVING] = ANLOS__MOTION__MOVING};

    m->id = k->id;
    m->existence = k->existence * sight_existence(sight, k->mirror.id);
    m->measurement = states[k->state];
    m->motion = motions[k->motion];
    m->age_s = k->age_s;
    m->unseen_s = k->unseen_s;
    m->level_db = told->level_db;
    m->shape = told->shape;
    m->shape_probability = told->shape_probability;
    m->wall = k->mirror.id;
    m->behind_no_wall = told->behind_no_wall;
    m->in_free_view = told->in_free_view;
    int err = fill_image(m, sight, k);
    return err || !placed ? err : fill_place(m, sight, k);
}

/* As `like`, but for its detections. */
static Anlos__DetectionList *create(const Anlos__DetectionList *like, size_t n)
{
    Anlos__DetectionList *list = malloc(sizeof *list);

    if (!list)
        return NULL;
    *list = *like;
    list->n_detections = 0;
    list->detections = calloc(n ? n : 1, sizeof *list->detections);
    if (list->detections)
        return list;
    free(list);
    return NULL;
}

int listing_make(struct listing *l, const struct sight *sight,
                 const struct track_report *tracks, size_t n, bool all_placed,
                 Anlos__DetectionList **list)
{
    Anlos__DetectionList *made = create(*list, n);

    if (!made)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++) {
        const struct track_report *k = &tracks[i];
        Anlos__Detection *m = malloc(sizeof *m);
        if (!m)
            goto fail;
        anlos__detection__init(m);
        made->detections[made->n_detections++] = m;
        if (k->detection < (*list)->n_detections)
            remember(&l->of[k->id], (*list)->detections[k->detection]);
        if (fill(m, &l->of[k->id], sight, k, k->placed || all_placed))
            goto fail;
    }
    objects_free(*list);
    *list = made;
    return 0;
fail:
    objects_free(made);
    return -ENOMEM;
}
