/* SPDX-License-Identifier: MIT */
#include "hal/room/scene.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/random.h"
#include "hal/room/scatter.h"
#include "hal/room/vector.h"
#include "hal/yaml_file.h"

/* -- its keys --------------------------------------------------------------------------
 */

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

/* -- what a schema cannot say: ranges, whose keys they are, what moves of a drive ------
 */

struct span { /* in which a value has to be */
    double min, max;
};

static int check_value(double value, struct span span, const char *key, const char *path,
                       struct error *why)
{
    if (value >= span.min && value <= span.max)
        return 0;
    return yaml_error_say(why, -EINVAL, path, key, "%g is outside %g..%g", value,
                          span.min, span.max);
}

struct rule {
    const char *key;
    double value, min, max;
};

static int check_rules(const struct rule *rules, size_t n, const char *prefix,
                       const char *path, struct error *why)
{
    char key[96];
    int err = 0;
    for (size_t i = 0; i < n && !err; i++) {
        snprintf(key, sizeof key, "%s%s", prefix, rules[i].key);
        err = check_value(rules[i].value, (struct span){rules[i].min, rules[i].max}, key,
                          path, why);
    }
    return err;
}

/* How near a wall may be drawn without getting behind the array. */
static double nearer_m(const struct scene *s)
{
    if (s->survey.wall)
        return fabs(s->survey.wall->distance_m);
    return s->survey.n_walls ? fabs(s->survey.walls[0].distance_m) : 10;
}

static int check_world(const struct scene *s, const char *path, struct error *why)
{
    const struct rule rules[] = {
        {"level", *s->level, 0, 1e3},
        {"direct_level", *s->direct_level, 0, 1e3},
        {"wall_sound.reflectivity", s->wall_sound->reflectivity, 0, 1},
        {"wall_sound.echo", s->wall_sound->echo, 0, 1},
        {"wall_sound.patches", s->wall_sound->patches, 0, 1e5},
        {"wall_sound.scattering_length_m", s->wall_sound->scattering_length_m, 0, 10},
        {"wall_sound.roughness_m", s->wall_sound->roughness_m, 0, 1},
        {"clutter.points", s->clutter->points, 0, 1e5},
        {"clutter.scattering_length_m", s->clutter->scattering_length_m, 0, 10},
        {"clutter.near_m", s->clutter->near_m, 0, 100},
        {"clutter.far_m", s->clutter->far_m, s->clutter->near_m, 100},
        {"microphones.ripple_db", s->microphones->ripple_db, 0, 20},
        {"errors.gain_db", s->errors->gain_db, 0, 20},
        {"errors.element_m", s->errors->element_m, 0, 0.1},
        {"errors.stage_m", s->errors->stage_m, 0, 0.1},
        {"drawn.wall_m", s->drawn ? s->drawn->wall_m : 0, 0, nearer_m(s)},
        {"drawn.wall_deg", s->drawn ? s->drawn->wall_deg : 0, 0, 45},
        {"noise.snr_db", s->noise->snr_db ? *s->noise->snr_db : 0, -100, 200},
        {"noise.at_m", s->noise->at_m ? *s->noise->at_m : 1, 0.1, 100},
        {"noise.rms", s->noise->rms ? *s->noise->rms : 0, 0, 10},
        {"drift.background_c", s->drift->background_c, -30, 30},
        {"drift.scan_c", s->drift->scan_c, -30, 30},
        {"drift.rate_c_min", s->drift->rate_c_min, -60, 60},
    };
    for (unsigned i = 0; i < s->wall_sound->n_spans; i++)
        if (!(s->wall_sound->spans_m[i][0] < s->wall_sound->spans_m[i][1]))
            return yaml_error_say(why, -EINVAL, path, "wall_sound.spans_m",
                                  "%g to %g is no piece of a wall",
                                  s->wall_sound->spans_m[i][0],
                                  s->wall_sound->spans_m[i][1]);
    if (s->noise->snr_db && s->noise->rms)
        return yaml_error_say(why, -EINVAL, path, "noise.rms",
                              "expected snr_db or rms, found both");
    if (s->noise->at_m && !s->noise->snr_db)
        return yaml_error_say(why, -EINVAL, path, "noise.at_m",
                              "expected snr_db with it");
    if (s->noise->snr_db && !s->n_objects && !s->noise->at_m && !s->drive)
        return yaml_error_say(
            why, -EINVAL, path, "noise.snr_db",
            "there are no objects to measure noise against; say rms, or "
            "at_m");
    if (s->microphones->ripple_db > 0 && s->survey.calibration)
        return yaml_error_say(why, -EINVAL, path, "microphones",
                              "calibration says what the microphones do; expected one");
    return check_rules(rules, sizeof rules / sizeof *rules, "", path, why);
}

