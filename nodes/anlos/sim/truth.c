#include "nodes/anlos/sim/truth.h"

#include "nodes/rt/export.h"

static json_t *object_json(const struct room_object *o, const struct survey *s)
{
    json_t *j = json_object();
    double vehicle[3];
    survey_to_vehicle(s, o->position_m, vehicle);
    json_object_set_new(j, "name", json_string(o->name));
    json_object_set_new(j, "kind", json_string(o->kind));
    json_object_set_new(j, "position_m", export_reals(o->position_m, 3));
    json_object_set_new(j, "virtual_m", export_reals(o->virtual_m, 3));
    json_object_set_new(j, "vehicle_m",
                        s->has_mount ? export_reals(vehicle, 3) : json_null());
    json_object_set_new(j, "extent_m", export_reals(o->extent_m, 3));
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
                            json_pack("{so, so}", "normal",
                                      export_reals(s->wall_normal, 3), "distance_m",
                                      export_real(s->wall_distance_m)));
    else
        json_object_set_new(truth, "wall", json_null());
    for (size_t i = 0; i < n; i++)
        json_array_append_new(all, object_json(&objects[i], s));
    json_object_set_new(truth, "objects", all);
    int err = export_json(folder, "truth.json", truth, why);
    json_decref(truth);
    return err;
}
