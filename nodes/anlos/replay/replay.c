/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/commands.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/bag/catalog.h"
#include "msgs/bag/manifest.h"
#include "msgs/bag/topic_message.h"
#include "msgs/convert.h"
#include "msgs/topics.h"
#include "nodes/anlos/bag/stream.h"
#include "nodes/anlos/recon/options.h"
#include "nodes/anlos/recon/report.h"
#include "nodes/anlos/replay/chain.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/export.h"
#include "nodes/rt/launchfile.h"
#include "nodes/rt/launchfile_pipeline.h"
#include "nodes/rt/stop.h"
#include "recon/imaging/imager.h"
#include "recon/processing.h"

/* -- with what a bag is processed -------------------------------------------------------
 */

/* Its own launch file's settings, and the command line's where these are given. */
struct settings {
    struct launchfile *launch;     /* NULL: the bag has none */
    char name[256];                /* of the launch file; empty: none */
    char revision[128];            /* of the program that recorded; empty: not known */
    struct imager_options imaging; /* those of the launch file, and of o */
    struct chain_config chain; /* but for the bus; borrows from launch, imaging and o */
};

static bool is_text(struct bytes b, const char *text)
{
    return b.size == strlen(text) && !memcmp(b.data, text, b.size);
}

static void copy_text(char *out, size_t size, struct bytes b)
{
    snprintf(out, size, "%.*s", (int)(b.size < size ? b.size : size - 1),
             b.size ? (const char *)b.data : "");
}

/* What the recorder says of itself. */
static int read_session(struct settings *s, const struct bag_catalog *bag,
                        struct error *why)
{
    struct bytes_buffer into = {0};
    struct bag_record r;
    struct bytes key, value;
    int err = 0;

    for (size_t i = 0; !err && i < bag->n_metadata; i++) {
        const struct bag_record *index = &bag->metadata[i].record;
        if (!is_text(index->metadata_index.name, MANIFEST_SESSION))
            continue;
        err = bag_catalog_read(bag, index, &into, &r, why);
        while (!err && bag_map_next(&r.metadata.metadata, &key, &value)) {
            if (is_text(key, MANIFEST_LAUNCH))
                copy_text(s->name, sizeof s->name, value);
            if (is_text(key, MANIFEST_REVISION))
                copy_text(s->revision, sizeof s->revision, value);
        }
    }
    bytes_free(&into);
    return err;
}

static int read_launch(struct settings *s, const struct bag_catalog *bag,
                       struct error *why)
{
    struct bytes_buffer into = {0};
    struct bag_record r;
    char name[512];
    int err = 0;

    for (size_t i = 0; !err && !s->launch && i < bag->n_attachments; i++) {
        const struct bag_record *index = &bag->attachments[i].record;
        if (!s->name[0] || !is_text(index->attachment_index.name, s->name))
            continue;
        snprintf(name, sizeof name, "%s in the bag", s->name);
        err = bag_catalog_read(bag, index, &into, &r, why);
        if (!err)
            err = launchfile_parse(&s->launch, name, r.attachment.data.data,
                                   r.attachment.data.size, why);
    }
    bytes_free(&into);
    return err;
}

/* What the command line says wins.  Another method does not take the options of the
 * launch file's. */
static int take_imaging(struct settings *s, const struct recon_options *o,
                        struct error *why)
{
    struct scan_imager_config *c = &s->chain.pipeline.scan;
    char reason[256];

    if (s->chain.pipeline.is_static && (o->method || o->imaging->given))
        return error_say(why, -EINVAL,
                         "--%s is for scans; the frames of a fixed array have one way",
                         o->method ? "method" : "set");
    if (o->method)
        c->method = o->method;
    s->imaging = c->options && !o->method ? *c->options : *o->imaging;
    imager_options_overlay(&s->imaging, o->imaging);
    c->options = &s->imaging;
    if (c->method && imager_options_check(c->options, c->method, reason, sizeof reason))
        return error_say(why, -EINVAL, "--set %s", reason);
    return 0;
}

static void take_options(struct pipeline_config *c, const struct recon_options *o)
{
    if (o->has_window)
        c->frontend.window = o->window;
    if (o->has_compression)
        c->frontend.compression = o->compression;
    c->scan.threads = c->array.threads = o->threads;
}