/* Which keys an object of each kind needs (2), may have (1), or must not have (0). */
struct key_use {
    const char *key;
    bool given;
    unsigned char use[SCENE_KINDS];
};

static int check_keys(const struct scene_object *o, const char *prefix, const char *path,
                      struct error *why)
{
    const struct key_use keys[] = {
        {"scattering_length_m", o->scattering_length_m, {2, 0, 0, 0, 0, 1, 1, 1}},
        {"side_m", o->side_m, {0, 0, 0, 0, 2, 0, 0, 0}},
        {"size_m", o->size_m, {0, 2, 0, 2, 0, 0, 0, 0}},
        {"outline_m", o->outline_m, {0, 0, 2, 0, 0, 0, 0, 0}},
        {"letter", o->letter[0], {0, 0, 0, 2, 0, 0, 0, 0}},
        {"stroke_m", o->stroke_m, {0, 0, 0, 2, 0, 0, 0, 0}},
        {"facing", o->facing, {0, 1, 1, 1, 1, 1, 1, 1}},
        {"up", o->up, {0, 1, 1, 1, 0, 0, 0, 0}},
        {"reflectivity", o->reflectivity, {0, 1, 1, 1, 1, 0, 0, 0}},
        {"opaque", o->opaque, {0, 0, 0, 0, 0, 1, 1, 1}},
    };
    char key[96];
    if (!o->position_m)
        return yaml_error_say(why, -EINVAL, path, prefix,
                              "the key \"position_m\" is missing, or a path");
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        unsigned use = keys[i].use[o->kind];
        snprintf(key, sizeof key, "%s%s", prefix, keys[i].key);
        if (use == 2 && !keys[i].given)
            return yaml_error_say(why, -EINVAL, path, prefix, "a %s needs the key \"%s\"",
                                  scene_kind_name(o->kind), keys[i].key);
        if (use == 0 && keys[i].given)
            return yaml_error_say(why, -EINVAL, path, key, "a %s does not have this",
                                  scene_kind_name(o->kind));
    }
    return 0;
}

/* v: [3] or NULL. */
static int check_direction(const double *v, const char *prefix, const char *name,
                           const char *path, struct error *why)
{
    char key[96];
    double copy[3];
    if (!v)
        return 0;
    memcpy(copy, v, sizeof copy);
    snprintf(key, sizeof key, "%s%s", prefix, name);
    return survey_yaml_normalize(copy, path, key, why);
}

