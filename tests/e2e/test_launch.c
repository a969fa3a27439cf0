/* SPDX-License-Identifier: MIT */
/* The real processes, from the emitted chirp to CAN frames, on a small simulated scene.
 */
#include "tests/e2e/point.h"

#include <errno.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "msgs/bus.h"
#include "msgs/health.pb-c.h"
#include "msgs/scan.pb-c.h"

#define DEADLINE_MS 60000

/* In both passes. */
static uint32_t pings_of_scene(void)
{
    struct room *room = NULL;

    assert_int_equal(room_load(&room, SCENE, NULL), 0);
    const struct survey *s = room_survey(room);
    uint32_t n = (uint32_t)(2 * s->n_positions * s->n_speakers);
    room_destroy(room);
    return n;
}

static void write_system(struct scratch *s, const char *array, const char *stage,
                         const char *scan)
{
    char text[1024];

    snprintf(text, sizeof text,
             "nodes: [stage, array, scan, dsp, recon, track, can, report]\n"
             "array: {uri: '%s'}\n"
             "stage: {uri: '%s'}\n"
             "scan: {%s}\n"
             "report: {folder: %s/out}\n",
             array, stage, scan, s->folder);
    scratch_write(s, "launch.yaml", text);
}

static void write_launch(struct scratch *s, const char *pace)
{
    char array[512];

    snprintf(array, sizeof array, "sim:%s?pace=%s", SCENE, pace);
    write_system(s, array, "sim:?pace=fast", "background: true");
}

static pid_t start(struct scratch *s)
{
    pid_t pid = fork();

    assert_true(pid >= 0);
    if (pid)
        return pid;
    char launch[128];
    snprintf(launch, sizeof launch, "%s/launch.yaml", s->folder);
    /* What it says is kept for when something is wrong. */
    if (!freopen(scratch_path(s, "says"), "w", stdout) ||
        dup2(STDOUT_FILENO, STDERR_FILENO) < 0)
        _exit(98);
    execl(BINARY_DIR "/bin/anlos", "anlos", "launch", launch, "--run-dir", s->folder,
          NULL);
    _exit(99);
}

/* Shows what the launch said.  true: a sanitizer complained in one of the processes. */
static bool show(struct scratch *s, bool print)
{
    char line[400];
    bool error = false;
    FILE *f = fopen(scratch_path(s, "says"), "r");

    while (f && fgets(line, sizeof line, f)) {
        error |= strstr(line, "Sanitizer") || strstr(line, "runtime error");
        if (print)
            print_message("%s", line);
    }
    if (f)
        fclose(f);
    return error;
}

static void assert_ends_well(struct scratch *s, pid_t pid)
{
    int status;

    assert_int_equal(waitpid(pid, &status, 0), pid);
    if (WIFEXITED(status) && !WEXITSTATUS(status) && !show(s, false))
        return;
    show(s, true);
    fail_msg("the launch ended with status %x", (unsigned)status);
}

static json_t *read_json(struct scratch *s, const char *name)
{
    json_error_t error;
    json_t *o = json_load_file(scratch_path(s, name), 0, &error);

    if (!o) {
        show(s, true);
        fail_msg("%s: %s", s->path, error.text);
    }
    return o;
}

static void assert_detections(struct scratch *s)
{
    json_t *o = read_json(s, "out/detections.json");

    assert_point_found(o);
    json_decref(o);
}

static int64_t integer(const json_t *o, const char *a, const char *b)
{
    const json_t *x = json_object_get(o, a);

    x = b ? json_object_get(x, b) : x;
    assert_true(json_is_integer(x));
    return json_integer_value(x);
}

static void assert_starts_with(struct scratch *s, const char *name, const char *bytes,
                               size_t n)
{
    char start[16];
    FILE *f = fopen(scratch_path(s, name), "rb");

    if (!f)
        fail_msg("%s is missing", s->path);
    assert_int_equal(fread(start, 1, n, f), n);
    fclose(f);
    assert_memory_equal(start, bytes, n);
}

