/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/bag/export.h"

#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal/text_file.h"
#include "msgs/bag/copy.h"
#include "msgs/bag/schemas.h"
#include "msgs/convert.h"
#include "msgs/detections.pb-c.h"
#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/topic/message_json.h"
#include "nodes/anlos/usage.h"
#include "nodes/foxglove/channels.h"
#include "nodes/rt/export.h"
#include "nodes/rt/export_projection.h"
#include "nodes/rt/stop.h"

static const char head[] =
    "capture_ns,publish_ns,scan,counter,preview,frame,mirrored,id,x_m,y_m,z_m,"
    "xx_m2,xy_m2,xz_m2,yy_m2,yz_m2,zz_m2,existence,level_db,virtual_x_m,virtual_y_m,"
    "virtual_z_m,extent_x_m,extent_y_m,extent_z_m\n";

static void put_number(FILE *f, double x)
{
    char text[DECIMAL_SIZE];

    if (isfinite(x))
        fprintf(f, ",%s", decimal_print(x, text));
    else
        fputc(',', f); /* empty: none */
}

static void put_vec3(FILE *f, const Anlos__Vec3 *v)
{
    put_number(f, v ? v->x : NAN);
    put_number(f, v ? v->y : NAN);
    put_number(f, v ? v->z : NAN);
}

static void put_detection(FILE *f, const struct envelope *e,
                          const Anlos__DetectionList *list, const Anlos__Detection *d)
{
    fprintf(f, "%" PRId64 ",%" PRId64 ",%u,%u,%d,%s,%d,%u", e->capture_ns, e->publish_ns,
            list->scan, list->counter, list->preview,
            list->in_vehicle_frame ? "vehicle" : "array", list->mirrored, d->id);
    put_vec3(f, d->position_m);
    for (size_t i = 0; i < 6; i++)
        put_number(f, i < d->n_covariance_m2 ? d->covariance_m2[i] : NAN);
    put_number(f, d->existence);
    put_number(f, d->level_db);
    put_vec3(f, d->virtual_m);
    put_vec3(f, d->extent_m);
    fputc('\n', f);
}

struct table {
    struct stream *stream;
    const struct export_options *options;
    size_t n; /* lines */
};

static int write_rows(FILE *f, void *context, struct error *why)
{
    struct table *t = context;
    struct stream_message m;
    int err;

    fputs(head, f);
    while (!(err = stream_next(t->stream, &m, why)) && !ferror(f)) {
        ProtobufCMessage *content;
        err = stream_unpack(&content, t->stream, &m, why);
        if (err)
            return err;
        Anlos__DetectionList *list = (Anlos__DetectionList *)content;
        for (size_t i = 0; i < list->n_detections; i++, t->n++)
            put_detection(f, &m.envelope, list, list->detections[i]);
        anlos__detection_list__free_unpacked(list, NULL);
    }
    return err == -ENODATA ? 0 : err;
}

int export_csv(struct stream *s, const struct export_options *o, struct error *why)
{
    struct table t = {s, o, 0};
    int err = verb_write_file(o->out, write_rows, &t, why);

    if (!err && strcmp(o->out, "-"))
        printf("%s: %zu detections\n", o->out, t.n);
    return err;
}

/* 0, -ENOMEM; what cannot be written shows in f. */
static int write_line(FILE *f, const struct stream *s, const struct stream_message *m,
                      bool full)
{
    ProtobufCMessage *content;
    int err = stream_unpack(&content, s, m, NULL);
    const struct message_line l = {.topic = (const char *)m->channel->topic.data,
                                   .n_topic = m->channel->topic.size,
                                   .envelope = &m->envelope,
                                   .n_bytes = m->payload.size,
                                   .content = content,
                                   .why_not = m->topic
                                                  ? "not a message of the topic's schema"
                                                  : "not a topic of anlos"};

    if (err != -ENOMEM)
        err = message_line_write(&l, full, f);
    if (content)
        protobuf_c_message_free_unpacked(content, NULL);
    return err;
}

