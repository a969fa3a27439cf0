#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/survey/file.h"
#include "nodes/anlos/bench/files.h"

static int read_objects(struct bench_truth *t, const char *path, struct complaint *why)
{
    json_t *root;
    int err = bench_read_json(&root, path, why);
    if (err)
        return err;
    const json_t *all = json_object_get(root, "objects");
    if (!json_array_size(all))
        err = complain(why, -EINVAL, "%s: objects: expected one or more", path);
    for (size_t i = 0; !err && i < json_array_size(all); i++) {
        const json_t *o = json_array_get(all, i);
        const char *kind = json_string_value(json_object_get(o, "kind"));
        double at[3];
        if (!kind || (strcmp(kind, "point") && strcmp(kind, "corner")))
            err = complain(why, -EINVAL,
                           "%s: %s: expected points and corners; of letters name the "
                           "scene file itself",
                           path, kind ? kind : "kind");
        else if (bench_read_numbers(json_object_get(o, "virtual_m"), at, 3))
            err = complain(why, -EINVAL, "%s: virtual_m: expected three numbers", path);
        else
            err = bench_truth_add_point(t, at, why);
    }
    json_decref(root);
    return err;
}

static int read_simulated(struct bench_scene *s, const char *folder,
                          struct complaint *why)
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

int bench_scene_read(struct bench_scene *out, const char *recordings, const char *name,
                     const char *calibration, const char *survey_folder,
                     struct complaint *why)
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
        err = complain(why, -ENOENT,
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

int bench_scene_list(char **out, const char *recordings, struct complaint *why)
{
    struct dirent **entries;
    int n = scandir(recordings, &entries, NULL, alphasort);
    if (n < 0)
        return complain(why, -errno, "%s: %s", recordings, strerror(errno));
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
        return complain(why, -ENOMEM, "out of memory");
    if (used)
        return 0;
    free(*out);
    *out = NULL;
    return complain(why, -ENOENT,
                    "%s: expected folders with survey.yaml and truth.json, or NAME.json "
                    "beside NAME_wav/",
                    recordings);
}
