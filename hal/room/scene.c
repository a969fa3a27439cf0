/* SPDX-License-Identifier: MIT */
#include "hal/room/scene.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hal/yaml_file.h"

#define OPTIONAL CYAML_FLAG_OPTIONAL

static const cyaml_strval_t kinds[] = {
    {"point", SCENE_POINT},     {"rectangle", SCENE_RECTANGLE},
    {"polygon", SCENE_POLYGON}, {"letter", SCENE_LETTER},
    {"corner", SCENE_CORNER},   {"person", SCENE_PERSON},
    {"cyclist", SCENE_CYCLIST}, {"car", SCENE_CAR}};
static const cyaml_strval_t arrays[] = {
    {"explicit", SCENE_EXPLICIT}, {"paper", SCENE_PAPER}, {"bumper", SCENE_BUMPER}};
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

static const cyaml_schema_field_t knot_fields[] = {
    NUMBER(scene_knot, t_s, CYAML_FLAG_DEFAULT),
    CYAML_FIELD_SEQUENCE_FIXED("position_m", CYAML_FLAG_DEFAULT, struct scene_knot,
                               position_m, &survey_yaml_number, 3),
    CYAML_FIELD_END};
static const cyaml_schema_value_t knot_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct scene_knot, knot_fields)};

static const cyaml_schema_field_t drawn_path_fields[] = {
    NUMBER(scene_drawn_path, turn_deg, OPTIONAL),
    CYAML_FIELD_SEQUENCE_FIXED("shift_m", OPTIONAL, struct scene_drawn_path, shift_m,
                               &survey_yaml_number, 3),
    CYAML_FIELD_BOOL("reversed", OPTIONAL, struct scene_drawn_path, reversed),
    VECTOR_PTR(scene_drawn_path, speed_m_s, 2), CYAML_FIELD_END};
static const cyaml_schema_field_t object_fields[] = {
    CYAML_FIELD_STRING("name", CYAML_FLAG_DEFAULT, struct scene_object, name, 1),
    CYAML_FIELD_ENUM("kind", CYAML_FLAG_STRICT, struct scene_object, kind, kinds,
                     SCENE_KINDS),
    VECTOR_PTR(scene_object, position_m, 3),
    CYAML_FIELD_SEQUENCE_COUNT("path", CYAML_FLAG_POINTER | OPTIONAL, struct scene_object,
                               path, n_path, &knot_schema, 1, 100),
    VECTOR_PTR(scene_object, present_s, 2),
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
    CYAML_FIELD_MAPPING_PTR("drawn", OPTIONAL, struct scene_object, drawn,
                            drawn_path_fields),
    CYAML_FIELD_BOOL("opaque", OPTIONAL, struct scene_object, opaque),
    CYAML_FIELD_END};
static const cyaml_schema_value_t object_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct scene_object, object_fields)};

static const cyaml_schema_field_t wall_fields[] = {
    NUMBER(scene_wall, reflectivity, CYAML_FLAG_DEFAULT),
    NUMBER(scene_wall, echo, OPTIONAL),
    CYAML_FIELD_UINT("patches", OPTIONAL, struct scene_wall, patches),
    NUMBER(scene_wall, scattering_length_m, OPTIONAL),
    NUMBER(scene_wall, roughness_m, OPTIONAL),
    CYAML_FIELD_SEQUENCE_COUNT("spans_m", CYAML_FLAG_POINTER | OPTIONAL,
                               struct scene_wall, spans_m, n_spans, &pair, 1, 100),
    CYAML_FIELD_END};
static const cyaml_schema_field_t clutter_fields[] = {
    CYAML_FIELD_UINT("points", CYAML_FLAG_DEFAULT, struct scene_clutter, points),
    NUMBER(scene_clutter, scattering_length_m, CYAML_FLAG_DEFAULT),
    NUMBER(scene_clutter, near_m, CYAML_FLAG_DEFAULT),
    NUMBER(scene_clutter, far_m, CYAML_FLAG_DEFAULT),
    CYAML_FIELD_BOOL("mirrored", OPTIONAL, struct scene_clutter, mirrored),
    CYAML_FIELD_END};