static int check_object(const struct scene_object *o, const char *prefix,
                        const char *path, struct error *why)
{
    int least = o->size_m && o->size_m[1] < o->size_m[0];
    const struct rule rules[] = {
        {"scattering_length_m", o->scattering_length_m ? *o->scattering_length_m : 0, -10,
         10},
        {"side_m", o->side_m ? *o->side_m : 1, 0.01, 5},
        {"size_m", o->size_m ? o->size_m[least] : 1, 0.005, 5},
        {"size_m", o->size_m ? o->size_m[1 - least] : 1, 0.005, 5},
        {"stroke_m", o->stroke_m ? *o->stroke_m : 0.01, 0.005,
         o->size_m ? o->size_m[least] : 5},
        {"reflectivity", o->reflectivity ? *o->reflectivity : 1, -1, 1},
        {"position_m[0]", o->position_m[0], -100, 100},
        {"position_m[1]", o->position_m[1], -100, 100},
        {"position_m[2]", o->position_m[2], -100, 100},
    };
    int err = check_rules(rules, sizeof rules / sizeof *rules, prefix, path, why);
    for (size_t i = 0; i < 2 * (size_t)o->n_outline && !err; i++)
        if (!(o->outline_m[i / 2][i % 2] >= -5 && o->outline_m[i / 2][i % 2] <= 5)) {
            char key[96];
            snprintf(key, sizeof key, "%soutline_m[%zu]", prefix, i / 2);
            err = yaml_error_say(why, -EINVAL, path, key, "%g is outside -5..5",
                                 o->outline_m[i / 2][i % 2]);
        }
    err = err ? err : check_direction(o->facing, prefix, "facing", path, why);
    err = err ? err : check_direction(o->up, prefix, "up", path, why);
    if (!err && o->letter[0] && !scatter_letter_known(o->letter[0])) {
        char key[96];
        snprintf(key, sizeof key, "%sletter", prefix);
        err = yaml_error_say(why, -EINVAL, path, key, "\"%s\": expected one of %s",
                             o->letter, SCATTER_LETTERS);
    }
    return err;
}

/* Of n channels. */
static int check_fault(const struct scene_fault *f, const char *prefix, size_t n,
                       const char *path, struct error *why)
{
    const struct rule rules[] = {
        {"channel", f->channel, 0, (double)n - 1},
        {"gain_db", f->gain_db, -60, 60},
        {"noise_rms", f->noise_rms, 0, 10},
        {"limit", f->limit ? *f->limit : 1, 0, 1e3},
        {"swapped_with", f->swapped_with ? *f->swapped_with : 0, 0, (double)n - 1},
    };
    return check_rules(rules, sizeof rules / sizeof *rules, prefix, path, why);
}

static int check_faults(const struct scene *s, const char *path, struct error *why)
{
    const struct scene_faults *f = s->faults;
    const struct rule rules[] = {
        {"faults.latency_samples", f->latency_samples, 0, 1e6},
        {"faults.sound_speed_m_s", f->sound_speed_m_s ? *f->sound_speed_m_s : 340, 300,
         360},
    };
    char prefix[48];
    int err = check_rules(rules, sizeof rules / sizeof *rules, "", path, why);
    for (unsigned i = 0; i < f->n_speakers && !err; i++) {
        snprintf(prefix, sizeof prefix, "faults.speakers[%u].", i);
        err = check_fault(&f->speakers[i], prefix, s->survey.n_speakers, path, why);
    }
    for (unsigned i = 0; i < f->n_microphones && !err; i++) {
        snprintf(prefix, sizeof prefix, "faults.microphones[%u].", i);
        err = check_fault(&f->microphones[i], prefix, s->survey.n_microphones, path, why);
    }
    return err;
}

/* -- what moves of a drive, and keys that only a drive has ------------------------------
 */

enum { MOST_OBJECTS = 64 };

/* Times rise, from 0 at the earliest to the period at the latest. */
static int check_time(double t_s, double before_s, bool first, double period_s,
                      const char *key, const char *path, struct error *why)
{
    if (!first && !(t_s > before_s))
        return yaml_error_say(why, -EINVAL, path, key,
                              "%g s does not come after the %g s before it", t_s,
                              before_s);
    return check_value(t_s, (struct span){0, period_s}, key, path, why);
}