/* 0; errors of opening a bag and of launchfile_load; -EINVAL (options that the method has
 * not, a method for a fixed array).  *s stays where it is.  Clear with settings_clear,
 * also afteran error. */
static int settings_load(struct settings *s, const struct recon_options *o,
                         struct error *why)
{
    struct bag_catalog *bag = NULL;

    *s = (struct settings){.launch = NULL};
    int err = bag_catalog_open(&bag, o->bag, why);
    if (!err)
        err = read_session(s, bag, why);
    if (!err && o->launch) {
        snprintf(s->name, sizeof s->name, "%s", o->launch);
        err = launchfile_load(&s->launch, o->launch, NULL, why);
    } else if (!err) {
        err = read_launch(s, bag, why);
    }
    bag_catalog_close(bag);
    if (err)
        return err;
    if (!s->launch)
        s->name[0] = '\0';
    launchfile_pipeline(&s->chain.pipeline, s->launch);
    sender_config_set(&s->chain.sender, s->launch);
    take_options(&s->chain.pipeline, o);
    return take_imaging(s, o, why);
}

static void settings_clear(struct settings *s)
{
    launchfile_destroy(s->launch);
    s->launch = NULL;
}

/* -- what it leaves behind --------------------------------------------------------------
 */

#define REPLAY_CAN_FILE   "can.candump"
#define REPLAY_LISTS_FILE "lists.mcap"

/* The lists as a bag again: what a recorder beside the nodes would have of them, if work
 * took no time. */
struct lists {
    struct bag_writer *writer; /* NULL: nobody asked */
    struct bag_topics *topics;
    int64_t epoch_ns; /* of all that is made here; 0: nothing has come yet */
    uint64_t n;
    size_t n_images;   /* whose list is in */
    uint64_t n_walled; /* lists of walls that are in */
};

struct replay {
    const struct recon_options *options;
    struct settings settings;
    struct lists lists;
    struct canbus *can;
    struct chain chain;
    bool begun;           /* the chain, with the first survey */
    struct survey survey; /* the newest */
    uint64_t survey_id;
    struct processing processing; /* of it */
    bool bad_input;               /* what went wrong is the input's fault */
    struct stopwatch stages[RECON_STAGES], total;
};

static size_t pings_expected(const struct replay *r)
{
    if (r->chain.cfg.pipeline.is_static)
        return r->chain.volume.pings_expected;
    return r->survey.n_positions * r->survey.n_speakers;
}

/* As the image says: of an array that stands it is made of frames. */
static const char *method_of(const struct chain *c)
{
    return c->cfg.pipeline.is_static ? c->volume.method : c->cfg.pipeline.scan.method;
}

static void warn(json_t *warnings, json_t *text)
{
    fprintf(stderr, "anlos recon: %s\n", json_string_value(text));
    json_array_append_new(warnings, text);
}

static json_t *warnings_json(const struct replay *r)
{
    const struct chain *c = &r->chain;
    const struct air *air = pipeline_air(c->pipeline);
    size_t used = c->volume.pings_used, expected = pings_expected(r);
    json_t *warnings = json_array();

    for (size_t i = 0; i < c->n_notes; i++)
        warn(warnings,
             c->notes[i].times > 1
                 ? json_sprintf("%s (%zu times)", c->notes[i].text, c->notes[i].times)
                 : json_string(c->notes[i].text));
    if (c->n_more_notes)
        warn(warnings, json_sprintf("%zu more of other kinds", c->n_more_notes));
    if (c->n_unusable)
        warn(warnings, json_sprintf("%zu pings were of no use", c->n_unusable));
    if (used + c->volume.pings_blanked < expected)
        warn(warnings, json_sprintf("%zu of %zu pings are lost",
                                    expected - used - c->volume.pings_blanked, expected));
    if (c->clipped)
        warn(warnings,
             json_sprintf("%llu samples are clipped", (unsigned long long)c->clipped));
    if (air_is_distrusted(air))
        warn(warnings, json_sprintf("background: the air has changed by %.1f K since it "
                                    "was recorded: it does not fit any more",
                                    air_kelvin(air, air->largest)));
    if (!c->n_background_pings &&
        c->cfg.pipeline.frontend.background != BACKGROUND_ADAPTIVE)
        warn(warnings, json_string("no background recording: the room's own echoes stay "
                                   "in the image"));
    return warnings;
}