static const cyaml_schema_field_t microphone_fields[] = {
    NUMBER(scene_microphones, ripple_db, CYAML_FLAG_DEFAULT), CYAML_FIELD_END};
static const cyaml_schema_field_t error_fields[] = {
    NUMBER(scene_errors, gain_db, OPTIONAL), NUMBER(scene_errors, element_m, OPTIONAL),
    NUMBER(scene_errors, stage_m, OPTIONAL), CYAML_FIELD_END};
static const cyaml_schema_field_t rise_fields[] = {
    CYAML_FIELD_SEQUENCE_FIXED("during_s", CYAML_FLAG_DEFAULT, struct scene_rise,
                               during_s, &survey_yaml_number, 2),
    NUMBER(scene_rise, by_db, CYAML_FLAG_DEFAULT), CYAML_FIELD_END};
static const cyaml_schema_value_t rise_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct scene_rise, rise_fields)};
static const cyaml_schema_field_t slam_fields[] = {
    CYAML_FIELD_SEQUENCE_FIXED("during_s", CYAML_FLAG_DEFAULT, struct scene_slam,
                               during_s, &survey_yaml_number, 2),
    NUMBER(scene_slam, peak, CYAML_FLAG_DEFAULT),
    NUMBER(scene_slam, decay_s, CYAML_FLAG_DEFAULT),
    VECTOR_PTR(scene_slam, position_m, 3), CYAML_FIELD_END};
static const cyaml_schema_value_t slam_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct scene_slam, slam_fields)};
static const cyaml_schema_value_t harmonic = {
    CYAML_VALUE_UINT(CYAML_FLAG_DEFAULT, uint32_t)};
static const cyaml_schema_field_t tone_fields[] = {
    NUMBER(scene_tone, frequency_hz, CYAML_FLAG_DEFAULT),
    NUMBER(scene_tone, rms, CYAML_FLAG_DEFAULT),
    CYAML_FIELD_UINT("harmonics", OPTIONAL, struct scene_tone, harmonics),
    CYAML_FIELD_SEQUENCE_FIXED("comb", CYAML_FLAG_POINTER | OPTIONAL, struct scene_tone,
                               comb, &harmonic, 2),
    NUMBER(scene_tone, wander, OPTIONAL),
    NUMBER(scene_tone, spread_db, OPTIONAL),
    VECTOR_PTR(scene_tone, during_s, 2),
    CYAML_FIELD_END};
static const cyaml_schema_value_t tone_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct scene_tone, tone_fields)};
static const cyaml_schema_field_t noise_fields[] = {
    NUMBER_PTR(scene_noise, snr_db),
    NUMBER_PTR(scene_noise, at_m),
    NUMBER_PTR(scene_noise, rms),
    CYAML_FIELD_SEQUENCE_COUNT("rises", CYAML_FLAG_POINTER | OPTIONAL, struct scene_noise,
                               rises, n_rises, &rise_schema, 1, 100),
    CYAML_FIELD_SEQUENCE_COUNT("slams", CYAML_FLAG_POINTER | OPTIONAL, struct scene_noise,
                               slams, n_slams, &slam_schema, 1, 1000),
    CYAML_FIELD_SEQUENCE_COUNT("tones", CYAML_FLAG_POINTER | OPTIONAL, struct scene_noise,
                               tones, n_tones, &tone_schema, 1, 100),
    CYAML_FIELD_END};
