/* SPDX-License-Identifier: MIT */
/* `anlos bag`: a small simulated recording there and back, and bags made for the purpose.
 */
#include "msgs/survey.pb-c.h"
#include "tests/hal/scratch.h"

#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include "hal/recording/recording.h"
#include "hal/survey/file.h"
#include "msgs/array.pb-c.h"
#include "msgs/bag/topic_message.h"
#include "msgs/detections.pb-c.h"
#include "msgs/tensor.h"
#include "msgs/volume.pb-c.h"
#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/bag/export.h"
#include "nodes/anlos/bag/stream.h"
#include "nodes/anlos/commands.h"
#include "nodes/rt/stop.h"
#include "tests/nodes/command.h"
#include "tests/nodes/near.h"

static struct command_result result;

static int run(const char *const words[])
{
    command_run(&result, command_bag, (char *const *)words);
    return result.code;
}

/* `anlos bag` with these words; its exit code. */
#define bag(...) run((const char *const[]){"bag", __VA_ARGS__, NULL})

static char folder[64]; /* with the recording "r" and its bag "r.mcap" */
static char recording[96], recorded_bag[96];

static int make_recording(void **state)
{
    struct scratch *s;

    if (scratch_open(state))
        return -1;
    s = *state;
    snprintf(folder, sizeof folder, "%s", s->folder);
    snprintf(recording, sizeof recording, "%s/r", folder);
    snprintf(recorded_bag, sizeof recorded_bag, "%s/r.mcap", folder);
    char *words[] = {"sim", SOURCE_DIR "/tests/nodes/point.yaml", "--out", recording,
                     NULL};
    command_run(&result, command_sim, words);
    return result.code ? -1 : bag("import", recording, "-o", recorded_bag);
}

/* A path in the folder; four may be in use at once. */
static const char *in_folder(const char *name)
{
    static char paths[4][192];
    static int next;
    char *path = paths[next++ % 4];

    snprintf(path, sizeof paths[0], "%.63s/%.127s", folder, name);
    return path;
}

static bool is_there(const char *name)
{
    return !access(in_folder(name), F_OK);
}

/* What no test may leave behind. */
static void assert_no_leftovers(void)
{
    char command[160];

    snprintf(command, sizeof command,
             "test -z \"$(find '%s' -name '*.part*' -o -name '.[a-z]*')\"", folder);
    assert_int_equal(system(command), 0);
}

static char *slurp(const char *name, size_t *size)
{
    FILE *f = fopen(in_folder(name), "rb");
    assert_non_null(f);
    fseek(f, 0, SEEK_END);
    *size = (size_t)ftell(f);
    rewind(f);
    char *data = malloc(*size + 1);
    assert_int_equal(fread(data, 1, *size, f), *size);
    data[*size] = '\0';
    fclose(f);
    return data;
}

static void assert_same(const char *a, const char *b)
{
    size_t n[2];
    char *x = slurp(a, &n[0]), *y = slurp(b, &n[1]);

    assert_int_equal(n[0], n[1]);
    assert_memory_equal(x, y, n[0]);
    free(x);
    free(y);
}

static void export_lines_of(const char *from, const char *to)
{
    if (bag("export", in_folder(from), "--format", "json", "-o", in_folder(to)))
        fail_msg("%s", result.err);
}

/* Samples of a recording's pass, [n_positions][n_microphones][frames]. */
static float *read_pass(const char *in, const char *pass, size_t *n, uint64_t *id)
{
    struct error why = {""};
    struct survey s;
    struct recording *r;
    uint32_t counts[2][64];
    char path[200];

    snprintf(path, sizeof path, "%.90s/survey.yaml", in);
    if (survey_load(&s, path, &why))
        fail_msg("%s", why.text);
    *id = survey_id(&s);
    snprintf(path, sizeof path, "%.90s/%s", in, pass);
    if (recording_open(&r, path, &s, &why))
        fail_msg("%s", why.text);
    size_t frames = s.n_microphones * recording_frames(r);
    float *x = malloc(s.n_positions * frames * sizeof *x);
    for (size_t k = 0; k < s.n_positions; k++)
        assert_int_equal(recording_read(r, k, x + k * frames, counts[0], counts[1], &why),
                         0);
    *n = s.n_positions * frames;
    recording_close(r);
    survey_clear(&s);
    return x;
}

static void a_recording_comes_back_out_of_its_bag(void **state)
{
    static const char *const passes[] = {"scene", "background"};

    (void)state;
    if (bag("export", recorded_bag, "--format", "wav", "-o", in_folder("back")))
        fail_msg("%s", result.err);
    for (int i = 0; i < 2; i++) {
        size_t n[2];
        uint64_t id[2];
        float *x = read_pass(recording, passes[i], &n[0], &id[0]);
        float *y = read_pass(in_folder("back"), passes[i], &n[1], &id[1]);
        assert_int_equal(n[0], n[1]);
        assert_true(id[0] == id[1]);
        assert_memory_equal(x, y, n[0] * sizeof *x);
        free(x);
        free(y);
    }
    assert_no_leftovers();
}

static void equal_recordings_become_equal_bags(void **state)
{
    (void)state;
    assert_int_equal(bag("import", recording, "-o", in_folder("again.mcap")), 0);
    assert_same("r.mcap", "again.mcap");
    assert_int_equal(bag("check", recorded_bag, in_folder("again.mcap")), 0);
    assert_contains(result.out, "no fault");
}

