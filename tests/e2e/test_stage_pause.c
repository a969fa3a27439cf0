/* SPDX-License-Identifier: MIT */
/* The real processes on a small simulated scene, with a stage that stalls in the middle
 * of the scan: a person homes it, and the scan goes on. */
#include "tests/hal/scratch.h"

#include <jansson.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/hal/zaber_device.h"

#define SCENE       SOURCE_DIR "/launch/scenes/point.yaml"
#define DEADLINE_MS 60000
#define STEP_M      1.984375e-6 /* 25.4 mm a turn of 200 x 64 microsteps */

static void write_launch(struct scratch *s, const struct zaber_device *d)
{
    char text[1024];

    snprintf(text, sizeof text,
             "nodes: [stage, array, scan, dsp, recon, track, can, report]\n"
             "array: {uri: 'sim:%s'}\n"
             "stage: {uri: 'zaber:%s?pitch_mm=25.4&settle=0'}\n"
             "scan: {background: false, timeout_s: 1}\n"
             "report: {folder: %s/out}\n",
             SCENE, d->path, s->folder);
    scratch_write(s, "launch.yaml", text);
}

static pid_t start(struct scratch *s)
{
    char launch[128];

    snprintf(launch, sizeof launch, "%s/launch.yaml", s->folder);
    pid_t pid = fork();
    assert_true(pid >= 0);
    if (pid)
        return pid;
    if (!freopen(scratch_path(s, "says"), "w", stdout) ||
        dup2(STDOUT_FILENO, STDERR_FILENO) < 0)
        _exit(98);
    execl(BINARY_DIR "/bin/anlos", "anlos", "launch", launch, "--run-dir", s->folder,
          NULL);
    _exit(99);
}

static void read_says(struct scratch *s, char *text, size_t size)
{
    FILE *f = fopen(scratch_path(s, "says"), "r");
    size_t n = f ? fread(text, 1, size - 1, f) : 0;

    if (f)
        fclose(f);
    text[n] = '\0';
}

static void await_text(struct scratch *s, const char *part)
{
    char text[16384];

    for (int i = 0; i < DEADLINE_MS / 10; i++) {
        read_says(s, text, sizeof text);
        if (strstr(text, part))
            return;
        poll(NULL, 0, 10);
    }
    fail_msg("the launch does not say \"%s\" but: %s", part, text);
}

static int home(struct scratch *s)
{
    char command[300];

    snprintf(command, sizeof command, BINARY_DIR "/bin/anlos stage home --run-dir %s",
             s->folder);
    return system(command);
}

static void assert_done_well(struct scratch *s, pid_t pid)
{
    char text[16384];
    int status;

    assert_int_equal(waitpid(pid, &status, 0), pid);
    read_says(s, text, sizeof text);
    if (status || strstr(text, "Sanitizer") || strstr(text, "runtime error"))
        fail_msg("status %x: %s", (unsigned)status, text);
}

static const json_t *stage_device(const json_t *report)
{
    const json_t *nodes = json_object_get(report, "nodes");

    for (size_t i = 0; i < json_array_size(nodes); i++) {
        const json_t *o = json_array_get(nodes, i);
        if (!strcmp(json_string_value(json_object_get(o, "node")), "stage"))
            return json_object_get(o, "device");
    }
    return NULL;
}

static void a_stall_pauses_the_scan_until_somebody_homes_the_stage(void **state)
{
    struct scratch *s = *state;
    struct zaber_device *d = zaber_device_start(false);

    write_launch(s, d);
    pid_t launcher = start(s);
    for (int i = 0; !d->homings; i++) { /* by its first move */
        assert_true(i < DEADLINE_MS / 2);
        poll(NULL, 0, 2);
    }
    d->stall_at = (long)(0.1 / STEP_M); /* between the third position and the fourth */
    await_text(s, "scan    warning pauses: stage: stalled and stopped (FS)");
    await_text(s, "paused at 12/24 pings; stage: stalled");
    d->stall_at = 0;
    assert_int_equal(home(s), 0);
    assert_done_well(s, launcher);
    assert_int_equal(d->homings, 2);

    json_t *report = json_load_file(scratch_path(s, "out/report.json"), 0, NULL);
    const json_t *pings = json_object_get(report, "pings");
    assert_string_equal(json_string_value(json_object_get(report, "state")), "done");
    assert_int_equal(json_integer_value(json_object_get(pings, "done")), 24);
    assert_int_equal(json_integer_value(json_object_get(pings, "lost")), 0);
    assert_int_equal(json_integer_value(json_object_get(stage_device(report), "homings")),
                     2);
    json_decref(report);
    zaber_device_unplug(d);
    free(d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(
            a_stall_pauses_the_scan_until_somebody_homes_the_stage, scratch_open,
            scratch_close),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
