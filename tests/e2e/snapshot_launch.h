/* SPDX-License-Identifier: MIT */
/* tests/e2e/snapshot_launch.h -- a system of real processes that keeps its last seconds.
 */
#ifndef ANLOS_TESTS_E2E_SNAPSHOT_LAUNCH_H
#define ANLOS_TESTS_E2E_SNAPSHOT_LAUNCH_H

#include "tests/nodes/record_rig.h"
#include "tests/small_disk.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "hear.h"
#include "msgs/bag/manifest.h"
#include "msgs/health.pb-c.h"
#include "msgs/save.pb-c.h"
#include "msgs/topics.h"
#include "msgs/traces.pb-c.h"

#define SCRATCH_TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)
#define SCENE           SOURCE_DIR "/launch/scenes/full-array.yaml"

struct system {
    struct scratch *s;
    pid_t pid;
    struct bus *bus;  /* of "stage", which this system has not */
    uint64_t missing; /* of the bags that were saved */
};

static inline int64_t now_ns(void)
{
    return clock_now_ns(clock_system());
}

/* build/bin/anlos; what it says goes into a file of that name.  small: a folder that is a
 * disk of 1 MB for it; NULL: none. */
static inline pid_t start_anlos(struct scratch *s, const char *says, const char *small,
                                char *const words[])
{
    pid_t pid = fork();

    assert_true(pid >= 0);
    if (pid)
        return pid;
    if (small && small_disk_mount(small))
        _exit(97);
    if (!freopen(scratch_path(s, says), "w", stdout) ||
        dup2(STDOUT_FILENO, STDERR_FILENO) < 0)
        _exit(98);
    execv(BINARY_DIR "/bin/anlos", words);
    _exit(99);
}

static inline int end_of(pid_t pid)
{
    int status;

    assert_int_equal(waitpid(pid, &status, 0), pid);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/* Its first line, without the end; the exit code. */
static inline int run(struct system *y, char line[512], char *const words[])
{
    int code = end_of(start_anlos(y->s, "command", NULL, words));
    FILE *f = fopen(scratch_path(y->s, "command"), "r");

    assert_non_null(f);
    line[0] = '\0';
    if (fgets(line, 512, f))
        line[strcspn(line, "\n")] = '\0';
    fclose(f);
    return code;
}

/* can: what the launch file says of it; empty: there is none.  keeps: a ring. record: a
 * recording beside it, in the folder that is a small disk. */
static inline void start_with(struct system *y, const char *can, bool keeps, bool record)
{
    const struct bus_config cfg = {
        .node = "stage", .run_dir = y->s->folder, .epoch_ns = now_ns()};
    char text[1024], file[128], small[128], bag[160];

    snprintf(text, sizeof text,
             "nodes: [array, scan, dsp, %sreport]\n%s"
             "array: {uri: 'sim:" SCENE "'}\n"
             "scan: {mode: fixed, speakers: [0, 5, 10, 15], background: true, "
             "background_frames: 2}\n"
             "report: {folder: %s/out}\n"
             "record: {snapshot: {folder: none, after_s: 0, max_mb: 64}}\n",
             *can ? "can, " : "", can, y->s->folder);
    scratch_write(y->s, "launch.yaml", text);
    snprintf(file, sizeof file, "%s/launch.yaml", y->s->folder);
    snprintf(text, sizeof text, "%s/saved", y->s->folder);
    assert_int_equal(bus_create(&y->bus, &cfg, NULL), 0);
    assert_int_equal(bus_subscribe(y->bus, topic_traces()), 0);
    assert_int_equal(bus_subscribe(y->bus, topic_save_status()), 0);
    assert_int_equal(bus_subscribe(y->bus, topic_health()), 0);
    snprintf(small, sizeof small, "%s/small", y->s->folder);
    snprintf(bag, sizeof bag, "%s/a.mcap", small);
    y->pid = start_anlos(y->s, "says", record ? small : NULL,
                         (char *[]){"anlos", "launch", file, "--run-dir", y->s->folder,
                                    keeps ? "--snapshot" : NULL, text,
                                    record ? "--record" : NULL, bag, NULL});
}

static inline void start(struct system *y, bool record)
{
    start_with(y, "", true, record);
}

/* The next message of a topic, to be freed. */
static inline ProtobufCMessage *hear(struct system *y, const struct topic *topic)
{
    ProtobufCMessage *m = hear_on(y->bus, topic, NULL, 0);

    if (m)
        return m;
    kill(y->pid, SIGKILL);
    fail_msg("nothing came on %s", topic->name);
    return NULL;
}

static inline void await_frame(struct system *y, uint32_t frame)
{
    uint32_t at = 0;

    while (at < frame) {
        Anlos__Traces *t = (Anlos__Traces *)hear(y, topic_traces());
        at = t->frame;
        anlos__traces__free_unpacked(t, NULL);
    }
}

/* Messages that the bag says it should have and has not: a busy machine may lose some. */
static inline uint64_t count_lost(const char *bag)
{
    uint64_t sum = 0;
    char lost[256];

    for (const struct topic *t = topics_all(); t->name; t++)
        if (find_metadata(bag, MANIFEST_LOST, 0, t->name, lost))
            sum += strtoull(lost, NULL, 10);
    return sum;
}

/* Whole, and with all that it takes to make an image of it. */
static inline void check_image(struct system *y, const char *bag, const char *out)
{
    char line[512], folder[256], text[300], lost[256];
    uint64_t n_faults;

    assert_int_equal(bag_check(&n_faults, bag, NULL, NULL), 0);
    assert_int_equal(n_faults, 0);
    assert_true(find_metadata(bag, MANIFEST_LOST, 0, "ping", lost));
    snprintf(folder, sizeof folder, "%s/%s", y->s->folder, out);
    int code =
        run(y, line,
            (char *[]){"anlos", "recon", "--bag", (char *)bag, "--out", folder, NULL});
    if (code)
        fail_msg("recon: %s", line);
    snprintf(text, sizeof text, "%s/volume.nrrd", folder);
    assert_int_equal(access(text, F_OK), 0);
}

#endif