static void info_tells_what_is_there(void **state)
{
    json_t *o, *topic;
    size_t i;

    (void)state;
    assert_int_equal(bag("info", recorded_bag), 0);
    assert_contains(result.out, "ping           anlos.Ping");
    assert_contains(result.out, "survey.yaml");
    assert_contains(result.out, "zstd");
    assert_int_equal(bag("info", "--json", recorded_bag), 0);
    o = json_loads(result.out, 0, NULL);
    assert_non_null(o);
    json_array_foreach(json_object_get(o, "topics"), i, topic)
    {
        json_int_t n = json_integer_value(json_object_get(topic, "messages"));
        if (i == 1) { /* 24 pings of a pass, a slot of 31.25 ms each */
            assert_string_equal(json_string_value(json_object_get(topic, "topic")),
                                "ping");
            assert_int_equal(n, 48);
            assert_near(json_number_value(json_object_get(topic, "rate_hz")), 32.0, 1e-6);
        }
    }
    assert_int_equal(json_integer_value(json_object_get(o, "messages")), 50);
    json_decref(o);
}

static void parts_of_a_bag_merge_into_the_whole(void **state)
{
    (void)state;
    assert_int_equal(
        bag("filter", recorded_bag, "-o", in_folder("1.mcap"), "--end", "0.7"), 0);
    assert_int_equal(
        bag("filter", recorded_bag, "-o", in_folder("2.mcap"), "--start", "0.7000001"),
        0);
    assert_int_equal(bag("merge", in_folder("2.mcap"), in_folder("1.mcap"), "-o",
                         in_folder("12.mcap"), "--compression", "lz4"),
                     0);
    assert_int_equal(bag("check", in_folder("12.mcap")), 0);
    export_lines_of("r.mcap", "r.json");
    export_lines_of("12.mcap", "12.json");
    assert_same("r.json", "12.json");
    assert_int_equal(bag("info", in_folder("12.mcap")), 0);
    assert_contains(result.out, "lz4");
    /* The attachment and the metadata were the same in both. */
    assert_null(strstr(strstr(result.out, "survey.yaml") + 1, "survey.yaml"));
    assert_no_leftovers();
}

static long size_of(const char *name)
{
    size_t size;

    free(slurp(name, &size));
    return (long)size;
}

static void shuffled_sound_is_smaller_and_the_same_to_who_reads_it(void **state)
{
    (void)state;
    if (bag("filter", recorded_bag, "-o", in_folder("kept.mcap")) ||
        bag("filter", recorded_bag, "-o", in_folder("shuffled.mcap"), "--shuffle") ||
        bag("filter", in_folder("shuffled.mcap"), "-o", in_folder("still.mcap")) ||
        bag("merge", in_folder("still.mcap"), "-o", in_folder("plain.mcap"), "--plain"))
        fail_msg("%s", result.err);
    assert_true(size_of("shuffled.mcap") < 0.95 * (double)size_of("kept.mcap"));
    assert_same("shuffled.mcap", "still.mcap");
    assert_same("kept.mcap", "plain.mcap");
    assert_int_equal(bag("check", in_folder("shuffled.mcap")), 0);
    export_lines_of("kept.mcap", "kept.json");
    export_lines_of("shuffled.mcap", "shuffled.json");
    assert_same("kept.json", "shuffled.json");
    if (bag("export", in_folder("shuffled.mcap"), "--format", "wav", "-o",
            in_folder("unshuffled")) ||
        bag("import", in_folder("unshuffled"), "-o", in_folder("back.mcap")))
        fail_msg("%s", result.err);
    assert_same("r.mcap", "back.mcap");
    assert_no_leftovers();
}

static void topics_are_filtered_by_name_and_pattern(void **state)
{
    (void)state;
    assert_int_equal(
        bag("filter", recorded_bag, "-o", in_folder("s.mcap"), "--topics", "sur*"), 0);
    assert_contains(result.out, "2 of 50 messages");
    assert_int_equal(bag("filter", recorded_bag, "-o", in_folder("p.mcap"), "--exclude",
                         "survey,stage/*"),
                     2);
    assert_contains(result.err, "stage/*");
    assert_false(is_there("p.mcap"));
    assert_int_equal(
        bag("filter", recorded_bag, "-o", in_folder("p.mcap"), "--exclude", "survey"), 0);
    assert_contains(result.out, "48 of 50 messages");
}

static void lines_go_to_stdout_too(void **state)
{
    size_t size;

    (void)state;
    export_lines_of("r.mcap", "file.json");
    assert_int_equal(
        bag("export", recorded_bag, "--format", "json", "--topic", "survey", "-o", "-"),
        0);
    char *text = slurp("file.json", &size);
    /* The first survey is the first message, and nothing else is said. */
    assert_memory_equal(result.out, text, strcspn(text, "\n") + 1);
    assert_int_equal(result.out[strlen(result.out) - 1], '\n');
    assert_int_equal(result.out[strlen(result.out) - 2], '}');
    free(text);
}

