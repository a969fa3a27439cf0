/* SPDX-License-Identifier: MIT */
/* hal/room/scene_check.c -- what a schema cannot say about a scene: ranges, and which
 * keys belong to which kind of object. */
#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "hal/room/scatter.h"
#include "hal/room/scene.h"
#include "hal/survey/place.h"

struct rule {
    const char *key;
    double value, min, max;
};

static int check_rules(const struct rule *rules, size_t n, const char *prefix,
                       const char *path, struct error *why)
{
    char key[96];
    for (size_t i = 0; i < n; i++) {
        if (rules[i].value >= rules[i].min && rules[i].value <= rules[i].max)
            continue;
        snprintf(key, sizeof key, "%s%s", prefix, rules[i].key);
        return yaml_error_say(why, -EINVAL, path, key, "%g is outside %g..%g",
                              rules[i].value, rules[i].min, rules[i].max);
    }
    return 0;
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

int scene_check(const struct scene *s, const char *path, struct error *why)
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
    return err;
}
