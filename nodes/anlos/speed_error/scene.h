/* SPDX-License-Identifier: MIT */
/* nodes/anlos/speed_error/scene.h -- a scene that `anlos speed-error` images: both
 * recordings in memory, and the truth.  Made by the simulator of hal/room/room, or read
 * from a folder.
 */
#ifndef ANLOS_NODES_ANLOS_SPEED_ERROR_SCENE_H
#define ANLOS_NODES_ANLOS_SPEED_ERROR_SCENE_H

#include "dsp/error.h"
#include "hal/survey/firing.h"
#include "nodes/anlos/speed_error/score.h"
#include "recon/survey.h"

struct bench_scene {
    char name[64];
    struct survey survey; /* names no volume */
    size_t frames;
    float *scene, *background; /* [n_positions][n_microphones][frames]; background NULL:
                                * there is none, for it is silent */
    struct bench_truth truth;
};

/* Of the file of a scene (hal/room/scene.h): points, corners and letters before a wall
 * that stands across z.  firing: hal/survey/firing.h, or NULL.  What is silent but for
 * the objects needs no background. 0, -EINTR, -EINVAL (also what has no truth), other
 * negative errno. */
int bench_scene_simulate(struct bench_scene *out, const char *path,
                         const struct firing *firing, size_t threads, struct error *why);

/* Scenes that are part of the program: "points\0...", as imager_methods(). */
const char *bench_scene_builtin_names(void);

/* Writes the file of one of them to FOLDER/NAME.yaml.  0, -ENOENT, other errno. */
int bench_scene_write_builtin(const char *name, const char *folder, struct error *why);

/* Of a folder of recordings: NAME as `anlos sim` wrote it (points and corners), or
 * NAME.json, NAME_wav/ and NAME_bg_wav/ as the reference simulator does.  calibration:
 * the folder of its microphones' curves, or NULL; survey_folder: where a survey.yaml of
 * the latter is put.  0, -ENOENT (no such), other negative errno. */
int bench_scene_read(struct bench_scene *out, const char *recordings, const char *name,
                     const char *calibration, const char *survey_folder,
                     struct error *why);

/* The names in such a folder, in order, each ended by a zero, an empty one at the end;
 * free() it.  0, -ENOENT (there are none), other negative errno. */
int bench_scene_list(char **out, const char *recordings, struct error *why);

void bench_scene_clear(struct bench_scene *s);

#endif