/* Not the last one alone. */
static void topics_named_one_by_one_are_all_taken(void **state)
{
    (void)state;
    assert_int_equal(bag("export", recorded_bag, "--format", "json", "--topic", "survey",
                         "--topic", "ping", "-o", "-"),
                     0);
    assert_contains(result.out, "\"topic\":\"survey\"");
    assert_contains(result.out, "\"topic\":\"ping\"");
    assert_int_equal(bag("filter", recorded_bag, "-o", in_folder("q.mcap"), "--exclude",
                         "survey", "--exclude", "ping"),
                     0);
    assert_int_equal(bag("export", in_folder("q.mcap"), "--format", "json", "-o", "-"),
                     0);
    assert_null(strstr(result.out, "\"topic\":\"survey\""));
    assert_null(strstr(result.out, "\"topic\":\"ping\""));
}

static void what_was_cut_is_recovered_and_told(void **state)
{
    size_t size;
    char *data = slurp("r.mcap", &size);
    FILE *f = fopen(in_folder("cut.mcap"), "wb");

    (void)state;
    fwrite(data, 1, size / 2, f);
    fclose(f);
    assert_int_equal(bag("check", in_folder("cut.mcap")), 1);
    assert_contains(result.out, "byte ");
    assert_int_equal(bag("info", in_folder("cut.mcap")), 2);
    assert_contains(result.err, "anlos bag recover");
    assert_int_equal(bag("recover", in_folder("cut.mcap"), "-o", in_folder("saved.mcap")),
                     1);
    assert_contains(result.out, "the file was cut");
    assert_contains(result.out, "its end is missing");
    assert_int_equal(bag("check", in_folder("saved.mcap")), 0);
    assert_int_equal(bag("recover", recorded_bag, "-o", in_folder("all.mcap")), 0);
    assert_contains(result.out, "nothing was lost");
    assert_int_equal(
        bag("recover", SOURCE_DIR "/README.md", "-o", in_folder("none.mcap")), 2);
    assert_contains(result.err, "README.md: nothing in it is whole: it is no bag");
    assert_false(is_there("none.mcap"));
    export_lines_of("r.mcap", "whole.json");
    export_lines_of("all.mcap", "all.json");
    assert_same("whole.json", "all.json");
    free(data);
    assert_no_leftovers();
}

/* -- bags of single messages ------------------------------------------------------------
 */

struct making {
    struct bag_writer *writer;
    struct bag_topics *topics;
    int64_t now_ns;
};

static struct making make(const char *name)
{
    const struct bag_writer_config cfg = {.profile = "", .library = ""};
    struct making m = {.now_ns = 1000};
    struct error why = {""};

    if (bag_writer_create(&m.writer, in_folder(name), &cfg, &why))
        fail_msg("%s", why.text);
    assert_int_equal(bag_topics_create(&m.topics, m.writer), 0);
    return m;
}

static void add_bytes(struct making *m, const char *topic, const uint8_t *data,
                      size_t size)
{
    struct error why = {""};
    struct envelope e = {.node = "test",
                         .capture_ns = m->now_ns,
                         .publish_ns = m->now_ns + 5,
                         .payload_size = (uint32_t)size};

    m->now_ns += 10;
    snprintf(e.topic, sizeof e.topic, "%s", topic);
    if (bag_topics_put(m->topics, &e, data, NULL, &why))
        fail_msg("%s", why.text);
}

static void add(struct making *m, const char *topic, const ProtobufCMessage *message)
{
    size_t size = protobuf_c_message_get_packed_size(message);
    uint8_t *data = malloc(size + 1);

    protobuf_c_message_pack(message, data);
    add_bytes(m, topic, data, size);
    free(data);
}

static void made(struct making *m)
{
    struct error why = {""};

    bag_topics_destroy(m->topics);
    if (bag_writer_close(m->writer, &why))
        fail_msg("%s", why.text);
}

static Anlos__Vec3 vec3(double x, double y, double z)
{
    Anlos__Vec3 v = ANLOS__VEC3__INIT;

    v.x = x;
    v.y = y;
    v.z = z;
    return v;
}

static void detections_become_lines_of_a_table(void **state)
{
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;
    Anlos__Detection d = ANLOS__DETECTION__INIT, *all[] = {&d, &d};
    Anlos__Vec3 at = vec3(1.5, -2, 0.25), at_virtual = vec3(0.1, 0.2, 0.3);
    double covariance[] = {1, 2, 3, 4, 5, 6};
    struct making m = make("d.mcap");
    size_t size;

    (void)state;
    d.id = 7;
    d.position_m = &at;
    d.virtual_m = &at_virtual;
    d.covariance_m2 = covariance;
    d.n_covariance_m2 = 6;
    d.existence = 0.75;
    d.level_db = NAN;
    list.scan = 2;
    list.counter = 9;
    list.mirrored = list.in_vehicle_frame = true;
    list.detections = all;
    list.n_detections = 1;
    add(&m, "detections", &list.base);
    made(&m);
    assert_int_equal(
        bag("export", in_folder("d.mcap"), "--format", "csv", "-o", in_folder("d.csv")),
        0);
    char *text = slurp("d.csv", &size);
    assert_string_equal(
        strchr(text, '\n') + 1,
        "1000,1005,2,9,0,vehicle,1,7,1.5,-2,0.25,1,2,3,4,5,6,0.75,,0.1,0.2,0.3,,,\n");
    free(text);
}

