/* A simulated drive is recorded, with what the vehicle tells over CAN and a wall that is
 * heard; the recording gives the same lists and the same CAN frames, their protection
 * included, as fast as it goes, at a pace, on a machine that others keep busy, and in one
 * process without the bus. */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "msgs/bus.h"

#define SCENE SOURCE_DIR "/launch/scenes/drive-person-moving.yaml"
#define LISTS 60 /* 1.5 s: the wall is known by then */
#define BUSY  4  /* processes without an end, twice what a small machine has */
#define FRAMES                                                                           \
    "recon: {frames: {pings: 8, sum: power, every: ping}}\nwall: {from: echoes}\n"
#define DEADLINE_MS 60000

static pid_t start(struct scratch *s, char *const argv[])
{
    pid_t pid = fork();

    assert_true(pid >= 0);
    if (!pid) {
        if (!freopen(scratch_path(s, "says"), "w", stdout) ||
            dup2(STDOUT_FILENO, STDERR_FILENO) < 0)
            _exit(98);
        execv(BINARY_DIR "/bin/anlos", argv);
        _exit(99);
    }
    return pid;
}

static int end_of(pid_t pid)
{
    int status;

    assert_int_equal(waitpid(pid, &status, 0), pid);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/* No process may have met a sanitizer's complaint. */
static void assert_clean(struct scratch *s)
{
    char line[1000];
    FILE *f = fopen(scratch_path(s, "says"), "r");

    assert_non_null(f);
    while (fgets(line, sizeof line, f))
        if (strstr(line, "Sanitizer") || strstr(line, "runtime error"))
            fail_msg("%s", line);
    fclose(f);
}

/* Until so many lists have come, with the vehicle's motion beside them. */
static void wait_for_lists(struct scratch *s)
{
    const struct bus_config cfg = {.run_dir = s->folder, .listen_only = true};
    struct bus *b = NULL;
    struct bus_message m;
    unsigned lists = 0, motions = 0;

    assert_int_equal(bus_create(&b, &cfg, NULL), 0);
    assert_int_equal(bus_subscribe(b, topic_detections()), 0);
    assert_int_equal(bus_subscribe(b, topic_ego()), 0);
    while (lists < LISTS) {
        assert_int_equal(bus_receive(b, &m, DEADLINE_MS), 0);
        lists += m.topic == topic_detections();
        motions += m.topic == topic_ego();
        bus_message_free(&m);
    }
    assert_true(motions > 0);
    bus_destroy(b);
}

static char *path_of(struct scratch *s, const char *name)
{
    return strdup(scratch_path(s, name));
}

static void record(struct scratch *s)
{
    char *launch, *bag = path_of(s, "drive.mcap"), *out = path_of(s, "live");

    launch = strdup(scratch_write(
        s, "live.yaml",
        "nodes: [array, scan, dsp, recon, wall, track, can, report]\n"
        "array: {uri: 'sim:" SCENE "'}\n"
        "scan: {mode: fixed}\n" FRAMES "can: {uri: 'sim:" SCENE "?log=can.candump'}\n"
        "report: {folder: out}\n"));
    char *argv[] = {(char *)"anlos",
                    (char *)"launch",
                    launch,
                    (char *)"--out",
                    out,
                    (char *)"--record",
                    bag,
                    (char *)"--run-dir",
                    s->folder,
                    NULL};
    pid_t pid = start(s, argv);
    wait_for_lists(s);
    kill(pid, SIGINT);
    assert_int_equal(end_of(pid), 130);
    assert_clean(s);
    free(launch);
    free(bag);
    free(out);
}

/* The frames of all lists, without their stamps, which are all of the recording: none is
 * of the time of the replay, after all of it. */
static char *frames_of(struct scratch *s, const char *name)
{
    double stamp_s = 0.0, first_s = 0.0;
    char line[256], frame[200], *text = calloc(1, 1 << 22);
    FILE *f = fopen(scratch_path(s, name), "r");
    size_t used = 0;

    assert_non_null(text);
    if (!f)
        fail_msg("%s is missing", s->path);
    while (fgets(line, sizeof line, f)) {
        assert_int_equal(sscanf(line, "(%lf) can0 %199s", &stamp_s, frame), 2);
        if (first_s == 0.0)
            first_s = stamp_s;
        if (strncmp(frame, "400#", 4) != 0 && strncmp(frame, "401#", 4) != 0)
            used += (size_t)sprintf(text + used, "%s\n", frame);
    }
    fclose(f);
    assert_true(first_s <= stamp_s);
    return text;
}

static char *replay(struct scratch *s, const char *rate, const char *to)
{
    char *launch = path_of(s, "play.yaml"), *out = path_of(s, to), name[64];
    char *argv[] = {
        (char *)"anlos",     (char *)"launch", launch,           (char *)"--out", out,
        (char *)"--run-dir", s->folder,        (char *)"--rate", (char *)rate,    NULL};

    assert_int_equal(end_of(start(s, argv)), 0); /* nothing was skipped */
    assert_clean(s);
    snprintf(name, sizeof name, "%s/can.candump", to);
    free(launch);
    free(out);
    return frames_of(s, name);
}

/* The same while others take all of the processors. */
static char *replay_loaded(struct scratch *s)
{
    pid_t busy[BUSY];

    for (size_t i = 0; i < BUSY; i++) {
        busy[i] = fork();
        assert_true(busy[i] >= 0);
        if (!busy[i]) {
            prctl(PR_SET_PDEATHSIG, SIGKILL);
            for (volatile unsigned k = 0;; k++)
                ;
        }
    }
    char *frames = replay(s, "max", "loaded");
    for (size_t i = 0; i < BUSY; i++) {
        kill(busy[i], SIGKILL);
        end_of(busy[i]);
    }
    return frames;
}

static char *reconstruct(struct scratch *s)
{
    char *bag = path_of(s, "drive.mcap"), *out = path_of(s, "one");
    char *argv[] = {(char *)"anlos",
                    (char *)"recon",
                    (char *)"--bag",
                    bag,
                    (char *)"--out",
                    out,
                    NULL};

    assert_int_equal(end_of(start(s, argv)), 0);
    assert_clean(s);
    free(bag);
    free(out);
    return frames_of(s, "one/can.candump");
}

static void a_recorded_drive_gives_the_same_frames_at_every_pace(void **state)
{
    struct scratch *s = *state;

    record(s);
    scratch_write(s, "play.yaml",
                  "nodes: [play, dsp, recon, wall, track, can, report]\n"
                  "play: {bag: drive.mcap}\n"
                  "scan: {mode: fixed}\n" FRAMES "report: {folder: out}\n");
    char *one = reconstruct(s), *fast = replay(s, "max", "max");
    char *paced = replay(s, "1", "paced"), *loaded = replay_loaded(s);
    assert_contains(one, "402#");
    assert_string_equal(fast, one);
    assert_string_equal(paced, one);
    assert_string_equal(loaded, one);
    free(loaded);
    free(one);
    free(fast);
    free(paced);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(
            a_recorded_drive_gives_the_same_frames_at_every_pace, scratch_open,
            scratch_close),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