static int check_path(const struct scene_object *o, unsigned index, double period_s,
                      const char *path, struct error *why)
{
    static const struct span anywhere = {-1000, 1000};
    char key[64];
    int err = 0;
    for (unsigned k = 0; k < o->n_path && !err; k++) {
        const struct scene_knot *knot = &o->path[k];
        snprintf(key, sizeof key, "objects[%u].path[%u].t_s", index, k);
        err =
            check_time(knot->t_s, k ? knot[-1].t_s : 0, k == 0, period_s, key, path, why);
        snprintf(key, sizeof key, "objects[%u].path[%u].position_m", index, k);
        for (int a = 0; a < 3 && !err; a++)
            err = check_value(knot->position_m[a], anywhere, key, path, why);
    }
    if (err || o->present_s || !o->n_path)
        return err;
    const double *first = o->path[0].position_m;
    if (!memcmp(first, o->path[o->n_path - 1].position_m, 3 * sizeof *first))
        return 0;
    snprintf(key, sizeof key, "objects[%u].path", index);
    return yaml_error_say(why, -EINVAL, path, key,
                          "the drive repeats, and this does not end where it begins; say "
                          "present_s: [FROM, TO]");
}

static int check_during(const double during_s[2], double period_s, const char *key,
                        const char *path, struct error *why)
{
    if (during_s[0] >= 0 && during_s[0] < during_s[1] && during_s[1] <= period_s)
        return 0;
    return yaml_error_say(why, -EINVAL, path, key, "%g to %g is not a span within 0..%g",
                          during_s[0], during_s[1], period_s);
}

static int check_timed_fault(const struct scene_fault *f, double period_s,
                             const char *prefix, const char *path, struct error *why)
{
    char key[96];
    int err = 0;
    snprintf(key, sizeof key, "%s.%s", prefix, f->moved_m ? "moved_m" : "during_s");
    if ((f->during_s || f->moved_m) && !(period_s > 0))
        return yaml_error_say(why, -EINVAL, path, key,
                              "only a drive has this, and there is no key \"drive\"");
    for (int a = 0; f->moved_m && a < 3 && !err; a++)
        err = check_value(f->moved_m[a], (struct span){-0.5, 0.5}, key, path, why);
    snprintf(key, sizeof key, "%s.during_s", prefix);
    return !err && f->during_s ? check_during(f->during_s, period_s, key, path, why)
                               : err;
}

static double leg_m(const struct scene_knot *from, const struct scene_knot *to)
{
    double way[3];
    vector_add(to->position_m, -1, from->position_m, way);
    return sqrt(vector_dot(way, way));
}

/* When a path is over that is gone along at a speed. */
static double path_ends_s(const struct scene_object *o, double speed_m_s)
{
    double end_s = o->path[0].t_s;
    for (unsigned k = 1; k < o->n_path; k++) {
        double way_m = leg_m(&o->path[k - 1], &o->path[k]);
        end_s += way_m > 0 ? way_m / speed_m_s : o->path[k].t_s - o->path[k - 1].t_s;
    }
    return end_s;
}

static int check_drawn_path(const struct scene_object *o, unsigned index, double period_s,
                            const char *path, struct error *why)
{
    static const struct span some = {0, 100}, speed = {0.01, 30};
    const struct scene_drawn_path *d = o->drawn;
    char key[64];
    if (!d)
        return 0;
    snprintf(key, sizeof key, "objects[%u].drawn", index);
    if (!o->n_path)
        return yaml_error_say(why, -EINVAL, path, key, "there is no path to change");
    snprintf(key, sizeof key, "objects[%u].drawn.turn_deg", index);
    int err = check_value(d->turn_deg, (struct span){0, 180}, key, path, why);
    snprintf(key, sizeof key, "objects[%u].drawn.shift_m", index);
    for (int a = 0; a < 3 && !err; a++)
        err = check_value(d->shift_m[a], some, key, path, why);
    snprintf(key, sizeof key, "objects[%u].drawn.speed_m_s", index);
    for (int i = 0; i < 2 && d->speed_m_s && !err; i++)
        err = check_value(d->speed_m_s[i], i ? (struct span){d->speed_m_s[0], 30} : speed,
                          key, path, why);
    if (err || !d->speed_m_s)
        return err;
    double ends_s = path_ends_s(o, d->speed_m_s[0]);
    if (ends_s <= period_s)
        return 0;
    return yaml_error_say(why, -EINVAL, path, key,
                          "at %g m/s the path ends after %.1f s, and the drive after %g",
                          d->speed_m_s[0], ends_s, period_s);
}