static void the_last_final_volume_becomes_nrrd_and_pictures(void **state)
{
    float voxels[24];
    struct tensor_view view;
    Anlos__Volume v = ANLOS__VOLUME__INIT;
    Anlos__Vec3 origin = vec3(1, 2, 3), step = vec3(0.5, 0.25, 0.125);
    struct making m = make("v.mcap");
    size_t size;

    (void)state;
    v.origin_m = &origin;
    v.step_m = &step;
    for (uint32_t i = 0; i < 3; i++) { /* a preview, the image, a preview repeated */
        for (int k = 0; k < 24; k++)
            voxels[k] = (float)(k + 100 * (int)i);
        v.intensity =
            tensor_borrow_f32(&view, voxels, 3, (size_t)4, (size_t)3, (size_t)2);
        v.scan = 1;
        v.preview = i != 1;
        add(&m, "volume", &v.base);
    }
    made(&m);
    assert_int_equal(
        bag("export", in_folder("v.mcap"), "--format", "nrrd", "-o", in_folder("v.nrrd")),
        0);
    char *text = slurp("v.nrrd", &size);
    assert_contains(text, "sizes: 2 3 4");
    for (int k = 0; k < 24; k++)
        voxels[k] = (float)(k + 100);
    assert_memory_equal(text + size - sizeof voxels, voxels, sizeof voxels);
    free(text);
    assert_int_equal(bag("export", in_folder("v.mcap"), "--format", "png", "-o",
                         in_folder("pictures")),
                     0);
    assert_true(is_there("pictures/projection_xz.png"));
    assert_int_equal(bag("export", in_folder("v.mcap"), "--format", "png", "-o",
                         in_folder("pictures")),
                     2);
    assert_contains(result.err, "projection_xy.png exists already");
    assert_int_equal(bag("export", in_folder("v.mcap"), "--format", "nrrd", "-o",
                         in_folder("w.nrrd"), "--scan", "2"),
                     2);
    assert_contains(result.err, "scan 2");
    assert_no_leftovers();
}

/* The pings of the recording's bag again, changed on their way. */
static void copy_pings(struct making *m, bool (*change)(Anlos__Ping *, size_t i))
{
    struct error why = {""};
    struct stream_message in;
    struct stream *s;
    size_t i = 0;

    if (stream_open(&s, recorded_bag, &why))
        fail_msg("%s", why.text);
    while (!stream_next(s, &in, &why)) {
        ProtobufCMessage *content;
        assert_int_equal(stream_unpack(&content, s, &in, &why), 0);
        if (in.topic != topic_ping() || change((Anlos__Ping *)content, i++))
            add(m, in.topic->name, content);
        protobuf_c_message_free_unpacked(content, NULL);
    }
    stream_close(s);
}

static bool spoil_the_third(Anlos__Ping *p, size_t i)
{
    if (i != 2)
        return true;
    memset(p->samples->data.data, 0x3d, p->samples->data.len);
    p->valid = false;
    return true;
}

static bool keep_the_third(Anlos__Ping *p, size_t i)
{
    (void)p;
    return i == 2;
}

static bool shift_the_stage(Anlos__Ping *p, size_t i)
{
    (void)i;
    p->stage_m += 0.001;
    return true;
}

static void a_ping_that_was_taken_again_stands_for_the_failed_one(void **state)
{
    struct making m = make("retaken.mcap");
    size_t n[2];
    uint64_t id[2];

    (void)state;
    copy_pings(&m, spoil_the_third);
    copy_pings(&m, keep_the_third);
    made(&m);
    if (bag("export", in_folder("retaken.mcap"), "--format", "wav", "-o",
            in_folder("retaken")))
        fail_msg("%s", result.err);
    assert_contains(result.out, "1 pings were taken again");
    float *x = read_pass(recording, "background", &n[0], &id[0]);
    float *y = read_pass(in_folder("retaken"), "background", &n[1], &id[1]);
    assert_memory_equal(x, y, n[0] * sizeof *x);
    free(x);
    free(y);
}

static void a_ping_that_is_missing_is_told(void **state)
{
    struct making m = make("lossy.mcap");

    (void)state;
    copy_pings(&m, spoil_the_third);
    made(&m);
    assert_int_equal(bag("export", in_folder("lossy.mcap"), "--format", "wav", "-o",
                         in_folder("lossy")),
                     1);
    assert_contains(result.err, "1 pings are missing");
    assert_contains(result.out, "47 of 48 pings");
    assert_true(is_there("lossy/survey.yaml"));
}

static void the_survey_of_an_export_says_where_the_stage_stood(void **state)
{
    struct making m = make("shifted.mcap");
    struct error why = {""};
    struct survey s[2];
    char path[200];

    (void)state;
    copy_pings(&m, shift_the_stage);
    made(&m);
    assert_int_equal(bag("export", in_folder("shifted.mcap"), "--format", "wav", "-o",
                         in_folder("shifted")),
                     0);
    snprintf(path, sizeof path, "%s/survey.yaml", recording);
    assert_int_equal(survey_load(&s[0], path, &why), 0);
    assert_int_equal(survey_load(&s[1], in_folder("shifted/survey.yaml"), &why), 0);
    for (size_t k = 0; k < s[0].n_positions; k++)
        assert_near(s[1].stage_positions_m[k], s[0].stage_positions_m[k] + 0.001, 1e-9);
    survey_clear(&s[0]);
    survey_clear(&s[1]);
}

