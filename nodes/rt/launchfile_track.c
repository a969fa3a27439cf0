#include "nodes/rt/launchfile_track.h"

#include <errno.h>
#include <string.h>

#include "hal/survey/place.h"
#include "recon/track_life.h"

const struct launch_track launch_track_default = {.threshold_db = 12.0,
                                                  .min_existence = 0.5,
                                                  .cfar = CFAR_OFF,
                                                  .false_alarm_rate = 1e-4,
                                                  .mode = OBJECT_TRACKER_AUTO,
                                                  .confirm_hits = 3,
                                                  .confirm_of = 5,
                                                  .confirm_existence = 0.9,
                                                  .detection_probability = 0.8,
                                                  .clutter = 0.2,
                                                  .sidelobe_db = 4.0,
                                                  .look_s = 0.2,
                                                  .acceleration_psd = 0.5,
                                                  .join_m = 0.5,
                                                  .coast_s = 1.5};

static int check(const struct launchfile *l, struct error *why)
{
    const struct launch_track *t = &l->track;
    const struct {
        const char *key;
        double value, min, max;
    } numbers[] = {
        {"track.threshold_db", t->threshold_db, 0, 120},
        {"track.min_existence", t->min_existence, 0, 1},
        {"track.false_alarm_rate", t->false_alarm_rate, 1e-12, 0.5},
        {"track.confirm_of", t->confirm_of, 1, TRACK_LOOKS_MAX},
        {"track.confirm_hits", t->confirm_hits, 1, t->confirm_of},
        {"track.confirm_existence", t->confirm_existence, 0, 0.998},
        {"track.detection_probability", t->detection_probability, 0.01, 0.99},
        {"track.clutter", t->clutter, 1e-6, 1000},
        {"track.look_s", t->look_s, 0, 10},
        {"track.sidelobe_db", t->sidelobe_db, 0.1, 200},
        {"track.acceleration_psd", t->acceleration_psd, 1e-6, 1000},
        {"track.join_m", t->join_m, 0, 10},
        {"track.coast_s", t->coast_s, 0.01, 60},
    };
    int err = 0;

    for (size_t i = 0; !err && i < sizeof numbers / sizeof *numbers; i++)
        err = yaml_check_range(l->path, numbers[i].key, numbers[i].value, numbers[i].min,
                               numbers[i].max, why);
    return err;
}

static int copy_mode(struct launchfile *l, const char *mode, struct error *why)
{
    static const char *const names[] = {[OBJECT_TRACKER_AUTO] = "auto",
                                        [OBJECT_TRACKER_LISTS] = "lists",
                                        [OBJECT_TRACKER_TRACKS] = "tracks"};

    for (unsigned i = 0; mode && i < sizeof names / sizeof *names; i++) {
        if (strcmp(mode, names[i]))
            continue;
        l->track.mode = (enum object_tracker_mode)i;
        return 0;
    }
    return mode ? yaml_error_say(why, -EINVAL, l->path, "track.mode",
                                 "expected auto, lists or tracks, not %s", mode)
                : 0;
}

int launchfile_copy_track(struct launchfile *l, const struct launch_text *t,
                          struct error *why)
{
    const struct launch_text_track *from = &t->track;
    const struct {
        const double *value;
        double *to;
    } numbers[] = {
        {from->threshold_db, &l->track.threshold_db},
        {from->min_existence, &l->track.min_existence},
        {from->false_alarm_rate, &l->track.false_alarm_rate},
        {from->confirm_existence, &l->track.confirm_existence},
        {from->detection_probability, &l->track.detection_probability},
        {from->clutter, &l->track.clutter},
        {from->look_s, &l->track.look_s},
        {from->sidelobe_db, &l->track.sidelobe_db},
        {from->acceleration_psd, &l->track.acceleration_psd},
        {from->join_m, &l->track.join_m},
        {from->coast_s, &l->track.coast_s},
    };

    l->track = launch_track_default;
    if (l->scan.fixed)
        l->track.cfar = CFAR_ORDERED;
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        if (numbers[i].value)
            *numbers[i].to = *numbers[i].value;
    if (from->confirm_hits)
        l->track.confirm_hits = *from->confirm_hits;
    if (from->confirm_of)
        l->track.confirm_of = *from->confirm_of;
    if (from->cfar && cfar_kind_from_name(from->cfar, &l->track.cfar))
        return yaml_error_say(why, -EINVAL, l->path, "track.cfar",
                              "expected off, averaging or ordered, not %s", from->cfar);
    int err = copy_mode(l, from->mode, why);
    return err ? err : check(l, why);
}
