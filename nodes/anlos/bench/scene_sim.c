#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/pool.h"
#include "hal/room/room.h"
#include "hal/room/scene.h"
#include "nodes/anlos/bench/scene.h"
#include "nodes/anlos/interrupt.h"

/* -- the truth --------------------------------------------------------------------------
 */

static int add_object(struct bench_truth *t, const struct scene_object *o,
                      const double virtual_m[3], const char *path, struct complaint *why)
{
    if (o->kind == SCENE_POINT || o->kind == SCENE_CORNER)
        return bench_truth_add_point(t, virtual_m, why);
    struct bench_mask m = {.z_m = virtual_m[2], .centre_m = {virtual_m[0], virtual_m[1]}};
    if (o->kind != SCENE_LETTER || !o->stroke_m || !o->size_m ||
        bench_mask_letter(&m, o->letter[0], o->size_m, *o->stroke_m))
        return complain(why, -EINVAL,
                        "%s: %s: expected a point, a corner or a letter: errors of "
                        "others are not defined",
                        path, o->name);
    return bench_truth_add_mask(t, &m, why);
}

/* The room knows where things are, the file what they look like. */
static int find_truth(struct bench_truth *t, const struct room *room, const char *path,
                      struct complaint *why)
{
    const struct room_object *objects;
    size_t n = room_objects(room, &objects);
    struct scene *file;
    struct survey survey;
    int err = scene_load(&file, &survey, path, why);
    if (err)
        return err;
    if (fabs(survey.wall_normal[2]) < 0.9999)
        err = complain(why, -EINVAL, "%s: wall: expected the normal [0, 0, 1]", path);
    for (size_t i = 0; !err && i < n && i < file->n_objects; i++)
        err = add_object(t, &file->objects[i], objects[i].virtual_m, path, why);
    if (!err && !t->n_points && !t->n_masks)
        err = complain(why, -EINVAL, "%s: objects: expected one or more", path);
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
    int err = room_record(r->rooms[thread], background ? PASS_BACKGROUND : PASS_SCENE,
                          position, r->speakers, s->survey.n_speakers, 0, to);
    if (err)
        atomic_compare_exchange_strong(&r->err, &none, err);
}

/* Only one thread makes plans of transforms, so rooms are loaded one by one. */
static int load_rooms(struct recorder *r, const char *path, size_t threads,
                      struct complaint *why)
{
    int err = 0;
    r->rooms = calloc(threads, sizeof *r->rooms);
    if (!r->rooms)
        return complain(why, -ENOMEM, "out of memory");
    for (size_t t = 0; !err && t < threads; t++)
        err = room_load(&r->rooms[t], path, why);
    if (err)
        return err;
    struct bench_scene *s = r->to;
    if (survey_copy(&s->survey, room_survey(r->rooms[0])))
        return complain(why, -ENOMEM, "out of memory");
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
               : complain(why, -ENOMEM, "out of memory");
}

static int record(struct recorder *r, const char *path, size_t threads,
                  struct complaint *why)
{
    struct pool *pool;
    int err = pool_create(&pool, threads);
    if (err)
        return complain(why, err, "%zu threads: %s", threads, strerror(-err));
    pool_run(pool, 2 * r->to->survey.n_positions, record_item, r);
    pool_destroy(pool);
    err = atomic_load(&r->err);
    if (err)
        return complain(why, err, "%s: %s", path, strerror(-err));
    return interrupt_requested() ? complain(why, -EINTR, "interrupted") : 0;
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

int bench_scene_simulate(struct bench_scene *out, const char *path, size_t threads,
                         struct complaint *why)
{
    struct recorder r = {.to = out};
    memset(out, 0, sizeof *out);
    atomic_init(&r.err, 0);
    name_after(out, path);
    int err = load_rooms(&r, path, threads, why);
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