/* Every kind of frame is there, in the format of `candump -L`. */
static void assert_candump(struct scratch *s)
{
    static const unsigned ids[] = {0x400, 0x402, 0x403, 0x404, 0x405, 0x406};
    unsigned seen = 0, id;
    char line[200], data[32];
    double stamp;
    FILE *f = fopen(scratch_path(s, "out/can.candump"), "r");

    assert_non_null(f);
    while (fgets(line, sizeof line, f)) {
        assert_int_equal(sscanf(line, "(%lf) can0 %x#%31s", &stamp, &id, data), 3);
        assert_int_equal(strlen(data), 16);
        for (unsigned i = 0; i < sizeof ids / sizeof *ids; i++)
            seen |= (id == ids[i]) << i;
    }
    fclose(f);
    assert_int_equal(seen, 0x3f);
}

static void assert_folder(struct scratch *s)
{
    static const char *const pictures[] = {
        "out/projection_xy.png", "out/projection_xz.png", "out/projection_yz.png"};

    assert_detections(s);
    assert_starts_with(s, "out/volume.nrrd", "NRRD0005", 8);
    for (int i = 0; i < 3; i++)
        assert_starts_with(s, pictures[i], "\x89PNG\r\n\x1a\n", 8);
    assert_candump(s);
}

/* How many of those of the launch file; a launch of a moment may be over before the
 * launcher's own health comes. */
static size_t nodes_with_health(const json_t *report)
{
    const json_t *node;
    size_t i, n = 0;

    json_array_foreach(json_object_get(report, "nodes"), i, node)
    {
        const char *name = json_string_value(json_object_get(node, "node"));
        n += name && strcmp(name, "launcher");
    }
    return n;
}

static void one_command_goes_from_chirp_to_can_frame(void **state)
{
    struct scratch *s = *state;

    const uint32_t n_pings = pings_of_scene();

    write_launch(s, "fast");
    assert_ends_well(s, start(s));
    assert_folder(s);
    json_t *report = read_json(s, "out/report.json");
    assert_string_equal(json_string_value(json_object_get(report, "state")), "done");
    assert_int_equal(integer(report, "pings", "expected"), n_pings);
    assert_int_equal(integer(report, "pings", "done"), n_pings);
    assert_int_equal(integer(report, "pings", "lost"), 0);
    assert_int_equal(integer(report, "pings", "imaged"), n_pings / 2);
    assert_int_equal(nodes_with_health(report), 8);
    json_decref(report);
}

/* By another process, like everything else here. */
static void make_recording(struct scratch *s, const char *scene)
{
    int status;
    pid_t pid = fork();

    assert_true(pid >= 0);
    if (!pid) {
        if (!freopen("/dev/null", "w", stdout))
            _exit(98);
        execl(BINARY_DIR "/bin/anlos", "anlos", "sim", scene, "--out",
              scratch_path(s, "rec"), NULL);
        _exit(99);
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_int_equal(status, 0);
}

/* A stage that cannot move does not matter: the array was moved when it recorded. */
static void a_recording_goes_the_same_way(void **state)
{
    struct scratch *s = *state;
    char array[300];

    make_recording(s, SCENE);
    snprintf(array, sizeof array, "wav:%s/rec/scene?background=%s/rec/background",
             s->folder, s->folder);
    write_system(s, array, "none:", "background: true");
    assert_ends_well(s, start(s));
    assert_folder(s);
    json_t *o = read_json(s, "out/detections.json");
    assert_string_equal(json_string_value(json_object_get(o, "source")), "replay");
    json_decref(o);
}

/* At 8 cm/s; who is late on a busy machine has other runs. */
static void a_stage_that_does_not_stop_finds_the_same(void **state)
{
    struct scratch *s = *state;
    const uint32_t n_pings = pings_of_scene();

    write_system(s, "sim:" SCENE "?slot_samples=6000",
                 "sim:", "mode: continuous, background: true, retries: 100");
    assert_ends_well(s, start(s));
    assert_folder(s);
    json_t *report = read_json(s, "out/report.json");
    assert_string_equal(json_string_value(json_object_get(report, "state")), "done");
    assert_int_equal(integer(report, "pings", "done"), n_pings);
    assert_int_equal(integer(report, "pings", "lost"), 0);
    assert_int_equal(integer(report, "pings", "imaged"), n_pings / 2);
    json_decref(report);
}

static void a_recording_of_it_goes_the_same_way(void **state)
{
    struct scratch *s = *state;
    char array[300];

    make_recording(s, SCENE "?slot_samples=3000&continuous=yes");
    snprintf(array, sizeof array, "wav:%s/rec/scene?background=%s/rec/background",
             s->folder, s->folder);
    write_system(s, array, "none:", "mode: continuous, background: true");
    assert_ends_well(s, start(s));
    assert_folder(s);
}

/* Half of the positions are out of the stage's reach. */
static void a_scan_that_fails_shows_what_it_has_found(void **state)
{
    struct scratch *s = *state;
    int status;

    write_system(s, "sim:" SCENE, "sim:?pace=fast&max=0.1", "background: false");
    pid_t pid = start(s);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 1);
    assert_false(show(s, false));
    json_t *report = read_json(s, "out/report.json");
    assert_string_equal(json_string_value(json_object_get(report, "state")), "failed");
    assert_int_equal(integer(report, "pings", "done"), pings_of_scene() / 4);
    json_decref(report);
    json_decref(read_json(s, "out/detections.json"));
    char text[8192] = "";
    FILE *f = fopen(scratch_path(s, "says"), "r");
    assert_non_null(f);
    text[fread(text, 1, sizeof text - 1, f)] = '\0';
    fclose(f);
    assert_contains(text, "scan    error   stage: cannot move to 0.1200 m");
    assert_contains(text, "hidden object       really at");
}

