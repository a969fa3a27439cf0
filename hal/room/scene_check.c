/* SPDX-License-Identifier: MIT */
/* hal/room/scene_check.c -- what a schema cannot say about a scene: ranges, which keys
 * belong to which kind of object, and what moves of a drive. */
#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "hal/room/scatter.h"
#include "hal/room/scene.h"
#include "hal/yaml_file.h"

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

/* -- what moves of a drive, and keys that only a drive has ------------------------------
 */

enum { MOST_OBJECTS = 64 };

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
    double ends_s = scene_path_ends_s(o, d->speed_m_s[0]);
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
    } kinds[] = {{"speakers", s->faults->speakers, s->faults->n_speakers},
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
        for (unsigned i = 0; i < kinds[k].n && !err; i++) {
            snprintf(key, sizeof key, "faults.%s[%u]", kinds[k].key, i);
            err = check_timed_fault(&kinds[k].faults[i], period_s, key, path, why);
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
    return err ? err : check_drive(s, path, why);
}
