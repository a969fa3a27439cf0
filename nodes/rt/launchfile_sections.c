/* SPDX-License-Identifier: MIT */
#include "nodes/rt/launchfile_sections.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/yaml_file.h"
#include "nodes/rt/uri.h"
#include "recon/tracking/object_tracker.h"
#include "recon/walls/wall_finder.h"

/* -- scan -------------------------------------------------------------------------------
 */

enum { DEFAULT_FRAMES = 8, MOST_FRAMES = 1000 };
#define DEFAULT_BACKGROUND_S 10.0
#define MOST_BACKGROUND_S    3600.0

static int copy_mode(struct launchfile *l, const struct launch_text *t, struct error *why)
{
    const char *mode = t->scan.mode ? t->scan.mode : "stepped";

    l->scan.fixed = !strcmp(mode, "fixed");
    l->scan.continuous = !strcmp(mode, "continuous");
    if (l->scan.fixed || l->scan.continuous || !strcmp(mode, "stepped"))
        return 0;
    return yaml_error_say(why, -EINVAL, l->path, "scan.mode",
                          "expected stepped, continuous or fixed, not %s", mode);
}

static int refuse_of_stepped(const struct launchfile *l, const struct launch_text *t,
                             struct error *why)
{
    const char *key = t->scan.speakers_count      ? "scan.speakers"
                      : t->scan.background_frames ? "scan.background_frames"
                      : t->dsp.background_s       ? "dsp.background_s"
                      : t->dsp.background         ? "dsp.background"
                                                  : NULL;

    return key && !l->scan.fixed
               ? yaml_error_say(why, -EINVAL, l->path, key,
                                "is of an array that stands; expected it with scan.mode: "
                                "fixed")
               : 0;
}

static int copy_speakers(struct launchfile *l, const struct launch_text *t,
                         struct error *why)
{
    size_t n = t->scan.speakers_count;

    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < i; k++)
            if (t->scan.speakers[k] == t->scan.speakers[i])
                return yaml_error_say(why, -EINVAL, l->path, "scan.speakers",
                                      "expected each speaker once, but %u is there twice",
                                      t->scan.speakers[i]);
    if (!n)
        return 0;
    l->scan.speakers = malloc(n * sizeof *l->scan.speakers);
    if (!l->scan.speakers)
        return -ENOMEM;
    memcpy(l->scan.speakers, t->scan.speakers, n * sizeof *l->scan.speakers);
    l->scan.n_speakers = n;
    return 0;
}

static int copy_frames(struct launchfile *l, const struct launch_text *t,
                       struct error *why)
{
    unsigned frames = t->scan.background_frames ? *t->scan.background_frames
                                                : DEFAULT_FRAMES;

    l->scan.background_frames = frames;
    if (frames >= 1 && frames <= MOST_FRAMES)
        return 0;
    return yaml_error_say(why, -EINVAL, l->path, "scan.background_frames",
                          "expected 1 to %d, not %u", MOST_FRAMES, frames);
}

static int copy_background(struct launchfile *l, const struct launch_text *t,
                           struct error *why)
{
    static const char *const names[] = {[BACKGROUND_NONE] = "none",
                                        [BACKGROUND_RECORDED] = "recorded",
                                        [BACKGROUND_ADAPTIVE] = "adaptive"};
    const char *name = t->dsp.background;
    double s = t->dsp.background_s ? *t->dsp.background_s : DEFAULT_BACKGROUND_S;
    unsigned mode = l->scan.background ? BACKGROUND_RECORDED : BACKGROUND_NONE;

    for (mode = name ? 0 : mode; name && mode <= BACKGROUND_ADAPTIVE; mode++)
        if (!strcmp(names[mode], name))
            break;
    if (mode > BACKGROUND_ADAPTIVE)
        return yaml_error_say(why, -EINVAL, l->path, "dsp.background",
                              "expected none, recorded or adaptive, not %s", name);
    if ((mode == BACKGROUND_RECORDED) != l->scan.background)
        return yaml_error_say(why, -EINVAL, l->path, "dsp.background",
                              "%s does not go with scan.background: %s, which says "
                              "whether one is recorded",
                              names[mode], l->scan.background ? "true" : "false");
    if (!(s > 0 && s <= MOST_BACKGROUND_S))
        return yaml_error_say(why, -EINVAL, l->path, "dsp.background_s",
                              "expected over 0 and up to %g, not %g", MOST_BACKGROUND_S,
                              s);
    l->dsp.background = (enum background_mode)mode;
    l->dsp.background_s = s;
    return 0;
}

