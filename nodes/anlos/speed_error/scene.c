/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/speed_error/scene.h"

#include <dirent.h>
#include <errno.h>
#include <jansson.h>
#include <limits.h>
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "dsp/pool.h"
#include "hal/recording/recording.h"
#include "hal/room/room.h"
#include "hal/room/scene.h"
#include "hal/survey/file.h"
#include "nodes/rt/export.h"
#include "nodes/rt/stop.h"

/* FOLDER/NAME and the rest of the name.  0, -ENAMETOOLONG. */
static int bench_join(char out[PATH_MAX], const char *folder, const char *name,
                      const char *rest, struct error *why)
{
    int n = snprintf(out, PATH_MAX, "%s/%s%s", folder, name, rest);
    return n < PATH_MAX ? 0 : error_say(why, -ENAMETOOLONG, "%s: path too long", folder);
}

static bool bench_exists(const char *folder, const char *name, const char *rest)
{
    char path[PATH_MAX];
    struct stat st;
    return !bench_join(path, folder, name, rest, NULL) && !stat(path, &st);
}

/* 0, -EINVAL (the error names the line). */
static int bench_read_json(json_t **out, const char *path, struct error *why)
{
    json_error_t error;
    *out = json_load_file(path, 0, &error);
    return *out ? 0 : error_say(why, -EINVAL, "%s:%d: %s", path, error.line, error.text);
}

/* The first n of an array of numbers.  0, -EINVAL. */
static int bench_read_numbers(const json_t *from, double *out, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const json_t *v = json_array_get(from, i);
        if (!json_is_number(v))
            return -EINVAL;
        out[i] = json_number_value(v);
    }
    return 0;
}

static int read_pass(float *to, const struct bench_scene *s, struct recording *r,
                     struct error *why)
{
    uint32_t *counts = malloc(2 * s->survey.n_microphones * sizeof *counts);
    int err = counts ? 0 : error_say(why, -ENOMEM, "out of memory");
    for (size_t k = 0; !err && k < s->survey.n_positions; k++)
        err = interrupt_requested()
                  ? error_say(why, -EINTR, "interrupted")
                  : recording_read(r, k, to + k * s->survey.n_microphones * s->frames,
                                   counts, counts + s->survey.n_microphones, why);
    free(counts);
    return err;
}

/* Both recordings of the scene's survey into memory.  0, -EINTR, other errno. */
static int bench_read_passes(struct bench_scene *s, const char *scene,
                             const char *background, struct error *why)
{
    struct recording *r[2] = {NULL, NULL};
    int err = recording_open(&r[0], scene, &s->survey, why);
    if (!err)
        err = recording_open(&r[1], background, &s->survey, why);
    if (!err && recording_frames(r[0]) != recording_frames(r[1]))
        err = error_say(why, -EINVAL, "%s: %zu frames, expected the %zu of %s",
                        background, recording_frames(r[1]), recording_frames(r[0]),
                        scene);
    if (!err) {
        s->frames = recording_frames(r[0]);
        size_t size = s->survey.n_positions * s->survey.n_microphones * s->frames;
        s->scene = malloc(size * sizeof *s->scene);
        s->background = malloc(size * sizeof *s->background);
        if (!s->scene || !s->background)
            err = error_say(why, -ENOMEM, "out of memory");
    }
    if (!err)
        err = read_pass(s->scene, s, r[0], why);
    if (!err)
        err = read_pass(s->background, s, r[1], why);
    recording_close(r[0]);
    recording_close(r[1]);
    return err;
}

/* The places are those of the reference's scenes: what is imaged at z is really at
 * 2 - z. */
static const char head[] = "array: paper\n"
                           "sound_speed_m_s: 340\n"
                           "wall: {normal: [0, 0, 1], distance_m: 1}\n"
                           "seed: 1\n"
                           "level: 0.03\n";
static const char reference_room[] =
    "wall_sound: {reflectivity: 0.95, patches: 150, scattering_length_m: 0.01,\n"
    "  roughness_m: 0.02}\n"
    "clutter: {points: 40, scattering_length_m: 0.03, near_m: 1.0, far_m: 5.0}\n"
    "microphones: {ripple_db: 1.5}\n"
    "errors: {gain_db: 0.5}\n"
    "noise: {snr_db: 30}\n";
static const char silence[] = "direct_level: 0\ngate_m: [1.5, 4.5]\n";

