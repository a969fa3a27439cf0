#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "hal/recording/recording.h"
#include "nodes/anlos/bench/files.h"
#include "nodes/anlos/interrupt.h"

int bench_join(char out[PATH_MAX], const char *folder, const char *name, const char *rest,
               struct complaint *why)
{
    int n = snprintf(out, PATH_MAX, "%s/%s%s", folder, name, rest);
    return n < PATH_MAX ? 0 : complain(why, -ENAMETOOLONG, "%s: path too long", folder);
}

bool bench_exists(const char *folder, const char *name, const char *rest)
{
    char path[PATH_MAX];
    struct stat st;
    return !bench_join(path, folder, name, rest, NULL) && !stat(path, &st);
}

int bench_read_json(json_t **out, const char *path, struct complaint *why)
{
    json_error_t error;
    *out = json_load_file(path, 0, &error);
    return *out ? 0 : complain(why, -EINVAL, "%s:%d: %s", path, error.line, error.text);
}

int bench_read_numbers(const json_t *from, double *out, size_t n)
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
                     struct complaint *why)
{
    uint32_t *counts = malloc(2 * s->survey.n_microphones * sizeof *counts);
    int err = counts ? 0 : complain(why, -ENOMEM, "out of memory");
    for (size_t k = 0; !err && k < s->survey.n_positions; k++)
        err = interrupt_requested()
                  ? complain(why, -EINTR, "interrupted")
                  : recording_read(r, k, to + k * s->survey.n_microphones * s->frames,
                                   counts, counts + s->survey.n_microphones, why);
    free(counts);
    return err;
}

int bench_read_passes(struct bench_scene *s, const char *scene, const char *background,
                      struct complaint *why)
{
    struct recording *r[2] = {NULL, NULL};
    int err = recording_open(&r[0], scene, &s->survey, why);
    if (!err)
        err = recording_open(&r[1], background, &s->survey, why);
    if (!err && recording_frames(r[0]) != recording_frames(r[1]))
        err = complain(why, -EINVAL, "%s: %zu frames, expected the %zu of %s", background,
                       recording_frames(r[1]), recording_frames(r[0]), scene);
    if (!err) {
        s->frames = recording_frames(r[0]);
        size_t size = s->survey.n_positions * s->survey.n_microphones * s->frames;
        s->scene = malloc(size * sizeof *s->scene);
        s->background = malloc(size * sizeof *s->background);
        if (!s->scene || !s->background)
            err = complain(why, -ENOMEM, "out of memory");
    }
    if (!err)
        err = read_pass(s->scene, s, r[0], why);
    if (!err)
        err = read_pass(s->background, s, r[1], why);
    recording_close(r[0]);
    recording_close(r[1]);
    return err;
}
