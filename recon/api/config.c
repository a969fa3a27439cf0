/* SPDX-License-Identifier: MIT */
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "dsp/error.h"
#include "recon/api/api.h"

#define MOST_THREADS POOL_MAX_THREADS

void anlos_config_fill(struct anlos_config *cfg, size_t size, int array)
{
    bool is_static = array == ANLOS_STATIC_ARRAY;
    struct pipeline_config d;

    if (!cfg)
        return;
    pipeline_config_default(&d, is_static);
    const struct anlos_config fresh = {
        .size = size,
        .array = array,
        .threads = d.array.threads,
        .window = window_name(d.frontend.window),
        .compression = compression_name(d.frontend.compression),
        .background = is_static ? ANLOS_BACKGROUND_ADAPTIVE : ANLOS_BACKGROUND_NONE,
        .background_s = d.frontend.background_s,
        .method = d.scan.method,
        .threshold_db = d.tracker.detector.threshold_db,
        .min_existence = d.tracker.detector.min_existence,
        .false_alarm_rate = is_static ? d.tracker.detector.false_alarm_rate : 0.0,
        .confirm_hits = d.tracker.track.life.confirm_hits,
        .confirm_of = d.tracker.track.life.confirm_of,
        .confirm_existence = d.tracker.track.life.confirm_existence,
        .coast_s = d.tracker.track.coast_s,
        .walls = ANLOS_WALLS_SURVEY,
        .reach_m = d.walls.listener.reach_m,
        .lost_s = d.walls.map.lost_s};
    memset(cfg, 0, size);
    memcpy(cfg, &fresh, size < sizeof fresh ? size : sizeof fresh);
}

/* Numbers that inside believes: the launch file checks them there. */
static int check_numbers(const struct anlos_config *c, struct anlos_error *why)
{
    const struct {
        const char *name;
        double value, min, max;
    } numbers[] = {
        {"array", c->array, ANLOS_SCAN, ANLOS_STATIC_ARRAY},
        {"threads", (double)c->threads, 1, MOST_THREADS},
        {"background", c->background, ANLOS_BACKGROUND_NONE, ANLOS_BACKGROUND_ADAPTIVE},
        {"background_s", c->background_s, 1e-3, 3600},
        {"image_pings", (double)c->image_pings, 0, FRAMES_MAX_PINGS},
        {"frame_pings", (double)c->frame_pings, 0, SURVEY_MAX_ELEMENTS},
        {"threshold_db", c->threshold_db, 0, 60},
        {"min_existence", c->min_existence, 0, 1},
        {"false_alarm_rate", c->false_alarm_rate, 0, 0.5},
        {"confirm_of", c->confirm_of, 1, TRACK_LOOKS_MAX},
        {"confirm_hits", c->confirm_hits, 1, c->confirm_of},
        {"confirm_existence", c->confirm_existence, 0, 0.998},
        {"coast_s", c->coast_s, 0.01, 60},
        {"walls", c->walls, ANLOS_WALLS_SURVEY, ANLOS_WALLS_HEARD},
        {"reach_m", c->reach_m, 0.3, 20},
        {"lost_s", c->lost_s, 0.1, 600},
    };

    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        if (!(numbers[i].value >= numbers[i].min && numbers[i].value <= numbers[i].max))
            return api_fail(why, ANLOS_INVALID,
                            "configuration: %s is %g, expected %g to %g", numbers[i].name,
                            numbers[i].value, numbers[i].min, numbers[i].max);
    if (c->background == ANLOS_BACKGROUND_ADAPTIVE && c->array == ANLOS_SCAN)
        return api_fail(why, ANLOS_INVALID,
                        "configuration: an adaptive background is of a static array; "
                        "expected none or recorded for a scan");
    if (c->false_alarm_rate > 0.0 && c->false_alarm_rate < 1e-12)
        return api_fail(why, ANLOS_INVALID,
                        "configuration: false_alarm_rate is %g, expected 0, or 1e-12 to "
                        "0.5",
                        c->false_alarm_rate);
    return 0;
}

static int take_options(struct api_config *p, const struct anlos_config *c,
                        struct anlos_error *why)
{
    char said[256];

    imager_options_default(&p->options);
    if (c->n_options && !c->options)
        return api_fail(why, ANLOS_INVALID, "configuration: options is NULL");
    for (size_t i = 0; i < c->n_options; i++) {
        if (!c->options[i])
            return api_fail(why, ANLOS_INVALID, "configuration: option %zu is NULL", i);
        if (imager_option_set(&p->options, c->options[i], said, sizeof said))
            return api_fail(why, ANLOS_INVALID, "configuration: option %s: %s",
                            c->options[i], said);
    }
    if (imager_options_check(&p->options, p->method, said, sizeof said))
        return api_fail(why, ANLOS_INVALID, "configuration: %s", said);
    return 0;
}

