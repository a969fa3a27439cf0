/* SPDX-License-Identifier: MIT */
/* `anlos calibrate` on a sound card: the cable's far end is a simulated room with faults,
 * some 250 ms away. */
#include "tests/hal/scratch.h"

#include <fcntl.h>
#include <math.h>
#include <spawn.h>
#include <string.h>
#include <sys/wait.h>

#include "hal/survey/calibration.h"
#include "tests/hw/far_end.h"
#include "tests/hw/room_answer.h"

enum { CHANNELS = 8, AHEAD = 12000 };
static const size_t inputs[] = {3, 2, 1, 0};

/* The rig names the calibration file before it is there. */
#define ARRAY                                                                            \
    "sound_speed_m_s: 343\n"                                                             \
    "sample_rate_hz: 48000\n"                                                            \
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.03125, phase: cosine}\n"      \
    "slot_samples: 15600\n"                                                              \
    "speakers_m: [[0, 0, 0], [0, 0.2, 0], [0, 0.4, 0], [0, 0.6, 0]]\n"                   \
    "microphones_m: [[0.1, 0, 0], [0.1, 0.2, 0], [0.1, 0.4, 0], [0.1, 0.6, 0]]\n"        \
    "wall: {normal: [0, 0, 1], distance_m: 1}\n"                                         \
    "gate_m: [0.5, 1.8]\n"
#define SCENE                                                                            \
    ARRAY "level: 0.02\nwall_sound: {reflectivity: 1, echo: 0.8}\n"                      \
          "faults:\n  latency_samples: 17.37\n"                                          \
          "  speakers: [{channel: 1, inverted: true}, {channel: 3, gain_db: -3}]\n"      \
          "  microphones: [{channel: 0, gain_db: 4}, {channel: 2, dead: true}]\n"
#define RIG                                                                              \
    ARRAY "device: {format: S32, buffer_ms: 500, inputs: [3, 2, 1, 0]}\n"                \
          "calibrated: lab.yaml\n"

extern char **environ;

/* What it said of its own accord goes to the test's output: nothing of lost frames. */
static void check_words(struct scratch *s)
{
    char line[400];
    FILE *f = fopen(scratch_path(s, "says"), "r");
    assert_non_null(f);
    while (fgets(line, sizeof line, f)) {
        print_message("%s", line);
        assert_null(strstr(line, "frames were lost"));
    }
    fclose(f);
}

/* Exit code of `anlos calibrate WHAT more` with the far end there.  Neither end loses a
 * frame. */
static int calibrate(struct scratch *s, struct room_answer *room, const char *what)
{
    char array[256], out[128], says[128];
    posix_spawn_file_actions_t files;
    pid_t pid;
    int status;
    snprintf(array, sizeof array, "alsa:hw:Loopback,0,0?rig=%s/rig.yaml", s->folder);
    snprintf(out, sizeof out, "%s/lab.yaml", s->folder);
    snprintf(says, sizeof says, "%s/says", s->folder);
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, STDERR_FILENO, says,
                                     O_WRONLY | O_CREAT | O_TRUNC, 0666);
    char *const words[] = {BINARY_DIR "/bin/anlos",
                           "calibrate",
                           (char *)what,
                           "--array",
                           array,
                           "--out",
                           out,
                           NULL};
    struct far_end *far = room_answer_start(room, AHEAD);
    fflush(NULL);
    assert_int_equal(posix_spawn(&pid, words[0], &files, NULL, words, environ), 0);
    posix_spawn_file_actions_destroy(&files);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFEXITED(status));
    bool broke = far_end_broke(far);
    far_end_stop(far);
    room_answer_forget(room);
    check_words(s);
    assert_false(broke);
    return WEXITSTATUS(status);
}

static struct calibration *load(struct scratch *s)
{
    struct error why = {.text = ""};
    struct calibration *c;
    if (calibration_load(&c, scratch_path(s, "lab.yaml"), &why))
        fail_msg("%s", why.text);
    return c;
}

/* The cable's delay is a whole number of frames, so the fraction is the room's. */
static void a_card_is_calibrated_to_a_tenth_of_a_sample(void **state)
{
    static const double speaker_db[] = {0.75, 0.75, 0.75, -2.25};
    static const double microphone_db[] = {4 - 4 / 3.0, -4 / 3.0, 0, -4 / 3.0};
    struct scratch *s = *state;
    static struct room_answer room; /* the far end runs on when an assertion fails */
    scratch_write(s, "rig.yaml", RIG);
    room_answer_create(&room, scratch_write(s, "scene.yaml", SCENE), CHANNELS, inputs,
                       pow(10, -6 / 20.0));
    assert_int_equal(calibrate(s, &room, "time-zero"), 0);
    assert_int_equal(calibrate(s, &room, "channels"), 1);
    assert_int_equal(calibrate(s, &room, "gains"), 0);
    struct calibration *c = load(s);
    double cable = c->latency_samples - 17.37;
    print_message("the cable's delay: %.3f\n", cable);
    assert_true(fabs(cable - rint(cable)) < 0.1);
    assert_true(fabs(cable - AHEAD) < 100);
    for (size_t i = 0; i < 4; i++) {
        assert_int_equal(c->speakers[i].faults, i == 1 ? CALIBRATION_INVERTED : 0);
        assert_int_equal(c->microphones[i].faults, i == 2 ? CALIBRATION_DEAD : 0);
        assert_true(fabs(c->speakers[i].gain_db - speaker_db[i]) < 0.1);
        assert_true(fabs(c->microphones[i].gain_db - microphone_db[i]) < 0.1);
    }
    calibration_destroy(c);
    /* With the file that the rig names in place, what is measured stays the same. */
    assert_int_equal(calibrate(s, &room, "channels"), 1);
    c = load(s);
    assert_int_equal(c->speakers[1].faults, CALIBRATION_INVERTED);
    calibration_destroy(c);
    assert_int_equal(room.n_strange, 0);
    room_answer_clear(&room);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_card_is_calibrated_to_a_tenth_of_a_sample),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