int launchfile_copy_scan(struct launchfile *l, const struct launch_text *t,
                         struct error *why)
{
    l->scan.background = t->scan.background && *t->scan.background;
    int err = copy_mode(l, t, why);
    if (!err)
        err = refuse_of_stepped(l, t, why);
    if (!err)
        err = copy_speakers(l, t, why);
    if (!err)
        err = copy_frames(l, t, why);
    if (!err)
        err = copy_background(l, t, why);
    return err;
}

void launchfile_free_scan(struct launchfile *l)
{
    free(l->scan.speakers);
}

/* -- frames -----------------------------------------------------------------------------
 */

static int refuse_frames_of_stepped(const struct launchfile *l,
                                    const struct launch_text *t, struct error *why)
{
    const struct launch_text_frames *f = &t->recon.frames;

    if (l->scan.fixed || !(f->pings || f->sum || f->every))
        return 0;
    return yaml_error_say(why, -EINVAL, l->path, "recon.frames",
                          "is of an array that stands; expected it with scan.mode: "
                          "fixed");
}

static int refuse_of_fixed(const struct launchfile *l, const struct launch_text *t,
                           struct error *why)
{
    bool has_option = false;

    if (!l->scan.fixed)
        return 0;
    for (const struct imager_option *i = imager_option_table; i->name; i++)
        has_option = has_option || launch_text_option(t, i->name);
    const char *key = t->recon.method    ? "recon.method"
                      : has_option       ? "recon.options"
                      : t->recon.preview ? "recon.preview"
                                         : NULL;
    if (!key)
        return 0;
    return yaml_error_say(why, -EINVAL, l->path, key,
                          "is for scans: with scan.mode: fixed expected recon.frames");
}

static int copy(struct launchfile *l, const struct launch_text *t, struct error *why)
{
    const struct launch_text_frames *f = &t->recon.frames;
    const char *sum = f->sum ? f->sum : "power", *every = f->every ? f->every : "frame";

    l->recon.frames.pings = f->pings ? *f->pings : 0;
    l->recon.frames.sum = strcmp(sum, "power") ? FRAMES_COHERENT : FRAMES_POWER;
    l->recon.frames.every_ping = !strcmp(every, "ping");
    if (l->recon.frames.pings > FRAMES_MAX_PINGS)
        return yaml_error_say(why, -EINVAL, l->path, "recon.frames.pings",
                              "expected 0 to %d, not %u", FRAMES_MAX_PINGS,
                              l->recon.frames.pings);
    if (strcmp(sum, "power") && strcmp(sum, "coherent"))
        return yaml_error_say(why, -EINVAL, l->path, "recon.frames.sum",
                              "expected coherent or power, not %s", sum);
    if (strcmp(every, "ping") && strcmp(every, "frame"))
        return yaml_error_say(why, -EINVAL, l->path, "recon.frames.every",
                              "expected ping or frame, not %s", every);
    return 0;
}

int launchfile_copy_frames(struct launchfile *l, const struct launch_text *t,
                           struct error *why)
{
    int err = refuse_frames_of_stepped(l, t, why);

    if (!err)
        err = refuse_of_fixed(l, t, why);
    return err ? err : copy(l, t, why);
}

/* -- track ------------------------------------------------------------------------------
 */

/* As the stage has it where nothing is said. */
static void track_default(struct launch_track *out, bool fixed)
{
    struct object_tracker_config d;

    object_tracker_config_default(&d, fixed);
    *out = (struct launch_track){.threshold_db = d.detector.threshold_db,
                                 .min_existence = d.detector.min_existence,
                                 .cfar = d.detector.cfar,
                                 .false_alarm_rate = d.detector.false_alarm_rate,
                                 .mode = d.mode,
                                 .confirm_hits = d.track.life.confirm_hits,
                                 .confirm_of = d.track.life.confirm_of,
                                 .confirm_existence = d.track.life.confirm_existence,
                                 .detection_probability = d.track.detection_probability,
                                 .clutter = d.clutter,
                                 .sidelobe_db = d.sidelobe_db,
                                 .look_s = d.look_s,
                                 .acceleration_psd = d.track.acceleration_psd_m2_s3,
                                 .join_m = d.track.join_m,
                                 .coast_s = d.track.coast_s};
}