struct lines {
    struct stream *stream;
    const struct export_options *options;
    uint64_t n;
};

static int write_lines(FILE *f, void *context, struct error *why)
{
    struct lines *l = context;
    struct stream_message m;
    int err;

    while (!(err = stream_next(l->stream, &m, why)) && !ferror(f)) {
        if (write_line(f, l->stream, &m, l->options->full))
            return error_say(why, -ENOMEM, "out of memory");
        l->n++;
    }
    return err == -ENODATA ? 0 : err;
}

int export_lines(struct stream *s, const struct export_options *o, struct error *why)
{
    struct lines l = {s, o, 0};
    int err = verb_write_file(o->out, write_lines, &l, why);

    if (!err && strcmp(o->out, "-"))
        printf("%s: %" PRIu64 " messages\n", o->out, l.n);
    return err;
}

struct image {
    Anlos__Volume *volume;
    Anlos__DetectionList *detections; /* of the same scan, or NULL */
};

static void clear(struct image *i)
{
    if (i->volume)
        anlos__volume__free_unpacked(i->volume, NULL);
    if (i->detections)
        anlos__detection_list__free_unpacked(i->detections, NULL);
}

static void take_volume(struct image *i, Anlos__Volume *v, size_t scan)
{
    bool wanted = !scan || v->scan == scan;
    bool worse = i->volume && i->volume->scan == v->scan && !i->volume->preview &&
                 v->preview;

    if (!wanted || worse) {
        anlos__volume__free_unpacked(v, NULL);
        return;
    }
    if (i->volume)
        anlos__volume__free_unpacked(i->volume, NULL);
    i->volume = v;
}

static void take_detections(struct image *i, Anlos__DetectionList *d)
{
    if (i->detections)
        anlos__detection_list__free_unpacked(i->detections, NULL);
    i->detections = d;
}

static int find_image(struct image *out, struct stream *s, const struct export_options *o,
                      struct error *why)
{
    struct stream_message m;
    int err;

    while (!(err = stream_next(s, &m, why))) {
        ProtobufCMessage *content;
        err = stream_unpack(&content, s, &m, why);
        if (err)
            return err;
        if (m.topic == topic_volume())
            take_volume(out, (Anlos__Volume *)content, o->scan);
        else
            take_detections(out, (Anlos__DetectionList *)content);
    }
    if (err != -ENODATA)
        return err;
    if (!out->volume)
        return error_say(why, -ENODATA,
                         o->scan ? "%s: no volume of scan %zu"
                                 : "%s: no "
                                   "volume",
                         o->file, o->scan);
    if (out->detections && out->detections->scan != out->volume->scan)
        take_detections(out, NULL);
    return 0;
}

static int say(const struct image *i, const char *out)
{
    printf("%s: the image of scan %u, %u of %u pings%s\n", out, i->volume->scan,
           i->volume->pings_used, i->volume->pings_expected,
           i->volume->preview ? ", a preview" : "");
    return 0;
}

static const float *intensity_of(const struct image *i, struct grid *grid,
                                 const struct export_options *o, struct error *why)
{
    const float *intensity = volume_grid(i->volume, grid);

    if (!intensity)
        error_say(why, -EBADMSG, "%s: the volume does not hold", o->file);
    return intensity;
}

static int write_nrrd(const struct image *i, const struct export_options *o,
                      struct error *why)
{
    struct verb_output out;
    struct grid grid;
    const float *intensity = intensity_of(i, &grid, o, why);
    int err = intensity ? verb_output_begin(&out, o->out, why) : -EBADMSG;

    if (err)
        return err;
    char *slash = strrchr(out.temporary, '/');
    if (slash)
        *slash = '\0';
    err = export_nrrd(!slash                   ? "."
                      : slash == out.temporary ? "/"
                                               : out.temporary,
                      slash ? slash + 1 : out.temporary, &grid, intensity, why);
    if (slash)
        *slash = '/';
    return verb_output_end(&out, err, why);
}

