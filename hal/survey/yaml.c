/* SPDX-License-Identifier: MIT */
#include "hal/survey/yaml.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/recording/pings_file.h"
#include "hal/recording/replica_file.h"
#include "hal/survey/response_file.h"
#include "hal/yaml_file.h"
#include "recon/walls/wall.h"

#define MOST_BEHIND 0.5 /* sine: a wall beside the array may be nearest behind it */

static const cyaml_strval_t phases[] = {{"cosine", 0}, {"sine", 1}};

const struct cyaml_schema_value survey_yaml_number = {
    CYAML_VALUE_FLOAT(CYAML_FLAG_DEFAULT, double)};
const struct cyaml_schema_value survey_yaml_point = {
    CYAML_VALUE_SEQUENCE_FIXED(CYAML_FLAG_DEFAULT, double, &survey_yaml_number, 3)};
static const cyaml_schema_value_t text = {
    CYAML_VALUE_STRING(CYAML_FLAG_POINTER, char, 1, 31)};

/* clang-format off */
#define POINT(key, type)                                                                 \
    CYAML_FIELD_SEQUENCE_FIXED(#key, CYAML_FLAG_DEFAULT, struct type, key,               \
                               &survey_yaml_number, 3)
/* clang-format on */

const struct cyaml_schema_field survey_yaml_chirp_fields[] = {
    CYAML_FIELD_FLOAT("start_hz", CYAML_FLAG_DEFAULT, struct survey_yaml_chirp, start_hz),
    CYAML_FIELD_FLOAT("stop_hz", CYAML_FLAG_DEFAULT, struct survey_yaml_chirp, stop_hz),
    CYAML_FIELD_FLOAT("duration_s", CYAML_FLAG_DEFAULT, struct survey_yaml_chirp,
                      duration_s),
    CYAML_FIELD_ENUM("phase", CYAML_FLAG_STRICT | CYAML_FLAG_OPTIONAL,
                     struct survey_yaml_chirp, phase, phases, 2),
    CYAML_FIELD_BOOL("alternates", CYAML_FLAG_OPTIONAL, struct survey_yaml_chirp,
                     alternates),
    CYAML_FIELD_END};

const struct cyaml_schema_field survey_yaml_stage_fields[] = {
    POINT(axis, survey_yaml_stage),
    CYAML_FIELD_SEQUENCE_COUNT("positions_m", CYAML_FLAG_POINTER,
                               struct survey_yaml_stage, positions_m, n_positions,
                               &survey_yaml_number, 1, 65536),
    CYAML_FIELD_BOOL("continuous", CYAML_FLAG_OPTIONAL, struct survey_yaml_stage,
                     continuous),
    CYAML_FIELD_END};

const struct cyaml_schema_field survey_yaml_calibration_fields[] = {
    CYAML_FIELD_STRING_PTR("folder", CYAML_FLAG_POINTER, struct survey_yaml_calibration,
                           folder, 1, 4096),
    CYAML_FIELD_SEQUENCE_COUNT("serials", CYAML_FLAG_POINTER,
                               struct survey_yaml_calibration, serials, n_serials, &text,
                               1, 4096),
    CYAML_FIELD_END};

const struct cyaml_schema_field survey_yaml_volume_fields[] = {
    POINT(x_m, survey_yaml_volume), POINT(y_m, survey_yaml_volume),
    POINT(z_m, survey_yaml_volume), CYAML_FIELD_END};

static const struct cyaml_schema_value floor_point = {
    CYAML_VALUE_SEQUENCE_FIXED(CYAML_FLAG_DEFAULT, double, &survey_yaml_number, 2)};

#define ENDS(type)                                                                       \
    CYAML_FIELD_SEQUENCE_COUNT("ends_m", CYAML_FLAG_POINTER | CYAML_FLAG_OPTIONAL,       \
                               struct type, ends_m, n_ends, &floor_point, 2, 2)

const struct cyaml_schema_field survey_yaml_wall_fields[] = {
    POINT(normal, survey_yaml_wall),
    CYAML_FIELD_FLOAT("distance_m", CYAML_FLAG_DEFAULT, struct survey_yaml_wall,
                      distance_m),
    ENDS(survey_yaml_wall), CYAML_FIELD_END};