static int check_track(const struct launchfile *l, struct error *why)
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

static int copy_track_mode(struct launchfile *l, const char *mode, struct error *why)
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

    track_default(&l->track, l->scan.fixed);
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
    int err = copy_track_mode(l, from->mode, why);
    return err ? err : check_track(l, why);
}

/* -- wall -------------------------------------------------------------------------------
 */

#define COUNT(a) (sizeof(a) / sizeof((a)[0]))

static int copy_names(struct launchfile *l, const struct launch_text_wall *t,
                      struct error *why)
{
    static const char *const from[] = {[WALL_FROM_SURVEY] = "survey",
                                       [WALL_FROM_TOPIC] = "topic",
                                       [WALL_FROM_ECHOES] = "echoes"};
    const char *prior = t->prior ? t->prior : "vertical";
    size_t k = 0;

    while (t->from && k < COUNT(from) && strcmp(t->from, from[k]) != 0)
        k++;
    if (k == COUNT(from))
        return yaml_error_say(why, -EINVAL, l->path, "wall.from",
                              "expected survey, topic or echoes, not %s", t->from);
    l->wall.from = (enum wall_from)k;
    l->wall.vertical = !strcmp(prior, "vertical");
    if (!l->wall.vertical && strcmp(prior, "none") != 0)
        return yaml_error_say(why, -EINVAL, l->path, "wall.prior",
                              "expected vertical or none, not %s", prior);
    return 0;
}

static int copy_numbers(struct launchfile *l, const struct launch_text_wall *t,
                        struct error *why)
{
    struct wall_finder_config d;
    wall_finder_config_default(&d);
    const struct {
        const char *key;
        const double *text;
        double *value, otherwise, min, max;
    } numbers[] = {
        {"wall.vertical_deg", t->vertical_deg, &l->wall.vertical_deg,
         d.map.vertical_rad * 180.0 / M_PI, 0.1, 20.0},
        {"wall.reach_m", t->reach_m, &l->wall.reach_m, d.listener.reach_m, 0.3, 20.0},
        {"wall.every_s", t->every_s, &l->wall.every_s, d.listener.every_s, 0.05, 60.0},
        {"wall.lost_s", t->lost_s, &l->wall.lost_s, d.map.lost_s, 0.1, 600.0},
    };

    for (size_t i = 0; i < COUNT(numbers); i++) {
        double value = numbers[i].text ? *numbers[i].text : numbers[i].otherwise;
        int err = yaml_check_range(l->path, numbers[i].key, value, numbers[i].min,
                                   numbers[i].max, why);
        if (err)
            return err;
        *numbers[i].value = value;
    }
    return 0;
}

static int copy_free_view(struct launchfile *l, const struct launch_text_wall *t,
                          struct error *why)
{
    if (t->free_view_m_count == 1 || t->free_view_m_count == 2)
        return yaml_error_say(why, -EINVAL, l->path, "wall.free_view_m",
                              "expected at least 3 corners, each [x, z]");
    for (unsigned i = 0; i < t->free_view_m_count; i++)
        for (int a = 0; a < 2; a++) {
            char key[48];
            double x = t->free_view_m[i][a];
            snprintf(key, sizeof key, "wall.free_view_m[%u]", i);
            if (!(fabs(x) <= 1000.0))
                return yaml_error_say(why, -EINVAL, l->path, key,
                                      "expected [x, z] within 1000 m, not %g", x);
            l->wall.free_view_m[i][a] = x;
        }
    l->wall.n_corners = t->free_view_m_count;
    return 0;
}

int launchfile_copy_wall(struct launchfile *l, const struct launch_text *t,
                         struct error *why)
{
    int err = copy_names(l, &t->wall, why);

    if (!err)
        err = copy_numbers(l, &t->wall, why);
    return err ? err : copy_free_view(l, &t->wall, why);
}

/* -- view -------------------------------------------------------------------------------
 */

int launchfile_copy_view(struct launchfile *l, const struct launch_text *t,
                         struct error *why)
{
    unsigned port = t->view.port ? *t->view.port : 8765;