static json_t *recording_json(const struct replay *r)
{
    const struct settings *s = &r->settings;

    return json_pack(
        "{ss, ss?, ss?, sI, sI, sI, sI, sI, sb}", "bag", r->options->bag, "launch",
        s->name[0] ? s->name : NULL, "revision", s->revision[0] ? s->revision : NULL,
        "scan", (json_int_t)r->chain.detections->scan, "images",
        (json_int_t)r->chain.n_images, "positions", (json_int_t)r->survey.n_positions,
        "speakers", (json_int_t)r->survey.n_speakers, "microphones",
        (json_int_t)r->survey.n_microphones, "calibrated", r->survey.n_responses > 0);
}

static void add_pings(const struct replay *r, json_t *report)
{
    const struct chain *c = &r->chain;
    size_t expected = pings_expected(r), used = c->volume.pings_used;

    json_object_set_new(
        report, "compression",
        json_string(compression_name(c->cfg.pipeline.frontend.compression)));
    json_object_set_new(report, "window",
                        json_string(window_name(c->cfg.pipeline.frontend.window)));
    json_object_set_new(report, "pings",
                        json_pack("{sI, sI, sI, sI, sI}", "expected",
                                  (json_int_t)expected, "used", (json_int_t)used, "lost",
                                  (json_int_t)(expected - used), "unusable",
                                  (json_int_t)c->n_unusable, "background",
                                  (json_int_t)c->n_background_pings));
    json_object_set_new(report, "clipped_samples", json_integer((json_int_t)c->clipped));
    json_object_set_new(report, "microphones_masked",
                        json_integer((json_int_t)c->volume.microphones_masked));
    if (c->n_background_pings)
        json_object_set_new(report, "air", recon_report_air(pipeline_air(c->pipeline)));
    json_object_set_new(report, "sound_speed_m_s",
                        export_real(r->survey.sound_speed_m_s));
    json_object_set_new(report, "temperature_c", export_real(r->survey.temperature_c));
}

/* All files but that of the CAN frames. */
static int replay_write(struct replay *r, const char *folder,
                        const struct stopwatch *began, struct error *why)
{
    const struct chain *c = &r->chain;
    struct recon_results results = {
        .options = r->options,
        .method = method_of(c),
        .imaging = c->cfg.pipeline.scan.options,
        .grid = &c->volume.grid,
        .intensity = c->volume.intensity,
        .detections = c->detections,
        .gate_m = r->processing.gate_m,
        .band_hz = r->processing.band_hz,
        .stages = r->stages,
        .total = &r->total,
    };
    int err = pool_create(&results.pool, r->options->threads);

    if (err)
        return error_say(why, err, "%zu threads: %s", r->options->threads,
                         strerror(-err));
    err = recon_results_write(&results, folder, began, why);
    if (!err) {
        json_t *report = recon_results_report(&results, recording_json(r));
        add_pings(r, report);
        err = recon_results_finish(report, warnings_json(r), folder, why);
    }
    pool_destroy(results.pool);
    return err;
}

/* The objects, the time and the folder, on stdout. */
static void replay_print(const struct replay *r)
{
    const struct chain *c = &r->chain;

    recon_report_print_objects(c->detections, r->survey.pings_m != NULL, false);
    if (c->n_images > 1)
        printf("%zu images in the bag; the files are of the last, scan %u\n", c->n_images,
               c->detections->scan);
    printf("%zu of %zu pings, method %s, settings of %s, %zu thread%s: %.2f s",
           c->volume.pings_used, pings_expected(r), method_of(c),
           r->settings.name[0] ? r->settings.name : "no launch file (defaults)",
           r->options->threads, r->options->threads == 1 ? "" : "s", r->total.wall_s);
    recon_report_print_stages(r->stages);
    printf("%s: %sdetections.json, " REPLAY_CAN_FILE ", %sreport.json\n", r->options->out,
           r->options->no_image ? "" : "volume.nrrd, projection_{xy,xz,yz}.png, ",
           r->options->records ? REPLAY_LISTS_FILE ", " : "");
}

/* -- the lists as a bag -----------------------------------------------------------------
 */
