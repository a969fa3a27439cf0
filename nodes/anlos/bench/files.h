/* nodes/anlos/bench/files.h -- what both kinds of recordings that `anlos bench` reads
 * have in common (bench_scene_read.c, bench_scene_reference.c). */
#ifndef ANLOS_NODES_ANLOS_BENCH_FILES_H
#define ANLOS_NODES_ANLOS_BENCH_FILES_H

#include <jansson.h>
#include <limits.h>

#include "nodes/anlos/bench/scene.h"

/* FOLDER/NAME and the rest of the name.  0, -ENAMETOOLONG. */
int bench_join(char out[PATH_MAX], const char *folder, const char *name, const char *rest,
               struct complaint *why);
bool bench_exists(const char *folder, const char *name, const char *rest);

/* 0, -EINVAL (the complaint names the line). */
int bench_read_json(json_t **out, const char *path, struct complaint *why);

/* The first n of an array of numbers.  0, -EINVAL. */
int bench_read_numbers(const json_t *from, double *out, size_t n);

/* Both recordings of the scene's survey into memory.  0, -EINTR, other errno. */
int bench_read_passes(struct bench_scene *s, const char *scene, const char *background,
                      struct complaint *why);

/* NAME.json, NAME_wav/ and NAME_bg_wav/; see bench_scene_read. */
int bench_read_reference(struct bench_scene *s, const char *recordings, const char *name,
                         const char *calibration, const char *survey_folder,
                         struct complaint *why);

#endif