static const struct cyaml_schema_field one_wall_fields[] = {
    POINT(normal, survey_yaml_one_wall),
    CYAML_FIELD_FLOAT("distance_m", CYAML_FLAG_DEFAULT, struct survey_yaml_one_wall,
                      distance_m),
    CYAML_FIELD_SEQUENCE_FIXED("gate_m", CYAML_FLAG_DEFAULT, struct survey_yaml_one_wall,
                               gate_m, &survey_yaml_number, 2),
    ENDS(survey_yaml_one_wall), CYAML_FIELD_END};
const struct cyaml_schema_value survey_yaml_one_wall = {CYAML_VALUE_MAPPING(
    CYAML_FLAG_DEFAULT, struct survey_yaml_one_wall, one_wall_fields)};

const struct cyaml_schema_field survey_yaml_mount_fields[] = {
    POINT(origin_m, survey_yaml_mount), POINT(x_axis, survey_yaml_mount),
    POINT(y_axis, survey_yaml_mount), CYAML_FIELD_END};

int survey_yaml_normalize(double v[3], const char *path, const char *key,
                          struct error *why)
{
    double length = hypot(hypot(v[0], v[1]), v[2]);
    if (!(length > 1e-9) || !isfinite(length))
        return yaml_error_say(why, -EINVAL, path, key,
                              "expected a direction, found a vector of length %g",
                              length);
    if (fabs(length - 1) < 4e-16) /* keeps what was normalized before as it is */
        return 0;
    for (int a = 0; a < 3; a++)
        v[a] /= length;
    return 0;
}

static void *copy_of(const void *p, size_t size)
{
    void *out = malloc(size);
    if (out)
        memcpy(out, p, size);
    return out;
}

static int take_sound_speed(struct survey *s, const struct survey_yaml *y,
                            const char *path, struct error *why)
{
    s->temperature_c = y->temperature_c ? *y->temperature_c : NAN;
    if (!y->sound_speed_m_s && !y->temperature_c)
        return error_say(why, -EINVAL,
                         "%s: expected one of the keys sound_speed_m_s, temperature_c",
                         path);
    if (y->temperature_c && !(*y->temperature_c >= -60 && *y->temperature_c <= 80))
        return yaml_error_say(why, -EINVAL, path, "temperature_c",
                              "%g is outside -60..80", *y->temperature_c);
    s->sound_speed_m_s = y->sound_speed_m_s ? *y->sound_speed_m_s
                                            : survey_sound_speed_m_s(*y->temperature_c);
    return 0;
}

static int take_timing(struct survey *s, const struct survey_yaml *y, const char *path,
                       struct error *why)
{
    s->sample_rate_hz = *y->sample_rate_hz;
    if (y->chirp) {
        s->chirp_start_hz = y->chirp->start_hz;
        s->chirp_stop_hz = y->chirp->stop_hz;
        s->chirp_duration_s = y->chirp->duration_s;
        s->chirp_sine = y->chirp->phase == 1;
        s->chirp_alternates = y->chirp->alternates;
    }
    s->slot_samples = *y->slot_samples;
    s->together = y->together ? *y->together : 0;
    s->latency_samples = y->latency_samples ? *y->latency_samples : 0;
    return take_sound_speed(s, y, path, why);
}

/* What a sibling file of the survey says, with the survey's line in front. */
static int take_replica(struct survey *s, const char *name, const char *path,
                        struct error *why)
{
    struct error inner = {.text = ""};
    double band_hz[2];
    if (!(s->sample_rate_hz > 0))
        return 0; /* survey_check says so */
    char *file = yaml_sibling(path, name);
    if (!file)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    int err = replica_load(&s->replica, &s->n_replica, file, s->sample_rate_hz, &inner);
    if (!err) {
        err = replica_band(s->replica, s->n_replica, s->sample_rate_hz, band_hz);
        if (err)
            error_say(&inner, err, "%s: silent, or a single tone", file);
    }
    free(file);
    if (err)
        return yaml_error_say(why, err, path, "replica", "%.700s", inner.text);
    s->chirp_start_hz = band_hz[0];
    s->chirp_stop_hz = band_hz[1];
    s->chirp_duration_s = (double)s->n_replica / s->sample_rate_hz;
    return 0;
}

