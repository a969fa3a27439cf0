/* SPDX-License-Identifier: MIT */
/* `anlos recon --bag` on the scene of point.yaml, put into bags ping by ping; the point
 * stands at 0.13 0.11 0.4 in the array frame, so at 0.4 0.13 0.41 in the vehicle's. */
#include "tests/hal/scratch.h"

#include <jansson.h>
#include <math.h>
#include <unistd.h>

#include "msgs/bag/manifest.h"
#include "msgs/bag/topic_message.h"
#include "msgs/scan.pb-c.h"
#include "msgs/topics.h"
#include "nodes/anlos/commands.h"
#include "tests/nodes/command.h"
#include "tests/nodes/near.h"
#include "tests/nodes/scene.h"
#include "tests/nodes/wall_message.h"

#define SECOND 1000000000LL
#define START  (1700000000 * SECOND)
#define LATE   (SECOND / 10) /* from the sound to the message */

static const char launch_text[] = "nodes: [array, scan, dsp, recon, track, can, report]\n"
                                  "array: {uri: \"sim:none.yaml\"}\n"
                                  "can: {base_id: 0x500}\n";

static struct command_result result;
static char bag[96], out[96];
static struct scene scene;

static int open_all(void **state)
{
    if (scratch_open(state) || scene_open(&scene, SOURCE_DIR "/tests/nodes/point.yaml"))
        return -1;
    const struct scratch *s = *state;
    snprintf(bag, sizeof bag, "%s/scan.mcap", s->folder);
    snprintf(out, sizeof out, "%s/out", s->folder);
    return 0;
}

static int close_all(void **state)
{
    scene_close(&scene);
    return scratch_close(state);
}

/* -- bags -------------------------------------------------------------------------------
 */

struct writing {
    int64_t scan_epoch_ns;
    bool silent;               /* what is put as sound is none */
    const struct topic *walls; /* told before each ping; NULL: none are */
    struct bag_writer *writer;
    struct bag_topics *topics;
    uint64_t sequence;
    int64_t now_ns;
};

static void begin_bag(struct writing *w)
{
    const struct bag_writer_config cfg = {
        .profile = "anlos", .library = "test", .chunk_size = 1 << 20};
    struct error why = {""};

    unlink(bag);
    *w = (struct writing){.now_ns = START, .scan_epoch_ns = START};
    if (bag_writer_create(&w->writer, bag, &cfg, &why))
        fail_msg("%s", why.text);
    assert_int_equal(bag_topics_create(&w->topics, w->writer), 0);
}

static void put(struct writing *w, const struct topic *t, const char *node,
                int64_t capture_ns, const ProtobufCMessage *m)
{
    struct error why = {""};
    struct envelope e = {.epoch_ns = t == topic_scan_status() ? w->scan_epoch_ns : START,
                         .sequence = w->sequence++,
                         .capture_ns = capture_ns,
                         .publish_ns = w->now_ns,
                         .payload_size = (uint32_t)protobuf_c_message_get_packed_size(m)};
    uint8_t *payload = malloc(e.payload_size);

    assert_non_null(payload);
    protobuf_c_message_pack(m, payload);
    snprintf(e.topic, sizeof e.topic, "%s", t->name);
    snprintf(e.node, sizeof e.node, "%s", node);
    if (bag_topics_put(w->topics, &e, payload, NULL, &why))
        fail_msg("%s", why.text);
    free(payload);
}

/* A wall straight ahead, 0.05 m behind the survey's: the vehicle's x is the array's z. */
static void put_walls(struct writing *w)
{
    struct wall_message m;

    wall_message_make(&m);
    m.wall.distance_m = 0.85;
    m.wall.existence = 1.0;
    if (w->walls == topic_wall()) {
        m.normal.x = 0.0;
        m.normal.z = 1.0;
    }
    put(w, w->walls, w->walls == topic_wall() ? "wall" : "can", w->now_ns, &m.list.base);
}

