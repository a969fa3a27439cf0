/* SPDX-License-Identifier: MIT */
/* An array that stands, as real processes: round after round until it is stopped. */
#include "hear.h"
#include "tests/hal/scratch.h"

#include <errno.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <jansson.h>

#include "hal/recording/recording.h"
#include "msgs/scan.pb-c.h"
#include "msgs/traces.pb-c.h"

#define FRAMES 4

struct system {
    pid_t pid;
    struct bus *bus;
};

static void start(struct scratch *s, struct system *y)
{
    struct error why = {""};
    const struct bus_config cfg = {
        .node = "hand", .run_dir = s->folder, .epoch_ns = clock_now_ns(clock_system())};
    char text[1024], launch[128];

    snprintf(text, sizeof text,
             "nodes: [array, scan, dsp, report]\n"
             "array: {uri: 'sim:" SOURCE_DIR "/launch/scenes/full-array.yaml'}\n"
             "scan: {mode: fixed, speakers: [0, 5, 10, 15], background: true, "
             "background_frames: 2}\n"
             "report: {folder: %s/out}\n",
             s->folder);
    scratch_write(s, "launch.yaml", text);
    snprintf(launch, sizeof launch, "%s/launch.yaml", s->folder);
    assert_int_equal(bus_create(&y->bus, &cfg, &why), 0);
    assert_int_equal(bus_subscribe(y->bus, topic_traces()), 0);
    assert_int_equal(bus_subscribe(y->bus, topic_scan_status()), 0);
    assert_int_equal(bus_subscribe(y->bus, topic_health()), 0);
    y->pid = fork();
    assert_true(y->pid >= 0);
    if (y->pid)
        return;
    if (!freopen(scratch_path(s, "says"), "w", stdout) ||
        dup2(STDOUT_FILENO, STDERR_FILENO) < 0)
        _exit(98);
    execl(BINARY_DIR "/bin/anlos", "anlos", "launch", launch, "--run-dir", s->folder,
          NULL);
    _exit(99);
}

/* Ends it as a person does; the exit code. */
static int stop(struct system *y)
{
    int status;

    kill(y->pid, SIGINT);
    assert_int_equal(waitpid(y->pid, &status, 0), y->pid);
    bus_destroy(y->bus);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static ProtobufCMessage *hear(struct system *y, const struct topic *topic,
                              const char *node, int64_t since_ns)
{
    ProtobufCMessage *m = hear_on(y->bus, topic, node, since_ns);

    if (m)
        return m;
    kill(y->pid, SIGKILL);
    fail_msg("nothing came on %s", topic->name);
    return NULL;
}

/* Until the report has heard that so many pings are done. */
static void wait_for_pings(struct system *y, uint32_t n)
{
    uint32_t done = 0;

    while (done < n) {
        Anlos__ScanStatus *s = (Anlos__ScanStatus *)hear(y, topic_scan_status(), NULL, 0);
        done = s->pings_done;
        protobuf_c_message_free_unpacked(&s->base, NULL);
    }
    protobuf_c_message_free_unpacked(hear(y, topic_scan_status(), NULL, 0), NULL);
    protobuf_c_message_free_unpacked(
        hear(y, topic_health(), "report", clock_now_ns(clock_system())), NULL);
}

static void an_array_that_stands_goes_on_until_ctrl_c_and_leaves_a_report(void **state)
{
    static const uint32_t speakers[] = {0, 5, 10, 15};
    struct system y;
    uint64_t before = 0;

    start(*state, &y);
    while (before < FRAMES * 4) {
        Anlos__Traces *t = (Anlos__Traces *)hear(&y, topic_traces(), NULL, 0);
        uint64_t number = 0;
        for (uint64_t k = 0; k < 4; k++)
            if (t->speaker == speakers[k])
                number = 4ull * (t->frame - 1) + k + 1;
        assert_true(number > before && t->scan == 1 && t->position == 0);
        assert_true(t->background_subtracted);
        before = number;
        protobuf_c_message_free_unpacked(&t->base, NULL);
    }
    wait_for_pings(&y, 8 + FRAMES * 4);
    assert_int_equal(stop(&y), 130);
    json_error_t error;
    json_t *report = json_load_file(scratch_path(*state, "out/report.json"), 0, &error);
    assert_non_null(report);
    const json_t *pings = json_object_get(report, "pings");
    assert_string_equal(json_string_value(json_object_get(report, "state")), "stopped");
    assert_true(json_integer_value(json_object_get(pings, "done")) >= 8 + FRAMES * 4);
    assert_true(json_is_null(json_object_get(pings, "expected")));
    json_decref(report);
}

static void record(struct scratch *s)
{
    enum { SLOTS = 24, SLOT = 1200 };
    static float sound[2][SLOTS * SLOT];
    struct error why = {""};
    uint32_t x = 1;

    for (size_t i = 0; i < sizeof sound / sizeof(float); i++) {
        x = x * 1664525u + 1013904223u;
        (&sound[0][0])[i] = (float)(x >> 8) / 0x1p25f - 0.25f;
    }
    scratch_folder(s, "rec");
    scratch_write(s, "rec/survey.yaml",
                  "temperature_c: 20\n"
                  "sample_rate_hz: 48000\n"
                  "slot_samples: 1200\n"
                  "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.01}\n"
                  "speakers_m: [[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]]\n"
                  "microphones_m: [[0, 0.1, 0], [0.1, 0.1, 0]]\n"
                  "gate_m: [0.3, 3]\n"
                  "volume: {x_m: [0, 0.2, 0.1], y_m: [0, 0, 0.1], z_m: [1, 2, 0.1]}\n");
    if (recording_write(scratch_path(s, "rec"), 0, 2, SLOTS * SLOT, 48000, sound[0],
                        &why))
        fail_msg("%s", why.text);
}

static void a_recording_of_one_is_done_when_it_ends(void **state)
{
    struct scratch *s = *state;
    char text[512];
    int status;

    record(s);
    snprintf(text, sizeof text,
             "nodes: [array, scan, dsp, recon, track, report]\n"
             "array: {uri: 'wav:%s/rec'}\n"
             "scan: {mode: fixed}\n"
             "report: {folder: %s/out}\n",
             s->folder, s->folder);
    scratch_write(s, "launch.yaml", text);
    pid_t pid = fork();
    assert_true(pid >= 0);
    if (!pid) {
        if (!freopen(scratch_path(s, "says"), "w", stdout) ||
            dup2(STDOUT_FILENO, STDERR_FILENO) < 0)
            _exit(98);
        snprintf(text, sizeof text, "%s/launch.yaml", s->folder);
        execl(BINARY_DIR "/bin/anlos", "anlos", "launch", text, "--run-dir", s->folder,
              NULL);
        _exit(99);
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
    json_t *report = json_load_file(scratch_path(s, "out/report.json"), 0, NULL);
    assert_non_null(report);
    assert_string_equal(json_string_value(json_object_get(report, "state")), "done");
    assert_int_equal(
        json_integer_value(json_object_get(json_object_get(report, "pings"), "done")),
        24);
    json_decref(report);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_recording_of_one_is_done_when_it_ends),
        TEST(an_array_that_stands_goes_on_until_ctrl_c_and_leaves_a_report),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