static void a_message_that_is_none_is_told_and_does_no_harm(void **state)
{
    struct making m = make("garbled.mcap");
    const uint8_t noise[] = {0xff, 0xff, 0xff, 0xff};
    size_t size;

    (void)state;
    add_bytes(&m, "ping", noise, sizeof noise);
    made(&m);
    assert_int_equal(bag("export", in_folder("garbled.mcap"), "--format", "wav", "-o",
                         in_folder("garbled")),
                     2);
    assert_contains(result.err, "is none");
    assert_false(is_there("garbled"));
    export_lines_of("garbled.mcap", "garbled.json");
    char *text = slurp("garbled.json", &size);
    assert_contains(text, "not a message of the topic's schema");
    free(text);
}

/* -- refusals ---------------------------------------------------------------------------
 */

/* -- of an array that stands ------------------------------------------------------------
 */

enum { DRIVE_SLOT = 1200, DRIVE_MICS = 2, DRIVE_SLOTS = 31 };

static const char drive_survey[] =
    "temperature_c: 20\n"
    "sample_rate_hz: 48000\n"
    "slot_samples: 1200\n"
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.01}\n"
    "speakers_m: [[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]]\n"
    "microphones_m: [[0, 0.1, 0], [0.1, 0.1, 0]]\n"
    "gate_m: [0.3, 3]\n";

static float drive_sound[DRIVE_MICS][DRIVE_SLOTS * DRIVE_SLOT + 900];

static void put_text(const char *name, const char *text)
{
    FILE *f = fopen(in_folder(name), "w");

    assert_non_null(f);
    assert_true(fputs(text, f) >= 0);
    assert_int_equal(fclose(f), 0);
}

/* 31 slots of three speakers, and three quarters of one more. */
static void make_drive(const char *name, const char *table, const char *ego)
{
    struct error why = {""};
    uint32_t x = 1;
    char path[128];

    for (size_t i = 0; i < sizeof drive_sound / sizeof(float); i++) {
        x = x * 1664525u + 1013904223u;
        (&drive_sound[0][0])[i] = (float)(x >> 8) / 0x1p25f - 0.25f;
    }
    assert_int_equal(mkdir(in_folder(name), 0777), 0);
    snprintf(path, sizeof path, "%s/survey.yaml", name);
    put_text(path, drive_survey);
    snprintf(path, sizeof path, "%s/scene", name);
    assert_int_equal(mkdir(in_folder(path), 0777), 0);
    if (recording_write(in_folder(path), 0, DRIVE_MICS, DRIVE_SLOTS * DRIVE_SLOT + 900,
                        48000, drive_sound[0], &why))
        fail_msg("%s", why.text);
    if (table) {
        snprintf(path, sizeof path, "%s/scene/emissions.csv", name);
        put_text(path, table);
    }
    if (ego) {
        snprintf(path, sizeof path, "%s/ego.csv", name);
        put_text(path, ego);
    }
}

/* The pings of a bag, checked against the sound; their number. */
static size_t check_drive(const char *bag, const struct emission *expected, size_t n)
{
    struct error why = {""};
    struct stream_message m;
    struct stream *s;
    size_t at = 0, extents[2];

    assert_int_equal(stream_open(&s, in_folder(bag), &why), 0);
    stream_select(s, "ping");
    while (!stream_next(s, &m, &why)) {
        ProtobufCMessage *content;
        assert_int_equal(stream_unpack(&content, s, &m, &why), 0);
        Anlos__Ping *p = (Anlos__Ping *)content;
        assert_true(at < n);
        const float *x = tensor_f32(p->samples, 2, extents);
        assert_int_equal(p->speaker, expected[at].speaker);
        assert_int_equal(p->frame, expected[at].frame);
        assert_true(m.envelope.capture_ns == expected[at].time_ns);
        for (size_t c = 0; c < DRIVE_MICS; c++)
            for (size_t i = 0; i < extents[1]; i++) {
                size_t from = (size_t)expected[at].sample + i;
                bool there = from < DRIVE_SLOTS * DRIVE_SLOT + 900;
                assert_true(x[c * extents[1] + i] ==
                            (there ? drive_sound[c][from] : 0.0f));
            }
        anlos__ping__free_unpacked(p, NULL);
        at++;
    }
    stream_close(s);
    return at;
}

/* Out of the bag, and into another one: the same messages at the same times. */
static void assert_round_trip(const char *name, const char *topics)
{
    char names[5][64];
    static const char *const ends[] = {".mcap", ".trip", ".trip.mcap", ".first.txt",
                                       ".second.txt"};

    for (int i = 0; i < 5; i++)
        snprintf(names[i], sizeof names[i], "%s%s", name, ends[i]);
    if (bag("export", in_folder(names[0]), "--format", "wav", "-o",
            in_folder(names[1])) ||
        bag("import", in_folder(names[1]), "-o", in_folder(names[2])))
        fail_msg("%s", result.err);
    for (int i = 0; i < 2; i++)
        if (bag("export", in_folder(names[2 * i]), "--format", "json", "--full",
                "--topic", topics, "-o", in_folder(names[3 + i])))
            fail_msg("%s", result.err);
    assert_same(names[3], names[4]);
    assert_no_leftovers();
}