static const cyaml_schema_field_t interferer_fields[] = {
    CYAML_FIELD_SEQUENCE_FIXED("position_m", CYAML_FLAG_DEFAULT, struct scene_interferer,
                               position_m, &survey_yaml_number, 3),
    NUMBER(scene_interferer, turn_deg, OPTIONAL),
    NUMBER(scene_interferer, start_s, OPTIONAL),
    NUMBER(scene_interferer, clock_ppm, OPTIONAL),
    CYAML_FIELD_UINT_PTR("slot_samples", OPTIONAL, struct scene_interferer, slot_samples),
    CYAML_FIELD_UINT("jitter_samples", OPTIONAL, struct scene_interferer, jitter_samples),
    CYAML_FIELD_BOOL_PTR("stagger", OPTIONAL, struct scene_interferer, stagger),
    NUMBER(scene_interferer, level_db, OPTIONAL),
    CYAML_FIELD_BOOL("down", OPTIONAL, struct scene_interferer, down),
    VECTOR_PTR(scene_interferer, during_s, 2),
    CYAML_FIELD_END};
static const cyaml_schema_value_t interferer_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct scene_interferer, interferer_fields)};
static const cyaml_schema_field_t motion_fields[] = {
    NUMBER(scene_motion, t_s, CYAML_FLAG_DEFAULT),
    NUMBER(scene_motion, speed_m_s, CYAML_FLAG_DEFAULT),
    NUMBER(scene_motion, yaw_rate_deg_s, OPTIONAL), CYAML_FIELD_END};
static const cyaml_schema_value_t motion_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct scene_motion, motion_fields)};
static const cyaml_schema_field_t rock_fields[] = {
    NUMBER(scene_rock, frequency_hz, CYAML_FLAG_DEFAULT),
    NUMBER(scene_rock, forward_m, OPTIONAL), NUMBER(scene_rock, left_m, OPTIONAL),
    NUMBER(scene_rock, yaw_deg, OPTIONAL), CYAML_FIELD_END};
static const cyaml_schema_field_t drive_fields[] = {
    NUMBER(scene_drive, period_s, CYAML_FLAG_DEFAULT),
    CYAML_FIELD_SEQUENCE_COUNT("ego", CYAML_FLAG_POINTER | OPTIONAL, struct scene_drive,
                               ego, n_ego, &motion_schema, 1, 200),
    CYAML_FIELD_MAPPING_PTR("rock", OPTIONAL, struct scene_drive, rock, rock_fields),
    CYAML_FIELD_END};
static const cyaml_schema_field_t drawn_fields[] = {
    NUMBER(scene_drawn, wall_m, OPTIONAL), NUMBER(scene_drawn, wall_deg, OPTIONAL),
    CYAML_FIELD_END};
static const cyaml_schema_field_t drift_fields[] = {
    NUMBER(scene_drift, background_c, OPTIONAL), NUMBER(scene_drift, scan_c, OPTIONAL),
    NUMBER(scene_drift, rate_c_min, OPTIONAL), CYAML_FIELD_END};

static const cyaml_schema_field_t fault_fields[] = {
    CYAML_FIELD_UINT("channel", CYAML_FLAG_DEFAULT, struct scene_fault, channel),
    NUMBER(scene_fault, gain_db, OPTIONAL),
    VECTOR_PTR(scene_fault, during_s, 2),
    VECTOR_PTR(scene_fault, moved_m, 3),
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
                     3),
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
    PART(drive, drive_fields),
    PART(drawn, drawn_fields),
    CYAML_FIELD_SEQUENCE_COUNT("interferers", CYAML_FLAG_POINTER | OPTIONAL, struct scene,
                               interferers, n_interferers, &interferer_schema, 1, 8),
    CYAML_FIELD_SEQUENCE_COUNT("building", CYAML_FLAG_POINTER | OPTIONAL, struct scene,
                               building, n_building, &pair, 3, 100),
    CYAML_FIELD_SEQUENCE_COUNT("objects", CYAML_FLAG_POINTER | OPTIONAL, struct scene,
                               objects, n_objects, &object_schema, 0, 1000),
    CYAML_FIELD_END};
static const cyaml_schema_value_t scene_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct scene, scene_fields)};

const char *scene_kind_name(int kind)
{
    return kinds[kind].str;
}

/* p: of a pointer to what the file says.  Keeps that, or makes it and copies the default
 * value.  0, -ENOMEM. */
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
    static const struct survey_yaml_chirp chirp = {2000, 20000, 0.0625, 0, false};
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

