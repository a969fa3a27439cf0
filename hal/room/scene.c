#include "hal/room/scene.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hal/yaml/file.h"
#include "hal/survey/place.h"

#define OPTIONAL CYAML_FLAG_OPTIONAL

static const cyaml_strval_t kinds[] = {{"point", SCENE_POINT},
                                       {"rectangle", SCENE_RECTANGLE},
                                       {"polygon", SCENE_POLYGON},
                                       {"letter", SCENE_LETTER},
                                       {"corner", SCENE_CORNER}};
static const cyaml_strval_t arrays[] = {{"explicit", 0}, {"paper", 1}};
static const cyaml_schema_value_t pair = {
    CYAML_VALUE_SEQUENCE_FIXED(CYAML_FLAG_DEFAULT, double, &survey_yaml_number, 2)};

/* clang-format off */
#define NUMBER(type, key, flags) CYAML_FIELD_FLOAT(#key, flags, struct type, key)
#define NUMBER_PTR(type, key) CYAML_FIELD_FLOAT_PTR(#key, OPTIONAL, struct type, key)
#define VECTOR_PTR(type, key, n)                                                         \
    CYAML_FIELD_SEQUENCE_FIXED(#key, CYAML_FLAG_POINTER | OPTIONAL, struct type, key,    \
                               &survey_yaml_number, n)
#define PART(key, fields)                                                                \
    CYAML_FIELD_MAPPING_PTR(#key, OPTIONAL, struct scene, key, fields)
/* clang-format on */

static const cyaml_schema_field_t object_fields[] = {
    CYAML_FIELD_STRING("name", CYAML_FLAG_DEFAULT, struct scene_object, name, 1),
    CYAML_FIELD_ENUM("kind", CYAML_FLAG_STRICT, struct scene_object, kind, kinds, 5),
    CYAML_FIELD_SEQUENCE_FIXED("position_m", CYAML_FLAG_DEFAULT, struct scene_object,
                               position_m, &survey_yaml_number, 3),
    NUMBER_PTR(scene_object, scattering_length_m),
    NUMBER_PTR(scene_object, side_m),
    VECTOR_PTR(scene_object, size_m, 2),
    CYAML_FIELD_SEQUENCE_COUNT("outline_m", CYAML_FLAG_POINTER | OPTIONAL,
                               struct scene_object, outline_m, n_outline, &pair, 3, 1000),
    CYAML_FIELD_STRING("letter", OPTIONAL, struct scene_object, letter, 1),
    NUMBER_PTR(scene_object, stroke_m),
    VECTOR_PTR(scene_object, facing, 3),
    VECTOR_PTR(scene_object, up, 3),
    NUMBER_PTR(scene_object, reflectivity),
    CYAML_FIELD_END};
static const cyaml_schema_value_t object_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct scene_object, object_fields)};

static const cyaml_schema_field_t wall_fields[] = {
    NUMBER(scene_wall, reflectivity, CYAML_FLAG_DEFAULT),
    NUMBER(scene_wall, echo, OPTIONAL),
    CYAML_FIELD_UINT("patches", OPTIONAL, struct scene_wall, patches),
    NUMBER(scene_wall, scattering_length_m, OPTIONAL),
    NUMBER(scene_wall, roughness_m, OPTIONAL),
    CYAML_FIELD_END};
static const cyaml_schema_field_t clutter_fields[] = {
    CYAML_FIELD_UINT("points", CYAML_FLAG_DEFAULT, struct scene_clutter, points),
    NUMBER(scene_clutter, scattering_length_m, CYAML_FLAG_DEFAULT),
    NUMBER(scene_clutter, near_m, CYAML_FLAG_DEFAULT),
    NUMBER(scene_clutter, far_m, CYAML_FLAG_DEFAULT), CYAML_FIELD_END};
static const cyaml_schema_field_t microphone_fields[] = {
    NUMBER(scene_microphones, ripple_db, CYAML_FLAG_DEFAULT), CYAML_FIELD_END};
static const cyaml_schema_field_t error_fields[] = {
    NUMBER(scene_errors, gain_db, OPTIONAL), NUMBER(scene_errors, element_m, OPTIONAL),
    NUMBER(scene_errors, stage_m, OPTIONAL), CYAML_FIELD_END};