int export_nrrd_file(struct stream *s, const struct export_options *o, struct error *why)
{
    struct image image = {NULL, NULL};
    int err = find_image(&image, s, o, why);

    if (!err)
        err = write_nrrd(&image, o, why);
    if (!err)
        err = say(&image, o->out);
    clear(&image);
    return err;
}

static int check_vacant(const char *out, struct error *why)
{
    static const char *const names[] = {"projection_xy.png", "projection_xz.png",
                                        "projection_yz.png"};
    return export_vacant(out, names, sizeof names / sizeof *names, why);
}

static int write_png(const struct image *i, const struct export_options *o,
                     struct error *why)
{
    struct export_stage stage;
    struct grid grid;
    const float *intensity = intensity_of(i, &grid, o, why);
    int err = intensity ? check_vacant(o->out, why) : -EBADMSG;

    if (!err)
        err = export_stage_begin(&stage, o->out, why);
    if (err)
        return err;
    err = export_projections(stage.path, &grid, intensity, i->detections, why);
    return export_stage_end(&stage, err, why);
}

static int export_png(struct stream *s, const struct export_options *o, struct error *why)
{
    struct image image = {NULL, NULL};
    int err = find_image(&image, s, o, why);

    if (!err)
        err = write_png(&image, o, why);
    if (!err)
        err = say(&image, o->out);
    clear(&image);
    return err;
}

struct view { /* a channel that is added */
    bool known;
    uint16_t id, schema_id;
    uint32_t n; /* messages */
};

struct work {
    struct stream *stream;
    struct bag_writer *writer;
    struct bag_copy *copy;
    struct setting setting;
    struct view *views; /* [n_views]: all of channels_count */
    size_t n_views;
    uint64_t n_copied, n_added, n_left_out, n_sound;
    bool with_sound;
};

/* The id of its schema, which another channel may have had before. */
static int define_schema(struct work *w, const struct channel *c, uint16_t *id,
                         struct error *why)
{
    struct channel other;

    for (size_t i = 0; i < w->n_views; i++) {
        channel_get(i, &other);
        if (w->views[i].known && bytes_equal(other.schema.name, c->schema.name)) {
            *id = w->views[i].schema_id;
            return 0;
        }
    }
    return bag_writer_schema(w->writer, &c->schema, id, why);
}

static int define(struct work *w, const struct channel *c, struct view *v,
                  struct error *why)
{
    struct bag_channel channel = {.topic = bytes_of(c->name),
                                  .message_encoding = bytes_of(BAG_PROTOBUF)};
    int err = define_schema(w, c, &v->schema_id, why);

    channel.schema_id = v->schema_id;
    if (!err)
        err = bag_writer_channel(w->writer, &channel, &v->id, why);
    v->known = !err;
    return err;
}

static int add_view(struct work *w, size_t index, const struct channel *c,
                    const struct foxglove_message *m, const struct bag_message *raw,
                    struct error *why)
{
    struct view *v = &w->views[index];
    uint8_t *data;
    size_t size;
    int err = channel_pack(c, &w->setting, m, &data, &size);

    if (err == -ENOMEM)
        return error_say(why, err, "out of memory");
    if (err) {
        w->n_left_out++;
        return 0;
    }
    if (!v->known)
        err = define(w, c, v, why);
    if (!err) {
        const struct bag_message out = {.channel_id = v->id,
                                        .sequence = v->n++,
                                        .log_time = raw->log_time,
                                        .publish_time = raw->publish_time,
                                        .data = {data, size}};
        err = bag_writer_message(w->writer, &out, why);
        w->n_added += !err;
    }
    free(data);
    return err;
}