static int take_names(struct api_config *p, const struct anlos_config *c,
                      struct anlos_error *why)
{
    struct frontend_config *f = &p->inside.frontend;

    if (!c->window || window_from_name(c->window, &f->window))
        return api_fail(why, ANLOS_INVALID,
                        "configuration: window '%s', expected hann, hamming or "
                        "rectangular",
                        c->window ? c->window : "(NULL)");
    if (!c->compression || compression_from_name(c->compression, &f->compression))
        return api_fail(why, ANLOS_INVALID,
                        "configuration: compression '%s', expected matched_filter or "
                        "deramp",
                        c->compression ? c->compression : "(NULL)");
    if (!c->method || !imager_has_method(c->method)) {
        char known[256] = "";
        for (size_t i = 0; anlos_method(i); i++)
            text_add(known, sizeof known, ", ", "%s", anlos_method(i));
        return api_fail(why, ANLOS_INVALID,
                        "configuration: method '%s', expected one of %s",
                        c->method ? c->method : "(NULL)", known);
    }
    snprintf(p->method, sizeof p->method, "%s", c->method);
    return take_options(p, c, why);
}

static void take_objects(struct object_tracker_config *t, const struct anlos_config *c)
{
    t->detector.threshold_db = c->threshold_db;
    t->detector.min_existence = c->min_existence;
    t->detector.cfar = c->false_alarm_rate > 0.0 ? CFAR_ORDERED : CFAR_OFF;
    if (c->false_alarm_rate > 0.0)
        t->detector.false_alarm_rate = c->false_alarm_rate;
    t->mode = c->lists ? OBJECT_TRACKER_LISTS : OBJECT_TRACKER_AUTO;
    t->track.life.confirm_hits = c->confirm_hits;
    t->track.life.confirm_of = c->confirm_of;
    t->track.life.confirm_existence = c->confirm_existence;
    t->track.coast_s = c->coast_s;
    t->walls_s = c->lost_s;
}

int api_configure(struct api_config *p, const struct anlos_config *given,
                  struct anlos_error *why)
{
    static const enum background_mode backgrounds[] = {
        [ANLOS_BACKGROUND_NONE] = BACKGROUND_NONE,
        [ANLOS_BACKGROUND_RECORDED] = BACKGROUND_RECORDED,
        [ANLOS_BACKGROUND_ADAPTIVE] = BACKGROUND_ADAPTIVE};
    struct pipeline_config *cfg = &p->inside;
    struct anlos_config own, *c = &own;
    int code = api_take(c, sizeof *c, offsetof(struct anlos_config, stop), given,
                        "struct anlos_config", why);

    if (!code)
        code = check_numbers(c, why);
    if (code)
        return code;
    pipeline_config_default(cfg, c->array == ANLOS_STATIC_ARRAY);
    code = take_names(p, c, why);
    if (code)
        return code;
    cfg->frontend.background = backgrounds[c->background];
    cfg->frontend.background_s = c->background_s;
    cfg->array.threads = cfg->scan.threads = c->threads;
    cfg->array.frame_pings = c->frame_pings;
    cfg->array.pings = c->image_pings;
    cfg->array.sum = c->coherent ? FRAMES_COHERENT : FRAMES_POWER;
    cfg->array.every_ping = c->every_ping;
    cfg->array.moving_only = c->background == ANLOS_BACKGROUND_ADAPTIVE;
    cfg->scan.method = p->method;
    cfg->scan.options = &p->options;
    cfg->scan.stop = c->stop;
    cfg->scan.stop_ctx = c->stop_ctx;
    take_objects(&cfg->tracker, c);
    cfg->finds_walls = c->walls != ANLOS_WALLS_SURVEY;
    cfg->walls.map.from = c->walls == ANLOS_WALLS_HEARD ? WALL_FROM_ECHOES
                                                        : WALL_FROM_TOPIC;
    cfg->walls.map.lost_s = c->lost_s;
    cfg->walls.listener.reach_m = c->reach_m;
    return 0;
}

/* -- methods ----------------------------------------------------------------------------
 */

const char *anlos_method(size_t i)
{
    const char *m = imager_methods();

    while (*m && i--)
        m += strlen(m) + 1;
    return *m ? m : NULL;
}

const char *anlos_option(size_t i, const char **help, char *methods, size_t methods_size)
{
    const struct imager_option *o = imager_option_table;

    while (o->name && i--)
        o++;
    if (!o->name)
        return NULL;
    if (help)
        *help = o->help;
    if (methods && methods_size) {
        methods[0] = 0;
        for (const char *m = o->methods; *m; m += strlen(m) + 1)
            text_add(methods, methods_size, ", ", "%s", m);
    }
    return o->name;
}