static void put_pass(struct writing *w, Anlos__Pass pass, size_t leave_out)
{
    Anlos__Ping ping;

    for (uint32_t i = 0; i < scene.survey->n_stage_positions_m; i++) {
        for (uint32_t j = 0; j < scene.survey->n_speakers_m; j++) {
            if (leave_out && leave_out-- == 1)
                continue;
            scene_ping(&scene, pass, i, j, &ping);
            if (w->silent)
                memset(ping.samples->data.data, 0, ping.samples->data.len);
            w->now_ns += SECOND;
            if (w->walls)
                put_walls(w);
            put(w, topic_ping(), "array", w->now_ns - LATE, &ping.base);
        }
    }
}

static void put_state(struct writing *w, Anlos__ScanStatus__State state)
{
    Anlos__ScanStatus status;

    anlos__scan_status__init(&status);
    status.state = state;
    status.scan = 1;
    put(w, topic_scan_status(), "scan", 0, &status.base);
}

static void put_launch(struct writing *w)
{
    static const char name[] = MANIFEST_LAUNCH_FOLDER "test.yaml";
    struct bytes_buffer pairs = {0};
    struct error why = {""};
    const struct bag_attachment launch = {.name = bytes_of(name),
                                          .media_type = bytes_of("application/yaml"),
                                          .data = bytes_of(launch_text)};

    bag_map_put(&pairs, bytes_of(MANIFEST_LAUNCH), bytes_of(name));
    bag_map_put(&pairs, bytes_of(MANIFEST_REVISION), bytes_of("abc123"));
    const struct bag_metadata session = {.name = bytes_of(MANIFEST_SESSION),
                                         .metadata = bytes_in(&pairs)};
    assert_int_equal(bag_writer_attachment(w->writer, &launch, &why), 0);
    assert_int_equal(bag_writer_metadata(w->writer, &session, &why), 0);
    bytes_free(&pairs);
}

static void end_bag(struct writing *w)
{
    struct error why = {""};

    bag_topics_destroy(w->topics);
    if (bag_writer_close(w->writer, &why))
        fail_msg("%s", why.text);
}

/* A scan without background, with walls of this topic; NULL: none. */
static void make_walled_scan(const struct topic *walls)
{
    struct writing w;

    begin_bag(&w);
    w.walls = walls;
    put(&w, topic_survey(), "array", 0, &scene.survey->base);
    put_pass(&w, ANLOS__PASS__SCENE, 0);
    end_bag(&w);
}

/* A scan with its background, of which ping leave_out (from 1; 0: none) is not there. */
static void make_scan(size_t leave_out, bool with_launch)
{
    struct writing w;

    begin_bag(&w);
    if (with_launch)
        put_launch(&w);
    put(&w, topic_survey(), "array", 0, &scene.survey->base);
    put_pass(&w, ANLOS__PASS__BACKGROUND, 0);
    put_state(&w, ANLOS__SCAN_STATUS__STATE__RUNNING);
    put_pass(&w, ANLOS__PASS__SCENE, leave_out);
    put_state(&w, ANLOS__SCAN_STATUS__STATE__DONE);
    end_bag(&w);
}

/* -- results ----------------------------------------------------------------------------
 */

static int run(const char *const words[])
{
    command_run(&result, command_recon, (char *const *)words);
    return result.code;
}

/* `anlos recon` with these words; its exit code. */
#define recon(...) run((const char *const[]){"recon", __VA_ARGS__, NULL})

static json_t *load(const char *name)
{
    char path[160];
    snprintf(path, sizeof path, "%s/%s", out, name);
    json_t *j = json_load_file(path, 0, NULL);
    assert_non_null(j);
    return j;
}