static int add_views(struct work *w, const struct stream_message *m, struct error *why)
{
    ProtobufCMessage *content;
    int err = stream_unpack(&content, w->stream, m, why);
    const struct foxglove_message in = {.topic = m->topic,
                                        .node = m->envelope.node,
                                        .content = content,
                                        .capture_ns = m->envelope.capture_ns,
                                        .publish_ns = m->envelope.publish_ns};
    struct channel c;

    if (err) {
        w->n_left_out++;
        return err == -EBADMSG ? 0 : err;
    }
    setting_take(&w->setting, &in);
    for (size_t i = 0; i < w->n_views && !err; i++) {
        channel_get(i, &c);
        if (c.convert && channel_is_from(&c, m->topic))
            err = add_view(w, i, &c, &in, &m->raw, why);
    }
    protobuf_c_message_free_unpacked(content, NULL);
    return err;
}

static bool is_source(const struct work *w, const struct topic *t)
{
    struct channel c;

    for (size_t i = 0; t && i < w->n_views; i++) {
        channel_get(i, &c);
        if (c.convert && channel_is_from(&c, t))
            return true;
    }
    return false;
}

/* One that was made like this one is not to have everything twice. */
static bool is_view(const struct bag_channel *channel)
{
    const size_t n = sizeof CHANNEL_VIEW - 1;

    return channel->topic.size > n && !memcmp(channel->topic.data, CHANNEL_VIEW, n);
}

/* An image may come before the first survey of its bag, which is repeated every second.
 */
static int find_survey(struct work *w, struct error *why)
{
    struct stream_message m;
    int err = 0;

    stream_select(w->stream, "survey");
    while (!err && !w->setting.has_survey && !(err = stream_next(w->stream, &m, why))) {
        ProtobufCMessage *content;
        err = stream_unpack(&content, w->stream, &m, why);
        const struct foxglove_message in = {.topic = m.topic, .content = content};
        err = err == -EBADMSG ? 0 : err;
        if (!content)
            continue;
        setting_take(&w->setting, &in);
        protobuf_c_message_free_unpacked(content, NULL);
    }
    stream_select(w->stream, NULL);
    stream_rewind(w->stream);
    return err == -ENODATA ? 0 : err;
}

/* Most of a bag's bytes, of which nothing is drawn. */
static bool is_sound(const struct topic *t)
{
    return t && (t == topic_ping() || t == topic_traces() || t == topic_echoes());
}

static int copy_all(struct work *w, struct error *why)
{
    struct stream_message m;
    int err = bag_copy_rest(w->copy, 0, why);

    while (!err && !(err = stream_next(w->stream, &m, why))) {
        if (is_view(m.channel))
            continue;
        if (!w->with_sound && is_sound(m.topic)) {
            w->n_sound++;
            continue;
        }
        err = bag_copy_message(w->copy, 0, &m.raw, why);
        w->n_copied += !err;
        if (!err && is_source(w, m.topic))
            err = add_views(w, &m, why);
    }
    return err == -ENODATA ? 0 : err;
}

static int write_bag(struct work *w, const struct export_options *o, struct error *why)
{
    const struct bytes profile = stream_catalog(w->stream)->header.record.header.profile;
    struct verb_output output;
    char text[64];
    int err = verb_output_begin(&output, o->out, why);

    if (err)
        return err;
    snprintf(text, sizeof text, "%.*s", (int)(profile.size < 64 ? profile.size : 0),
             (const char *)profile.data);
    err = verb_writer_create(&w->writer, &output, text, BAG_ZSTD, why);
    if (err)
        return verb_output_end(&output, err, why);
    if (bag_copy_create(&w->copy, w->writer) ||
        bag_copy_add(w->copy, stream_catalog(w->stream)))
        err = error_say(why, -ENOMEM, "out of memory");
    if (!err)
        err = find_survey(w, why);
    if (!err)
        err = copy_all(w, why);
    int closed = bag_writer_close(w->writer, err ? NULL : why);
    return verb_output_end(&output, err ? err : closed, why);
}

/* The bag with what Foxglove draws added (nodes/foxglove/channels.h). */
static int export_foxglove(struct stream *s, const struct export_options *o,
                           struct error *why)
{
    struct work w = {.stream = s, .n_views = channels_count(), .with_sound = o->full};
    int err;

