#include "recon/pipeline.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "recon/api/api.h"
#include "recon/processing.h"

#define FULL_SCALE   0.9999f
#define CLIPPED_RUN  3 /* one sample or two at full scale may be a loud sound */
#define MOST_THREADS POOL_MAX_THREADS

struct anlos_pipeline {
    struct pipeline *inside;
    struct pipeline_config cfg;
    struct imager_options options;
    char method[32];
    struct anlos_survey survey;     /* as it is planned for; empty: none is */
    uint64_t survey_id;             /* 0: none */
    size_t clean_samples;           /* room in clean, of each microphone */
    float *clean;                   /* [n_microphones][clean_samples]: without what is not
                                       finite */
    uint32_t *clipped, *not_finite; /* [n_microphones] */
    bool *heard;                    /* [n_speakers] in this round, and its number */
    uint32_t frame;
    struct anlos_image image; /* size 0: none */
    struct object_list list;
    int64_t list_ns;
    bool has_list;
    uint64_t wall_lists; /* of which news was told */
    char note[512];
    struct anlos_health health;
};

/* -- configuration ----------------------------------------------------------------------
 */

void anlos_pipeline_config_fill(struct anlos_pipeline_config *cfg, size_t size, int array)
{
    bool is_static = array == ANLOS_STATIC_ARRAY;
    struct pipeline_config d;

    if (!cfg)
        return;
    pipeline_config_default(&d, is_static);
    const struct anlos_pipeline_config fresh = {
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
static int check_numbers(const struct anlos_pipeline_config *c, struct anlos_error *why)
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

static int take_options(struct anlos_pipeline *p, const struct anlos_pipeline_config *c,
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

static int take_names(struct anlos_pipeline *p, const struct anlos_pipeline_config *c,
                      struct anlos_error *why)
{
    struct frontend_config *f = &p->cfg.frontend;

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
        for (size_t i = 0; anlos_method(i); i++) {
            size_t used = strlen(known);
            snprintf(known + used, sizeof known - used, "%s%s", used ? ", " : "",
                     anlos_method(i));
        }
        return api_fail(why, ANLOS_INVALID,
                        "configuration: method '%s', expected one of %s",
                        c->method ? c->method : "(NULL)", known);
    }
    snprintf(p->method, sizeof p->method, "%s", c->method);
    return take_options(p, c, why);
}

static void take_objects(struct object_tracker_config *t,
                         const struct anlos_pipeline_config *c)
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

static int configure(struct anlos_pipeline *p, const struct anlos_pipeline_config *c,
                     struct anlos_error *why)
{
    static const enum background_mode backgrounds[] = {
        [ANLOS_BACKGROUND_NONE] = BACKGROUND_NONE,
        [ANLOS_BACKGROUND_RECORDED] = BACKGROUND_RECORDED,
        [ANLOS_BACKGROUND_ADAPTIVE] = BACKGROUND_ADAPTIVE};
    struct pipeline_config *cfg = &p->cfg;
    int code = check_numbers(c, why);

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
    take_objects(&cfg->tracker, c);
    cfg->finds_walls = c->walls != ANLOS_WALLS_SURVEY;
    cfg->walls.map.from = c->walls == ANLOS_WALLS_HEARD ? WALL_FROM_ECHOES
                                                        : WALL_FROM_TOPIC;
    cfg->walls.map.lost_s = c->lost_s;
    cfg->walls.listener.reach_m = c->reach_m;
    return 0;
}

/* -- life -------------------------------------------------------------------------------
 */

int anlos_pipeline_create(struct anlos_pipeline **out,
                          const struct anlos_pipeline_config *cfg,
                          const struct anlos_survey *survey, struct anlos_error *why)
{
    struct anlos_pipeline_config own;
    int code = api_there(out, "out", why);

    if (code)
        return code;
    *out = NULL;
    code = API_TAKE(&own, cfg, "struct anlos_pipeline_config", why);
    if (code)
        return code;
    struct anlos_pipeline *p = calloc(1, sizeof *p);
    if (!p)
        return api_fail(why, ANLOS_NO_MEMORY, "pipeline: out of memory");
    code = configure(p, &own, why);
    if (!code) {
        int err = pipeline_create(&p->inside, &p->cfg);
        if (err)
            code = api_fail_inside(why, err, NULL, "pipeline");
    }
    if (!code && survey)
        code = anlos_pipeline_survey(p, survey, why);
    if (code)
        anlos_pipeline_destroy(p);
    else
        *out = p;
    return code;
}

static void forget(struct anlos_pipeline *p)
{
    survey_clear(&p->survey.inside);
    p->survey_id = 0;
    free(p->clean);
    free(p->clipped);
    free(p->not_finite);
    free(p->heard);
    p->clean = NULL;
    p->clipped = p->not_finite = NULL;
    p->heard = NULL;
    p->clean_samples = 0;
    p->frame = 0;
    p->image.size = 0;
    p->has_list = false;
}

void anlos_pipeline_destroy(struct anlos_pipeline *p)
{
    if (!p)
        return;
    api_lock();
    pipeline_destroy(p->inside);
    api_unlock();
    forget(p);
    free(p);
}

static int plan(struct anlos_pipeline *p, const struct survey *survey,
                struct anlos_error *why)
{
    struct error inside = {""};

    p->clipped = calloc(survey->n_microphones, sizeof *p->clipped);
    p->not_finite = calloc(survey->n_microphones, sizeof *p->not_finite);
    p->heard = calloc(survey->n_speakers, sizeof *p->heard);
    if (!p->clipped || !p->not_finite || !p->heard ||
        survey_copy(&p->survey.inside, survey))
        return api_fail(why, ANLOS_NO_MEMORY, "survey: out of memory");
    api_lock();
    int err = pipeline_survey(p->inside, survey, &inside);
    api_unlock();
    return err ? api_fail_inside(why, err, &inside, "survey") : 0;
}

int anlos_pipeline_survey(struct anlos_pipeline *p, const struct anlos_survey *survey,
                          struct anlos_error *why)
{
    int code = api_there(p, "pipeline", why);

    if (!code)
        code = api_survey(survey, why);
    if (code)
        return code;
    uint64_t id = anlos_survey_id(survey);
    if (id == p->survey_id)
        return 0;
    forget(p);
    code = plan(p, &survey->inside, why);
    if (code)
        forget(p);
    else
        p->survey_id = id;
    return code;
}

/* -- pings ------------------------------------------------------------------------------
 */

static int check_ping(const struct anlos_pipeline *p, const struct anlos_ping *ping,
                      struct anlos_error *why)
{
    const struct survey *s = &p->survey.inside;

    if (!p->survey_id)
        return api_fail(why, ANLOS_NOT_READY,
                        "a ping before there is a survey; call anlos_pipeline_survey");
    if (ping->survey && ping->survey != p->survey_id)
        return api_fail(why, ANLOS_INVALID,
                        "a ping of the survey %016llx, but the pipeline is planned for "
                        "%016llx; give it that survey first",
                        (unsigned long long)ping->survey,
                        (unsigned long long)p->survey_id);
    if (ping->n_microphones != s->n_microphones)
        return api_fail(why, ANLOS_INVALID,
                        "a ping of %zu microphones, but the survey has %zu",
                        ping->n_microphones, s->n_microphones);
    if (ping->speaker >= s->n_speakers || ping->position >= s->n_positions)
        return api_fail(why, ANLOS_INVALID,
                        "a ping of speaker %u at position %u, but the survey has %zu and "
                        "%zu, counted from 0",
                        ping->speaker, ping->position, s->n_speakers, s->n_positions);
    if (ping->n_samples < s->slot_samples)
        return api_fail(why, ANLOS_INVALID,
                        "a ping of %zu samples, expected a slot at least, %zu; best are "
                        "%zu",
                        ping->n_samples, s->slot_samples,
                        anlos_survey_ping_samples(&p->survey));
    if (ping->down && !s->chirp_alternates)
        return api_fail(why, ANLOS_INVALID,
                        "a ping whose chirp ran down, but the survey's does not "
                        "alternate");
    if (ping->has_temperature &&
        !(ping->temperature_c >= -60.0 && ping->temperature_c <= 80.0))
        return api_fail(why, ANLOS_INVALID, "a ping in air of %g C, expected -60 to 80",
                        ping->temperature_c);
    if (ping->background && p->cfg.frontend.background == BACKGROUND_NONE)
        return api_fail(why, ANLOS_INVALID,
                        "a ping of the background, but the configuration says none; "
                        "expected ANLOS_BACKGROUND_RECORDED");
    int code = api_there(ping->samples, "samples of a ping", why);
    if (!code)
        code = api_stamp(ping->capture_ns, "capture_ns of a ping", why);
    return code ? code : api_stamp(ping->received_ns, "received_ns of a ping", why);
}

/* Counts what is not finite, and what is at full scale where nobody has. */
static bool look(struct anlos_pipeline *p, const struct anlos_ping *ping)
{
    bool clean = true;

    for (size_t m = 0; m < ping->n_microphones; m++) {
        const float *x = ping->samples + m * ping->n_samples;
        uint32_t broken = 0, clipped = 0, run = 0;
        for (size_t i = 0; i < ping->n_samples; i++) {
            broken += !isfinite(x[i]);
            run = fabsf(x[i]) >= FULL_SCALE ? run + 1 : 0;
            clipped += run == CLIPPED_RUN ? CLIPPED_RUN : run > CLIPPED_RUN;
        }
        p->not_finite[m] = broken;
        p->clipped[m] = ping->clipped ? ping->clipped[m] : clipped;
        p->health.not_finite_samples += broken;
        p->health.clipped_samples += p->clipped[m];
        clean = clean && !broken;
    }
    return clean;
}

/* A copy with zeros in place of what is not finite. */
static const float *scrub(struct anlos_pipeline *p, const struct anlos_ping *ping,
                          struct anlos_error *why)
{
    size_t n = ping->n_microphones * ping->n_samples;

    if (p->clean_samples < ping->n_samples) {
        float *fresh = calloc(n, sizeof *fresh);
        if (!fresh) {
            api_fail(why, ANLOS_NO_MEMORY, "a ping of %zu samples: out of memory", n);
            return NULL;
        }
        free(p->clean);
        p->clean = fresh;
        p->clean_samples = ping->n_samples;
    }
    for (size_t i = 0; i < n; i++)
        p->clean[i] = isfinite(ping->samples[i]) ? ping->samples[i] : 0.0f;
    return p->clean;
}

/* A speaker that is heard again begins another round. */
static uint32_t frame_of(struct anlos_pipeline *p, const struct anlos_ping *ping)
{
    size_t n = p->survey.inside.n_speakers;

    if (!p->cfg.is_static)
        return 0;
    if (ping->frame)
        return ping->frame;
    if (!p->frame || p->heard[ping->speaker]) {
        memset(p->heard, 0, n * sizeof *p->heard);
        p->frame++;
    }
    p->heard[ping->speaker] = true;
    return p->frame;
}

static int64_t received_ns(const struct anlos_pipeline *p, const struct anlos_ping *ping)
{
    double ping_s = (double)ping->n_samples / p->survey.inside.sample_rate_hz;

    return ping->received_ns ? ping->received_ns
                             : ping->capture_ns + llrint(1e9 * ping_s);
}

static void add_note(struct anlos_pipeline *p, const char *text)
{
    size_t used = strlen(p->note);

    if (text[0])
        snprintf(p->note + used, sizeof p->note - used, "%s%s", used ? "; " : "", text);
}

static void count_front(struct anlos_pipeline *p, const struct frontend_output *front)
{
    p->health.microphones = front->faults.n;
    p->health.silent = front->faults.silent;
    p->health.damaged = front->faults.damaged;
    p->health.clipped = front->faults.clipped;
    if (front->outcome == FRONTEND_TRACES && front->traces.blanked) {
        p->health.blanked++;
        add_note(p, "a sound from outside drowned a ping, which is blanked");
    }
}

static int wall_news(struct anlos_pipeline *p)
{
    uint64_t lists;
    int64_t stamp_ns;

    pipeline_known_walls(p->inside, &stamp_ns, &lists);
    int news = lists != p->wall_lists ? ANLOS_NEW_WALLS : 0;
    p->health.wall_lists += lists - p->wall_lists;
    p->wall_lists = lists;
    return news;
}

/* What came of a ping, or of a scan's end. */
static int take_output(struct anlos_pipeline *p, const struct pipeline_output *out)
{
    int news = 0;

    add_note(p, out->note);
    p->health.unfit += out->unfit;
    if (out->image) {
        api_image(&p->image, out->image);
        p->health.images++;
        news |= ANLOS_NEW_IMAGE;
    }
    if (out->objects) {
        p->list = *out->objects;
        p->list_ns = out->image->capture_ns;
        p->has_list = true;
        p->health.lists++;
        news |= ANLOS_NEW_OBJECTS;
    }
    return news | wall_news(p) | (p->note[0] ? ANLOS_NEW_NOTE : 0);
}

static int refuse(struct anlos_pipeline *p, const struct pipeline_output *out,
                  struct anlos_error *why)
{
    p->health.refused++;
    if (out->front->outcome == FRONTEND_LACKS_BACKGROUND)
        return api_fail(why, ANLOS_NOT_READY,
                        "%s; feed that ping with `background` set before",
                        out->front->note[0] ? out->front->note
                                            : "no background of this ping was recorded");
    return api_fail(why, ANLOS_INVALID, "%s",
                    out->front->note[0] ? out->front->note : "this ping cannot be used");
}

static int feed(struct anlos_pipeline *p, const struct ping *ping, int64_t now_ns,
                struct anlos_error *why)
{
    struct pipeline_output out;
    struct error inside = {""};
    int err = pipeline_ping(p->inside, ping, now_ns, &out, &inside);

    count_front(p, out.front);
    add_note(p, out.front->note);
    int news = take_output(p, &out);
    if (out.front->outcome != FRONTEND_TRACES && out.front->outcome != FRONTEND_KEPT)
        return refuse(p, &out, why);
    p->health.pings++;
    return err ? api_fail_inside(why, err, &inside, "objects") : news;
}

int anlos_pipeline_ping(struct anlos_pipeline *p, const struct anlos_ping *ping,
                        struct anlos_error *why)
{
    struct anlos_ping own;
    int code = api_there(p, "pipeline", why);

    if (code)
        return code;
    p->note[0] = 0;
    code = API_TAKE(&own, ping, "struct anlos_ping", why);
    if (!code)
        code = check_ping(p, &own, why);
    if (code) {
        p->health.refused++;
        return code;
    }
    const float *samples = look(p, &own) ? own.samples : scrub(p, &own, why);
    if (!samples)
        return ANLOS_NO_MEMORY;
    const struct ping inside = {
        .survey_id = p->survey_id,
        .capture_ns = own.capture_ns,
        .scan = own.scan,
        .frame = frame_of(p, &own),
        .pass = own.background ? PASS_BACKGROUND : PASS_SCENE,
        .position = own.position,
        .speaker = own.speaker,
        .stage_m = p->survey.inside.stage_positions_m[own.position],
        .temperature_c = own.has_temperature ? own.temperature_c : NAN,
        .down = own.down,
        .valid = true,
        .n_microphones = own.n_microphones,
        .n_samples = own.n_samples,
        .samples = samples,
        .clipped = p->clipped,
        .not_finite = p->not_finite};
    return feed(p, &inside, received_ns(p, &own), why);
}

int anlos_pipeline_finish(struct anlos_pipeline *p, struct anlos_error *why)
{
    struct pipeline_output out;
    struct error inside = {""};
    int code = api_there(p, "pipeline", why);

    if (code)
        return code;
    if (!p->survey_id)
        return api_fail(why, ANLOS_NOT_READY, "a scan's end before there is a survey");
    p->note[0] = 0;
    int err = pipeline_finish(p->inside, &out, &inside);
    int news = take_output(p, &out);
    return err ? api_fail_inside(why, err, &inside, "objects") : news;
}

/* -- motion, air, walls -----------------------------------------------------------------
 */

int anlos_pipeline_ego(struct anlos_pipeline *p, double speed_m_s, double yaw_rate_rad_s,
                       int64_t capture_ns, struct anlos_error *why)
{
    const struct ego_motion motion = {speed_m_s, yaw_rate_rad_s};
    struct error inside = {""};
    int code = api_there(p, "pipeline", why);

    if (!code)
        code = api_stamp(capture_ns, "capture_ns of ego motion", why);
    if (code)
        return code;
    if (!ego_motion_is_plausible(&motion))
        return api_fail(why, ANLOS_INVALID,
                        "a vehicle with %g m/s and %g rad/s, expected up to %g and %g",
                        speed_m_s, yaw_rate_rad_s, EGO_FASTEST_M_S, EGO_FASTEST_RAD_S);
    p->note[0] = 0;
    int err = pipeline_ego(p->inside, &motion, capture_ns, capture_ns, &inside);
    int news = wall_news(p);
    return err ? api_fail_inside(why, err, &inside, "ego motion") : news;
}

int anlos_pipeline_air(struct anlos_pipeline *p, double temperature_c,
                       struct anlos_error *why)
{
    int code = api_there(p, "pipeline", why);

    if (code)
        return code;
    if (!(temperature_c >= -60.0 && temperature_c <= 80.0))
        return api_fail(why, ANLOS_INVALID, "air of %g C, expected -60 to 80",
                        temperature_c);
    pipeline_temperature(p->inside, temperature_c);
    return 0;
}

int anlos_pipeline_walls(struct anlos_pipeline *p, const struct anlos_wall *walls,
                         size_t n, int64_t capture_ns, struct anlos_error *why)
{
    struct walls inside;
    struct error said = {""};
    int code = api_there(p, "pipeline", why);

    if (!code)
        code = api_walls(&inside, walls, n, why);
    if (!code)
        code = api_stamp(capture_ns, "capture_ns of walls", why);
    if (code)
        return code;
    bool finds = p->cfg.finds_walls;
    if (finds && p->cfg.walls.map.from == WALL_FROM_ECHOES)
        return api_fail(why, ANLOS_INVALID,
                        "walls, but the configuration says that they are heard; expected "
                        "ANLOS_WALLS_GIVEN or ANLOS_WALLS_SURVEY");
    p->note[0] = 0;
    int err = finds ? pipeline_given(p->inside, &inside, capture_ns, capture_ns, &said)
                    : pipeline_walls(p->inside, &inside, capture_ns, &said);
    int news = wall_news(p);
    return err ? api_fail_inside(why, err, &said, "walls") : news;
}

/* -- out --------------------------------------------------------------------------------
 */

int anlos_pipeline_image(const struct anlos_pipeline *p, struct anlos_image *out,
                         struct anlos_error *why)
{
    int code = api_there(p, "pipeline", why);

    if (code)
        return code;
    if (!p->image.size)
        return api_fail(why, ANLOS_NOT_READY,
                        "there is no image yet: feed pings until one is news, or say "
                        "anlos_pipeline_finish");
    return API_GIVE(out, &p->image, "struct anlos_image", why);
}

static int check_list(const struct anlos_pipeline *p, struct anlos_error *why)
{
    int code = api_there(p, "pipeline", why);

    if (!code && !p->has_list)
        code = api_fail(why, ANLOS_NOT_READY,
                        "there is no list of objects yet: one comes with each image");
    return code;
}

int anlos_pipeline_list(const struct anlos_pipeline *p, struct anlos_list *out,
                        struct anlos_error *why)
{
    struct anlos_list own;
    int code = check_list(p, why);

    if (code)
        return code;
    api_list(&own, &p->list, p->list_ns);
    return API_GIVE(out, &own, "struct anlos_list", why);
}

int anlos_pipeline_object(const struct anlos_pipeline *p, size_t i,
                          struct anlos_object *out, struct anlos_error *why)
{
    struct anlos_object own;
    int code = check_list(p, why);

    if (!code && i >= p->list.n)
        code = api_fail(why, ANLOS_INVALID, "object %zu of %zu, counted from 0", i,
                        p->list.n);
    if (code)
        return code;
    api_object(&own, &p->list.objects[i]);
    return API_GIVE(out, &own, "struct anlos_object", why);
}

/* Before somebody has told of them they are the survey's. */
static void known_walls(const struct anlos_pipeline *p, struct walls *out)
{
    uint64_t lists;
    int64_t stamp_ns;
    const struct walls *known = pipeline_known_walls(p->inside, &stamp_ns, &lists);

    if (known)
        *out = *known;
    else
        walls_from_survey(out, &p->survey.inside);
}

size_t anlos_pipeline_n_walls(const struct anlos_pipeline *p)
{
    struct walls known = {.n = 0};

    if (p && p->survey_id)
        known_walls(p, &known);
    return known.n;
}

int anlos_pipeline_wall(const struct anlos_pipeline *p, size_t i, struct anlos_wall *out,
                        struct anlos_error *why)
{
    struct anlos_wall own;
    struct walls known;
    size_t n = anlos_pipeline_n_walls(p);
    int code = api_there(p, "pipeline", why);

    if (!code && i >= n)
        code = api_fail(why, ANLOS_INVALID, "wall %zu of %zu, counted from 0", i, n);
    if (code)
        return code;
    known_walls(p, &known);
    api_wall(&own, &known, i);
    return API_GIVE(out, &own, "struct anlos_wall", why);
}

const char *anlos_pipeline_note(const struct anlos_pipeline *p)
{
    return p ? p->note : "";
}

int anlos_pipeline_health(const struct anlos_pipeline *p, struct anlos_health *out,
                          struct anlos_error *why)
{
    int code = api_there(p, "pipeline", why);

    if (code)
        return code;
    struct track_counts counts = object_tracker_counts(pipeline_tracker(p->inside));
    struct anlos_health own = p->health;
    own.size = sizeof own;
    own.late_images = counts.late;
    own.crowded = counts.crowded;
    own.sound_speed_m_s = p->survey_id ? p->survey.inside.sound_speed_m_s : 0.0;
    return API_GIVE(out, &own, "struct anlos_health", why);
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
        for (const char *m = o->methods; *m; m += strlen(m) + 1) {
            size_t used = strlen(methods);
            snprintf(methods + used, methods_size - used, "%s%s", used ? ", " : "", m);
        }
    }
    return o->name;
}