/* By way of a wall that stands so far ahead: the image is of the scene's, at 0.8 m. */
static void assert_point_found_by(double wall_m)
{
    const double truth_m[3] = {0.4 + 2.0 * (wall_m - 0.8), 0.13, 0.41};
    json_t *list = load("detections.json"), *place = NULL;

    assert_int_equal(json_array_size(json_object_get(list, "detections")), 1);
    place = json_object_get(json_array_get(json_object_get(list, "detections"), 0),
                            "position_m");
    for (size_t a = 0; a < 3; a++)
        assert_near(json_real_value(json_array_get(place, a)), truth_m[a], 0.005);
    json_decref(list);
}

static void assert_point_found(void)
{
    assert_point_found_by(0.8);
}

static json_int_t number(const json_t *report, const char *object, const char *key)
{
    return json_integer_value(json_object_get(json_object_get(report, object), key));
}

/* -- tests ------------------------------------------------------------------------------
 */

static void a_recorded_scan_gives_the_object_and_its_can_frames(void **state)
{
    (void)state;
    char path[160], text[512];

    make_scan(0, true);
    assert_int_equal(recon("--bag", bag, "--out", out), 0);
    assert_point_found();
    json_t *list = load("detections.json");
    assert_string_equal(json_string_value(json_object_get(list, "source")), "replay");
    json_decref(list);
    snprintf(path, sizeof path, "%s/can.candump", out);
    FILE *f = fopen(path, "r");
    assert_non_null(f);
    size_t lines = 0;
    while (fgets(text, sizeof text, f)) {
        /* The bag's launch file has the base 500; header, time, state, dynamics, quality.
         */
        static const char *const ids[] = {"502#", "503#", "504#", "505#", "506#"};
        assert_true(lines < 5);
        assert_non_null(strstr(text, ids[lines]));
        lines++;
    }
    fclose(f);
    assert_int_equal(lines, 5);
}

static void the_report_says_what_it_was_made_of(void **state)
{
    (void)state;
    make_scan(0, true);
    assert_int_equal(recon("--bag", bag, "--out", out), 0);
    json_t *report = load("report.json");
    json_t *recording = json_object_get(report, "recording");
    assert_string_equal(json_string_value(json_object_get(recording, "launch")),
                        MANIFEST_LAUNCH_FOLDER "test.yaml");
    assert_string_equal(json_string_value(json_object_get(recording, "revision")),
                        "abc123");
    assert_int_equal(number(report, "pings", "used"), 24);
    assert_int_equal(number(report, "pings", "background"), 24);
    assert_int_equal(number(report, "pings", "lost"), 0);
    json_decref(report);
}

static void a_list_is_as_old_as_the_message_was_when_it_was_sent(void **state)
{
    (void)state;
    char path[160];
    unsigned seconds, micros, header[8];

    make_scan(0, false);
    assert_int_equal(recon("--bag", bag, "--out", out), 0);
    snprintf(path, sizeof path, "%s/can.candump", out);
    FILE *f = fopen(path, "r");
    assert_non_null(f);
    assert_int_equal(fscanf(f, "(%u.%u) can0 402#%2x%2x%2x%2x%2x%2x%2x%2x", &seconds,
                            &micros, &header[0], &header[1], &header[2], &header[3],
                            &header[4], &header[5], &header[6], &header[7]),
                     10);
    fclose(f);
    assert_int_equal(seconds, START / SECOND + 48);
    assert_int_equal(micros, 0);
    /* anlos.dbc: Latency is 12 bits from bit 36 on, in ms. */
    assert_int_equal(header[4] >> 4 | header[5] << 4, LATE / 1000000);
}

static void a_lost_ping_is_told_and_the_rest_is_imaged(void **state)
{
    (void)state;
    make_scan(5, false);
    assert_int_equal(recon("--bag", bag, "--out", out), 0);
    assert_non_null(strstr(result.err, "1 of 24 pings are lost"));
    assert_point_found();
    json_t *report = load("report.json");
    assert_int_equal(number(report, "pings", "lost"), 1);
    json_decref(report);
}