static int check_mover(const struct scene_object *o, unsigned index, double period_s,
                       const char *path, struct error *why)
{
    char key[64];
    snprintf(key, sizeof key, "objects[%u].present_s", index);
    int err = o->present_s ? check_during(o->present_s, period_s, key, path, why) : 0;
    if (!err)
        err = check_path(o, index, period_s, path, why);
    return err ? err : check_drawn_path(o, index, period_s, path, why);
}

static int check_slam(const struct scene_slam *slam, unsigned index, double period_s,
                      const char *path, struct error *why)
{
    static const struct span anywhere = {-1000, 1000};
    char key[64];
    int err = 0;
    snprintf(key, sizeof key, "noise.slams[%u].during_s", index);
    for (int k = 0; k < 2 && !err; k++)
        err = check_value(slam->during_s[k],
                          (struct span){k ? slam->during_s[0] : 0, period_s}, key, path,
                          why);
    snprintf(key, sizeof key, "noise.slams[%u].peak", index);
    if (!err)
        err = check_value(slam->peak, (struct span){0, 100}, key, path, why);
    snprintf(key, sizeof key, "noise.slams[%u].decay_s", index);
    if (!err)
        err = check_value(slam->decay_s, (struct span){1e-4, 1}, key, path, why);
    snprintf(key, sizeof key, "noise.slams[%u].position_m", index);
    for (int a = 0; a < 3 && slam->position_m && !err; a++)
        err = check_value(slam->position_m[a], anywhere, key, path, why);
    return err;
}

#define MOST_HARMONICS 10000

static int check_tone(const struct scene_tone *tone, unsigned index, double period_s,
                      const char *path, struct error *why)
{
    char key[64];
    snprintf(key, sizeof key, "noise.tones[%u].frequency_hz", index);
    int err = check_value(tone->frequency_hz, (struct span){1, 1e5}, key, path, why);
    snprintf(key, sizeof key, "noise.tones[%u].rms", index);
    if (!err)
        err = check_value(tone->rms, (struct span){0, 10}, key, path, why);
    snprintf(key, sizeof key, "noise.tones[%u].comb", index);
    if (!err && tone->comb && tone->harmonics)
        err = yaml_error_say(why, -EINVAL, path, key,
                             "a tone has this or harmonics, not both");
    for (int k = 0; k < 2 && !err && tone->comb; k++)
        err = check_value(tone->comb[k],
                          (struct span){k ? tone->comb[0] : 1, MOST_HARMONICS}, key, path,
                          why);
    snprintf(key, sizeof key, "noise.tones[%u].wander", index);
    if (!err)
        err = check_value(tone->wander, (struct span){0, 0.1}, key, path, why);
    snprintf(key, sizeof key, "noise.tones[%u].spread_db", index);
    if (!err)
        err = check_value(tone->spread_db, (struct span){0, 40}, key, path, why);
    snprintf(key, sizeof key, "noise.tones[%u].during_s", index);
    return !err && tone->during_s ? check_during(tone->during_s, period_s, key, path, why)
                                  : err;
}