static int take_pings(struct survey *s, const char *name, const char *path,
                      struct error *why)
{
    struct error inner = {.text = ""};
    char *file = yaml_sibling(path, name);
    if (!file)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    int err = pings_load(&s->pings_m, &s->n_positions, file, &inner);
    free(file);
    if (err)
        return yaml_error_say(why, err, path, "pings", "%.700s", inner.text);
    s->n_speakers = s->n_microphones = 1;
    s->stage_axis[0] = 1;
    s->speakers_m = calloc(1, sizeof *s->speakers_m);
    s->microphones_m = calloc(1, sizeof *s->microphones_m);
    s->stage_positions_m = calloc(s->n_positions, sizeof *s->stage_positions_m);
    if (!s->speakers_m || !s->microphones_m || !s->stage_positions_m)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    return 0;
}

static int take_elements(struct survey *s, const struct survey_yaml *y, const char *path,
                         struct error *why)
{
    static const double fixed_axis[3] = {1, 0, 0}, fixed_m = 0;
    const double *axis = y->stage ? y->stage->axis : fixed_axis;
    const double *positions_m = y->stage ? y->stage->positions_m : &fixed_m;
    s->n_speakers = y->n_speakers;
    s->n_microphones = y->n_microphones;
    s->n_positions = y->stage ? y->stage->n_positions : 1;
    s->continuous = y->stage && y->stage->continuous;
    s->speakers_m = copy_of(y->speakers_m, s->n_speakers * sizeof *s->speakers_m);
    s->microphones_m =
        copy_of(y->microphones_m, s->n_microphones * sizeof *s->microphones_m);
    s->stage_positions_m = copy_of(positions_m, s->n_positions * sizeof *positions_m);
    if (!s->speakers_m || !s->microphones_m || !s->stage_positions_m)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    memcpy(s->stage_axis, axis, sizeof s->stage_axis);
    return survey_yaml_normalize(s->stage_axis, path, "stage.axis", why);
}

static int take_mount(struct survey *s, const struct survey_yaml_mount *m,
                      const char *path, struct error *why)
{
    memcpy(s->mount_origin_m, m->origin_m, sizeof m->origin_m);
    memcpy(s->mount_x_axis, m->x_axis, sizeof m->x_axis);
    memcpy(s->mount_y_axis, m->y_axis, sizeof m->y_axis);
    s->has_mount = true;
    int err = survey_yaml_normalize(s->mount_x_axis, path, "mount.x_axis", why);
    if (!err)
        err = survey_yaml_normalize(s->mount_y_axis, path, "mount.y_axis", why);
    return err;
}

/* Behind the array a wall mirrors nothing that is imaged: no list would ever have an
 * object, and nobody would say why. */
static int check_ahead(const struct survey *s, const double normal[3], double distance_m,
                       const char *path, const char *key, struct error *why)
{
    static const double origin[3] = {0};
    const double *at = s->pings_m         ? s->pings_m[0][1]
                       : s->n_microphones ? s->microphones_m[0]
                                          : origin;
    double before_m = distance_m -
                      (normal[0] * at[0] + normal[1] * at[1] + normal[2] * at[2]);
    if (!(before_m * normal[2] < -MOST_BEHIND * fabs(before_m)))
        return 0;
    return yaml_error_say(why, -EINVAL, path, key,
                          "%g along the normal [%g, %g, %g] is behind the array, which "
                          "hears what is ahead: z goes forward to the wall",
                          distance_m, normal[0], normal[1], normal[2]);
}

/* Two points of the array's plane. */
static int take_ends(double out[2], const double normal[3], double distance_m,
                     const double (*points)[2], const char *path, const char *key,
                     struct error *why)
{
    struct wall w = {.normal = {normal[0], normal[1], normal[2]},
                     .distance_m = distance_m};
    if (!points)
        return 0;
    if (!wall_end_at(&w, (double[]){points[0][0], 0.0, points[0][1]},
                     (double[]){points[1][0], 0.0, points[1][1]}))
        return yaml_error_say(why, -EINVAL, path, key,
                              "[%g, %g] and [%g, %g] are one place of the wall; expected "
                              "where it begins and where it ends",
                              points[0][0], points[0][1], points[1][0], points[1][1]);
    memcpy(out, w.ends_m, sizeof w.ends_m);
    return 0;
}