static void a_ping_whose_background_is_lost_is_told_with_the_reason(void **state)
{
    const char *launch = scratch_write(*state, "l.yaml",
                                       "nodes: [dsp, recon]\nscan: {background: true}\n");
    struct writing w;

    begin_bag(&w);
    put(&w, topic_survey(), "array", 0, &scene.survey->base);
    put_pass(&w, ANLOS__PASS__BACKGROUND, 5);
    put_pass(&w, ANLOS__PASS__SCENE, 0);
    end_bag(&w);
    assert_int_equal(recon("--bag", bag, "--out", out, "--launch", launch), 0);
    assert_non_null(strstr(result.err, "a ping has no background to be subtracted"));
    assert_non_null(strstr(result.err, "1 of 24 pings are lost"));
}

static void pings_before_the_first_survey_of_a_bag_are_of_use(void **state)
{
    (void)state;
    struct writing w;

    begin_bag(&w);
    put_pass(&w, ANLOS__PASS__BACKGROUND, 0);
    put_pass(&w, ANLOS__PASS__SCENE, 0);
    put(&w, topic_survey(), "array", 0, &scene.survey->base);
    end_bag(&w);
    assert_int_equal(recon("--bag", bag, "--out", out), 0);
    assert_point_found();
    json_t *report = load("report.json");
    assert_int_equal(number(report, "pings", "used"), 24);
    json_decref(report);
}

static void without_a_launch_file_pings_without_background_do(void **state)
{
    (void)state;
    struct writing w;

    begin_bag(&w);
    put(&w, topic_survey(), "array", 0, &scene.survey->base);
    put_pass(&w, ANLOS__PASS__SCENE, 0);
    end_bag(&w);
    assert_int_equal(recon("--bag", bag, "--out", out), 0);
    assert_non_null(strstr(result.err, "no background recording"));
    json_t *report = load("report.json");
    assert_int_equal(number(report, "pings", "used"), 24);
    json_decref(report);
}

static void a_scan_that_was_begun_again_is_of_its_own_pings_alone(void **state)
{
    (void)state;
    struct writing w;

    begin_bag(&w);
    put(&w, topic_survey(), "array", 0, &scene.survey->base);
    put_state(&w, ANLOS__SCAN_STATUS__STATE__RUNNING);
    w.silent = true;
    put_pass(&w, ANLOS__PASS__SCENE, 24); /* broken off before the last */
    w.scan_epoch_ns += SECOND;
    w.silent = false;
    put_state(&w, ANLOS__SCAN_STATUS__STATE__RUNNING);
    put_pass(&w, ANLOS__PASS__SCENE, 0);
    put_state(&w, ANLOS__SCAN_STATUS__STATE__DONE);
    end_bag(&w);
    assert_int_equal(recon("--bag", bag, "--out", out), 0);
    json_t *report = load("report.json");
    assert_int_equal(number(report, "pings", "used"), 24);
    assert_int_equal(json_integer_value(json_object_get(report, "microphones_masked")),
                     0);
    json_decref(report);
}

static void options_and_another_launch_file_win_over_those_of_the_bag(void **state)
{
    const char *other = scratch_write(*state, "other.yaml",
                                      "nodes: [dsp, recon]\n"
                                      "recon: {method: incoherent}\n"
                                      "dsp: {window: hamming}\n");

    make_scan(0, true);
    assert_int_equal(recon("--bag", bag, "--out", out, "--launch", other), 0);
    json_t *report = load("report.json");
    assert_string_equal(json_string_value(json_object_get(report, "method")),
                        "incoherent");
    assert_string_equal(json_string_value(json_object_get(report, "window")), "hamming");
    json_decref(report);
    assert_int_equal(recon("--bag", bag, "--out", out, "--launch", other, "--method",
                           "backprojection", "--window", "hann"),
                     0);
    report = load("report.json");
    assert_string_equal(json_string_value(json_object_get(report, "method")),
                        "backprojection");
    assert_string_equal(json_string_value(json_object_get(report, "window")), "hann");
    json_decref(report);
    assert_point_found();
}