    w.views = calloc(w.n_views, sizeof *w.views);
    err = w.views ? write_bag(&w, o, why) : error_say(why, -ENOMEM, "out of memory");
    if (!err)
        printf("%s: %" PRIu64 " messages, and %" PRIu64 " made of them for Foxglove\n",
               o->out, w.n_copied, w.n_added);
    if (!err && w.n_sound)
        printf("%" PRIu64 " of sound are left out (ping, traces, echoes; --full keeps "
               "them)\n",
               w.n_sound);
    if (!err && w.n_left_out)
        fprintf(stderr,
                "anlos bag export: %s: %" PRIu64
                " could not be made: the survey is missing, or a message does not hold\n",
                o->file, w.n_left_out);
    bag_copy_destroy(w.copy);
    setting_clear(&w.setting);
    free(w.views);
    return err;
}

static const char help[] =
    "anlos bag export -- what is in a bag, in the formats of other programs\n"
    "\n"
    "usage: anlos bag export FILE --format F -o OUT [--topic T]... [--scan N] [--full]\n"
    "\n"
    "  format  from topic      OUT\n"
    "  wav     survey, ping    a folder: survey.yaml, scene and background as WAV "
    "files,\n"
    "                          which 'anlos recon' reads; retaken pings come once, a "
    "ping\n"
    "                          that was lost is silence; of an array that stands all\n"
    "                          that it heard, with emissions.csv, and ego.csv of a "
    "vehicle\n"
    "                          that moved: 'anlos bag import' takes them back\n"
    "  csv     detections      a file with a line for each detection; positions in m, "
    "the\n"
    "                          covariance in m2, what is not known empty\n"
    "  json    any             a file with a message on each line, as 'anlos topic "
    "echo'\n"
    "                          prints it\n"
    "  nrrd    volume          a file: float32, x fastest, in m\n"
    "  png     volume          a folder: the maxima along x, y and z, with the "
    "detections\n"
    "  foxglove  all           a bag: this one without its sound, and in Foxglove's own\n"
    "                          schemas the image as a cloud, voxels and pictures, the\n"
    "                          objects, wall, vehicle, frames and log, under view/:\n"
    "                          Foxglove and Lichtblick draw them\n"
    "  osi     detections      a trace file of ASAM OSI 3.7: tracks as SensorData in "
    "the\n"
    "                          vehicle frame, and with --scenes who was really there as\n"
    "                          GroundTruth, in the frame of where the vehicle began\n"
    "\n"
    "  --format F      wav, csv, json, nrrd, png, foxglove or osi\n"
    "  -o, --out OUT   must not be there; csv and json: - is stdout\n"
    "  --topic T,...   json: only these, names or patterns with commas between, or "
    "several\n"
    "                  times; all by default\n"
    "  --scan N        wav, nrrd, png: this scan; by default the last one\n"
    "  --full          json: every number of sound and images; foxglove: the sound, too\n"
    "  --scenes FILE   osi: of a recorded simulated drive: its scene\n"
    "  --help          this text\n"
    "\n"
    "examples\n"
    "  anlos bag export scan.mcap --format wav -o recording\n"
    "  anlos recon recording --out image\n"
    "\n"
    "exit codes: 0 done; 1 failed, or pings are missing in OUT; 2 bad arguments or "
    "files,\n"
    "or nothing of that is in the bag; 130 stopped by Ctrl-C (no OUT then)\n";

struct format {
    const char *name;
    const char *needs, *wants; /* topics that must be there, and that are taken if so */
    int (*write)(struct stream *, const struct export_options *, struct error *);
};

static const struct format formats[] = {
    {"wav", "ping", "survey,ping", NULL},
    {"csv", "detections", "detections", export_csv},
    {"json", NULL, NULL, export_lines},
    {"nrrd", "volume", "volume,detections", export_nrrd_file},
    {"png", "volume", "volume,detections", export_png},
    {"foxglove", "survey", NULL, export_foxglove},
    {"osi", "detections", "detections,ego", export_osi},
};