static void a_recording_that_goes_on_is_imported_to_its_end(void **state)
{
    struct emission expected[DRIVE_SLOTS];

    (void)state;
    for (size_t k = 0; k < DRIVE_SLOTS; k++)
        expected[k] = (struct emission){.sample = k * DRIVE_SLOT,
                                        .speaker = k % 3,
                                        .frame = (uint32_t)k / 3 + 1,
                                        .time_ns = 1000000000 + (int64_t)k * 25000000};
    make_drive("endless", NULL, NULL);
    if (bag("import", in_folder("endless"), "-o", in_folder("endless.mcap")))
        fail_msg("%s", result.err);
    assert_non_null(strstr(result.out, ": 31 pings\n"));
    assert_int_equal(check_drive("endless.mcap", expected, DRIVE_SLOTS), DRIVE_SLOTS);
    assert_round_trip("endless", "ping,survey");
}

/* Two of three speakers; one and another sound together; half a slot late; a long pause;
 * a wrong one: in Unix time, as is the vehicle's. */
static void a_drive_goes_in_and_out_with_its_times_and_its_motion(void **state)
{
    static const int64_t t_ns = INT64_C(1795393947812990809);
    static const struct emission expected[] = {
        {300, 0, 1, false, true, true, t_ns, 20.0},
        {300, 2, 1, false, true, true, t_ns, 20.0},
        {1500, 0, 2, false, true, true, t_ns + 25000000, 20.0},
        {3300, 2, 2, false, false, true, t_ns + 62500000, 20.0},
        {20000, 0, 9, false, true, true, t_ns + INT64_C(900000000000), 20.0},
        {37500, 2, 9, false, true, true, t_ns + INT64_C(900364583333), 20.0}};
    char table[2000] = "sample,speaker,frame,valid,time_s\n";
    size_t n = sizeof expected / sizeof *expected;

    (void)state;
    for (size_t i = 0; i < n; i++)
        snprintf(table + strlen(table), sizeof table - strlen(table),
                 "%d,%u,%u,%d,%lld.%09lld\n", (int)expected[i].sample,
                 expected[i].speaker, expected[i].frame, expected[i].valid,
                 (long long)expected[i].time_ns / 1000000000,
                 (long long)expected[i].time_ns % 1000000000);
    make_drive("moving", table,
               "time_s;speed_m_s;yaw_rate_rad_s;valid\n"
               "1795393947,5;1,5;-0,25;1\n"
               "1795393947,9;0;0;1\n"
               "1795394900;;;0\n");
    if (bag("import", in_folder("moving"), "-o", in_folder("moving.mcap")))
        fail_msg("%s", result.err);
    assert_non_null(strstr(result.out, ": 6 pings, 3 messages of ego motion\n"));
    assert_int_equal(check_drive("moving.mcap", expected, n), n);
    assert_round_trip("moving", "ping,survey,ego");
}

/* A bag as a program writes it that does not know what ids are made of. */
static void strip_ids(const char *from, const char *to)
{
    const struct bag_writer_config cfg = {
        .profile = "", .library = "test", .chunk_size = 1 << 20};
    struct error why = {""};
    struct stream_message m;
    struct bag_writer *writer;
    struct bag_topics *topics;
    struct stream *s;
    size_t stripped = 0;

    assert_int_equal(stream_open(&s, from, &why), 0);
    assert_int_equal(bag_writer_create(&writer, in_folder(to), &cfg, &why), 0);
    assert_int_equal(bag_topics_create(&topics, writer), 0);
    while (!stream_next(s, &m, &why)) {
        ProtobufCMessage *content;
        assert_int_equal(stream_unpack(&content, s, &m, &why), 0);
        if (m.topic == topic_survey())
            ((Anlos__Survey *)content)->id = 0;
        if (m.topic == topic_ping())
            ((Anlos__Ping *)content)->survey_id = 0;
        stripped += m.topic == topic_survey() || m.topic == topic_ping();
        size_t size = protobuf_c_message_get_packed_size(content);
        uint8_t *bytes = malloc(size + 1);
        protobuf_c_message_pack(content, bytes);
        m.envelope.payload_size = (uint32_t)size;
        assert_int_equal(bag_topics_put(topics, &m.envelope, bytes, NULL, &why), 0);
        free(bytes);
        protobuf_c_message_free_unpacked(content, NULL);
    }
    assert_true(stripped > 2);
    stream_close(s);
    bag_topics_destroy(topics);
    assert_int_equal(bag_writer_close(writer, &why), 0);
}

static void a_recording_without_ids_is_taken_with_the_survey_that_it_has(void **state)
{
    char bags[2][128], outs[2][128];

    (void)state;
    snprintf(bags[0], sizeof bags[0], "%s", recorded_bag);
    strip_ids(recorded_bag, "stripped.mcap");
    snprintf(bags[1], sizeof bags[1], "%.100s/stripped.mcap", folder);
    for (int i = 0; i < 2; i++) {
        snprintf(outs[i], sizeof outs[i], "%.100s/image%d", folder, i);
        char *words[] = {"recon", "--bag", bags[i], "--out", outs[i], NULL};
        command_run(&result, command_recon, words);
        if (result.code)
            fail_msg("%s", result.err);
    }
    assert_same("image0/volume.nrrd", "image1/volume.nrrd");
    assert_same("image0/detections.json", "image1/detections.json");
    if (bag("export", bags[1], "--format", "wav", "-o", in_folder("stripped")) ||
        bag("import", in_folder("stripped"), "-o", in_folder("numbered.mcap")))
        fail_msg("%s", result.err);
    export_lines_of("r.mcap", "with.txt");
    export_lines_of("numbered.mcap", "without.txt");
    assert_same("with.txt", "without.txt");
}