static void options_that_are_set_leave_the_others_of_the_launch_file(void **state)
{
    const char *other = scratch_write(*state, "other.yaml",
                                      "nodes: [dsp, recon]\n"
                                      "recon: {method: fast, options: {sharpen: 1, "
                                      "dmo: never}}\n");

    make_scan(0, true);
    assert_int_equal(
        recon("--bag", bag, "--out", out, "--launch", other, "--set", "sharpen=0.5"), 0);
    json_t *report = load("report.json"), *options = json_object_get(report, "options");
    assert_near(json_number_value(json_object_get(options, "sharpen")), 0.5, 0.0);
    assert_string_equal(json_string_value(json_object_get(options, "dmo")), "never");
    json_decref(report);
    assert_int_equal(recon("--bag", bag, "--out", out, "--launch", other, "--method",
                           "fast", "--set", "sharpen=0.5"),
                     0);
    report = load("report.json");
    options = json_object_get(report, "options");
    assert_string_equal(json_string_value(json_object_get(options, "dmo")), "auto");
    json_decref(report);
}

static void methods_and_their_options_are_refused_where_they_change_nothing(void **state)
{
    const char *fixed = scratch_write(*state, "fixed.yaml",
                                      "nodes: [array, scan, dsp, recon, track]\n"
                                      "array: {uri: \"sim:none.yaml\"}\n"
                                      "scan: {mode: fixed}\n");

    make_scan(0, false);
    assert_int_equal(
        recon("--bag", bag, "--out", out, "--launch", fixed, "--method", "fast"), 2);
    assert_non_null(strstr(result.err, "--method is for scans"));
    assert_int_equal(
        recon("--bag", bag, "--out", out, "--launch", fixed, "--set", "dmo=never"), 2);
    assert_non_null(strstr(result.err, "--set is for scans"));
    assert_int_equal(recon("--bag", bag, "--out", out, "--set", "l1=0.1"), 2);
    assert_non_null(strstr(result.err, "method 'fast' does not use it"));
}

static void walls_that_the_vehicle_gave_are_those_that_mirror(void **state)
{
    const char *launch = scratch_write(*state, "l.yaml",
                                       "nodes: [dsp, recon, wall, track]\n"
                                       "scan: {background: false}\n"
                                       "wall: {from: topic}\n");

    make_walled_scan(topic_wall_given());
    assert_int_equal(recon("--bag", bag, "--out", out, "--launch", launch), 0);
    assert_point_found_by(0.85);
}

static void lists_of_walls_of_the_recording_are_for_who_has_no_node_wall(void **state)
{
    const char *launch = scratch_write(*state, "l.yaml",
                                       "nodes: [dsp, recon, track]\n"
                                       "scan: {background: false}\n"
                                       "wall: {from: topic}\n");

    make_walled_scan(topic_wall());
    assert_int_equal(recon("--bag", bag, "--out", out, "--launch", launch), 0);
    assert_point_found_by(0.85);
    launch = scratch_write(*state, "l.yaml",
                           "nodes: [dsp, recon, wall, track]\n"
                           "scan: {background: false}\n"
                           "wall: {from: survey}\n");
    assert_int_equal(recon("--bag", bag, "--out", out, "--launch", launch), 0);
    assert_point_found();
}

static void walls_that_are_asked_for_and_are_not_there_are_said(void **state)
{
    const char *launch = scratch_write(*state, "l.yaml",
                                       "nodes: [dsp, recon, wall, track]\n"
                                       "wall: {from: topic}\n");

    make_walled_scan(topic_wall());
    assert_int_equal(recon("--bag", bag, "--out", out, "--launch", launch), 2);
    assert_non_null(strstr(result.err, "none are there (wall/given)"));
    assert_non_null(strstr(result.err, "those of the recording"));
    assert_int_equal(access(out, F_OK), -1);
    launch = scratch_write(*state, "l.yaml",
                           "nodes: [dsp, recon, track]\nwall: {from: topic}\n");
    make_walled_scan(NULL);
    assert_int_equal(recon("--bag", bag, "--out", out, "--launch", launch), 2);
    assert_non_null(strstr(result.err, "no lists of them are there"));
    assert_int_equal(access(out, F_OK), -1);
}