static int lists_open(struct lists *l, const char *folder, struct error *why)
{
    const struct bag_writer_config cfg = {.profile = "anlos",
                                          .library = "anlos " ANLOS_VERSION,
                                          .chunk_size = 1 << 20,
                                          .compression = BAG_ZSTD};
    char path[PATH_MAX + 32];

    snprintf(path, sizeof path, "%s/" REPLAY_LISTS_FILE, folder);
    int err = bag_writer_create(&l->writer, path, &cfg, why);
    if (err)
        return err;
    err = bag_topics_create(&l->topics, l->writer);
    return err ? error_say(why, err, "out of memory") : 0;
}

static int lists_close(struct lists *l, int err, struct error *why)
{
    if (!l->writer)
        return err;
    bag_topics_destroy(l->topics);
    int failed = bag_writer_close(l->writer, err ? NULL : why);
    *l = (struct lists){.writer = NULL};
    return err ? err : failed;
}

static int lists_put(struct lists *l, const struct topic *t, int64_t capture_ns,
                     int64_t publish_ns, const ProtobufCMessage *m, struct error *why)
{
    size_t size = protobuf_c_message_get_packed_size(m);
    uint8_t *bytes = malloc(size ? size : 1);

    if (!bytes)
        return error_say(why, -ENOMEM, "out of memory");
    protobuf_c_message_pack(m, bytes);
    if (!l->epoch_ns)
        l->epoch_ns = publish_ns;
    struct envelope e = {.epoch_ns = l->epoch_ns,
                         .sequence = l->n++,
                         .capture_ns = capture_ns,
                         .publish_ns = publish_ns,
                         .payload_size = (uint32_t)size,
                         .replayed = true};
    snprintf(e.topic, sizeof e.topic, "%s", t->name);
    snprintf(e.node, sizeof e.node, "recon");
    int err = bag_topics_put(l->topics, &e, bytes, NULL, why);
    free(bytes);
    return err;
}

/* The walls that the newest list went by, where they are not those of the recording. */
static int lists_put_walls(struct replay *r, int64_t now_ns, struct error *why)
{
    struct walls_view view;
    Anlos__WallList m;
    uint64_t n;
    int64_t stamp_ns;
    const struct walls *w = pipeline_known_walls(r->chain.pipeline, &stamp_ns, &n);

    if (!w || n == r->lists.n_walled || !r->settings.chain.pipeline.finds_walls)
        return 0;
    r->lists.n_walled = n;
    walls_to_message(w, "", &view, &m);
    return lists_put(&r->lists, topic_wall(), stamp_ns, now_ns, &m.base, why);
}

/* What a message leaves there. */
static int lists_take(struct replay *r, const struct stream_message *in,
                      const ProtobufCMessage *content, struct error *why)
{
    const struct envelope *e = &in->envelope;
    bool is_wall = in->topic == topic_wall();

    if (in->topic != topic_survey() && in->topic != topic_ego() &&
        (!is_wall || r->settings.chain.pipeline.finds_walls))
        return 0;
    return lists_put(&r->lists, in->topic, e->capture_ns, e->publish_ns, content, why);
}

/* And what came of it. */
static int lists_take_image(struct replay *r, struct error *why)
{
    const struct chain *c = &r->chain;

    if (!r->lists.writer || !r->begun || r->lists.n_images == c->n_images)
        return 0;
    r->lists.n_images = c->n_images;
    int err = lists_put_walls(r, c->list_ns, why);
    return err ? err
               : lists_put(&r->lists, topic_detections(), c->volume.capture_ns,
                           c->list_ns, &c->detections->base, why);
}

/* -- the bag through the chain ----------------------------------------------------------
 */

static const char topics[] = "survey,ping,scan/status,ego,ambient,wall,wall/given";

/* The nodes begin when they know the survey. */
static int begin(struct replay *r, const Anlos__Survey *survey, struct error *why)
{
    struct chain_config cfg = r->settings.chain;
    char reason[256];

    struct scan_imager_config *scan = &cfg.pipeline.scan;
    if (!scan->method) {
        scan->method = survey->n_pings_m ? "backprojection" : "fast";
        r->settings.chain.pipeline.scan.method = scan->method;
        if (imager_options_check(scan->options, scan->method, reason, sizeof reason))
            return error_say(why, -EINVAL, "--set %s", reason);
    }
    cfg.can = r->can;
    int err = chain_create(&r->chain, &cfg, r->stages);
    r->begun = true;
    return err ? error_say(why, err, "%zu threads: %s", scan->threads, strerror(-err))
               : 0;
}

