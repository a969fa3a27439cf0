#include "nodes/anlos/sim_truth.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "nodes/rt/export.h"
#include "nodes/rt/export_file.h"

static json_t *vec3(const double v[3])
{
    return json_pack("[o, o, o]", export_real(v[0]), export_real(v[1]),
                     export_real(v[2]));
}

static json_t *object_json(const struct room_object *o, const struct survey *s)
{
    json_t *j = json_object();
    double vehicle[3];
    survey_to_vehicle(s, o->position_m, vehicle);
    json_object_set_new(j, "name", json_string(o->name));
    json_object_set_new(j, "kind", json_string(o->kind));
    json_object_set_new(j, "position_m", vec3(o->position_m));
    json_object_set_new(j, "virtual_m", vec3(o->virtual_m));
    json_object_set_new(j, "vehicle_m", s->has_mount ? vec3(vehicle) : json_null());
    json_object_set_new(j, "extent_m", vec3(o->extent_m));
    return j;
}

int sim_truth_write(const struct room *room, const char *scene_path, const char *folder,
                    struct complaint *why)
{
    const struct survey *s = room_survey(room);
    const struct room_object *objects;
    size_t n = room_objects(room, &objects);
    json_t *all = json_array(), *truth = json_object();

    json_object_set_new(truth, "scene", json_string(scene_path));
    json_object_set_new(truth, "sound_speed_m_s", export_real(s->sound_speed_m_s));
    if (s->has_wall)
        json_object_set_new(truth, "wall",
                            json_pack("{so, so}", "normal", vec3(s->wall_normal),
                                      "distance_m", export_real(s->wall_distance_m)));
    else
        json_object_set_new(truth, "wall", json_null());
    for (size_t i = 0; i < n; i++)
        json_array_append_new(all, object_json(&objects[i], s));
    json_object_set_new(truth, "objects", all);
    int err = export_json(folder, "truth.json", truth, why);
    json_decref(truth);
    return err;
}

static int curve_write(const struct survey_response *r, const char *folder,
                       struct complaint *why)
{
    struct export_file e;
    char name[sizeof r->serial + 8];
    snprintf(name, sizeof name, "%s.txt", r->serial);
    int err = export_file_open(&e, folder, name, why);
    if (err)
        return err;
    errno = 0;
    int failed = fprintf(e.f, "*1000Hz\t0.0\n\t\n") < 0;
    for (size_t i = 0; i < r->n_points; i++)
        failed |= fprintf(e.f, "%.9g\t%.9g\n", r->frequency_hz[i], r->gain_db[i]) < 0;
    if (failed)
        return export_file_abandon(&e, errno ? -errno : -EIO, why);
    return export_file_commit(&e, why);
}

int sim_curves_write(const struct survey *s, const char *folder, struct complaint *why)
{
    if (mkdir(folder, 0777) && errno != EEXIST)
        return complain(why, -errno, "%s: cannot be written: %s", folder,
                        strerror(errno));
    for (size_t i = 0; i < s->n_responses; i++) {
        int err = curve_write(&s->responses[i], folder, why);
        if (err)
            return err;
    }
    return 0;
}