/* Its defaults would image the sound by way of another wall, and state it with certainty.
 */
static void walls_or_motion_without_a_launch_file_want_one(void **state)
{
    (void)state;
    make_walled_scan(topic_wall());
    assert_int_equal(recon("--bag", bag, "--out", out), 2);
    assert_non_null(strstr(result.err, "no launch file is in it"));
    assert_non_null(strstr(result.err, "(lists of walls); --launch FILE"));
    assert_int_equal(access(out, F_OK), -1);
    make_walled_scan(NULL);
    assert_int_equal(recon("--bag", bag, "--out", out), 0);
    assert_point_found();
}

static void a_bag_without_sound_says_what_is_missing(void **state)
{
    (void)state;
    struct writing w;

    begin_bag(&w);
    put_state(&w, ANLOS__SCAN_STATUS__STATE__DONE);
    end_bag(&w);
    assert_int_equal(recon("--bag", bag, "--out", out), 2);
    assert_non_null(strstr(result.err, "no survey"));
    begin_bag(&w);
    put(&w, topic_survey(), "array", 0, &scene.survey->base);
    end_bag(&w);
    assert_int_equal(recon("--bag", bag, "--out", out), 2);
    assert_non_null(strstr(result.err, "no pings"));
    assert_int_equal(access(out, F_OK), -1);
}

static void arguments_that_do_not_go_with_a_bag_are_refused(void **state)
{
    (void)state;
    assert_int_equal(recon("--bag", bag, "--out", out, "--wav", "x"), 2);
    assert_non_null(strstr(result.err, "in place of --wav"));
    assert_int_equal(recon("--bag", bag, "--out", out, "--method", "auto"), 2);
    assert_non_null(strstr(result.err, "needs a recording"));
    assert_int_equal(recon("--bag", bag, "--out", out, "--set", "l1=9"), 2);
    assert_int_equal(recon("--launch", "x", "--out", out), 2);
    assert_non_null(strstr(result.err, "--launch belongs to --bag"));
    assert_int_equal(recon("--bag", "/nonexistent.mcap", "--out", out), 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
#define TEST(name) cmocka_unit_test_setup_teardown(name, open_all, close_all)
        TEST(a_recorded_scan_gives_the_object_and_its_can_frames),
        TEST(the_report_says_what_it_was_made_of),
        TEST(a_list_is_as_old_as_the_message_was_when_it_was_sent),
        TEST(a_lost_ping_is_told_and_the_rest_is_imaged),
        TEST(a_ping_whose_background_is_lost_is_told_with_the_reason),
        TEST(pings_before_the_first_survey_of_a_bag_are_of_use),
        TEST(without_a_launch_file_pings_without_background_do),
        TEST(a_scan_that_was_begun_again_is_of_its_own_pings_alone),
        TEST(options_and_another_launch_file_win_over_those_of_the_bag),
        TEST(options_that_are_set_leave_the_others_of_the_launch_file),
        TEST(methods_and_their_options_are_refused_where_they_change_nothing),
        TEST(walls_that_the_vehicle_gave_are_those_that_mirror),
        TEST(lists_of_walls_of_the_recording_are_for_who_has_no_node_wall),
        TEST(walls_that_are_asked_for_and_are_not_there_are_said),
        TEST(walls_or_motion_without_a_launch_file_want_one),
        TEST(a_bag_without_sound_says_what_is_missing),
        TEST(arguments_that_do_not_go_with_a_bag_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