static const cyaml_schema_field_t noise_fields[] = {
    NUMBER_PTR(scene_noise, snr_db), NUMBER_PTR(scene_noise, rms), CYAML_FIELD_END};
static const cyaml_schema_field_t drift_fields[] = {
    NUMBER(scene_drift, background_c, OPTIONAL), NUMBER(scene_drift, scan_c, OPTIONAL),
    CYAML_FIELD_END};

static const cyaml_schema_field_t fault_fields[] = {
    CYAML_FIELD_UINT("channel", CYAML_FLAG_DEFAULT, struct scene_fault, channel),
    NUMBER(scene_fault, gain_db, OPTIONAL),
    CYAML_FIELD_BOOL("inverted", OPTIONAL, struct scene_fault, inverted),
    CYAML_FIELD_BOOL("dead", OPTIONAL, struct scene_fault, dead),
    NUMBER(scene_fault, noise_rms, OPTIONAL),
    NUMBER_PTR(scene_fault, limit),
    CYAML_FIELD_UINT_PTR("swapped_with", OPTIONAL, struct scene_fault, swapped_with),
    CYAML_FIELD_END};
static const cyaml_schema_value_t fault_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct scene_fault, fault_fields)};
static const cyaml_schema_field_t faults_fields[] = {
    NUMBER(scene_faults, latency_samples, OPTIONAL),
    NUMBER_PTR(scene_faults, sound_speed_m_s),
    CYAML_FIELD_SEQUENCE_COUNT("speakers", CYAML_FLAG_POINTER | OPTIONAL,
                               struct scene_faults, speakers, n_speakers, &fault_schema,
                               0, SURVEY_MAX_ELEMENTS),
    CYAML_FIELD_SEQUENCE_COUNT("microphones", CYAML_FLAG_POINTER | OPTIONAL,
                               struct scene_faults, microphones, n_microphones,
                               &fault_schema, 0, SURVEY_MAX_ELEMENTS),
    CYAML_FIELD_END};

static const cyaml_schema_field_t scene_fields[] = {
    SURVEY_YAML_FIELDS(struct scene, CYAML_FLAG_OPTIONAL),
    CYAML_FIELD_ENUM("array", CYAML_FLAG_STRICT | OPTIONAL, struct scene, array, arrays,
                     2),
    CYAML_FIELD_UINT("seed", OPTIONAL, struct scene, seed),
    NUMBER_PTR(scene, level),
    NUMBER_PTR(scene, direct_level),
    PART(wall_sound, wall_fields),
    PART(clutter, clutter_fields),
    PART(microphones, microphone_fields),
    PART(errors, error_fields),
    PART(noise, noise_fields),
    PART(drift, drift_fields),
    PART(faults, faults_fields),
    CYAML_FIELD_SEQUENCE_COUNT("objects", CYAML_FLAG_POINTER | OPTIONAL, struct scene,
                               objects, n_objects, &object_schema, 0, 1000),
    CYAML_FIELD_END};
static const cyaml_schema_value_t scene_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct scene, scene_fields)};

/* Keeps *p, or makes it and copies the default. */
static int fill_in(void *p, const void *value, size_t size)
{
    void *there;
    memcpy(&there, p, sizeof there);
    if (there)
        return 0;
    there = malloc(size);
    if (!there)
        return -ENOMEM;
    memcpy(there, value, size);
    memcpy(p, &there, sizeof there);
    return 0;
}

/* 16 speakers and 16 microphones upright, 0.08 m apart, carried 1 m in 32 steps (Lindell
 * 2019, section 4). */
