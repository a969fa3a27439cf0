/* SPDX-License-Identifier: MIT */
/* A simulated drive is recorded, with what the vehicle tells over CAN, its walls too, and
 * a wall that is heard; the recording gives the same lists and the same CAN frames, their
 * protection included, as fast as it goes, at a pace, on a machine that others keep busy,
 * and in one process without the bus. */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "msgs/bus.h"
#include "msgs/detections.pb-c.h"

#define SCENE       SOURCE_DIR "/launch/scenes/drive-person-moving.yaml"
#define LISTS       60 /* 1.5 s: the wall is known by then; */
#define TOLD        30 /* of them with an object, */
#define MOST_LISTS  (10 * LISTS)
#define BUSY        4 /* processes without an end, twice what a small machine has */
#define FRAMES      "recon: {frames: {pings: 8, sum: power, every: ping}}\n"
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

/* No process may have met a sanitizer's error. */
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
    unsigned lists = 0, told = 0, motions = 0;

    assert_int_equal(bus_create(&b, &cfg, NULL), 0);
    assert_int_equal(bus_subscribe(b, topic_detections()), 0);
    assert_int_equal(bus_subscribe(b, topic_ego()), 0);
    while (lists < LISTS || (told < TOLD && lists < MOST_LISTS)) {
        assert_int_equal(bus_receive(b, &m, DEADLINE_MS), 0);
        motions += m.topic == topic_ego();
        if (m.topic == topic_detections()) {
            Anlos__DetectionList *l = (Anlos__DetectionList *)bus_message_unpack(&m);
            assert_non_null(l);
            lists++;
            told += l->n_detections > 0;
            anlos__detection_list__free_unpacked(l, NULL);
        }
        bus_message_free(&m);
    }
    assert_true(motions > 0);
    bus_destroy(b);
}

static char *path_of(struct scratch *s, const char *name)
{
    return strdup(scratch_path(s, name));
}

/* The vehicle goes half a metre to and fro, and somebody walks behind the corner: at
 * whatever time of theirs it begins. */
static const char scene[] =
    "array: bumper\n"
    "temperature_c: 20\n"
    "wall: {normal: [0, 0, 1], distance_m: 2.2}\n"
    "mount: {origin_m: [3.6, 0, 0.4], x_axis: [0, 1, 0], y_axis: [0, 0, 1]}\n"
    "gate_m: [1.5, 4]\n"
    "volume: {x_m: [-3.2, 3.2, 0.04], y_m: [0, 0, 0.1], z_m: [2.2, 3.6, 0.02]}\n"
    "drive:\n"
    "  period_s: 4\n"
    "  ego: [{t_s: 0.5, speed_m_s: 0}, {t_s: 0.7, speed_m_s: 1},\n"
    "        {t_s: 1.0, speed_m_s: 1}, {t_s: 1.2, speed_m_s: 0},\n"
    "        {t_s: 2.5, speed_m_s: 0}, {t_s: 2.7, speed_m_s: -1},\n"
    "        {t_s: 3.0, speed_m_s: -1}, {t_s: 3.2, speed_m_s: 0}]\n"
    "building: [[-0.6, 0.9], [-9, 0.9], [-9, -6], [-0.6, -6]]\n"
    "objects:\n"
    "  - name: person\n"
    "    kind: person\n"
    "    path:\n"
    "      - {t_s: 0, position_m: [-2.4, 0.47, 1.4]}\n"
    "      - {t_s: 2, position_m: [0, 0.47, 1.4]}\n"
    "      - {t_s: 4, position_m: [-2.4, 0.47, 1.4]}\n"
    "seed: 11\n"
    "level: 0.03\n"
    "direct_level: 0.1\n"
    "wall_sound: {reflectivity: 0.95, echo: 0.5, patches: 60,\n"
    "             scattering_length_m: 0.005, roughness_m: 0.01}\n"
    "noise: {snr_db: 0, at_m: 4}\n";