static int check_interferer(const struct scene_interferer *i, unsigned index,
                            double period_s, const char *path, struct error *why)
{
    const struct {
        const char *key;
        double value;
        struct span span;
    } rules[] = {
        {"turn_deg", i->turn_deg, {-360, 360}},
        {"start_s", i->start_s, {0, 10}},
        {"clock_ppm", i->clock_ppm, {-1e4, 1e4}},
        {"slot_samples", i->slot_samples ? *i->slot_samples : 1, {1, 1e6}},
        {"jitter_samples", i->jitter_samples, {0, 1e6}},
        {"level_db", i->level_db, {-100, 100}},
    };
    char key[64];
    int err = 0;
    snprintf(key, sizeof key, "interferers[%u].position_m", index);
    for (int a = 0; a < 3 && !err; a++)
        err = check_value(i->position_m[a], (struct span){-100, 100}, key, path, why);
    for (size_t k = 0; k < sizeof rules / sizeof *rules && !err; k++) {
        snprintf(key, sizeof key, "interferers[%u].%s", index, rules[k].key);
        err = check_value(rules[k].value, rules[k].span, key, path, why);
    }
    snprintf(key, sizeof key, "interferers[%u].during_s", index);
    return !err && i->during_s ? check_during(i->during_s, period_s, key, path, why)
                               : err;
}

/* What comes and goes; period_s 0: nothing may. */
static int check_spans(const struct scene *s, double period_s, const char *path,
                       struct error *why)
{
    const struct {
        const char *key;
        const struct scene_fault *faults;
        unsigned n;
    } elements[] = {{"speakers", s->faults->speakers, s->faults->n_speakers},
                    {"microphones", s->faults->microphones, s->faults->n_microphones}};
    const struct {
        const char *key;
        bool given;
    } timed[] = {{"noise.rises", s->noise->n_rises},
                 {"noise.slams", s->noise->n_slams},
                 {"noise.tones", s->noise->n_tones},
                 {"interferers", s->n_interferers},
                 {"drift.rate_c_min", s->drift->rate_c_min != 0}};
    char key[64];
    int err = 0;
    for (size_t i = 0; i < sizeof timed / sizeof *timed; i++)
        if (timed[i].given && !(period_s > 0))
            return yaml_error_say(why, -EINVAL, path, timed[i].key,
                                  "only a drive has this, and there is no key \"drive\"");
    err = check_value(s->drift->rate_c_min * period_s / 120, (struct span){-30, 30},
                      "drift.rate_c_min", path, why);
    for (unsigned i = 0; i < s->noise->n_slams && !err; i++)
        err = check_slam(&s->noise->slams[i], i, period_s, path, why);
    for (unsigned i = 0; i < s->noise->n_tones && !err; i++)
        err = check_tone(&s->noise->tones[i], i, period_s, path, why);
    for (unsigned i = 0; i < s->n_interferers && !err; i++)
        err = check_interferer(&s->interferers[i], i, period_s, path, why);
    for (unsigned i = 0; i < s->noise->n_rises && !err; i++) {
        const struct scene_rise *rise = &s->noise->rises[i];
        snprintf(key, sizeof key, "noise.rises[%u].during_s", i);
        err = check_during(rise->during_s, period_s, key, path, why);
        snprintf(key, sizeof key, "noise.rises[%u].by_db", i);
        if (!err)
            err = check_value(rise->by_db, (struct span){-100, 100}, key, path, why);
    }
    for (unsigned k = 0; k < 2; k++)
        for (unsigned i = 0; i < elements[k].n && !err; i++) {
            snprintf(key, sizeof key, "faults.%s[%u]", elements[k].key, i);
            err = check_timed_fault(&elements[k].faults[i], period_s, key, path, why);
        }
    return err;
}

/* Everything keeps still. */
static int check_standing(const struct scene *s, const char *path, struct error *why)
{
    char key[64];
    for (unsigned i = 0; i < s->n_objects; i++) {
        const struct scene_object *o = &s->objects[i];
        if (!o->n_path && !o->present_s && !o->opaque && !o->drawn)
            continue;
        snprintf(key, sizeof key, "objects[%u].%s", i,
                 o->n_path      ? "path"
                 : o->present_s ? "present_s"
                 : o->opaque    ? "opaque"
                                : "drawn");
        return yaml_error_say(why, -EINVAL, path, key,
                              "only a drive has this, and there is no key \"drive\"");
    }
    return check_spans(s, 0, path, why);
}