static int fill_in_paper(struct survey_yaml *y)
{
    enum { ELEMENTS = 16, POSITIONS = 32 };
    static const double rate_hz = 48000;
    static const uint32_t slot = 3000;
    static const struct survey_yaml_chirp chirp = {2000, 20000, 0.0625, 0};
    struct survey_yaml_stage stage = {.axis = {1, 0, 0}, .n_positions = POSITIONS};
    double speakers[ELEMENTS][3], microphones[ELEMENTS][3], positions[POSITIONS];
    for (int i = 0; i < ELEMENTS; i++)
        for (int a = 0; a < 3; a++) {
            speakers[i][a] = a == 1 ? i / 15.0 : 0;
            microphones[i][a] = a == 0 ? 0.08 : speakers[i][a];
        }
    for (int k = 0; k < POSITIONS; k++)
        positions[k] = k / 31.0;
    y->n_speakers = y->n_microphones = ELEMENTS;
    if (fill_in(&y->sample_rate_hz, &rate_hz, sizeof rate_hz) ||
        fill_in(&y->slot_samples, &slot, sizeof slot) ||
        fill_in(&y->chirp, &chirp, sizeof chirp) ||
        fill_in(&y->speakers_m, speakers, sizeof speakers) ||
        fill_in(&y->microphones_m, microphones, sizeof microphones) ||
        fill_in(&y->stage, &stage, sizeof stage) ||
        fill_in(&y->stage->positions_m, positions, sizeof positions))
        return -ENOMEM;
    return 0;
}

static int fill_in_array(struct scene *s, const char *path, struct complaint *why)
{
    struct survey_yaml *y = &s->survey;
    const struct {
        const char *key;
        const void *value;
        bool by_preset; /* only the preset may say it */
    } keys[] = {{"speakers_m", y->speakers_m, true},
                {"microphones_m", y->microphones_m, true},
                {"stage", y->stage, true},
                {"sample_rate_hz", y->sample_rate_hz, false},
                {"slot_samples", y->slot_samples, false},
                {"chirp", y->chirp, false}};
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        if (s->array && keys[i].by_preset && keys[i].value)
            return yaml_complain(why, -EINVAL, path, keys[i].key,
                                 "\"array: paper\" says this already; expected one");
        if (!s->array && !keys[i].value && strcmp(keys[i].key, "stage"))
            return complain(why, -EINVAL,
                            "%s:1: the key \"%s\" is missing, or \"array: paper\"", path,
                            keys[i].key);
    }
    if (!y->wall)
        return complain(why, -EINVAL, "%s:1: the key \"wall\" is missing", path);
    if (s->array && fill_in_paper(y) < 0)
        return complain(why, -ENOMEM, "%s: out of memory", path);
    return 0;
}

static int fill_in_defaults(struct scene *s)
{
    static const double level = 0.05, direct = 1;
    static const struct scene_wall wall = {.reflectivity = 1};
    static const struct scene_clutter clutter = {.far_m = 1};
    static const struct scene_microphones microphones = {0};
    static const struct scene_errors errors = {0, 0, 0};
    static const struct scene_noise noise = {NULL, NULL};
    static const struct scene_drift drift = {0, 0};
    static const struct scene_faults faults = {0};
    if (fill_in(&s->level, &level, sizeof level) ||
        fill_in(&s->direct_level, &direct, sizeof direct) ||
        fill_in(&s->wall_sound, &wall, sizeof wall) ||
        fill_in(&s->clutter, &clutter, sizeof clutter) ||
        fill_in(&s->microphones, &microphones, sizeof microphones) ||
        fill_in(&s->errors, &errors, sizeof errors) ||
        fill_in(&s->noise, &noise, sizeof noise) ||
        fill_in(&s->drift, &drift, sizeof drift) ||
        fill_in(&s->faults, &faults, sizeof faults))
        return -ENOMEM;
    return 0;
}

int scene_load(struct scene **out, struct survey *survey, const char *path,
               struct complaint *why)
{
    void *root;
    *out = NULL;
    memset(survey, 0, sizeof *survey);
    int err = yaml_load(path, &scene_schema, &root, why);
    if (err)
        return err;
    struct scene *s = root;
    err = fill_in_array(s, path, why);
    if (!err && fill_in_defaults(s) < 0)
        err = complain(why, -ENOMEM, "%s: out of memory", path);
    if (!err)
        err = scene_check(s, path, why);
    if (!err)
        err = survey_from_yaml(survey, &s->survey, path, why);
    if (err) {
        scene_free(s);
        return err;
    }
    survey->source = ANLOS__SOURCE__SIMULATION;
    *out = s;
    return 0;
}

void scene_free(struct scene *s)
{
    yaml_unload(&scene_schema, s);
}