/* Listens until n pings are done, and returns the process id of a node. */
static pid_t wait_for_pings(struct bus *b, uint32_t n, const char *node)
{
    pid_t pid = 0;
    bool far_enough = false;

    while (!pid || !far_enough) {
        struct bus_message m;
        assert_int_equal(bus_receive(b, &m, DEADLINE_MS), 0);
        ProtobufCMessage *content = bus_message_unpack(&m);
        assert_non_null(content);
        if (m.topic == topic_scan_status()) {
            const Anlos__ScanStatus *status = (const Anlos__ScanStatus *)content;
            assert_int_not_equal(status->state, ANLOS__SCAN_STATUS__STATE__DONE);
            far_enough = status->pings_done >= n;
        } else if (!strcmp(((const Anlos__Health *)content)->node, node)) {
            pid = (pid_t)((const Anlos__Health *)content)->pid;
        }
        protobuf_c_message_free_unpacked(content, NULL);
        bus_message_free(&m);
    }
    return pid;
}

static void kill_during_the_scan(struct scratch *s, const char *node)
{
    const struct bus_config cfg = {
        .node = "test", .run_dir = s->folder, .listen_only = true};
    const uint32_t n_pings = pings_of_scene();
    struct bus *b = NULL;

    write_launch(s, "real"); /* slow enough that there is a middle */
    pid_t launcher = start(s);
    assert_int_equal(bus_create(&b, &cfg, NULL), 0);
    assert_int_equal(bus_subscribe(b, topic_scan_status()), 0);
    assert_int_equal(bus_subscribe(b, topic_health()), 0);
    assert_int_equal(kill(wait_for_pings(b, n_pings * 5 / 8, node), SIGKILL), 0);
    bus_destroy(b);
    assert_ends_well(s, launcher);
    assert_folder(s);
    json_t *report = read_json(s, "out/report.json");
    assert_string_equal(json_string_value(json_object_get(report, "state")), "done");
    assert_int_equal(integer(report, "pings", "lost"), 0);
    assert_int_equal(integer(report, "pings", "imaged"), n_pings / 2);
    assert_true(integer(report, "pings", "retaken") > 0);
    const json_t *nodes = json_object_get(report, "nodes");
    for (size_t i = 0; i < json_array_size(nodes); i++) {
        const json_t *o = json_array_get(nodes, i);
        const char *name = json_string_value(json_object_get(o, "node"));
        assert_int_equal(integer(o, "restarts", NULL), !strcmp(name, node));
    }
    json_decref(report);
}

static void a_dsp_killed_during_the_scan_costs_time_only(void **state)
{
    kill_during_the_scan(*state, "dsp");
}

static void a_recon_killed_during_the_scan_costs_time_only(void **state)
{
    kill_during_the_scan(*state, "recon");
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(one_command_goes_from_chirp_to_can_frame),
        TEST(a_recording_goes_the_same_way),
        TEST(a_stage_that_does_not_stop_finds_the_same),
        TEST(a_recording_of_it_goes_the_same_way),
        TEST(a_scan_that_fails_shows_what_it_has_found),
        TEST(a_dsp_killed_during_the_scan_costs_time_only),
        TEST(a_recon_killed_during_the_scan_costs_time_only),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