/* 16 microphones along 1 m of a bumper and 16 speakers between them, at one height; a
 * slot of 24 ms, for 4 m. */
static int fill_in_bumper(struct survey_yaml *y)
{
    enum { ELEMENTS = 16 };
    static const double rate_hz = 48000, pitch_m = 1.0 / (ELEMENTS - 0.5);
    static const uint32_t slot = 1152;
    static const struct survey_yaml_chirp chirp = {2000, 20000, 0.02, 0, false};
    double speakers[ELEMENTS][3] = {{0}}, microphones[ELEMENTS][3] = {{0}};
    for (int i = 0; i < ELEMENTS; i++) {
        microphones[i][0] = -0.5 + i * pitch_m;
        speakers[i][0] = microphones[i][0] + pitch_m / 2;
    }
    y->n_speakers = y->n_microphones = ELEMENTS;
    if (fill_in(&y->sample_rate_hz, &rate_hz, sizeof rate_hz) ||
        fill_in(&y->slot_samples, &slot, sizeof slot) ||
        fill_in(&y->chirp, &chirp, sizeof chirp) ||
        fill_in(&y->speakers_m, speakers, sizeof speakers) ||
        fill_in(&y->microphones_m, microphones, sizeof microphones))
        return -ENOMEM;
    return 0;
}

/* The keys of an array of that name.  0, -ENOMEM. */
static int fill_in_preset(struct survey_yaml *y, enum scene_array array)
{
    switch (array) {
    case SCENE_PAPER:
        return fill_in_paper(y);
    case SCENE_BUMPER:
        return fill_in_bumper(y);
    default:
        return 0;
    }
}

static int fill_in_array(struct scene *s, const char *path, struct error *why)
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
            return yaml_error_say(why, -EINVAL, path, keys[i].key,
                                  "\"array: %s\" says this already; expected one",
                                  arrays[s->array].str);
        if (!s->array && !keys[i].value && strcmp(keys[i].key, "stage"))
            return error_say(why, -EINVAL,
                             "%s:1: the key \"%s\" is missing, or \"array: paper\"", path,
                             keys[i].key);
    }
    if (!y->wall && !y->walls)
        return error_say(why, -EINVAL, "%s:1: the key \"wall\" is missing", path);
    if (fill_in_preset(y, s->array) < 0)
        return error_say(why, -ENOMEM, "%s: out of memory", path);
    return 0;
}

static int fill_in_defaults(struct scene *s)
{
    static const double level = 0.05, direct = 1;
    static const struct scene_wall wall = {.reflectivity = 1};
    static const struct scene_clutter clutter = {.far_m = 1};
    static const struct scene_microphones microphones = {0};
    static const struct scene_errors errors = {0, 0, 0};
    static const struct scene_noise noise = {.snr_db = NULL};
    static const struct scene_drift drift = {0};
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

/* What has a path is where that begins. */
static int place_objects(struct scene *s)
{
    for (unsigned i = 0; i < s->n_objects; i++) {
        struct scene_object *o = &s->objects[i];
        if (o->n_path && !o->position_m &&
            fill_in(&o->position_m, o->path[0].position_m, sizeof o->path[0].position_m))
            return -ENOMEM;
    }
    return 0;
}

int scene_load(struct scene **out, struct survey *survey, const char *path,
               struct error *why)
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
        err = error_say(why, -ENOMEM, "%s: out of memory", path);
    if (!err && place_objects(s) < 0)
        err = error_say(why, -ENOMEM, "%s: out of memory", path);
    if (!err)
        err = scene_check(s, path, why);
    if (!err)
        err = survey_from_yaml(survey, &s->survey, path, why);
    if (err) {
        scene_free(s);
        return err;
    }
    survey->source = SURVEY_SIMULATION;
    *out = s;
    return 0;
}

void scene_free(struct scene *s)
{
    yaml_unload(&scene_schema, s);
}
