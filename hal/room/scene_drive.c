/* SPDX-License-Identifier: MIT */
/* hal/room/scene_drive.c -- what a schema cannot say about a drive. */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "hal/room/scene.h"
#include "hal/survey/place.h"

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

static int check_tone(const struct scene_tone *tone, unsigned index, double period_s,
                      const char *path, struct error *why)
{
    char key[64];
    snprintf(key, sizeof key, "noise.tones[%u].frequency_hz", index);
    int err = check_value(tone->frequency_hz, (struct span){1, 1e5}, key, path, why);
    snprintf(key, sizeof key, "noise.tones[%u].rms", index);
    if (!err)
        err = check_value(tone->rms, (struct span){0, 10}, key, path, why);
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

int scene_check_drive(const struct scene *s, const char *path, struct error *why)
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
