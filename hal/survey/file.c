/* SPDX-License-Identifier: MIT */
#include "hal/survey/file.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "hal/recording/pings_file.h"
#include "hal/recording/replica_file.h"
#include "hal/survey/response_file.h"
#include "hal/survey/yaml.h"
#include "hal/text_file.h"
#include "hal/yaml_file.h"
#include "recon/walls/wall.h"

struct survey_root {
    struct survey_yaml survey;
};

static const struct cyaml_schema_field root_fields[] = {
    SURVEY_YAML_FIELDS(struct survey_root, CYAML_FLAG_OPTIONAL),
    CYAML_FIELD_STRING_PTR("pings", CYAML_FLAG_POINTER | CYAML_FLAG_OPTIONAL,
                           struct survey_root, survey.pings, 1, 4096),
    CYAML_FIELD_STRING_PTR("replica", CYAML_FLAG_POINTER | CYAML_FLAG_OPTIONAL,
                           struct survey_root, survey.replica, 1, 4096),
    CYAML_FIELD_END};
static const struct cyaml_schema_value root_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct survey_root, root_fields)};

/* Each part once: as the array and the chirp, or as the files in place of them. */
static int check_keys(const struct survey_yaml *y, const char *path, struct error *why)
{
    const struct {
        const char *key, *instead;
        bool there, replaced, optional;
    } keys[] = {
        {"sample_rate_hz", NULL, y->sample_rate_hz, false, false},
        {"chirp", "replica", y->chirp, y->replica, false},
        {"slot_samples", NULL, y->slot_samples, false, false},
        {"speakers_m", "pings", y->speakers_m, y->pings, false},
        {"microphones_m", "pings", y->microphones_m, y->pings, false},
        {"stage", "pings", y->stage, y->pings, true},
    };
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        if (keys[i].there && keys[i].replaced)
            return yaml_error_say(why, -EINVAL, path, keys[i].key,
                                  "the key \"%s\" says this already; expected one",
                                  keys[i].instead);
        if (!keys[i].there && !keys[i].replaced && !keys[i].optional)
            return error_say(why, -EINVAL, "%s:1: the key \"%s\" is missing%s%s%s", path,
                             keys[i].key, keys[i].instead ? ", or \"" : "",
                             keys[i].instead ? keys[i].instead : "",
                             keys[i].instead ? "\"" : "");
    }
    return 0;
}

int survey_load(struct survey *out, const char *path, struct error *why)
{
    void *root;
    memset(out, 0, sizeof *out);
    int err = yaml_load(path, &root_schema, &root, why);
    if (err)
        return err;
    const struct survey_yaml *y = &((const struct survey_root *)root)->survey;
    err = check_keys(y, path, why);
    if (!err)
        err = survey_from_yaml(out, y, path, why);
    yaml_unload(&root_schema, root);
    return err;
}

int survey_load_place(struct survey *out, const char *path, struct error *why)
{
    void *root;
    memset(out, 0, sizeof *out);
    int err = yaml_load(path, &root_schema, &root, why);
    if (err)
        return err;
    err = survey_yaml_place(out, &((const struct survey_root *)root)->survey, path, why);
    if (!err) {
        err = survey_check_place(out, why);
        if (err)
            yaml_place_error(why, path);
    }
    yaml_unload(&root_schema, root);
    return err;
}

static void print_list(FILE *f, const double *x, size_t n)
{
    char text[DECIMAL_SIZE];
    for (size_t i = 0; i < n; i++)
        fprintf(f, "%s%s", i ? ", " : "[", decimal_print(x[i], text));
    fputs("]", f);
}

static void print_key_list(FILE *f, const char *key, const double *x, size_t n,
                           const char *end)
{
    fprintf(f, "%s: ", key);
    print_list(f, x, n);
    fputs(end, f);
}

static void print_points(FILE *f, const char *key, const double (*p)[3], size_t n)
{
    fprintf(f, "%s:\n", key);
    for (size_t i = 0; i < n; i++) {
        fputs("  - ", f);
        print_list(f, p[i], 3);
        fputs("\n", f);
    }
}

static void print_timing(FILE *f, const struct survey *s)
{
    char a[DECIMAL_SIZE], b[DECIMAL_SIZE], c[DECIMAL_SIZE];
    if (!isnan(s->temperature_c))
        fprintf(f, "temperature_c: %s\n", decimal_print(s->temperature_c, a));
    fprintf(f, "sound_speed_m_s: %s\n", decimal_print(s->sound_speed_m_s, a));
    fprintf(f, "sample_rate_hz: %s\n", decimal_print(s->sample_rate_hz, a));
    if (!s->n_replica)
        fprintf(f, "chirp: {start_hz: %s, stop_hz: %s, duration_s: %s, phase: %s%s}\n",
                decimal_print(s->chirp_start_hz, a), decimal_print(s->chirp_stop_hz, b),
                decimal_print(s->chirp_duration_s, c), s->chirp_sine ? "sine" : "cosine",
                s->chirp_alternates ? ", alternates: true" : "");
    fprintf(f, "slot_samples: %zu\n", s->slot_samples);
    if (s->together > 1)
        fprintf(f, "together: %zu\n", s->together);
    fprintf(f, "latency_samples: %s\n", decimal_print(s->latency_samples, a));
}