static void record(struct scratch *s)
{
    char *launch, *bag = path_of(s, "drive.mcap"), *out = path_of(s, "live");

    scratch_write(s, "scene.yaml", scene);
    launch = strdup(
        scratch_write(s, "live.yaml",
                      "nodes: [array, scan, dsp, recon, wall, track, can, report]\n"
                      "array: {uri: 'sim:scene.yaml'}\n"
                      "scan: {mode: fixed}\n"
                      "wall: {from: echoes}\n" FRAMES
                      "can: {uri: 'sim:scene.yaml?wall=on&log=can.candump'}\n"
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

static char *replay(struct scratch *s, const char *file, const char *rate, const char *to)
{
    char *launch = path_of(s, file), *out = path_of(s, to), name[64];
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
static char *replay_loaded(struct scratch *s, const char *file)
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
    char *frames = replay(s, file, "max", "loaded");
    for (size_t i = 0; i < BUSY; i++) {
        kill(busy[i], SIGKILL);
        end_of(busy[i]);
    }
    return frames;
}

/* launch: NULL: as it is in the bag. */
static char *reconstruct(struct scratch *s, const char *launch)
{
    char *bag = path_of(s, "drive.mcap"), *out = path_of(s, "one");
    char *file = launch ? path_of(s, launch) : NULL;
    char *argv[] = {(char *)"anlos",
                    (char *)"recon",
                    (char *)"--bag",
                    bag,
                    (char *)"--out",
                    out,
                    launch ? (char *)"--launch" : NULL,
                    file,
                    NULL};

    assert_int_equal(end_of(start(s, argv)), 0);
    assert_clean(s);
    free(bag);
    free(out);
    free(file);
    return frames_of(s, "one/can.candump");
}

static void write_play(struct scratch *s, const char *name, const char *walls)
{
    char text[400];

    snprintf(text, sizeof text,
             "nodes: [play, dsp, recon, wall, track, can, report]\n"
             "play: {bag: drive.mcap}\n"
             "scan: {mode: fixed}\n" FRAMES "wall: {from: %s}\n"
             "report: {folder: out}\n",
             walls);
    scratch_write(s, name, text);
}

/* Where they part is enough to be said. */
static void assert_same(const char *frames, const char *expected)
{
    size_t i = 0;

    while (frames[i] && frames[i] == expected[i])
        i++;
    if (frames[i] != expected[i])
        fail_msg("at %zu of %zu: %.60s, expected %.60s", i, strlen(expected), frames + i,
                 expected + i);
}

static void a_recorded_drive_gives_the_same_frames_at_every_pace(void **state)
{
    struct scratch *s = *state;

    write_play(s, "play.yaml", "echoes");
    char *one = reconstruct(s, NULL), *fast = replay(s, "play.yaml", "max", "max");
    char *paced = replay(s, "play.yaml", "1", "paced");
    char *loaded = replay_loaded(s, "play.yaml");
    assert_non_null(strstr(one, "404#"));
    assert_same(fast, one);
    assert_same(paced, one);
    assert_same(loaded, one);
    free(loaded);
    free(one);
    free(fast);
    free(paced);
}

/* Without sound that tells of walls, it is not the machine that tells when there are. */
static void so_do_walls_that_the_vehicle_gives_and_those_of_the_survey(void **state)
{
    struct scratch *s = *state;

    write_play(s, "given.yaml", "topic");
    write_play(s, "survey.yaml", "survey");
    char *given = reconstruct(s, "given.yaml"), *loaded = replay_loaded(s, "given.yaml");
    char *survey = reconstruct(s, "survey.yaml");
    char *fast = replay(s, "survey.yaml", "max", "max");
    assert_non_null(strstr(given, "404#"));
    assert_same(loaded, given);
    assert_same(fast, survey);
    assert_string_not_equal(given, survey);
    free(given);
    free(loaded);
    free(survey);
    free(fast);
}

static int record_once(void **state)
{
    int err = scratch_open(state);

    if (!err)
        record(*state);
    return err;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_recorded_drive_gives_the_same_frames_at_every_pace),
        cmocka_unit_test(so_do_walls_that_the_vehicle_gives_and_those_of_the_survey),
    };
    return cmocka_run_group_tests(tests, record_once, scratch_close);
}
