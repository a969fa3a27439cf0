/* SPDX-License-Identifier: MIT */
/* `anlos stage` and the stage process, against a simulated Zaber device: 25.4 mm a turn,
 * so 1.984375 um a microstep; it starts at 70000 of them. */
#include "tests/hal/scratch.h"

#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/hal/zaber_device.h"

struct rig {
    struct scratch *scratch;
    struct zaber_device *device;
    pid_t node; /* 0: none */
    char uri[128];
    char out[4096]; /* of the last command, with what it complained of */
};

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);

    if (!r || scratch_open((void **)&r->scratch))
        return -1;
    r->device = zaber_device_start(true);
    snprintf(r->uri, sizeof r->uri, "zaber:%s?pitch_mm=25.4&settle=0", r->device->path);
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;
    void *scratch = r->scratch;
    int status = 0;

    if (r->node) {
        kill(r->node, SIGTERM);
        waitpid(r->node, &status, 0);
    }
    zaber_device_unplug(r->device);
    free(r->device);
    free(r);
    return scratch_close(&scratch) || status;
}

/* Runs `anlos stage ARGUMENTS`; its exit code. */
static int stage(struct rig *r, const char *arguments)
{
    char command[512];

    snprintf(command, sizeof command, BINARY_DIR "/bin/anlos stage %s 2>&1", arguments);
    FILE *f = popen(command, "r");
    assert_non_null(f);
    size_t n = fread(r->out, 1, sizeof r->out - 1, f);
    r->out[n] = '\0';
    int status = pclose(f);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static int directly(struct rig *r, const char *commands)
{
    char arguments[300];

    snprintf(arguments, sizeof arguments, "'%s' %s", r->uri, commands);
    return stage(r, arguments);
}

static int by_the_node(struct rig *r, const char *commands)
{
    char arguments[300];

    snprintf(arguments, sizeof arguments, "%s --run-dir %s", commands,
             r->scratch->folder);
    return stage(r, arguments);
}

static void start_node(struct rig *r)
{
    char text[300], launch[600];

    snprintf(text, sizeof text,
             "nodes: [stage]\narray: {uri: 'wav:/none'}\nstage: {uri: '%s'}\n", r->uri);
    snprintf(launch, sizeof launch, "%s", scratch_write(r->scratch, "launch.yaml", text));
    r->node = fork();
    assert_true(r->node >= 0);
    if (!r->node) {
        execl(BINARY_DIR "/bin/anlos-stage", "anlos-stage", "--launch", launch,
              "--run-dir", r->scratch->folder, NULL);
        _exit(99);
    }
    /* It is there once it answers. */
    for (int i = 0; by_the_node(r, "status"); i++) {
        assert_true(i < 6000);
        poll(NULL, 0, 10);
    }
}

static void commands_are_carried_out_one_after_the_other(void **state)
{
    struct rig *r = *state;

    assert_int_equal(directly(r, "status home move 0.1 status"), 0);
    assert_string_equal(r->out, "idle at 0.13891 m\n"
                                "idle at 0.00000 m\n"
                                "idle at 0.10000 m\n"
                                "idle at 0.10000 m\n");
    assert_int_equal(r->device->homings, 1);
}

static void what_is_refused_or_fails_ends_with_1(void **state)
{
    struct rig *r = *state;

    assert_int_equal(directly(r, "move 5 home"), 1);
    assert_contains(r->out,
                    "move: it does not reach that far: it goes from 0 to 0.9921 m\n");
    assert_int_equal(r->device->homings, 0);
    assert_int_equal(directly(r, "move -0.1"), 1);
    r->device->stall_at = 100000;
    assert_int_equal(directly(r, "move 0.4 move 0.1"), 1);
    assert_contains(r->out, "in fault at 0.19844 m, place not known: stalled and "
                            "stopped (FS)");
}

static void wrong_arguments_end_with_2(void **state)
{
    static const struct {
        const char *arguments, *part;
    } cases[] = {
        {"", "a command is missing"},
        {"move", "move: expected metres"},
        {"move far", "move far: expected metres"},
        {"hoem", "hoem: expected status, home, move M, stop or release"},
        {"--fast home", "--fast: unknown option"},
        {"sim: stop", "stop and release are for a system that runs"},
        {"sim: home --run-dir /tmp", "not both"},
        {"zaber: home", "no serial port is named"},
        {"status --run-dir", "a folder is missing"},
    };
    struct rig *r = *state;

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        assert_int_equal(stage(r, cases[i].arguments), 2);
        assert_contains(r->out, cases[i].part);
    }
    assert_int_equal(stage(r, "--help"), 0);
    assert_contains(r->out, "usage: anlos stage");
}

static void where_nothing_runs_it_says_so(void **state)
{
    struct rig *r = *state;

    assert_int_equal(by_the_node(r, "home"), 1);
    assert_contains(r->out, "nothing is running in");
}

static void a_running_stage_is_moved_held_and_released(void **state)
{
    struct rig *r = *state;

    start_node(r);
    assert_string_equal(r->out, "idle at 0.13891 m\n");
    assert_int_equal(by_the_node(r, "move 0.2"), 0);
    assert_string_equal(r->out, "idle at 0.20000 m: held by hand\n");
    assert_int_equal(by_the_node(r, "release status"), 0);
    assert_string_equal(r->out, "idle at 0.20000 m\nidle at 0.20000 m\n");
    assert_int_equal(by_the_node(r, "move 2"), 1);
    assert_contains(r->out, "it does not reach that far: it goes from 0 to 0.9921 m\n");
    assert_int_equal(by_the_node(r, "stop release"), 0);
    assert_int_equal(r->device->homings, 0);
}

static void a_running_stage_in_fault_is_homed_by_hand(void **state)
{
    struct rig *r = *state;

    start_node(r);
    r->device->stall_at = 100000;
    assert_int_equal(by_the_node(r, "move 0.4"), 1);
    assert_contains(r->out, "stalled and stopped (FS)");
    assert_int_equal(by_the_node(r, "move 0.1"), 1);
    assert_contains(r->out, "home it first");
    assert_int_equal(by_the_node(r, "release"), 1);
    assert_contains(r->out, "it is in fault: home it");
    r->device->stall_at = 0;
    assert_int_equal(by_the_node(r, "home move 0.4 release"), 0);
    assert_int_equal(r->device->homings, 1);
}

static void interrupted_it_brakes_the_stage(void **state)
{
    struct rig *r = *state;

    r->device->speed = 20000;
    pid_t pid = fork();
    assert_true(pid >= 0);
    if (!pid) {
        execl(BINARY_DIR "/bin/anlos", "anlos", "stage", r->uri, "move", "0.9", NULL);
        _exit(99);
    }
    for (int i = 0; r->device->position == 70000; i++) {
        assert_true(i < 30000);
        poll(NULL, 0, 2);
    }
    int status;
    kill(pid, SIGINT);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 130);
    assert_true(r->device->stops > 0 && r->device->position < 400000);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)
    const struct CMUnitTest tests[] = {
        TEST(commands_are_carried_out_one_after_the_other),
        TEST(what_is_refused_or_fails_ends_with_1),
        TEST(wrong_arguments_end_with_2),
        TEST(where_nothing_runs_it_says_so),
        TEST(a_running_stage_is_moved_held_and_released),
        TEST(a_running_stage_in_fault_is_homed_by_hand),
        TEST(interrupted_it_brakes_the_stage),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
