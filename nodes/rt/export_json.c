/* SPDX-License-Identifier: MIT */
#include "nodes/rt/export.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>

#include "nodes/rt/export_file.h"
#include "nodes/rt/json_whole.h"
#include "nodes/rt/names.h"
#include "recon/detection/objects.h"

json_t *export_real(double value)
{
    return isfinite(value) ? json_real(value) : json_null();
}

int export_json(const char *folder, const char *name, const json_t *value,
                struct error *why)
{
    struct export_file e;
    if (!json_whole(value))
        return error_say(why, -ENOMEM, "%s/%s: out of memory", folder, name);
    int err = export_file_open(&e, folder, name, why);
    if (err)
        return err;
    errno = 0;
    if (json_dumpf(value, e.f, JSON_INDENT(2) | JSON_REAL_PRECISION(9)) ||
        fputc('\n', e.f) == EOF)
        return export_file_abandon(&e, errno ? -errno : -EIO, why);
    return export_file_commit(&e, why);
}

json_t *export_reals(const double *v, size_t n)
{
    json_t *a = json_array();
    for (size_t i = 0; i < n; i++)
        json_array_append_new(a, export_real(v[i]));
    return a;
}

static json_t *vec3(const Anlos__Vec3 *v)
{
    if (!v)
        return json_null();
    return export_reals((const double[]){v->x, v->y, v->z}, 3);
}

static void add_track(json_t *o, const Anlos__Detection *d)
{
    json_object_set_new(o, "state", json_string(name_of_measurement(d->measurement)));
    json_object_set_new(o, "velocity_m_s",
                        export_reals(d->velocity_m_s, d->n_velocity_m_s));
    json_object_set_new(o, "age_s", export_real(d->age_s));
    json_object_set_new(o, "unseen_s", export_real(d->unseen_s));
}

/* What is not known is no number. */
static json_t *sigmas(const double c[6])
{
    double sigma[3] = {sqrt(c[0]), sqrt(c[3]), sqrt(c[5])};

    for (int a = 0; a < 3; a++)
        sigma[a] = sigma[a] < OBJECTS_KNOWN_M ? sigma[a] : NAN;
    return export_reals(sigma, 3);
}

static json_t *borders(unsigned at_border)
{
    static const char *const names[6] = {"x-", "x+", "y-", "y+", "z-", "z+"};
    json_t *all = json_array();

    for (int i = 0; i < 6; i++)
        if (at_border >> i & 1u)
            json_array_append_new(all, json_string(names[i]));
    return all;
}

json_t *export_multipath(const Anlos__Detection *d)
{
    static const char *const names[] = {[ANLOS__MULTIPATH__OF_A_PAIR] = "pair",
                                        [ANLOS__MULTIPATH__BY_A_FACE] = "face",
                                        [ANLOS__MULTIPATH__IN_A_SHADOW] = "shadow"};
    json_t *of = json_array();

    if (d->multipath <= 0 || d->multipath > ANLOS__MULTIPATH__IN_A_SHADOW) {
        json_decref(of);
        return json_null();
    }
    for (size_t i = 0; i < d->n_multipath_of; i++)
        json_array_append_new(of, json_integer(d->multipath_of[i]));
    return json_pack("{ss, so}", "by", names[d->multipath], "of", of);
}

static json_t *detection(const Anlos__Detection *d, bool tracked)
{
    json_t *o = json_object();
    json_object_set_new(o, "id", json_integer(d->id));
    json_object_set_new(o, "position_m", vec3(d->position_m));
    json_object_set_new(o, "sigma_m",
                        d->n_covariance_m2 == 6 ? sigmas(d->covariance_m2) : json_null());
    json_object_set_new(o, "covariance_m2",
                        export_reals(d->covariance_m2, d->n_covariance_m2));
    json_object_set_new(o, "existence", export_real(d->existence));
    json_object_set_new(o, "multipath", export_multipath(d));
    json_object_set_new(o, "level_db", export_real(d->level_db));
    json_object_set_new(o, "virtual_m", vec3(d->virtual_m));
    json_object_set_new(o, "extent_m", vec3(d->extent_m));
    json_object_set_new(o, "wall", json_integer(d->wall));
    json_object_set_new(o, "behind_no_wall", json_boolean(d->behind_no_wall));
    json_object_set_new(o, "in_free_view", json_boolean(d->in_free_view));
    json_object_set_new(o, "height_assumed", json_boolean(d->height_assumed));
    json_object_set_new(o, "at_border", borders(d->at_border));
    json_object_set_new(o, "class", json_string(name_of_shape(d->shape)));
    if (tracked)
        add_track(o, d);
    return o;
}

/* Corners as pairs, in the frame of the positions: [[x, y], ...]. */
static json_t *views(const Anlos__DetectionList *list)
{
    json_t *all = json_array();

    for (size_t i = 0; i < list->n_views; i++) {
        const Anlos__ViewArea *v = list->views[i];
        json_t *corners = json_array();
        for (size_t k = 0; k + 1 < v->n_corners_m; k += 2)
            json_array_append_new(corners, export_reals(v->corners_m + k, 2));
        json_array_append_new(
            all, json_pack("{si, so}", "wall", v->wall, "corners_m", corners));
    }
    return all;
}

int export_detections(const char *folder, const Anlos__DetectionList *list,
                      struct error *why)
{
    json_t *o = json_object(), *all = json_array();
    json_object_set_new(o, "scan", json_integer(list->scan));
    json_object_set_new(o, "counter", json_integer(list->counter));
    json_object_set_new(o, "preview", json_boolean(list->preview));
    json_object_set_new(o, "source", json_string(name_of_source(list->source)));
    json_object_set_new(o, "frame",
                        json_string(list->in_vehicle_frame ? "vehicle" : "array"));
    json_object_set_new(o, "tracked", json_boolean(list->tracked));
    json_object_set_new(o, "mirrored_at_wall", json_boolean(list->mirrored));
    json_object_set_new(o, "sound_speed_m_s", export_real(list->sound_speed_m_s));
    json_object_set_new(o, "temperature_c", export_real(list->temperature_c));
    for (size_t i = 0; i < list->n_detections; i++)
        json_array_append_new(all, detection(list->detections[i], list->tracked));
    json_object_set_new(o, "detections", all);
    json_object_set_new(o, "views", views(list));
    int err = export_json(folder, "detections.json", o, why);
    json_decref(o);
    return err;
}