static int check_ego(const struct scene_drive *d, const char *path, struct error *why)
{
    char key[64];
    int err =
        check_value(d->period_s, (struct span){0.1, 600}, "drive.period_s", path, why);
    for (unsigned k = 0; k < d->n_ego && !err; k++) {
        const struct scene_motion *m = &d->ego[k];
        snprintf(key, sizeof key, "drive.ego[%u].t_s", k);
        err = check_time(m->t_s, k ? m[-1].t_s : 0, k == 0, d->period_s, key, path, why);
        snprintf(key, sizeof key, "drive.ego[%u].speed_m_s", k);
        if (!err)
            err = check_value(m->speed_m_s, (struct span){-30, 30}, key, path, why);
        snprintf(key, sizeof key, "drive.ego[%u].yaw_rate_deg_s", k);
        if (!err)
            err =
                check_value(m->yaw_rate_deg_s, (struct span){-180, 180}, key, path, why);
    }
    return err;
}

static int check_rock(const struct scene_rock *r, const char *path, struct error *why)
{
    static const struct span swing = {0, 0.1}, turn = {0, 5};
    if (!r)
        return 0;
    int err = check_value(r->frequency_hz, (struct span){0, 10},
                          "drive.rock.frequency_hz", path, why);
    if (!err)
        err = check_value(r->forward_m, swing, "drive.rock.forward_m", path, why);
    if (!err)
        err = check_value(r->left_m, swing, "drive.rock.left_m", path, why);
    return err ? err : check_value(r->yaw_deg, turn, "drive.rock.yaw_deg", path, why);
}

static int check_drive(const struct scene *s, const char *path, struct error *why)
{
    if (!s->drive)
        return check_standing(s, path, why);
    int err = check_ego(s->drive, path, why);
    if (!err)
        err = check_rock(s->drive->rock, path, why);
    if (!err && !s->survey.mount)
        err = yaml_error_say(why, -EINVAL, path, "drive",
                             "the key \"mount\" is missing: which way is forward?");
    if (!err && s->survey.stage && s->survey.stage->n_positions > 1)
        err = yaml_error_say(why, -EINVAL, path, "drive",
                             "the array of a drive has no stage");
    if (!err && s->noise->snr_db && !s->noise->at_m)
        err = yaml_error_say(why, -EINVAL, path, "noise.snr_db",
                             "of a drive this needs at_m, the range of a person");
    if (!err && s->n_objects > MOST_OBJECTS)
        err = yaml_error_say(why, -EINVAL, path, "objects",
                             "a drive has up to %d, found %u", MOST_OBJECTS,
                             s->n_objects);
    for (unsigned i = 0; i < s->n_objects && !err; i++)
        err = check_mover(&s->objects[i], i, s->drive->period_s, path, why);
    return err ? err : check_spans(s, s->drive->period_s, path, why);
}

/* Ranges, and keys that belong to another kind of object, or to a drive alone. */
static int check(const struct scene *s, const char *path, struct error *why)
{
    char prefix[32];
    int err = check_world(s, path, why);
    if (!err)
        err = check_faults(s, path, why);
    for (unsigned i = 0; i < s->n_objects && !err; i++) {
        snprintf(prefix, sizeof prefix, "objects[%u].", i);
        err = check_keys(&s->objects[i], prefix, path, why);
        if (!err)
            err = check_object(&s->objects[i], prefix, path, why);
    }
    return err ? err : check_drive(s, path, why);
}

/* -- what is not given -----------------------------------------------------------------
 */

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
        err = check(s, path, why);
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

/* -- another draw of where its wall stands and how its objects go ----------------------
 */

enum { STREAM_WALL = 14, STREAM_PATH = 15 };