static void what_does_not_go_with_a_drive_is_said(void **state)
{
    (void)state;
    make_drive("late", NULL, "time_s,speed_m_s,yaw_rate_rad_s\n1795393947,0,0\n");
    assert_int_equal(bag("import", in_folder("late"), "-o", in_folder("late.mcap")), 2);
    assert_non_null(strstr(result.err, "ego.csv: is of 1795393947.000"));
    make_drive("beyond", "sample,speaker\n0,0\n38100,1\n", NULL);
    assert_int_equal(bag("import", in_folder("beyond"), "-o", in_folder("beyond.mcap")),
                     2);
    assert_non_null(strstr(result.err, "the last emission is at sample 38100, but"));
    assert_int_equal(bag("import", recording, "--ego", in_folder("late/ego.csv"), "-o",
                         in_folder("scan.mcap")),
                     2);
    assert_non_null(strstr(result.err, "a scan is taken by a vehicle that stands"));
    assert_false(is_there("late.mcap") || is_there("beyond.mcap"));
    assert_no_leftovers();
}

static void a_file_that_is_there_is_not_written_over(void **state)
{
    static const char *const verbs[] = {"recover", "filter", "merge"};

    (void)state;
    for (size_t i = 0; i < 3; i++) {
        assert_int_equal(bag(verbs[i], recorded_bag, "-o", recorded_bag), 2);
        assert_contains(result.err, "exists already");
    }
    assert_int_equal(bag("import", recording, "-o", recorded_bag), 2);
    assert_int_equal(bag("export", recorded_bag, "--format", "json", "-o", recorded_bag),
                     2);
    assert_int_equal(bag("export", recorded_bag, "--format", "wav", "-o", recording), 2);
    assert_contains(result.err, "exists already");
    assert_int_equal(mkdir(in_folder("places"), 0777), 0);
    FILE *f = fopen(in_folder("places/survey.yaml-pings.csv"), "w");
    assert_non_null(f);
    fclose(f);
    assert_int_equal(
        bag("export", recorded_bag, "--format", "wav", "-o", in_folder("places")), 2);
    assert_contains(result.err, "survey.yaml-pings.csv exists already");
    assert_int_equal(bag("check", recorded_bag), 0);
}

static int write_nowhere(FILE *f, void *context, struct error *why)
{
    (void)context;
    (void)why;
    return fputs("a line\n", f) < 0 ? -EIO : 0;
}

/* As of `| head`: of a file on a full disk it would be an error. */
static int write_to_nobody(int argc, char **argv)
{
    struct error why = {""};
    int ends[2];

    (void)argc;
    (void)argv;
    interrupt_catch();
    if (pipe(ends) || dup2(ends[1], STDOUT_FILENO) < 0 || close(ends[0]))
        return 127;
    return verb_end("export", verb_write_file("-", write_nowhere, NULL, &why), &why);
}

static void who_reads_no_further_is_told_nothing(void **state)
{
    char *const words[] = {(char *)"x", NULL};

    (void)state;
    command_run(&result, write_to_nobody, words);
    assert_int_equal(result.code, 141);
    assert_string_equal(result.err, "");
}

static void ctrl_c_leaves_no_file(void **state)
{
    char *files[] = {recorded_bag};
    const struct selection s = {
        .files = files, .n_files = 1, .end_s = INFINITY, .out = in_folder("half.mcap")};
    const struct import_options o = {.from = recording, .out = in_folder("i.mcap")};
    struct selection_result r;
    struct import_bag *b;
    struct error why = {""};

    (void)state;
    interrupt_catch();
    raise(SIGINT);
    assert_int_equal(selection_write(&s, &r, &why), -EINTR);
    assert_int_equal(import_bag_begin(&b, o.out, BAG_ZSTD, &why), 0);
    assert_int_equal(import_bag_end(b, import_recording(b, &o, &why), &why), -EINTR);
    interrupt_catch();
    assert_false(is_there("half.mcap"));
    assert_false(is_there("i.mcap"));
    assert_no_leftovers();
}

/* Ctrl-C before the first message. */
static int filter_is_stopped(int argc, char **argv)
{
    char *files[] = {recorded_bag};
    const struct selection s = {
        .files = files, .n_files = 1, .end_s = INFINITY, .out = argv[argc - 1]};
    struct selection_result r;
    struct error why = {""};

    interrupt_catch();
    raise(SIGINT);
    return verb_end("filter", selection_write(&s, &r, &why), &why);
}

static int export_is_stopped(int argc, char **argv)
{
    const struct export_options o = {.file = recorded_bag, .out = argv[argc - 1]};
    struct stream *s;
    struct error why = {""};

    interrupt_catch();
    if (stream_open(&s, o.file, &why))
        return 127;
    raise(SIGINT);
    int err = export_lines(s, &o, &why);
    stream_close(s);
    return verb_end("export", err, &why);
}