static const struct {
    const char *name, *around, *objects;
} scenes[] = {
    {"points", reference_room,
     "objects:\n"
     "  - {name: 1, kind: point, position_m: [0.20, 0.75, -0.62], scattering_length_m: "
     "0.02}\n"
     "  - {name: 2, kind: point, position_m: [0.45, 0.22, -0.78], scattering_length_m: "
     "0.02}\n"
     "  - {name: 3, kind: point, position_m: [0.65, 0.80, -0.94], scattering_length_m: "
     "0.02}\n"
     "  - {name: 4, kind: point, position_m: [0.92, 0.35, -1.10], scattering_length_m: "
     "0.02}\n"},
    {"corner_reflectors", reference_room,
     "objects:\n"
     "  - {name: 1, kind: corner, position_m: [0.20, 0.75, -0.62], side_m: 0.25}\n"
     "  - {name: 2, kind: corner, position_m: [0.45, 0.22, -0.78], side_m: 0.25}\n"
     "  - {name: 3, kind: corner, position_m: [0.65, 0.80, -0.94], side_m: 0.25}\n"
     "  - {name: 4, kind: corner, position_m: [0.92, 0.35, -1.10], side_m: 0.25}\n"},
    {"letter_H", reference_room,
     "objects:\n"
     "  - {name: H, kind: letter, letter: H, position_m: [0.54, 0.5, -0.2],\n"
     "     size_m: [0.76, 0.86], stroke_m: 0.2, facing: [0, 0, 1]}\n"},
    {"letters_LT", reference_room,
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

int bench_scene_write_builtin(const char *name, const char *folder, struct error *why)
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
    return error_say(why, -ENOENT, "%s: no such scene", name);
}

static int read_objects(struct bench_truth *t, const char *path, struct error *why)
{
    json_t *root;
    int err = bench_read_json(&root, path, why);
    if (err)
        return err;
    const json_t *all = json_object_get(root, "objects");
    if (!json_array_size(all))
        err = error_say(why, -EINVAL, "%s: objects: expected one or more", path);
    for (size_t i = 0; !err && i < json_array_size(all); i++) {
        const json_t *o = json_array_get(all, i);
        const char *kind = json_string_value(json_object_get(o, "kind"));
        double at[3];
        if (!kind || (strcmp(kind, "point") && strcmp(kind, "corner")))
            err = error_say(why, -EINVAL,
                            "%s: %s: expected points and corners; of letters name the "
                            "scene file itself",
                            path, kind ? kind : "kind");
        else if (bench_read_numbers(json_object_get(o, "virtual_m"), at, 3))
            err = error_say(why, -EINVAL, "%s: virtual_m: expected three numbers", path);
        else
            err = bench_truth_add_point(t, at, why);
    }
    json_decref(root);
    return err;
}

static int read_simulated(struct bench_scene *s, const char *folder, struct error *why)
{
    char path[PATH_MAX], background[PATH_MAX];
    int err = bench_join(path, folder, "survey.yaml", "", why);
    if (!err)
        err = survey_load(&s->survey, path, why);
    s->survey.has_volume = false;
    if (!err)
        err = bench_join(path, folder, "truth.json", "", why);
    if (!err)
        err = read_objects(&s->truth, path, why);
    if (!err)
        err = bench_join(path, folder, "scene", "", why);
    if (!err)
        err = bench_join(background, folder, "background", "", why);
    return err ? err : bench_read_passes(s, path, background, why);
}

static int bench_read_reference(struct bench_scene *s, const char *recordings,
                                const char *name, const char *calibration,
                                const char *survey_folder, struct error *why);

int bench_scene_read(struct bench_scene *out, const char *recordings, const char *name,
                     const char *calibration, const char *survey_folder,
                     struct error *why)
{
    char folder[PATH_MAX];
    memset(out, 0, sizeof *out);
    snprintf(out->name, sizeof out->name, "%.63s", name);
    int err = bench_join(folder, recordings, name, "", why);
    if (!err && bench_exists(folder, "survey.yaml", ""))
        err = read_simulated(out, folder, why);
    else if (!err && bench_exists(recordings, name, ".json"))
        err =
            bench_read_reference(out, recordings, name, calibration, survey_folder, why);
    else if (!err)
        err = error_say(why, -ENOENT,
                        "%s: no recording %s: expected %s/survey.yaml or %s.json",
                        recordings, name, name, name);
    if (err)
        bench_scene_clear(out);
    return err;
}

/* Hidden things and such as are neither kind: 0.  Else the length of the scene's name. */
static size_t name_length(const char *folder, const char *entry)
{
    char path[PATH_MAX];
    size_t n = strlen(entry);
    if (entry[0] == '.' || bench_join(path, folder, entry, "", NULL))
        return 0;
    if (bench_exists(path, "survey.yaml", "") && bench_exists(path, "truth.json", ""))
        return n;
    if (n <= 5 || strcmp(entry + n - 5, ".json"))
        return 0;
    snprintf(path, sizeof path, "%.*s", (int)(n - 5), entry);
    return bench_exists(folder, path, "_wav") ? n - 5 : 0;
}

int bench_scene_list(char **out, const char *recordings, struct error *why)
{
    struct dirent **entries;
    int n = scandir(recordings, &entries, NULL, alphasort);
    if (n < 0)
        return error_say(why, -errno, "%s: %s", recordings, strerror(errno));
    size_t size = 1, used = 0;
    for (int i = 0; i < n; i++)
        size += strlen(entries[i]->d_name) + 1;
    *out = calloc(size, 1);
    for (int i = 0; i < n; i++) {
        size_t length = *out ? name_length(recordings, entries[i]->d_name) : 0;
        if (length) {
            memcpy(*out + used, entries[i]->d_name, length);
            used += length + 1;
        }
        free(entries[i]);
    }
    free(entries);
    if (!*out)
        return error_say(why, -ENOMEM, "out of memory");
    if (used)
        return 0;
    free(*out);
    *out = NULL;
    return error_say(why, -ENOENT,
                     "%s: expected folders with survey.yaml and truth.json, or NAME.json "
                     "beside NAME_wav/",
                     recordings);
}

static void write_points(FILE *f, const char *key, const json_t *y, double x_m)
{
    fprintf(f, "%s:\n", key);
    for (size_t i = 0; i < json_array_size(y); i++)
        fprintf(f, "  - [%.17g, %.17g, 0]\n", x_m,
                json_number_value(json_array_get(y, i)));
}

static double real(const json_t *in, const char *key)
{
    return json_number_value(json_object_get(in, key));
}

/* Serial numbers in the order of the channels: the second word of each line. */
static int write_calibration(FILE *f, const char *folder, struct error *why)
{
    char path[PATH_MAX], absolute[PATH_MAX], line[256], serial[64];
    int err = bench_join(path, folder, "channel_mapping.txt", "", why);
    if (err)
        return err;
    FILE *map = fopen(path, "r");
    if (!map || !realpath(folder, absolute)) {
        err = error_say(why, -errno, "%s: %s", path, strerror(errno));
        if (map)
            fclose(map);
        return err;
    }
    fprintf(f, "calibration:\n  folder: \"%s\"\n  serials: [", absolute);
    bool first = true;
    while (fgets(line, sizeof line, map)) {
        if (sscanf(line, "%*d %63s", serial) != 1)
            continue; /* the heading */
        fprintf(f, "%s\"%s\"", first ? "" : ", ", serial);
        first = false;
    }
    fputs("]\n", f);
    fclose(map);
    return 0;
}

static int write_survey(const json_t *meta, const char *folder, const char *name,
                        const char *calibration, struct error *why)
{
    const json_t *chirp = json_object_get(meta, "chirp");
    const json_t *y = json_object_get(meta, "elem_y"),
                 *x = json_object_get(meta, "scan_x");
    struct export_file e;
    char file[128];
    snprintf(file, sizeof file, "%.100s.yaml", name);
    int err = export_file_open(&e, folder, file, why);
    if (err)
        return err;
    fprintf(e.f,
            "sound_speed_m_s: %.17g\nsample_rate_hz: %.17g\nslot_samples: %.0f\n"
            "latency_samples: %.17g\n"
            "chirp: {start_hz: %.17g, stop_hz: %.17g, duration_s: %.17g}\n",
            real(meta, "c"), real(meta, "fs"), real(chirp, "samples"),
            real(meta, "wav_lead_samples"), real(chirp, "f0"), real(chirp, "f1"),
            real(chirp, "samples") / real(meta, "fs"));
    write_points(e.f, "speakers_m", y, 0.0);
    write_points(e.f, "microphones_m", y, real(meta, "mic_dx"));
    fputs("stage:\n  axis: [1, 0, 0]\n  positions_m:\n", e.f);
    for (size_t i = 0; i < json_array_size(x); i++)
        fprintf(e.f, "    - %.17g\n", json_number_value(json_array_get(x, i)));
    if (calibration)
        err = write_calibration(e.f, calibration, why);
    if (!err)
        return export_file_commit(&e, why);
    struct error second;
    return export_file_abandon(&e, err, &second);
}

static int read_mask(struct bench_truth *t, const json_t *from, const char *path,
                     struct error *why)
{
    struct bench_mask m = {.z_m = real(from, "z")};
    const json_t *bars = json_object_get(from, "rects");
    int err = bench_read_numbers(json_object_get(from, "ctr"), m.centre_m, 2);
    m.n_bars = json_array_size(bars);
    if (err || m.n_bars > BENCH_MAX_BARS)
        return error_say(why, -EINVAL, "%s: masks: expected ctr and up to %d rects", path,
                         BENCH_MAX_BARS);
    for (size_t b = 0; b < m.n_bars; b++)
        if (bench_read_numbers(json_array_get(bars, b), m.bars_m[b], 4))
            return error_say(why, -EINVAL, "%s: rects: expected four numbers", path);
    return bench_truth_add_mask(t, &m, why);
}

static int read_truth(struct bench_truth *t, const json_t *meta, const char *path,
                      struct error *why)
{
    const json_t *truth = json_object_get(meta, "truth");
    const json_t *points = json_object_get(truth, "points");
    const json_t *masks = json_object_get(truth, "masks");
    double at[3];
    int err = 0;
    for (size_t i = 0; !err && i < json_array_size(points); i++)
        err = bench_read_numbers(json_object_get(json_array_get(points, i), "p"), at, 3)
                  ? error_say(why, -EINVAL, "%s: points: expected three numbers", path)
                  : bench_truth_add_point(t, at, why);
    for (size_t i = 0; !err && i < json_array_size(masks); i++)
        err = read_mask(t, json_array_get(masks, i), path, why);
    if (!err && !t->n_points && !t->n_masks)
        err = error_say(why, -EINVAL, "%s: truth: expected points or masks", path);
    return err;
}

/* NAME.json, NAME_wav/ and NAME_bg_wav/; see bench_scene_read. */
static int bench_read_reference(struct bench_scene *s, const char *recordings,
                                const char *name, const char *calibration,
                                const char *survey_folder, struct error *why)
{
    char path[PATH_MAX], background[PATH_MAX];
    json_t *meta = NULL;
    int err = bench_join(path, recordings, name, ".json", why);
    if (!err)
        err = bench_read_json(&meta, path, why);
    if (!err)
        err = read_truth(&s->truth, meta, path, why);
    if (!err)
        err = write_survey(meta, survey_folder, name, calibration, why);
    json_decref(meta);
    if (!err)
        err = bench_join(path, survey_folder, name, ".yaml", why);
    if (!err)
        err = survey_load(&s->survey, path, why);
    if (!err)
        err = bench_join(path, recordings, name, "_wav", why);
    if (!err)
        err = bench_join(background, recordings, name, "_bg_wav", why);
    return err ? err : bench_read_passes(s, path, background, why);
}

/* -- the truth --------------------------------------------------------------------------
 */
static int add_object(struct bench_truth *t, const struct scene_object *o,
                      const double virtual_m[3], const char *path, struct error *why)
{
    if (o->kind == SCENE_POINT || o->kind == SCENE_CORNER)
        return bench_truth_add_point(t, virtual_m, why);
    struct bench_mask m = {.z_m = virtual_m[2], .centre_m = {virtual_m[0], virtual_m[1]}};
    if (o->kind != SCENE_LETTER || !o->stroke_m || !o->size_m ||
        bench_mask_letter(&m, o->letter[0], o->size_m, *o->stroke_m))
        return error_say(why, -EINVAL,
                         "%s: %s: expected a point, a corner or a letter: errors of "
                         "others are not defined",
                         path, o->name);
    return bench_truth_add_mask(t, &m, why);
}

/* The room knows where things are, the file what they look like. */
static int find_truth(struct bench_truth *t, const struct room *room, const char *path,
                      struct error *why)
{
    const struct room_object *objects;
    size_t n = room_objects(room, &objects);
    struct scene *file;
    struct survey survey;
    int err = scene_load(&file, &survey, path, why);
    if (err)
        return err;
    if (fabs(survey.wall_normal[2]) < 0.9999)
        err = error_say(why, -EINVAL, "%s: wall: expected the normal [0, 0, 1]", path);
    for (size_t i = 0; !err && i < n && i < file->n_objects; i++)
        err = add_object(t, &file->objects[i], objects[i].virtual_m, path, why);
    if (!err && !t->n_points && !t->n_masks)
        err = error_say(why, -EINVAL, "%s: objects: expected one or more", path);
    scene_free(file);
    survey_clear(&survey);
    return err;
}

/* -- the sound --------------------------------------------------------------------------
 */
struct recorder {
    struct bench_scene *to;
    struct room **rooms; /* [threads]: one records for one thread at a time */
    uint32_t *speakers;
    atomic_int err;
};

static void record_item(void *ctx, size_t item, size_t thread)
{
    struct recorder *r = ctx;
    struct bench_scene *s = r->to;
    size_t position = item % s->survey.n_positions;
    size_t size = s->survey.n_microphones * s->frames;
    bool background = item >= s->survey.n_positions;
    float *to = (background ? s->background : s->scene) + position * size;
    int none = 0;
    if (interrupt_requested() || atomic_load(&r->err))
        return;
    enum pass pass = background ? PASS_BACKGROUND : PASS_SCENE;
    int err = s->survey.continuous
                  ? room_stream_round(r->rooms[thread], pass, position, to)
                  : room_record(r->rooms[thread], pass, position, r->speakers,
                                s->survey.n_speakers, 0, to);
    if (err)
        atomic_compare_exchange_strong(&r->err, &none, err);
}

/* Only one thread makes plans of transforms, so rooms are loaded one by one. */
static int load_rooms(struct recorder *r, const char *path, const struct firing *firing,
                      size_t threads, struct error *why)
{
    int err = 0;
    r->rooms = calloc(threads, sizeof *r->rooms);
    if (!r->rooms)
        return error_say(why, -ENOMEM, "out of memory");
    for (size_t t = 0; !err && t < threads; t++)
        err = room_load_drawn(&r->rooms[t], path, firing, 0, why);
    if (err)
        return err;
    struct bench_scene *s = r->to;
    if (survey_copy(&s->survey, room_survey(r->rooms[0])))
        return error_say(why, -ENOMEM, "out of memory");
    s->survey.has_volume = false;
    s->frames = room_frames(r->rooms[0], s->survey.n_speakers);
    r->speakers = malloc(s->survey.n_speakers * sizeof *r->speakers);
    for (size_t j = 0; r->speakers && j < s->survey.n_speakers; j++)
        r->speakers[j] = (uint32_t)j;
    size_t size = s->survey.n_positions * s->survey.n_microphones * s->frames;
    s->scene = malloc(size * sizeof *s->scene);
    s->background = malloc(size * sizeof *s->background);
    return r->speakers && s->scene && s->background
               ? 0
               : error_say(why, -ENOMEM, "out of memory");
}

static int record(struct recorder *r, const char *path, size_t threads, struct error *why)
{
    struct pool *pool;
    int err = pool_create(&pool, threads);
    if (err)
        return error_say(why, err, "%zu threads: %s", threads, strerror(-err));
    pool_run(pool, 2 * r->to->survey.n_positions, record_item, r);
    pool_destroy(pool);
    err = atomic_load(&r->err);
    if (err)
        return error_say(why, err, "%s: %s", path, strerror(-err));
    return interrupt_requested() ? error_say(why, -EINTR, "interrupted") : 0;
}

static void drop_silence(struct bench_scene *s)
{
    size_t size = s->survey.n_positions * s->survey.n_microphones * s->frames;
    for (size_t i = 0; i < size; i++)
        if (s->background[i] != 0.0f)
            return;
    free(s->background);
    s->background = NULL;
}

static void name_after(struct bench_scene *s, const char *path)
{
    const char *base = strrchr(path, '/');
    base = base ? base + 1 : path;
    size_t n = strcspn(base, ".");
    n = n < sizeof s->name - 1 ? n : sizeof s->name - 1;
    memcpy(s->name, base, n);
    s->name[n] = 0;
}

int bench_scene_simulate(struct bench_scene *out, const char *path,
                         const struct firing *firing, size_t threads, struct error *why)
{
    struct recorder r = {.to = out};
    memset(out, 0, sizeof *out);
    atomic_init(&r.err, 0);
    name_after(out, path);
    int err = load_rooms(&r, path, firing, threads, why);
    if (!err)
        err = find_truth(&out->truth, r.rooms[0], path, why);
    if (!err)
        err = record(&r, path, threads, why);
    if (!err)
        drop_silence(out);
    for (size_t t = 0; r.rooms && t < threads; t++)
        room_destroy(r.rooms[t]);
    free(r.rooms);
    free(r.speakers);
    if (err)
        bench_scene_clear(out);
    return err;
}

void bench_scene_clear(struct bench_scene *s)
{
    free(s->scene);
    free(s->background);
    survey_clear(&s->survey);
    memset(s, 0, sizeof *s);
}
