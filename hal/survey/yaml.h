/* SPDX-License-Identifier: MIT */
/* hal/survey/yaml.h -- the keys of survey.yaml as libcyaml reads them.  A scene file has
 * the same keys beside its own, so they are a list that both files' schemas include. */
#ifndef ANLOS_HAL_SURVEY_YAML_H
#define ANLOS_HAL_SURVEY_YAML_H

#include <stdbool.h>
#include <stdint.h>

#include <cyaml/cyaml.h>

#include "dsp/error.h"
#include "recon/survey.h"

struct survey_yaml_chirp {
    double start_hz, stop_hz, duration_s;
    int phase;       /* 0 cosine, 1 sine */
    bool alternates; /* every second one runs downward */
};

struct survey_yaml_stage {
    double axis[3];
    double *positions_m;
    unsigned n_positions;
    bool continuous; /* it does not stop there */
};

struct survey_yaml_calibration {
    char *folder;
    char **serials;
    unsigned n_serials;
};

struct survey_yaml_volume {
    double x_m[3], y_m[3], z_m[3];
};

struct survey_yaml_wall {
    double normal[3], distance_m;
    double (*ends_m)[2]; /* [n_ends]: x, z of two points that it reaches to; or NULL */
    unsigned n_ends;
};

struct survey_yaml_one_wall { /* of several */
    double normal[3], distance_m, gate_m[2];
    double (*ends_m)[2];
    unsigned n_ends;
};

struct survey_yaml_mount {
    double origin_m[3], x_axis[3], y_axis[3];
};

/* NULL: the key is not in the file. */
struct survey_yaml {
    double *sound_speed_m_s, *temperature_c, *sample_rate_hz, *latency_samples;
    struct survey_yaml_chirp *chirp;
    uint32_t *slot_samples, *together;
    double (*speakers_m)[3], (*microphones_m)[3];
    unsigned n_speakers, n_microphones;
    struct survey_yaml_stage *stage;
    struct survey_yaml_calibration *calibration;
    double *gate_m; /* [2] */
    struct survey_yaml_volume *volume;
    struct survey_yaml_wall *wall;
    struct survey_yaml_one_wall *walls; /* in place of wall */
    unsigned n_walls;
    struct survey_yaml_mount *mount;
    char *pings, *replica; /* survey.yaml alone, in place of an array and a chirp */
};

extern const struct cyaml_schema_value survey_yaml_number, survey_yaml_point,
    survey_yaml_one_wall;
extern const struct cyaml_schema_field survey_yaml_chirp_fields[],
    survey_yaml_stage_fields[], survey_yaml_calibration_fields[],
    survey_yaml_volume_fields[], survey_yaml_wall_fields[], survey_yaml_mount_fields[];

/* The fields of `struct root`, which has a member `struct survey_yaml survey`.  need:
 * CYAML_FLAG_DEFAULT or, where a preset may stand for them, CYAML_FLAG_OPTIONAL. */
/* clang-format off */
#define SURVEY_YAML_FIELDS(root, need)                                                   \
    CYAML_FIELD_FLOAT_PTR("sound_speed_m_s", CYAML_FLAG_OPTIONAL, root,                  \
                          survey.sound_speed_m_s),                                       \
    CYAML_FIELD_FLOAT_PTR("temperature_c", CYAML_FLAG_OPTIONAL, root,                    \
                          survey.temperature_c),                                         \
    CYAML_FIELD_FLOAT_PTR("sample_rate_hz", need, root, survey.sample_rate_hz),          \
    CYAML_FIELD_MAPPING_PTR("chirp", need, root, survey.chirp,                           \
                            survey_yaml_chirp_fields),                                   \
    CYAML_FIELD_UINT_PTR("slot_samples", need, root, survey.slot_samples),               \
    CYAML_FIELD_UINT_PTR("together", CYAML_FLAG_OPTIONAL, root, survey.together),        \
    CYAML_FIELD_FLOAT_PTR("latency_samples", CYAML_FLAG_OPTIONAL, root,                  \
                          survey.latency_samples),                                       \
    CYAML_FIELD_SEQUENCE_COUNT("speakers_m", CYAML_FLAG_POINTER | (need), root,          \
                               survey.speakers_m, survey.n_speakers,                     \
                               &survey_yaml_point, 1, 4096),                             \
    CYAML_FIELD_SEQUENCE_COUNT("microphones_m", CYAML_FLAG_POINTER | (need), root,       \
                               survey.microphones_m, survey.n_microphones,               \
                               &survey_yaml_point, 1, 4096),                             \
    CYAML_FIELD_MAPPING_PTR("stage", CYAML_FLAG_OPTIONAL, root, survey.stage,            \
                            survey_yaml_stage_fields),                                   \
    CYAML_FIELD_MAPPING_PTR("calibration", CYAML_FLAG_OPTIONAL, root,                    \
                            survey.calibration, survey_yaml_calibration_fields),         \
    CYAML_FIELD_SEQUENCE_FIXED("gate_m", CYAML_FLAG_POINTER | CYAML_FLAG_OPTIONAL, root, \
                               survey.gate_m, &survey_yaml_number, 2),                   \
    CYAML_FIELD_MAPPING_PTR("volume", CYAML_FLAG_OPTIONAL, root, survey.volume,          \
                            survey_yaml_volume_fields),                                  \
    CYAML_FIELD_MAPPING_PTR("wall", CYAML_FLAG_OPTIONAL, root, survey.wall,              \
                            survey_yaml_wall_fields),                                    \
    CYAML_FIELD_SEQUENCE_COUNT("walls", CYAML_FLAG_POINTER | CYAML_FLAG_OPTIONAL, root,  \
                               survey.walls, survey.n_walls, &survey_yaml_one_wall, 1,   \
                               SURVEY_MAX_WALLS),                                        \
    CYAML_FIELD_MAPPING_PTR("mount", CYAML_FLAG_OPTIONAL, root, survey.mount,            \
                            survey_yaml_mount_fields)
/* clang-format on */

/* Checks and copies; every key that SURVEY_YAML_FIELDS can need must be there.  Normals
 * and axes get length 1.  path: for errors, and what calibration.folder is relative
 * to.  Clear *out with survey_clear.  0, -EINVAL, -ENOENT (calibration), -ENOMEM. */
int survey_from_yaml(struct survey *out, const struct survey_yaml *y, const char *path,
                     struct error *why);

/* Gate, volume, wall and mount alone, into a survey that is there. */
int survey_yaml_place(struct survey *s, const struct survey_yaml *y, const char *path,
                      struct error *why);

/* Scales v to length 1.  0, -EINVAL (length 0; the error names key). */
int survey_yaml_normalize(double v[3], const char *path, const char *key,
                          struct error *why);

#endif
