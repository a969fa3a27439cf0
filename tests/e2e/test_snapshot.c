/* SPDX-License-Identifier: MIT */
/* "Save the last 30 s" of a system of real processes, asked for in each way, and what is
 * saved is imaged by itself. */
#include "tests/nodes/record_rig.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "hal/clock.h"
#include "msgs/bag/manifest.h"
#include "msgs/bus.h"
#include "msgs/health.pb-c.h"
#include "msgs/save.pb-c.h"
#include "msgs/traces.pb-c.h"

#define DEADLINE_NS 60000000000LL

struct system {
    struct scratch *s;
    pid_t pid;
    struct bus *bus; /* of "stage", which this system has not */
};

static int64_t now_ns(void)
{
    return clock_now_ns(clock_system());
}

/* build/bin/anlos; what it says goes into a file of that name. */
static pid_t start_anlos(struct scratch *s, const char *says, char *const words[])
{
    pid_t pid = fork();

    assert_true(pid >= 0);
    if (pid)
        return pid;
    if (!freopen(scratch_path(s, says), "w", stdout) ||
        dup2(STDOUT_FILENO, STDERR_FILENO) < 0)
        _exit(98);
    execv(BINARY_DIR "/bin/anlos", words);
    _exit(99);
}

static int end_of(pid_t pid)
{
    int status;

    assert_int_equal(waitpid(pid, &status, 0), pid);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/* Its first line, without the end; the exit code. */
static int run(struct system *y, char line[512], char *const words[])
{
    int code = end_of(start_anlos(y->s, "command", words));
    FILE *f = fopen(scratch_path(y->s, "command"), "r");

    assert_non_null(f);
    line[0] = '\0';
    if (fgets(line, 512, f))
        line[strcspn(line, "\n")] = '\0';
    fclose(f);
    return code;
}

static void start(struct system *y)
{
    const struct bus_config cfg = {
        .node = "stage", .run_dir = y->s->folder, .epoch_ns = now_ns()};
    char text[1024], file[128];

    snprintf(text, sizeof text,
             "nodes: [array, scan, dsp, report]\n"
             "array: {uri: 'sim:" SOURCE_DIR "/launch/scenes/full-array.yaml'}\n"
             "scan: {mode: fixed, speakers: [0, 5, 10, 15], background: true, "
             "background_frames: 2}\n"
             "report: {folder: %s/out}\n"
             "record: {snapshot: {folder: none, after_s: 0, max_mb: 64}}\n",
             y->s->folder);
    scratch_write(y->s, "launch.yaml", text);
    snprintf(file, sizeof file, "%s/launch.yaml", y->s->folder);
    snprintf(text, sizeof text, "%s/saved", y->s->folder);
    assert_int_equal(bus_create(&y->bus, &cfg, NULL), 0);
    assert_int_equal(bus_subscribe(y->bus, topic_traces()), 0);
    assert_int_equal(bus_subscribe(y->bus, topic_save_status()), 0);
    y->pid = start_anlos(y->s, "says",
                         (char *[]){"anlos", "launch", file, "--run-dir", y->s->folder,
                                    "--snapshot", text, NULL});
}

/* The next message of a topic, to be freed. */
static ProtobufCMessage *hear(struct system *y, const struct topic *topic)
{
    int64_t end_ns = now_ns() + DEADLINE_NS;
    struct bus_message in;

    while (now_ns() < end_ns) {
        if (bus_receive(y->bus, &in, 500))
            continue;
        ProtobufCMessage *m = in.topic == topic ? bus_message_unpack(&in) : NULL;
        bus_message_free(&in);
        if (m)
            return m;
    }
    kill(y->pid, SIGKILL);
    fail_msg("nothing came on %s", topic->name);
    return NULL;
}

static void await_frame(struct system *y, uint32_t frame)
{
    uint32_t at = 0;

    while (at < frame) {
        Anlos__Traces *t = (Anlos__Traces *)hear(y, topic_traces());
        at = t->frame;
        anlos__traces__free_unpacked(t, NULL);
    }
}

static void say_fault(struct system *y)
{
    Anlos__Health h = ANLOS__HEALTH__INIT;
    Anlos__Fault f = ANLOS__FAULT__INIT, *list[] = {&f};

    f.name = (char *)"channels_silent";
    f.count = f.of = 1;
    h.node = (char *)"stage";
    h.text = (char *)"";
    h.priority = (char *)"";
    h.faults = list;
    h.n_faults = 1;
    assert_int_equal(bus_publish_message(y->bus, topic_health(), 0, now_ns(), &h.base),
                     0);
}

/* Until so many bags are complete, the newest of that reason; its path.  act is done
 * until then, whenever the recorder speaks; or NULL. */
static void await_bag(struct system *y, uint64_t n, void (*act)(struct system *y),
                      const char *reason, char path[512])
{
    uint64_t saved = 0;
    char text[256];

    while (saved < n) {
        if (act)
            act(y);
        Anlos__SaveStatus *t = (Anlos__SaveStatus *)hear(y, topic_save_status());
        saved = t->saved;
        assert_string_equal(t->error, "");
        assert_int_equal(t->missing, 0);
        snprintf(path, 512, "%s", t->path);
        anlos__save_status__free_unpacked(t, NULL);
    }
    assert_int_equal(saved, n);
    assert_true(find_metadata(path, MANIFEST_SNAPSHOT, 0, MANIFEST_REASON, text));
    assert_string_equal(text, reason);
}

/* Whole, with nothing lost, and with all that it takes to make an image of it. */
static void check_image(struct system *y, const char *bag, const char *out)
{
    char line[512], folder[256], text[300], lost[256];
    uint64_t n_faults;

    assert_int_equal(bag_check(&n_faults, bag, NULL, NULL), 0);
    assert_int_equal(n_faults, 0);
    assert_true(find_metadata(bag, MANIFEST_LOST, 0, "ping", lost));
    assert_string_equal(lost, "0");
    snprintf(folder, sizeof folder, "%s/%s", y->s->folder, out);
    int code =
        run(y, line,
            (char *[]){"anlos", "recon", "--bag", (char *)bag, "--out", folder, NULL});
    if (code)
        fail_msg("recon: %s", line);
    snprintf(text, sizeof text, "%s/volume.nrrd", folder);
    assert_int_equal(access(text, F_OK), 0);
}

static void a_command_a_message_and_a_fault_each_save_a_bag_that_images(void **state)
{
    struct system y = {.s = *state};
    char line[512], path[512];

    start(&y);
    await_frame(&y, 4);
    if (run(&y, line,
            (char *[]){"anlos", "bag", "save", "by command", "--run-dir", y.s->folder,
                       NULL}))
        fail_msg("%s", line);
    await_bag(&y, 1, NULL, "by command", path);
    assert_string_equal(path, line);
    check_image(&y, path, "one");
    assert_int_equal(
        run(&y, line,
            (char *[]){"anlos", "topic", "pub", "record/save",
                       "{\"reason\": \"by topic\"}", "--run-dir", y.s->folder, NULL}),
        0);
    await_bag(&y, 2, NULL, "by topic", path);
    check_image(&y, path, "two");
    await_bag(&y, 3, say_fault, "channels_silent", path);
    check_image(&y, path, "three");
    kill(y.pid, SIGINT);
    assert_int_equal(end_of(y.pid), 130);
    bus_destroy(y.bus);
}

static void without_a_recorder_that_keeps_something_it_is_told_what_to_start(void **state)
{
    struct system y = {.s = *state};
    char line[512];

    assert_int_equal(
        run(&y, line, (char *[]){"anlos", "bag", "save", "--run-dir", y.s->folder, NULL}),
        1);
    assert_contains(line, "nothing is running in");
}

#define SCRATCH_TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        SCRATCH_TEST(a_command_a_message_and_a_fault_each_save_a_bag_that_images),
        SCRATCH_TEST(without_a_recorder_that_keeps_something_it_is_told_what_to_start),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