static void ctrl_c_says_how_far_it_came_and_that_there_is_no_file(void **state)
{
    char *const words[] = {(char *)"x", (char *)in_folder("half.mcap"), NULL};
    char no_file[300];

    (void)state;
    snprintf(no_file, sizeof no_file, "; there is no %s\n", words[1]);
    command_run(&result, filter_is_stopped, words);
    assert_int_equal(result.code, 130);
    assert_contains(result.err, "anlos bag filter: interrupted after 0 messages; ");
    assert_contains(result.err, no_file);
    command_run(&result, export_is_stopped, words);
    assert_int_equal(result.code, 130);
    assert_contains(result.err, ": interrupted at 0.0 of ");
    assert_contains(result.err, no_file);
    assert_no_leftovers();
}

static void wrong_arguments_are_refused(void **state)
{
    static const struct {
        const char *words[5], *text;
    } all[] = {
        {{NULL}, "is missing"},
        {{"inof"}, "inof: no such verb; did you mean info?"},
        {{"plya"}, "plya: no such verb; did you mean play?"},
        {{"xyzzy"}, "xyzzy: no such verb; expected record, save"},
        {{"info"}, "FILE is missing"},
        {{"info", "a", "b"}, "b: unexpected"},
        {{"info", "--jsn", "a"}, "did you mean --json?"},
        {{"info", "/nowhere/a.mcap"}, "/nowhere/a.mcap"},
        {{"check"}, "FILE is missing"},
        {{"check", SOURCE_DIR "/README.md"}, "no MCAP file"},
        {{"recover", "a"}, "-o OUT is missing"},
        {{"merge", "-o", "b"}, "FILE is missing"},
        {{"merge", "a", "-o", "b", "--compression"}, "expected a value"},
        {{"filter", "a", "--start", "-1"}, "--start -1: expected seconds"},
        {{"merge", "a", "--shuffle", "--compression", "none"}, "--shuffle: is for"},
        {{"export", "a", "-o", "b"}, "--format is missing"},
        {{"export", "a", "--format", "mp3"}, "--format mp3: expected wav"},
        {{"export", "a", "--format=png", "-o", "-"}, "-o -: --format png does not go"},
        {{"export", "a", "--format=wav", "-o", "-"}, "-o -: --format wav does not go"},
        {{"import", "-o", "b"}, "FOLDER or FILE.mat is missing"},
        {{"import", "/nowhere", "-o", "/tmp/anlos-never"}, "/nowhere"},
    };

    (void)state;
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        const char *const *w = all[i].words;
        int code = bag(w[0], w[1], w[2], w[3], w[4]);
        if (code != 2 || !strstr(result.err, all[i].text))
            fail_msg("%zu: %d, %s", i, code, result.err);
    }
    assert_int_equal(bag("filter", "a", "-o", "b", "--start", "2", "--end"), 2);
}

static void every_verb_explains_itself(void **state)
{
    static const char *const verbs[] = {"info",   "check",  "recover", "merge",
                                        "filter", "export", "import"};

    (void)state;
    assert_int_equal(bag("--help"), 0);
    for (size_t i = 0; i < sizeof verbs / sizeof *verbs; i++) {
        char text[40];
        assert_contains(result.out, verbs[i]);
        snprintf(text, sizeof text, "usage: anlos bag %s", verbs[i]);
        assert_int_equal(bag(verbs[i], "--help"), 0);
        assert_contains(result.out, text);
        assert_int_equal(bag("--help"), 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_recording_comes_back_out_of_its_bag),
        cmocka_unit_test(equal_recordings_become_equal_bags),
        cmocka_unit_test(a_recording_that_goes_on_is_imported_to_its_end),
        cmocka_unit_test(a_drive_goes_in_and_out_with_its_times_and_its_motion),
        cmocka_unit_test(what_does_not_go_with_a_drive_is_said),
        cmocka_unit_test(a_recording_without_ids_is_taken_with_the_survey_that_it_has),
        cmocka_unit_test(info_tells_what_is_there),
        cmocka_unit_test(parts_of_a_bag_merge_into_the_whole),
        cmocka_unit_test(shuffled_sound_is_smaller_and_the_same_to_who_reads_it),
        cmocka_unit_test(topics_are_filtered_by_name_and_pattern),
        cmocka_unit_test(lines_go_to_stdout_too),
        cmocka_unit_test(topics_named_one_by_one_are_all_taken),
        cmocka_unit_test(who_reads_no_further_is_told_nothing),
        cmocka_unit_test(what_was_cut_is_recovered_and_told),
        cmocka_unit_test(detections_become_lines_of_a_table),
        cmocka_unit_test(the_last_final_volume_becomes_nrrd_and_pictures),
        cmocka_unit_test(a_ping_that_was_taken_again_stands_for_the_failed_one),
        cmocka_unit_test(a_ping_that_is_missing_is_told),
        cmocka_unit_test(the_survey_of_an_export_says_where_the_stage_stood),
        cmocka_unit_test(a_message_that_is_none_is_told_and_does_no_harm),
        cmocka_unit_test(a_file_that_is_there_is_not_written_over),
        cmocka_unit_test(ctrl_c_leaves_no_file),
        cmocka_unit_test(ctrl_c_says_how_far_it_came_and_that_there_is_no_file),
        cmocka_unit_test(wrong_arguments_are_refused),
        cmocka_unit_test(every_verb_explains_itself),
    };
    return cmocka_run_group_tests(tests, make_recording, scratch_close);
}