/* Nothing that comes out of a recording may look live. */
static int take_survey(struct replay *r, Anlos__Survey *survey, struct error *why)
{
    int err = 0;

    survey->source = ANLOS__SOURCE__REPLAY;
    survey_complete_id(survey);
    if (!r->begun)
        err = begin(r, survey, why);
    if (!err)
        err = chain_survey(&r->chain, survey, why);
    if (err || (r->survey.n_positions && r->survey_id == survey->id))
        return err;
    survey_clear(&r->survey);
    r->survey_id = survey->id;
    err = survey_from_message(&r->survey, survey, why);
    return err ? err : processing_plan(&r->processing, &r->survey, why);
}

static int take(struct replay *r, const struct stream_message *m,
                ProtobufCMessage *content, struct error *why)
{
    const struct envelope *e = &m->envelope;

    if (m->topic == topic_survey())
        return take_survey(r, (Anlos__Survey *)content, why);
    if (!r->begun)
        return 0;
    if (m->topic == topic_ping()) {
        Anlos__Ping *ping = (Anlos__Ping *)content;
        if (!ping->survey_id) /* another program recorded it */
            ping->survey_id = r->survey_id;
        return chain_ping(&r->chain, ping, e->capture_ns, e->publish_ns, why);
    }
    if (m->topic == topic_scan_status())
        return chain_status(&r->chain, (Anlos__ScanStatus *)content, e->epoch_ns, why);
    if (m->topic == topic_ego())
        chain_ego(&r->chain, (Anlos__EgoMotion *)content, e->capture_ns, e->publish_ns);
    else if (m->topic == topic_ambient())
        chain_ambient(&r->chain, (Anlos__Ambient *)content);
    else if (m->topic == topic_wall_given())
        chain_given(&r->chain, (Anlos__WallList *)content, e->capture_ns, e->publish_ns);
    else
        chain_walls(&r->chain, (Anlos__WallList *)content, e->capture_ns);
    return 0;
}

static int take_next(struct replay *r, struct stream *s, struct error *why)
{
    struct stream_message m;
    struct stopwatch now = stopwatch_now(false);
    int err = stream_next(s, &m, why);
    ProtobufCMessage *content;

    if (!err)
        err = stream_unpack(&content, s, &m, why);
    stopwatch_lap(&r->stages[RECON_READ], &now, false);
    if (err)
        return err;
    err = take(r, &m, content, why);
    if (!err && r->lists.writer)
        err = lists_take(r, &m, content, why);
    if (!err)
        err = lists_take_image(r, why);
    protobuf_c_message_free_unpacked(content, NULL);
    return err;
}

/* The first survey comes before all else, as play has it: a bag that was cut begins with
 * pings. */
static int read_bag(struct replay *r, struct stream *s, struct error *why)
{
    stream_select(s, topic_survey()->name);
    int err = take_next(r, s, why);

    if (err && err != -ENODATA)
        return err;
    stream_select(s, topics);
    stream_rewind(s);
    do
        err = take_next(r, s, why);
    while (!err);
    if (err != -ENODATA)
        return err;
    err = r->begun ? chain_end(&r->chain, why) : 0;
    return err ? err : lists_take_image(r, why);
}

/* Why there is no image. */
static int error_say_of_nothing(const struct replay *r, struct error *why)
{
    const struct chain *c = &r->chain;
    const char *bag = r->options->bag;

    if (!r->begun)
        return error_say(why, -ENODATA,
                         "%s: no survey; 'anlos bag info' shows what is in", bag);
    if (!c->n_scene_pings)
        return error_say(why, -ENODATA, "%s: no pings of a scene", bag);
    if (c->cfg.pipeline.frontend.background && !c->n_background_pings)
        return error_say(
            why, -ENODATA,
            "%s: %s asks for a background (scan.background), and no pings of "
            "one are there; --launch FILE names other settings",
            bag, r->settings.name);
    return error_say(why, -ENODATA, "%s: of %zu pings none is usable%s%s", bag,
                     c->n_scene_pings, c->n_notes ? ": " : "",
                     c->n_notes ? c->notes[0].text : "");
}

static int process(struct replay *r, struct stream *s, const char *folder,
                   struct error *why)
{
    char uri[PATH_MAX + 32];