static const char *format_name(size_t i)
{
    return i < sizeof formats / sizeof *formats ? formats[i].name : NULL;
}

static const struct usage_option options[] = {
    {"format", USAGE_NAME('f', format_name)},
    {"out", USAGE_TEXT(struct export_options, out), .letter = 'o'},
    {"topic", USAGE_VALUE('t')},
    {"scan", USAGE_COUNT(struct export_options, scan, 1, UINT32_MAX),
     .expected = "a whole number above 0"},
    {"full", USAGE_FLAG(struct export_options, full)},
    {"scenes", USAGE_TEXT(struct export_options, scene)},
    {.name = NULL},
};

static int open_stream(struct stream **out, const struct format *f,
                       const struct export_options *o, struct error *why)
{
    int err = stream_open(out, o->file, why);

    if (err)
        return err;
    err = stream_require(*out, f->needs ? f->needs : o->topics, why);
    if (err)
        stream_close(*out);
    else
        stream_select(*out, f->wants ? f->wants : o->topics);
    return err;
}

static int run(const struct format *f, const struct export_options *o)
{
    struct stream *s;
    struct error why = {""};
    size_t n_missing = 0;

    interrupt_catch();
    int err = open_stream(&s, f, o, &why);
    if (err)
        return verb_end("export", err, &why);
    err = f->write ? f->write(s, o, &why) : export_wav(s, o, &n_missing, &why);
    stream_close(s);
    if (err == -ENODATA) /* not what was asked for */
        err = -EINVAL;
    if (err)
        return verb_end("export", err, &why);
    if (n_missing)
        fprintf(stderr,
                "anlos bag export: %s: %zu pings are missing; silence stands for "
                "them\n",
                o->file, n_missing);
    int code = usage_flush("bag export");
    return code ? code : n_missing ? EXIT_FAILED : EXIT_WORKED;
}

static int take_option(struct export_options *o, const struct format **f, int code)
{
    if (code == 't')
        return verb_add_patterns("bag export", optarg, o->topics_room, &o->topics);
    *f = &formats[choice_index(format_name, optarg)];
    return 0;
}

static int check(const struct export_options *o, const struct format *f)
{
    bool json = f && !f->needs;

    if (!f)
        return usage_error("bag export", "--format is missing");
    if (!o->out)
        return usage_error("bag export", "-o OUT is missing");
    if (!strcmp(o->out, "-") && !json && strcmp(f->name, "csv"))
        return usage_error("bag export",
                           "-o -: --format %s does not go to standard output, csv "
                           "and json do; name a file or folder",
                           f->name);
    if (o->full && !json && f->write != export_foxglove)
        return usage_error("bag export", "--full: only with --format json or foxglove");
    if (o->scene && f->write != export_osi)
        return usage_error("bag export", "--scenes: only with --format osi");
    if (o->scan &&
        (json || !strcmp(f->name, "csv") || f->write == export_osi || !f->wants))
        return usage_error("bag export", "--scan: only with --format wav, nrrd or png");
    if (o->topics && !json && strcmp(o->topics, f->needs))
        return usage_error("bag export", "--topic %s: --format %s is made of %s",
                           o->topics, f->name, f->wants ? f->needs : "all topics");
    return 0;
}

int bag_export(int argc, char **argv)
{
    struct export_options o = {.file = NULL};
    const struct format *format = NULL;
    struct usage usage = {
        .command = "bag export", .help = help, .options = options, .into = &o};
    int code;

    while ((code = usage_next(&usage, argc, argv)) > 0)
        if ((code = take_option(&o, &format, code)) != 0)
            return code;
    if (code)
        return ~code;
    code = verb_one_operand("bag export", "FILE", argc, argv);
    if (!code)
        code = check(&o, format);
    if (code)
        return code;
    o.file = argv[optind];
    return run(format, &o);
}