/* As two points of the array's plane, if it is known to end. */
static void print_ends(FILE *f, const double normal[3], double distance_m,
                       const double ends_m[2])
{
    struct wall w = {.normal = {normal[0], normal[1], normal[2]},
                     .ends_m = {ends_m[0], ends_m[1]}};
    double upright[3], level[3];
    if (!wall_ends(&w))
        return;
    wall_axes(&w, upright, level);
    fputs(", ends_m: [", f);
    for (int k = 0; k < 2; k++) {
        double point[2] = {distance_m * normal[0] + ends_m[k] * level[0],
                           distance_m * normal[2] + ends_m[k] * level[2]};
        fputs(k ? ", " : "", f);
        print_list(f, point, 2);
    }
    fputs("]", f);
}

static void print_place(FILE *f, const struct survey *s)
{
    char a[DECIMAL_SIZE];
    if (s->has_gate)
        print_key_list(f, "gate_m", s->gate_m, 2, "\n");
    if (s->has_volume) {
        fputs("volume:\n", f);
        print_key_list(f, "  x_m", s->volume_m[0], 3, "\n");
        print_key_list(f, "  y_m", s->volume_m[1], 3, "\n");
        print_key_list(f, "  z_m", s->volume_m[2], 3, "\n");
    }
    if (s->n_walls)
        fputs("walls:\n", f);
    for (size_t i = 0; i < s->n_walls; i++) {
        print_key_list(f, "  - {normal", s->walls[i].normal, 3, ", ");
        fprintf(f, "distance_m: %s, ", decimal_print(s->walls[i].distance_m, a));
        print_key_list(f, "gate_m", s->walls[i].gate_m, 2, "");
        print_ends(f, s->walls[i].normal, s->walls[i].distance_m, s->wall_ends_m[i]);
        fputs("}\n", f);
    }
    if (s->has_wall && !s->n_walls) {
        print_key_list(f, "wall: {normal", s->wall_normal, 3, ", ");
        fprintf(f, "distance_m: %s", decimal_print(s->wall_distance_m, a));
        print_ends(f, s->wall_normal, s->wall_distance_m, s->wall_ends_m[0]);
        fputs("}\n", f);
    }
    if (s->has_mount) {
        fputs("mount:\n", f);
        print_key_list(f, "  origin_m", s->mount_origin_m, 3, "\n");
        print_key_list(f, "  x_axis", s->mount_x_axis, 3, "\n");
        print_key_list(f, "  y_axis", s->mount_y_axis, 3, "\n");
    }
}

static void print_array(FILE *f, const struct survey *s)
{
    print_points(f, "speakers_m", (const double(*)[3])s->speakers_m, s->n_speakers);
    print_points(f, "microphones_m", (const double(*)[3])s->microphones_m,
                 s->n_microphones);
    print_key_list(f, "stage:\n  axis", s->stage_axis, 3, "\n");
    print_key_list(f, "  positions_m", s->stage_positions_m, s->n_positions, "\n");
    if (s->continuous)
        fputs("  continuous: true\n", f);
}

struct saving {
    const struct survey *survey;
    const char *path, *calibration; /* its folder; NULL: none */
};

static void print_survey(FILE *f, const void *what)
{
    const struct saving *k = what;
    const struct survey *s = k->survey;
    const char *slash = strrchr(k->path, '/');
    const char *name = slash ? slash + 1 : k->path;
    print_timing(f, s);
    if (s->n_replica)
        fprintf(f, "replica: \"%s-replica.wav\"\n", name);
    if (s->pings_m)
        fprintf(f, "pings: \"%s-pings.csv\"\n", name);
    else
        print_array(f, s);
    if (k->calibration) {
        fprintf(f, "calibration:\n  folder: \"%s\"\n  serials: [", k->calibration);
        for (size_t i = 0; i < s->n_responses; i++)
            fprintf(f, "%s\"%s\"", i ? ", " : "", s->responses[i].serial);
        fputs("]\n", f);
    }
    print_place(f, s);
}

static int save_responses(const struct survey *s, const char *path, const char *folder,
                          struct error *why)
{
    int err = 0;
    if (folder[strcspn(folder, "\"\\\n")])
        return error_say(why, -EINVAL, "%s: a calibration folder without quotes, please",
                         folder);
    char *place = yaml_sibling(path, folder);
    if (!place)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    if (mkdir(place, 0777) < 0 && errno != EEXIST)
        err = error_say(why, -errno, "%s: %s", place, strerror(errno));
    for (size_t i = 0; i < s->n_responses && !err; i++)
        err = response_save(&s->responses[i], place, why);
    free(place);
    return err;
}

int survey_save(const struct survey *s, const char *path, const char *calibration_folder,
                struct error *why)
{
    const char *calibration = s->n_responses ? calibration_folder : NULL;
    const struct saving what = {s, path, calibration};
    int err = calibration ? save_responses(s, path, calibration, why) : 0;
    if (err)
        return err;
    err = s->pings_m ? pings_save((const double(*)[2][3])s->pings_m, s->n_positions, path)
                     : 0;
    if (!err && s->n_replica)
        err = replica_save(s->replica, s->n_replica, path, s->sample_rate_hz);
    if (!err)
        err = text_file_write(path, false, print_survey, &what);
    if (err)
        error_say(why, err, "%s cannot be written: %s", path, strerror(-err));
    return err;
}