    if (port > 65535)
        return yaml_error_say(why, -EINVAL, l->path, "view.port",
                              "expected 0 (any) to 65535, not %u", port);
    l->view.port = port;
    l->view.save = t->view.save && *t->view.save;
    l->view.address = strdup(t->view.address ? t->view.address : "127.0.0.1");
    l->view.bag = t->view.bag ? launchfile_beside(l, t->view.bag) : NULL;
    return l->view.address && (l->view.bag || !t->view.bag) ? 0 : -ENOMEM;
}

void launchfile_free_view(struct launchfile *l)
{
    free(l->view.address);
    free(l->view.bag);
}

/* -- record -----------------------------------------------------------------------------
 */

#define MAX_MB 100000000 /* 100 TB */
#define MAX_S  31536000  /* a year */

static int add_node(struct launchfile *l)
{
    char **grown = realloc(l->nodes, (l->n_nodes + 1) * sizeof *grown);
    char *name = strdup("record");

    if (grown)
        l->nodes = grown;
    if (!grown || !name) {
        free(name);
        return -ENOMEM;
    }
    memmove(grown + 1, grown, l->n_nodes++ * sizeof *grown);
    grown[0] = name;
    return 0;
}

static int take_numbers(struct launchfile *l, const struct launch_text_record *t,
                        struct error *why)
{
    const struct {
        const char *key;
        const unsigned *text;
        unsigned *value, otherwise, min, max;
    } numbers[] = {
        {"record.split_mb", t->split_mb, &l->record.split_mb, 0, 0, MAX_MB},
        {"record.split_s", t->split_s, &l->record.split_s, 0, 0, MAX_S},
        {"record.quota_mb", t->quota_mb, &l->record.quota_mb, 0, 0, MAX_MB},
        {"record.flush_ms", t->flush_ms, &l->record.flush_ms, 1000, 1, 3600000},
        {"record.snapshot.before_s", t->snapshot.before_s, &l->record.snapshot.before_s,
         SNAPSHOT_BEFORE_S, 1, SNAPSHOT_MOST_S},
        {"record.snapshot.after_s", t->snapshot.after_s, &l->record.snapshot.after_s,
         SNAPSHOT_AFTER_S, 0, SNAPSHOT_MOST_S},
        {"record.snapshot.max_mb", t->snapshot.max_mb, &l->record.snapshot.max_mb,
         SNAPSHOT_MAX_MB, SNAPSHOT_LEAST_MB, SNAPSHOT_MOST_MB},
    };

    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        unsigned value = numbers[i].text ? *numbers[i].text : numbers[i].otherwise;
        if (value < numbers[i].min || value > numbers[i].max)
            return yaml_error_say(why, -EINVAL, l->path, numbers[i].key,
                                  "expected %u to %u, not %u", numbers[i].min,
                                  numbers[i].max, value);
        *numbers[i].value = value;
    }
    if (l->record.quota_mb && l->record.split_mb > l->record.quota_mb / 2)
        return yaml_error_say(why, -EINVAL, l->path, "record.split_mb",
                              "expected no more than half of quota_mb");
    return 0;
}

static char *copy_text(const char *text, const char *otherwise)
{
    return strdup(text ? text : otherwise);
}

static int copy_snapshot(struct launchfile *l, const struct launch_text_snapshot *s,
                         const char *asked, struct error *why)
{
    const char *folder = asked ? asked : s->folder;
    bool other = s->before_s || s->after_s || s->max_mb || s->faults;

    if (!folder && other)
        return yaml_error_say(why, -EINVAL, l->path, "record.snapshot.folder",
                              "expected where bags of the last seconds go, e.g. "
                              "out/snapshots");
    l->record.snapshot.faults = s->faults ? *s->faults : true;
    l->record.snapshot.folder = folder ? strdup(folder) : NULL;
    return folder && !l->record.snapshot.folder ? -ENOMEM : 0;
}

