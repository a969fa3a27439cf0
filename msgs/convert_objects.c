/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/convert.h"

_Static_assert(SHAPE_POINT == (int)ANLOS__SHAPE__POINT &&
                   SHAPE_PLATE == (int)ANLOS__SHAPE__PLATE &&
                   SHAPE_EXTENDED == (int)ANLOS__SHAPE__EXTENDED &&
                   MULTIPATH_NONE == (int)ANLOS__MULTIPATH__NO_MULTIPATH &&
                   MULTIPATH_PAIR == (int)ANLOS__MULTIPATH__OF_A_PAIR &&
                   MULTIPATH_FACE == (int)ANLOS__MULTIPATH__BY_A_FACE &&
                   MULTIPATH_SHADOW == (int)ANLOS__MULTIPATH__IN_A_SHADOW &&
                   TRACK_NEW == (int)ANLOS__MEASUREMENT__NEW &&
                   TRACK_MEASURED == (int)ANLOS__MEASUREMENT__MEASURED &&
                   TRACK_PREDICTED == (int)ANLOS__MEASUREMENT__PREDICTED &&
                   TRACK_DELETED == (int)ANLOS__MEASUREMENT__DELETED &&
                   TRACK_MOTION_UNKNOWN == (int)ANLOS__MOTION__MOTION_UNKNOWN &&
                   TRACK_STANDING == (int)ANLOS__MOTION__STANDING &&
                   TRACK_MOVING == (int)ANLOS__MOTION__MOVING,
               "");

static Anlos__Vec3 *vec3(const double v[3])
{
    Anlos__Vec3 *m = malloc(sizeof *m);

    if (!m)
        return NULL;
    anlos__vec3__init(m);
    m->x = v[0];
    m->y = v[1];
    m->z = v[2];
    return m;
}

static double *numbers(const double *values, size_t n)
{
    double *copy = malloc(n * sizeof *copy);

    return copy ? memcpy(copy, values, n * sizeof *copy) : NULL;
}

static int fill_place(Anlos__Detection *m, const struct object *o)
{
    m->position_m = vec3(o->place.position_m);
    m->extent_m = vec3(o->place.extent_m);
    m->covariance_m2 = numbers(o->place.covariance_m2, 6);
    if (!m->position_m || !m->extent_m || !m->covariance_m2)
        return -ENOMEM;
    m->n_covariance_m2 = 6;
    if (!o->tracked)
        return 0;
    m->velocity_m_s = numbers(o->velocity_m_s, 2);
    m->velocity_covariance_m2_s2 = numbers(o->velocity_m2_s2, 3);
    if (!m->velocity_m_s || !m->velocity_covariance_m2_s2)
        return -ENOMEM;
    m->n_velocity_m_s = 2;
    m->n_velocity_covariance_m2_s2 = 3;
    return 0;
}

static int fill_multipath(Anlos__Detection *m, const struct object *o)
{
    m->multipath = (Anlos__Multipath)o->multipath;
    m->multipath_of = malloc(sizeof o->of);
    if (!m->multipath_of)
        return -ENOMEM;
    memcpy(m->multipath_of, o->of, sizeof o->of);
    m->n_multipath_of = o->of[1] == o->of[0] ? 1 : 2;
    return 0;
}

static int fill(Anlos__Detection *m, const struct object *o)
{
    m->id = o->id;
    m->existence = o->existence;
    m->level_db = o->level_db;
    m->shape = (Anlos__Shape)o->shape.shape;
    m->shape_probability = o->shape.probability;
    m->wall = o->place.wall;
    m->behind_no_wall = o->place.behind_no_wall;
    m->in_free_view = o->place.in_free_view;
    m->height_assumed = o->place.height_assumed;
    m->at_border = o->at_border;
    m->measurement = (Anlos__Measurement)o->state;
    m->motion = (Anlos__Motion)o->motion;
    m->age_s = o->age_s;
    m->unseen_s = o->unseen_s;
    m->virtual_m = vec3(o->virtual_m);
    int err = m->virtual_m ? 0 : -ENOMEM;
    if (!err && o->placed)
        err = fill_place(m, o);
    return err || !o->multipath ? err : fill_multipath(m, o);
}

static int fill_views(Anlos__DetectionList *m, const struct field_of_view *view)
{
    m->views = calloc(view->n ? view->n : 1, sizeof *m->views);
    if (!m->views)
        return -ENOMEM;
    for (size_t i = 0; i < view->n; i++) {
        const struct view_area *from = &view->areas[i];
        Anlos__ViewArea *a = malloc(sizeof *a);
        if (!a)
            return -ENOMEM;
        anlos__view_area__init(a);
        m->views[m->n_views++] = a;
        a->wall = from->wall;
        a->corners_m = malloc(2 * from->n * sizeof *a->corners_m);
        if (!a->corners_m)
            return -ENOMEM;
        a->n_corners_m = 2 * from->n;
        memcpy(a->corners_m, from->corners_m, 2 * from->n * sizeof *a->corners_m);
    }
    return 0;
}

int detections_from_objects(Anlos__DetectionList **out, const struct object_list *list)
{
    Anlos__DetectionList *m = malloc(sizeof *m);

    if (!m)
        return -ENOMEM;
    anlos__detection_list__init(m);
    m->scan = list->scan;
    m->frame = list->frame;
    m->counter = list->counter;
    m->preview = list->preview;
    m->mirrored = list->mirrored;
    m->in_vehicle_frame = list->in_vehicle_frame;
    m->tracked = list->tracked;
    m->ego_unknown = list->ego_unknown;
    m->source = (Anlos__Source)list->source;
    m->temperature_c = list->temperature_c;
    m->sound_speed_m_s = list->sound_speed_m_s;
    m->detections = calloc(list->n ? list->n : 1, sizeof(Anlos__Detection *));
    if (!m->detections)
        goto fail;
    for (size_t i = 0; i < list->n; i++) {
        Anlos__Detection *d = malloc(sizeof *d);
        if (!d)
            goto fail;
        anlos__detection__init(d);
        m->detections[m->n_detections++] = d;
        if (fill(d, &list->objects[i]))
            goto fail;
    }
    if (fill_views(m, &list->view))
        goto fail;
    *out = m;
    return 0;
fail:
    detections_free(m);
    return -ENOMEM;
}

void detections_free(Anlos__DetectionList *list)
{
    if (!list)
        return;
    for (size_t i = 0; i < list->n_detections; i++) {
        Anlos__Detection *m = list->detections[i];
        free(m->position_m);
        free(m->virtual_m);
        free(m->extent_m);
        free(m->covariance_m2);
        free(m->velocity_m_s);
        free(m->velocity_covariance_m2_s2);
        free(m->multipath_of);
        free(m);
    }
    for (size_t i = 0; i < list->n_views; i++) {
        free(list->views[i]->corners_m);
        free(list->views[i]);
    }
    free(list->views);
    free(list->detections);
    free(list);
}