    snprintf(uri, sizeof uri, "log:%s/" REPLAY_CAN_FILE, folder);
    int err = canbus_open(&r->can, uri, why);
    if (!err && r->options->records)
        err = lists_open(&r->lists, folder, why);
    if (!err)
        err = read_bag(r, s, why);
    if (!err && !r->chain.detections)
        err = error_say_of_nothing(r, why);
    err = lists_close(&r->lists, err, why);
    canbus_close(r->can);
    r->can = NULL;
    if (interrupt_requested())
        err = error_say(why, -EINTR, "interrupted");
    return err;
}

static int run_in_stage(struct replay *r, struct stream *s, struct export_stage *stage,
                        const struct stopwatch *began, struct error *why)
{
    int err = process(r, s, stage->path, why);

    r->bad_input = err && err != -ENOMEM && err != -EINTR && err != -EAGAIN &&
                   err != -ENOSPC && err != -EIO;
    if (!err)
        err = replay_write(r, stage->path, began, why);
    if (!err && interrupt_requested())
        err = error_say(why, -EINTR, "interrupted");
    return export_stage_end(stage, err, why);
}

static bool has_topic(const struct stream *s, const struct topic *t)
{
    return !stream_require(s, t->name, NULL);
}

/* As in a replay by the nodes, node wall tells of the walls where the launch file has it,
 * else the lists of the recording do.  Walls that the launch file asks for are not left
 * out without a word. */
static int choose_walls(struct replay *r, const struct stream *s, struct error *why)
{
    const struct launchfile *l = r->settings.launch;
    const char *bag = r->options->bag, *name = r->settings.name;

    if (!l && (has_topic(s, topic_wall()) || has_topic(s, topic_ego())))
        return error_say(
            why, -ENODATA,
            "%s: no launch file is in it, and the defaults are for a scan with "
            "a wall where the survey has it, not for what was recorded here "
            "(%s); --launch FILE names its settings",
            bag, has_topic(s, topic_ego()) ? "ego motion" : "lists of walls");
    if (!l || l->wall.from == WALL_FROM_SURVEY)
        return 0;
    bool *finds = &r->settings.chain.pipeline.finds_walls;
    if (!*finds && !has_topic(s, topic_wall())) {
        if (l->wall.from == WALL_FROM_TOPIC)
            return error_say(why, -ENODATA,
                             "%s: %s asks for the walls of the recording (wall: {from: "
                             "topic}, and no node wall), and no lists of them are there; "
                             "--launch FILE names other settings",
                             bag, name);
        *finds = true;
    }
    if (*finds && l->wall.from == WALL_FROM_TOPIC && !has_topic(s, topic_wall_given()))
        return error_say(why, -ENODATA,
                         "%s: %s asks for walls that the vehicle gave (wall: {from: "
                         "topic}), and none are there (wall/given); --launch FILE names "
                         "other settings%s",
                         bag, name,
                         has_topic(s, topic_wall())
                             ? ": without the node wall they are those of the recording"
                             : "");
    return 0;
}

static int run(struct replay *r, const struct stopwatch *began, struct error *why)
{
    struct export_stage stage;
    struct stream *s = NULL;

    r->bad_input = true;
    int err = settings_load(&r->settings, r->options, why);
    if (!err)
        err = stream_open(&s, r->options->bag, why);
    if (!err)
        err = choose_walls(r, s, why);
    r->settings.chain.pipeline.scan.stop = interrupt_stops;
    if (!err)
        err = export_stage_begin(&stage, r->options->out, why);
    if (!err)
        err = run_in_stage(r, s, &stage, began, why);
    stream_close(s);
    return err;
}

int replay_run(const struct recon_options *options, const struct stopwatch *began)
{
    struct replay r = {.options = options};
    struct error why = {0};

    interrupt_catch();
    int err = run(&r, began, &why);
    if (err)
        fprintf(stderr, "anlos recon: %s\n", why.text);
    else
        replay_print(&r);
    if (r.begun)
        chain_clear(&r.chain);
    survey_clear(&r.survey);
    settings_clear(&r.settings);
    if (!err)
        return EXIT_WORKED;
    return err == -EINTR                   ? EXIT_INTERRUPTED
           : r.bad_input && err != -ENOMEM ? EXIT_BAD_INPUT
                                           : EXIT_FAILED;
}