void scene_up(const struct survey *s, double up[3])
{
    static const double array_up[3] = {0, 1, 0};
    double z_axis[3];
    memcpy(up, array_up, sizeof array_up);
    if (!s->has_mount)
        return;
    vector_cross(s->mount_x_axis, s->mount_y_axis, z_axis);
    up[0] = s->mount_x_axis[2];
    up[1] = s->mount_y_axis[2];
    up[2] = z_axis[2];
    vector_normalize(up);
}

static double around(struct random *r, double most)
{
    return most * (2 * random_even(r) - 1);
}

/* Turns v around a unit axis (Rodrigues). */
static void turn(const double axis[3], double angle, double v[3])
{
    double across[3], along = vector_dot(axis, v);
    vector_cross(axis, v, across);
    for (int k = 0; k < 3; k++)
        v[k] = cos(angle) * v[k] + sin(angle) * across[k] +
               (1 - cos(angle)) * along * axis[k];
}

static void draw_wall(const struct scene_drawn *drawn, const double up[3], uint32_t seed,
                      struct survey *s)
{
    struct random r;
    random_seed(&r, (uint64_t[]){seed, STREAM_WALL}, 2);
    s->wall_distance_m += around(&r, drawn->wall_m);
    turn(up, around(&r, drawn->wall_deg) * M_PI / 180, s->wall_normal);
    if (s->n_walls) {
        s->walls[0].distance_m = s->wall_distance_m;
        memcpy(s->walls[0].normal, s->wall_normal, sizeof s->wall_normal);
    }
}

/* In the middle between the farthest knots along each axis. */
static void middle_of(const struct scene_object *o, double out[3])
{
    for (int a = 0; a < 3; a++) {
        double from = o->path[0].position_m[a], to = from;
        for (unsigned k = 1; k < o->n_path; k++) {
            from = fmin(from, o->path[k].position_m[a]);
            to = fmax(to, o->path[k].position_m[a]);
        }
        out[a] = (from + to) / 2;
    }
}

/* Each leg takes as long as its speed says; where nobody goes, as long as before. */
static void set_speed(struct scene_object *o, double speed_m_s)
{
    double before_s = o->path[0].t_s;
    for (unsigned k = 1; k < o->n_path; k++) {
        double way_m = leg_m(&o->path[k - 1], &o->path[k]);
        double takes_s = o->path[k].t_s - before_s;
        before_s = o->path[k].t_s;
        o->path[k].t_s = o->path[k - 1].t_s + (way_m > 0 ? way_m / speed_m_s : takes_s);
    }
}

static void draw_path(struct scene_object *o, const double up[3], uint32_t seed,
                      unsigned number)
{
    const struct scene_drawn_path *drawn = o->drawn;
    struct random r;
    double middle[3], shift[3];
    random_seed(&r, (uint64_t[]){seed, STREAM_PATH, number}, 3);
    middle_of(o, middle);
    double angle = around(&r, drawn->turn_deg) * M_PI / 180;
    if (random_even(&r) < 0.5 && drawn->reversed)
        angle += M_PI;
    for (int k = 0; k < 3; k++)
        shift[k] = around(&r, drawn->shift_m[k]);
    for (unsigned k = 0; k < o->n_path; k++) {
        double *p = o->path[k].position_m;
        vector_add(p, -1, middle, p);
        turn(up, angle, p);
        vector_add(p, 1, middle, p);
        vector_add(p, 1, shift, p);
    }
    memcpy(o->position_m, o->path[0].position_m, sizeof o->path[0].position_m);
    double part = random_even(&r);
    if (drawn->speed_m_s)
        set_speed(o, drawn->speed_m_s[0] +
                         part * (drawn->speed_m_s[1] - drawn->speed_m_s[0]));
}

void scene_draw(struct scene *s, struct survey *survey)
{
    double up[3];
    scene_up(survey, up);
    if (s->drawn)
        draw_wall(s->drawn, up, s->seed, survey);
    for (unsigned i = 0; i < s->n_objects; i++)
        if (s->objects[i].drawn)
            draw_path(&s->objects[i], up, s->seed, i);
}