int launchfile_copy_record(struct launchfile *l, const struct launch_text *t,
                           const struct launchfile_options *options, struct error *why)
{
    const struct launch_text_record *r = &t->record;
    const char *path = options && options->record ? options->record : r->path;
    const char *compression = r->compression ? r->compression : "none";
    bool asked = options && (options->record || options->snapshot);

    if (asked && !launchfile_has_node(l, "record") && add_node(l))
        return -ENOMEM;
    int err = copy_snapshot(l, &r->snapshot, options ? options->snapshot : NULL, why);
    if (err)
        return err;
    if (launchfile_has_node(l, "record") && !path && !l->record.snapshot.folder)
        return yaml_error_say(why, -EINVAL, l->path, "record.path",
                              "expected the name of a bag, e.g. out/demo.mcap, or a "
                              "snapshot's folder");
    if (bag_compression_find(&l->record.compression,
                             bytes_of(strcmp(compression, "none") ? compression : "")))
        return yaml_error_say(why, -EINVAL, l->path, "record.compression",
                              "expected none, lz4 or zstd, not %s", compression);
    l->record.shuffle = r->shuffle && *r->shuffle;
    if (l->record.shuffle && l->record.compression == BAG_NONE)
        return yaml_error_say(why, -EINVAL, l->path, "record.shuffle",
                              "shuffled sound is for a compression: set "
                              "record.compression to zstd or lz4");
    l->record.path = copy_text(path, "");
    l->record.topics = copy_text(r->topics, "*");
    l->record.exclude = copy_text(r->exclude, "");
    if (!l->record.path || !l->record.topics || !l->record.exclude)
        return -ENOMEM;
    return take_numbers(l, r, why);
}

void launchfile_free_record(struct launchfile *l)
{
    free(l->record.path);
    free(l->record.snapshot.folder);
    free(l->record.topics);
    free(l->record.exclude);
}

/* -- play -------------------------------------------------------------------------------
 */

int launchfile_play_rate(const char *text, double *out)
{
    char *end;

    *out = 0.0;
    if (!strcmp(text, "max"))
        return 0;
    *out = strtod(text, &end);
    return end == text || *end || !(*out >= 1e-3 && *out <= 1e6) ? -EINVAL : 0;
}

/* A path of the file is relative to its folder, one of the command line to ours. */
static char *bag_path(const struct launchfile *l, const char *in_file,
                      const struct launchfile_options *options)
{
    if (options && options->bag)
        return strdup(options->bag);
    return in_file ? launchfile_beside(l, in_file) : strdup("");
}

static int copy_texts(struct launchfile *l, const struct launch_text_play *t,
                      const struct launchfile_options *options)
{
    const struct {
        char **to;
        const char *from;
    } texts[] = {{&l->play.topics, t->topics},
                 {&l->play.exclude, t->exclude},
                 {&l->play.remap, t->remap}};

    l->play.bag = bag_path(l, t->bag, options);
    if (!l->play.bag)
        return -ENOMEM;
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        if (texts[i].from && !(*texts[i].to = strdup(texts[i].from)))
            return -ENOMEM;
    return 0;
}

static int take_rate(struct launchfile *l, const char *asked, const char *in_file,
                     struct error *why)
{
    const char *rate = asked ? asked : in_file ? in_file : "1";

    if (!launchfile_play_rate(rate, &l->play.rate))
        return 0;
    if (asked)
        return error_say(why, -EINVAL, "--rate %s: expected max, or 0.001 to 1000000",
                         rate);
    return yaml_error_say(why, -EINVAL, l->path, "play.rate",
                          "expected max, or 0.001 to 1000000, not %s", rate);
}

int launchfile_copy_play(struct launchfile *l, const struct launch_text *t,
                         const struct launchfile_options *options, struct error *why)
{
    bool plays = launchfile_has_node(l, "play");
    int err = copy_texts(l, &t->play, options);

    if (!err)
        err = take_rate(l, options ? options->rate : NULL, t->play.rate, why);
    if (err)
        return err;
    if (options && (options->bag || options->rate) && !plays)
        return error_say(why, -EINVAL,
                         "%s: --bag and --rate are for launch files with the node play, "
                         "as launch/play.yaml",
                         l->path);
    if (plays && !l->play.bag[0])
        return yaml_error_say(why, -EINVAL, l->path, "play.bag",
                              "expected the name of a bag; or say --bag FILE");
    l->play.loop = t->play.loop && *t->play.loop;
    l->play.start_s = t->play.start_s ? *t->play.start_s : 0.0;
    l->play.end_s = t->play.end_s ? *t->play.end_s : INFINITY;
    if (!(l->play.start_s >= 0.0 && l->play.start_s <= l->play.end_s))
        return yaml_error_say(why, -EINVAL, l->path, "play.start_s",
                              "expected 0 or more, and no more than end_s");
    return 0;
}

void launchfile_free_play(struct launchfile *l)
{
    free(l->play.bag);
    free(l->play.topics);
    free(l->play.exclude);
    free(l->play.remap);
}
