#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "nodes/anlos/bench/scene.h"
#include "nodes/rt/export_file.h"

/* The places are those of the reference's scenes: what is imaged at z is really at
 * 2 - z. */
static const char head[] = "array: paper\n"
                           "sound_speed_m_s: 340\n"
                           "wall: {normal: [0, 0, 1], distance_m: 1}\n"
                           "seed: 1\n"
                           "level: 0.03\n";
static const char room[] =
    "wall_sound: {reflectivity: 0.95, patches: 150, scattering_length_m: 0.01,\n"
    "  roughness_m: 0.02}\n"
    "clutter: {points: 40, scattering_length_m: 0.03, near_m: 1.0, far_m: 5.0}\n"
    "microphones: {ripple_db: 1.5}\n"
    "errors: {gain_db: 0.5}\n"
    "noise: {snr_db: 30}\n";
static const char silence[] = "direct_level: 0\n";

static const struct {
    const char *name, *around, *objects;
} scenes[] = {
    {"points", room,
     "objects:\n"
     "  - {name: 1, kind: point, position_m: [0.20, 0.75, -0.62], scattering_length_m: "
     "0.02}\n"
     "  - {name: 2, kind: point, position_m: [0.45, 0.22, -0.78], scattering_length_m: "
     "0.02}\n"
     "  - {name: 3, kind: point, position_m: [0.65, 0.80, -0.94], scattering_length_m: "
     "0.02}\n"
     "  - {name: 4, kind: point, position_m: [0.92, 0.35, -1.10], scattering_length_m: "
     "0.02}\n"},
    {"corner_reflectors", room,
     "objects:\n"
     "  - {name: 1, kind: corner, position_m: [0.20, 0.75, -0.62], side_m: 0.25}\n"
     "  - {name: 2, kind: corner, position_m: [0.45, 0.22, -0.78], side_m: 0.25}\n"
     "  - {name: 3, kind: corner, position_m: [0.65, 0.80, -0.94], side_m: 0.25}\n"
     "  - {name: 4, kind: corner, position_m: [0.92, 0.35, -1.10], side_m: 0.25}\n"},
    {"letter_H", room,
     "objects:\n"
     "  - {name: H, kind: letter, letter: H, position_m: [0.54, 0.5, -0.2],\n"
     "     size_m: [0.76, 0.86], stroke_m: 0.2, facing: [0, 0, 1]}\n"},
    {"letters_LT", room,
     "objects:\n"
     "  - {name: T, kind: letter, letter: T, position_m: [0.32, 0.66, -0.55],\n"
     "     size_m: [0.25, 0.3], stroke_m: 0.07, facing: [0, 0, 1]}\n"
     "  - {name: L, kind: letter, letter: L, position_m: [0.74, 0.36, -0.95],\n"
     "     size_m: [0.25, 0.3], stroke_m: 0.07, facing: [0, 0, 1]}\n"},
    {"point", silence, /* for noise that is added afterwards */
     "objects:\n"
     "  - {name: 1, kind: point, position_m: [0.54, 0.5, -0.7], scattering_length_m: "
     "0.1}\n"},
};

const char *bench_scene_builtin_names(void)
{
    return "points\0corner_reflectors\0letter_H\0letters_LT\0point\0";
}

int bench_scene_write_builtin(const char *name, const char *folder, struct complaint *why)
{
    for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++) {
        if (strcmp(scenes[i].name, name))
            continue;
        struct export_file e;
        char file[128];
        snprintf(file, sizeof file, "%s.yaml", name);
        int err = export_file_open(&e, folder, file, why);
        if (err)
            return err;
        fprintf(e.f, "%s%s%s", head, scenes[i].around, scenes[i].objects);
        return export_file_commit(&e, why);
    }
    return complain(why, -ENOENT, "%s: no such scene", name);
}