static int take_walls(struct survey *s, const struct survey_yaml *y, const char *path,
                      struct error *why)
{
    int err = 0;
    if (y->wall)
        return yaml_error_say(why, -EINVAL, path, "walls",
                              "the key \"wall\" says this already; expected one");
    for (unsigned i = 0; !err && i < y->n_walls; i++) {
        char key[32];
        struct survey_wall *w = &s->walls[i];
        memcpy(w->normal, y->walls[i].normal, sizeof w->normal);
        memcpy(w->gate_m, y->walls[i].gate_m, sizeof w->gate_m);
        w->distance_m = y->walls[i].distance_m;
        snprintf(key, sizeof key, "walls[%u].normal", i);
        err = survey_yaml_normalize(w->normal, path, key, why);
        snprintf(key, sizeof key, "walls[%u].distance_m", i);
        if (!err)
            err = check_ahead(s, w->normal, w->distance_m, path, key, why);
        snprintf(key, sizeof key, "walls[%u].ends_m", i);
        if (!err)
            err = take_ends(s->wall_ends_m[i], w->normal, w->distance_m,
                            (const double(*)[2])y->walls[i].ends_m, path, key, why);
    }
    s->n_walls = y->n_walls;
    s->has_wall = true;
    s->wall_distance_m = s->walls[0].distance_m;
    memcpy(s->wall_normal, s->walls[0].normal, sizeof s->wall_normal);
    return err;
}

int survey_yaml_place(struct survey *s, const struct survey_yaml *y, const char *path,
                      struct error *why)
{
    int err = 0;
    s->has_gate = y->gate_m != NULL;
    if (y->gate_m)
        memcpy(s->gate_m, y->gate_m, sizeof s->gate_m);
    s->has_volume = y->volume != NULL;
    if (y->volume) {
        memcpy(s->volume_m[0], y->volume->x_m, sizeof y->volume->x_m);
        memcpy(s->volume_m[1], y->volume->y_m, sizeof y->volume->y_m);
        memcpy(s->volume_m[2], y->volume->z_m, sizeof y->volume->z_m);
    }
    s->has_wall = y->wall != NULL;
    if (y->wall) {
        s->wall_distance_m = y->wall->distance_m;
        memcpy(s->wall_normal, y->wall->normal, sizeof s->wall_normal);
        err = survey_yaml_normalize(s->wall_normal, path, "wall.normal", why);
        if (!err)
            err = check_ahead(s, s->wall_normal, s->wall_distance_m, path,
                              "wall.distance_m", why);
        if (!err)
            err = take_ends(s->wall_ends_m[0], s->wall_normal, s->wall_distance_m,
                            (const double(*)[2])y->wall->ends_m, path, "wall.ends_m",
                            why);
    }
    if (!err && y->walls)
        err = take_walls(s, y, path, why);
    if (!err && y->mount)
        err = take_mount(s, y->mount, path, why);
    return err;
}

static int take_responses(struct survey *s, const struct survey_yaml_calibration *c,
                          const char *path, struct error *why)
{
    struct error inner = {.text = ""};
    int err = 0;
    if (c->n_serials != s->n_microphones)
        return yaml_error_say(why, -EINVAL, path, "calibration.serials",
                              "expected one for each of %zu microphones, found %u",
                              s->n_microphones, c->n_serials);
    char *folder = yaml_sibling(path, c->folder);
    s->responses = calloc(s->n_microphones, sizeof *s->responses);
    if (!folder || !s->responses)
        err = error_say(why, -ENOMEM, "%s: out of memory", path);
    for (size_t i = 0; i < s->n_microphones && !err; i++) {
        err = response_load(&s->responses[i], folder, c->serials[i], &inner);
        if (err)
            yaml_error_say(why, err, path, "calibration", "%.700s", inner.text);
        else
            s->n_responses++;
    }
    free(folder);
    return err;
}

int survey_from_yaml(struct survey *out, const struct survey_yaml *y, const char *path,
                     struct error *why)
{
    struct survey s = {.source = SURVEY_REPLAY};
    int err = take_timing(&s, y, path, why);
    if (!err && y->replica)
        err = take_replica(&s, y->replica, path, why);
    if (!err)
        err = y->pings ? take_pings(&s, y->pings, path, why)
                       : take_elements(&s, y, path, why);
    if (!err)
        err = survey_yaml_place(&s, y, path, why);
    if (!err && y->calibration)
        err = take_responses(&s, y->calibration, path, why);
    if (!err) {
        err = survey_check(&s, why);
        if (err)
            yaml_place_error(why, path);
    }
    if (err)
        survey_clear(&s);
    else
        *out = s;
    return err;
}
