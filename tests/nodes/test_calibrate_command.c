/* SPDX-License-Identifier: MIT */
/* `anlos calibrate` on simulated rooms with faults: what it finds is what the scene says
 * is wrong. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "hal/array.h"
#include "hal/recording/recording.h"
#include "hal/room/elements.h"
#include "hal/survey/calibration.h"
#include "hal/survey/element_places.h"
#include "hal/survey/file.h"
#include "nodes/anlos/commands.h"
#include "tests/hal/folder.h"
#include "tests/nodes/command.h"
#include "tests/nodes/near.h"

enum { N = 6 };

/* Speakers and microphones upright, 12 cm apart, in two rows; a wall ahead. */
#define SOUND                                                                            \
    "temperature_c: 20\nsample_rate_hz: 48000\n"                                         \
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.025}\n"                       \
    "slot_samples: 1300\ngate_m: [0.3, 3]\n"                                             \
    "wall_sound: {reflectivity: 0.9, echo: 0.8}\n"                                       \
    "microphones: {ripple_db: 1.5}\nlevel: 0.03\n"
#define ARRAY                                                                            \
    SOUND                                                                                \
    "speakers_m: [[0, 0, 0], [0, 0.12, 0], [0, 0.24, 0], [0, 0.36, 0], [0, 0.48, 0], "   \
    "[0, 0.6, 0]]\n"                                                                     \
    "microphones_m: [[0.08, 0, 0], [0.08, 0.12, 0], [0.08, 0.24, 0], [0.08, 0.36, 0], "  \
    "[0.08, 0.48, 0], [0.08, 0.6, 0]]\n"
#define SCENE                                                                            \
    ARRAY "stage: {axis: [1, 0, 0], positions_m: [0, 0.1]}\n"                            \
          "wall: {normal: [0, 0, 1], distance_m: 1.2}\n"
#define QUIET SCENE "noise: {rms: 1.0e-4}\n"

struct fixture {
    char folder[64], scene[128], out[96];
    struct command_result r;
};

static int set_up(void **state)
{
    struct fixture *f = calloc(1, sizeof *f);
    if (!f)
        return -1;
    strcpy(f->folder, "/tmp/anlos-calibrate-XXXXXX");
    if (!mkdtemp(f->folder))
        return -1;
    snprintf(f->out, sizeof f->out, "%s/array.yaml", f->folder);
    *state = f;
    return 0;
}

static int tear_down(void **state)
{
    struct fixture *f = *state;
    int err = folder_remove(f->folder);
    free(f);
    return err;
}

static void write_scene(struct fixture *f, const char *head, const char *rest)
{
    char path[96];
    snprintf(path, sizeof path, "%s/scene.yaml", f->folder);
    snprintf(f->scene, sizeof f->scene, "sim:%s", path);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    assert_true(fputs(head, file) >= 0 && fputs(rest, file) >= 0);
    assert_int_equal(fclose(file), 0);
}

/* `anlos calibrate WHAT --array SCENE --out FILE more...` */
static int run(struct fixture *f, const char *what, char *const more[])
{
    char *words[20] = {"calibrate", (char *)what, "--array", f->scene, "--out", f->out};
    for (int i = 0; more && more[i]; i++)
        words[6 + i] = more[i];
    command_run(&f->r, command_calibrate, words);
    return f->r.code;
}

static void expect(struct fixture *f, int code, const char *text)
{
    if (f->r.code != code || (!strstr(f->r.out, text) && !strstr(f->r.err, text)))
        fail_msg("exit code %d, expected %d with \"%s\":\n%s%s", f->r.code, code, text,
                 f->r.out, f->r.err);
}

static struct calibration *load(const struct fixture *f)
{
    struct error why = {.text = ""};
    struct calibration *c;
    if (calibration_load(&c, f->out, &why))
        fail_msg("%s", why.text);
    return c;
}

static void time_zero_is_found_to_a_tenth_of_a_sample(void **state)
{
    static const double latencies[] = {0.0, 123.45, 1100.7};
    struct fixture *f = *state;
    for (size_t i = 0; i < sizeof latencies / sizeof *latencies; i++) {
        char faults[64];
        snprintf(faults, sizeof faults, "faults: {latency_samples: %g}\n", latencies[i]);
        write_scene(f, QUIET, faults);
        run(f, "time-zero", NULL);
        expect(f, 0, "good: latency_samples");
        struct calibration *c = load(f);
        assert_near(c->latency_samples, latencies[i], 0.1);
        assert_true(c->sound_speed_m_s != c->sound_speed_m_s); /* still not known */
        calibration_destroy(c);
    }
}

/* Elements are off by 2 mm rms, a reflector close by is louder than the direct sound, the
 * room has clutter, and two channels are swapped: 64 pairs outvote that. */
static void time_zero_bears_a_room(void **state)
{
    struct fixture *f = *state;
    write_scene(f, SCENE,
                "noise: {rms: 1.0e-3}\nseed: 3\ndirect_level: 0.2\n"
                "errors: {element_m: 0.002}\n"
                "clutter: {points: 40, scattering_length_m: 0.03, near_m: 0.6, "
                "far_m: 3}\n"
                "faults:\n  latency_samples: 61.7\n"
                "  speakers: [{channel: 1, swapped_with: 4}]\n");
    run(f, "time-zero", NULL);
    expect(f, 0, "good: latency_samples");
    struct calibration *c = load(f);
    assert_near(c->latency_samples, 61.7, 0.3); /* 2 mm are 0.28 samples */
    calibration_destroy(c);
}

static void one_pair_at_a_known_distance_is_enough(void **state)
{
    struct fixture *f = *state;
    char *pair[] = {"--pair", "2,3", "--distance-m", "0.144222", NULL};
    write_scene(f, QUIET, "faults: {latency_samples: 40.2}\n");
    run(f, "time-zero", pair);
    expect(f, 0, "one pair does not tell");
    struct calibration *c = load(f);
    assert_near(c->latency_samples, 40.2, 0.1);
    calibration_destroy(c);
}

static void a_wrong_speed_of_sound_is_noticed_and_can_be_fitted(void **state)
{
    struct fixture *f = *state;
    char *fit[] = {"--fit-speed", NULL};
    write_scene(f, QUIET, "faults: {latency_samples: 40.2, sound_speed_m_s: 350}\n");
    run(f, "time-zero", NULL);
    expect(f, 1, "the distances say another speed of sound");
    assert_int_equal(access(f->out, F_OK), -1);
    run(f, "time-zero", fit);
    expect(f, 0, "good: latency_samples");
    struct calibration *c = load(f);
    assert_near(c->latency_samples, 40.2, 0.1);
    assert_near(c->sound_speed_m_s, 350.0, 0.5);
    calibration_destroy(c);
}

static void distances_that_are_too_equal_do_not_tell_the_speed(void **state)
{
    struct fixture *f = *state;
    char *fit[] = {"--fit-speed", NULL};
    char scene[1024] = SCENE, *from = strstr(scene, "speakers_m"),
         *to = strstr(scene, "stage:");
    memmove(from + 70, to, strlen(to) + 1);
    memset(from, ' ', 70);
    memcpy(from, "speakers_m: [[0, 0, 0]]\nmicrophones_m: [[0.2, 0, 0], [0, 0.2, 0]]\n",
           66);
    from[69] = '\n';
    write_scene(f, scene, "noise: {rms: 1.0e-4}\n");
    run(f, "time-zero", fit);
    expect(f, 1, "bad: the distances do not tell the speed of sound");
    run(f, "time-zero", NULL);
    expect(f, 0, "the distances are too equal, or too few, to tell");
}

static void faulty_channels_are_named(void **state)
{
    static const struct {
        const char *key;
        bool microphone;
        size_t channel;
        unsigned faults;
    } expected[] = {
        {"inverted: true", false, 1, CALIBRATION_INVERTED},
        {"dead: true", false, 5, CALIBRATION_DEAD},
        {"limit: 0.4", false, 0, CALIBRATION_CLIPPED},
        {"noise_rms: 0.003", false, 2, CALIBRATION_NOISY},
        {"inverted: true", true, 4, CALIBRATION_INVERTED},
        {"dead: true", true, 0, CALIBRATION_DEAD},
        {"limit: 0.05", true, 3, CALIBRATION_CLIPPED},
        {"noise_rms: 0.003", true, 1, CALIBRATION_NOISY},
    };
    struct fixture *f = *state;
    char faults[1024] = "faults:\n  latency_samples: 20\n  speakers:\n";
    for (size_t i = 0; i < 8; i++) {
        size_t n = strlen(faults);
        snprintf(faults + n, sizeof faults - n, "%s    - {channel: %zu, %s}\n",
                 i == 4 ? "  microphones:\n" : "", expected[i].channel, expected[i].key);
    }
    write_scene(f, QUIET, faults);
    run(f, "channels", NULL);
    expect(f, 1,
           "bad: 6 of 12 channels have a fault: speaker 0 (clipped), speaker 2 (noisy), "
           "speaker 5 (dead), microphone 0 (dead), microphone 1 (noisy), microphone 3 "
           "(clipped)");
    struct calibration *c = load(f);
    for (size_t k = 0; k < N; k++) {
        unsigned speaker = 0, microphone = 0;
        for (size_t i = 0; i < 8; i++)
            if (expected[i].channel == k)
                *(expected[i].microphone ? &microphone : &speaker) |= expected[i].faults;
        assert_int_equal(c->speakers[k].faults, speaker);
        assert_int_equal(c->microphones[k].faults, microphone);
    }
    calibration_destroy(c);
}

static void channels_without_a_fault_are_good(void **state)
{
    struct fixture *f = *state;
    write_scene(f, QUIET,
                "faults: {latency_samples: 20, speakers: [{channel: 1, gain_db: -6}], "
                "microphones: [{channel: 2, gain_db: 6}]}\n");
    run(f, "channels", NULL);
    expect(f, 0, "good: all 12 channels are alive and in their places");
    assert_null(strstr(f->r.out, "answers as"));
    write_scene(f, QUIET, "faults: {microphones: [{channel: 2, inverted: true}]}\n");
    run(f, "channels", NULL);
    expect(f, 0, "the inverted ones will be set right");
    write_scene(f, SCENE, "");
    run(f, "channels", NULL);
    expect(f, 0, "noise cannot be told: all takes are the same");
}

static void swapped_channels_are_told_apart(void **state)
{
    struct fixture *f = *state;
    write_scene(f, QUIET,
                "faults:\n  speakers: [{channel: 1, swapped_with: 4}]\n"
                "  microphones: [{channel: 0, swapped_with: 2}]\n");
    run(f, "channels", NULL);
    expect(f, 1, "bad: 4 of 12 channels");
    static const char *const lines[] = {
        "speaker      1", "answers as 4", "speaker      4", "answers as 1",
        "microphone   0", "answers as 2", "microphone   2", "answers as 0"};
    const char *at = f->r.out;
    for (size_t i = 0; i < 8; i++) {
        at = strstr(at, lines[i]);
        assert_non_null(at);
        if (i % 2) /* on the line that names the channel */
            assert_null(memchr(strstr(f->r.out, lines[i - 1]), '\n',
                               (size_t)(at - strstr(f->r.out, lines[i - 1]))));
    }
}

/* All speakers upside down sound like all microphones upside down. */
static void what_arrivals_cannot_tell_apart_is_said(void **state)
{
    struct fixture *f = *state;
    write_scene(f, QUIET,
                "faults:\n  microphones: [{channel: 0, swapped_with: 5}, {channel: 1, "
                "swapped_with: 4}, {channel: 2, swapped_with: 3}]\n");
    run(f, "channels", NULL);
    expect(f, 1, "or the speakers are right and the microphones swapped in like manner");
}

static void gains_are_found_facing_a_flat_target(void **state)
{
    static const double speaker_db[N] = {0, 3, 0, 0, -4.5, 0};
    static const double microphone_db[N] = {2, 0, 0, 0, 0, -1};
    struct fixture *f = *state;
    char *range[] = {"--range-m", "1.2", NULL};
    write_scene(f, QUIET,
                "faults:\n  latency_samples: 33.3\n"
                "  speakers: [{channel: 1, gain_db: 3}, {channel: 4, gain_db: -4.5}]\n"
                "  microphones: [{channel: 0, gain_db: 2}, {channel: 5, gain_db: -1}]\n");
    for (int given = 0; given < 2; given++) {
        run(f, "gains", given ? range : NULL); /* else the survey's wall */
        expect(f, 0, "good: the gains are in");
        struct calibration *c = load(f);
        for (size_t k = 0; k < N; k++) {
            assert_near(c->speakers[k].gain_db, speaker_db[k] + 1.5 / 6, 0.05);
            assert_near(c->microphones[k].gain_db, microphone_db[k] - 1.0 / 6, 0.05);
        }
        calibration_destroy(c);
    }
}

static void a_target_that_is_not_there_gives_no_gains(void **state)
{
    struct fixture *f = *state;
    char *far[] = {"--range-m", "2.0", NULL};
    write_scene(f, QUIET, "");
    run(f, "gains", far);
    expect(f, 1, "no echo of the target is heard");
    assert_int_equal(access(f->out, F_OK), -1);
}

static void the_speed_of_sound_comes_from_the_air(void **state)
{
    struct fixture *f = *state;
    char *air[] = {"--temperature-c", "25", "--humidity", "60", NULL};
    write_scene(f, QUIET, "");
    run(f, "sound-speed", air);
    expect(f, 0, "good: sound_speed_m_s");
    struct calibration *c = load(f);
    assert_near(c->sound_speed_m_s, 347.24, 0.15); /* the ideal gas with its vapour */
    assert_near(c->temperature_c, 25.0, 0.0);
    assert_near(c->humidity_percent, 60.0, 0.0);
    calibration_destroy(c);
    char *sauna[] = {"--temperature-c", "55", "--humidity", "100", NULL};
    run(f, "sound-speed", sauna);
    expect(f, 2, "m/s, expected 300 to 360");
    c = load(f); /* as it was */
    assert_near(c->temperature_c, 25.0, 0.0);
    calibration_destroy(c);
}

static void the_speed_of_sound_comes_from_a_reflector(void **state)
{
    struct fixture *f = *state;
    char *range[] = {"--range-m", "1.2", NULL}, *wrong[] = {"--range-m", "2.1", NULL};
    write_scene(f, QUIET, "faults: {latency_samples: 50, sound_speed_m_s: 347.5}\n");
    run(f, "sound-speed", range);
    expect(f, 0, "good: sound_speed_m_s");
    struct calibration *c = load(f);
    assert_near(c->sound_speed_m_s, 347.5, 0.3);
    calibration_destroy(c);
    run(f, "sound-speed", wrong);
    expect(f, 1, "bad: fewer than half of the pairs hear the reflector");
    run(f, "sound-speed", NULL);
    expect(f, 2, "expected --temperature-c");
}

static void each_command_renews_its_part_and_keeps_the_rest(void **state)
{
    struct fixture *f = *state;
    char *air[] = {"--temperature-c", "20", "--humidity", "0", NULL};
    write_scene(f, QUIET, "faults: {latency_samples: 50}\n");
    assert_int_equal(run(f, "sound-speed", air), 0);
    assert_int_equal(run(f, "time-zero", NULL), 0);
    assert_int_equal(run(f, "channels", NULL), 0);
    assert_int_equal(run(f, "gains", NULL), 0);
    struct calibration *c = load(f);
    assert_near(c->latency_samples, 50.0, 0.1);
    assert_near(c->temperature_c, 20.0, 0.0);
    assert_true(c->has_channels && c->has_gains);
    assert_string_equal(c->array, f->scene);
    calibration_destroy(c);
    run(f, "show", NULL);
    expect(f, 0, "good: it fits");
    char *alone[] = {"calibrate", "show", "--out", f->out, NULL};
    command_run(&f->r, command_calibrate, alone);
    expect(f, 0, "not recorded: anlos calibrate background");
    char *named[] = {"calibrate", "show", f->out, NULL};
    command_run(&f->r, command_calibrate, named);
    expect(f, 0, "not recorded: anlos calibrate background");
}

static void a_background_is_a_recording_with_its_temperature(void **state)
{
    struct fixture *f = *state;
    struct error why = {.text = ""};
    struct survey s;
    struct recording *r;
    char folder[96], path[128];
    snprintf(folder, sizeof folder, "%s/empty", f->folder);
    char *more[] = {"--folder", folder, "--temperature-c", "18", "--humidity", "0", NULL};
    write_scene(f, QUIET, "faults: {latency_samples: 50}\n");
    assert_int_equal(run(f, "time-zero", NULL), 0);
    run(f, "background", more);
    expect(f, 0, "good: the recording is in");
    struct calibration *c = load(f);
    assert_string_equal(c->background, "empty");
    snprintf(path, sizeof path, "%s/survey.yaml", folder);
    assert_int_equal(survey_load(&s, path, &why), 0);
    assert_near(s.temperature_c, 18.0, 0.0);
    assert_near(s.sound_speed_m_s, survey_sound_speed_m_s(18.0), 1e-9);
    assert_near(s.latency_samples, c->latency_samples, 0.0); /* as calibrated */
    assert_int_equal(recording_open(&r, folder, &s, &why), 0);
    recording_close(r);
    survey_clear(&s);
    calibration_destroy(c);
    run(f, "background", more);
    expect(f, 2, "exists already");
}

static void a_background_can_be_carried_along_and_must_not_clip(void **state)
{
    struct fixture *f = *state;
    char folder[96], file[160];
    snprintf(folder, sizeof folder, "%s/empty", f->folder);
    char *more[] = {"--folder", folder, "--stage", "sim:?pace=fast", NULL};
    char *wrong[] = {"--folder", folder, "--stage", "sim:?steps=1", NULL};
    write_scene(f, QUIET, "faults: {microphones: [{channel: 2, limit: 0.05}]}\n");
    run(f, "background", wrong);
    expect(f, 2, "steps");
    assert_int_equal(access(folder, F_OK), -1);
    run(f, "background", more);
    expect(f, 1, "clipped       microphone 2");
    snprintf(file, sizeof file, "%s/pos01.wav", folder);
    assert_int_equal(access(file, R_OK), 0);
    snprintf(file, sizeof file, "wav:%.90s", folder);
    strcpy(f->scene, file);
    snprintf(folder, sizeof folder, "%s/second", f->folder);
    run(f, "background", more);
    expect(f, 2, "an array that plays a recording needs a background of it");
}

/* Where the array stands it hears another background than on its way. */
static void the_background_of_a_stage_that_does_not_stop_is_left_to_the_scan(void **state)
{
    struct fixture *f = *state;
    char folder[96];
    snprintf(folder, sizeof folder, "%s/empty", f->folder);
    char *more[] = {"--folder", folder, "--stage", "sim:?pace=fast", NULL};
    write_scene(f, QUIET, "");
    strcat(f->scene, "?continuous=yes&slot_samples=3000");
    run(f, "background", more);
    expect(f, 2, "by scan: {background: true}");
    assert_int_equal(access(folder, F_OK), -1);
}

static struct array *open_array(const char *uri)
{
    struct error why = {.text = ""};
    struct array *a;
    if (array_open(&a, uri, clock_system(), &why))
        fail_msg("%s", why.text);
    return a;
}

static void hear(struct array *a, uint32_t speaker, struct array_ping *ping)
{
    struct error why = {.text = ""};
    const struct array_shot shot = {
        .pass = PASS_SCENE, .speakers = &speaker, .n_speakers = 1};
    assert_int_equal(array_fire(a, &shot), 0);
    assert_int_equal(array_next(a, ping, &why), 0);
}

/* The factor that makes y of x, and how much of y that does not explain. */
static double factor(const float *x, const float *y, size_t n, double *rest)
{
    double xx = 0.0, xy = 0.0, yy = 0.0;
    for (size_t i = 0; i < n; i++) {
        xx += (double)x[i] * (double)x[i];
        xy += (double)x[i] * (double)y[i];
        yy += (double)y[i] * (double)y[i];
    }
    *rest = (yy - xy * xy / xx) / yy;
    return xy / xx;
}

/* Gains, signs and the latency that a scene has made wrong are undone by what is measured
 * of it: every pair sounds as in the scene without, up to one common factor. */
static void a_calibrated_array_hears_what_a_good_one_hears(void **state)
{
    struct fixture *f = *state;
    struct array_ping ping, right;
    char uri[256], good[128];
    double least = INFINITY, most = 0.0;
    write_scene(f, QUIET, "faults: {latency_samples: 61.25}\n");
    snprintf(good, sizeof good, "%s/good.yaml", f->folder);
    assert_int_equal(rename(f->scene + 4, good), 0);
    write_scene(f, QUIET,
                "faults:\n  latency_samples: 61.25\n"
                "  speakers: [{channel: 1, gain_db: 5}, {channel: 3, inverted: true}]\n"
                "  microphones: [{channel: 0, gain_db: -7}, {channel: 5, gain_db: 3, "
                "inverted: true}]\n");
    assert_int_equal(run(f, "time-zero", NULL), 0);
    assert_int_equal(run(f, "channels", NULL), 0);
    assert_int_equal(run(f, "gains", NULL), 0);
    snprintf(uri, sizeof uri, "%s?calibrated=%s", f->scene, f->out);
    struct array *a = open_array(uri);
    snprintf(uri, sizeof uri, "sim:%s", good);
    struct array *b = open_array(uri);
    assert_near(array_survey(a)->latency_samples, 61.25, 0.1);
    for (uint32_t j = 0; j < N; j++) {
        hear(a, j, &ping);
        hear(b, j, &right);
        for (size_t m = 0; m < N; m++) {
            double rest;
            double by = factor(right.samples + m * right.n_samples,
                               ping.samples + m * ping.n_samples, right.n_samples, &rest);
            assert_true(by > 0.0 && rest < 1e-3);
            least = fmin(least, by);
            most = fmax(most, by);
        }
    }
    assert_true(20.0 * log10(most / least) < 0.1);
    array_close(a);
    array_close(b);
}

/* Elements 10 mm off on each axis, heard before a wall to the left and one to the right.
 */
#define TURNED(x)                                                                        \
    ARRAY "stage: {axis: [1, 0, 0], positions_m: [0, 0.5]}\n"                            \
          "wall: {normal: [" x ", 0, 0.9028], distance_m: 1.2}\n"                        \
          "seed: 5\nnoise: {rms: 1.0e-4}\n"

/* The same of a level line that nothing carries. */
#define LEVEL(x)                                                                         \
    SOUND "speakers_m: [[0, 0, 0], [0.12, 0, 0], [0.24, 0, 0], [0.36, 0, 0], "           \
          "[0.48, 0, 0], [0.6, 0, 0]]\n"                                                 \
          "microphones_m: [[0.06, 0, 0], [0.18, 0, 0], [0.3, 0, 0], [0.42, 0, 0], "      \
          "[0.54, 0, 0], [0.66, 0, 0]]\n"                                                \
          "stage: {axis: [1, 0, 0], positions_m: [0]}\n"                                 \
          "wall: {normal: [" x ", 0, 0.9028], distance_m: 1.2}\n"                        \
          "seed: 5\nnoise: {rms: 1.0e-4}\n"

static void before_two_walls(struct fixture *f, const char *left, const char *other,
                             const char *errors, char right[128])
{
    write_scene(f, other, errors);
    snprintf(right, 128, "%s/right.yaml", f->folder);
    assert_int_equal(rename(f->scene + 4, right), 0);
    memmove(right + 4, right, strlen(right) + 1);
    memcpy(right, "sim:", 4);
    write_scene(f, left, errors);
}

/* Of the shape of what is found, each axis. */
static void measure_errors(const struct fixture *f, double errors_m[2 * N][3])
{
    struct pose truth;
    struct array *raw = open_array(f->scene);
    struct calibration *c = load(f);
    assert_int_equal(pose_create(&truth, array_survey(raw), 0.01, 0.0, 5), 0);
    for (int e = 0; e < 2 * N; e++)
        for (int a = 0; a < 3; a++)
            errors_m[e][a] = c->places_m[e][a] - (e < N
                                                      ? truth.speakers_at_m[e][a]
                                                      : truth.microphones_at_m[e - N][a]);
    assert_int_equal(
        element_places_shape(2 * N, (const double(*)[3])c->places_m, errors_m), 0);
    pose_clear(&truth);
    calibration_destroy(c);
    array_close(raw);
}

static double rms_of(const double (*x)[3], int axis)
{
    double sum = 0.0;
    for (int e = 0; e < 2 * N; e++)
        sum += x[e][axis] * x[e][axis];
    return sqrt(sum / (2 * N));
}

static void elements_that_stand_elsewhere_are_found(void **state)
{
    struct fixture *f = *state;
    char right[128], uri[256], *more[] = {"--array", right, NULL};
    double errors_m[2 * N][3], left_rms_m = 0.0;
    before_two_walls(f, TURNED("0.43"), TURNED("-0.43"),
                     "errors: {element_m: 0.01}\nfaults: {latency_samples: 5}\n", right);
    run(f, "array", more);
    expect(f, 0, "good: places, known to");
    struct calibration *c = load(f);
    assert_near(c->latency_samples, 5.0, 0.1);
    measure_errors(f, errors_m);
    for (int a = 0; a < 3; a++)
        left_rms_m = hypot(left_rms_m, rms_of((const double(*)[3])errors_m, a) / sqrt(3));
    assert_true(left_rms_m < 1e-3);
    assert_true(left_rms_m < 3.0 * c->places_sigma_m);

    /* Who opens the array with it has the places, and hears what he heard. */
    struct array_ping ping, same;
    snprintf(uri, sizeof uri, "%s?calibrated=%s", f->scene, f->out);
    struct array *a = open_array(uri), *raw = open_array(f->scene);
    assert_memory_equal(array_survey(a)->speakers_m, c->places_m, 3 * N * sizeof(double));
    hear(raw, 2, &ping);
    hear(a, 2, &same);
    assert_memory_equal(ping.samples, same.samples,
                        N * ping.n_samples * sizeof *ping.samples);
    array_close(a);
    array_close(raw);
    calibration_destroy(c);

    char *again[] = {"--array", f->scene, NULL}; /* as of a card, which opens once */
    run(f, "array", again);
    expect(f, 0, ", 2 walls,");
    run(f, "time-zero", NULL); /* by the places that are known now */
    expect(f, 0, "good: latency_samples");
}

/* Walls do not tell how it is turned about itself, nor its elements' heights: those stay,
 * and are called unknown, and what is across it otherwise is found. */
static void a_level_line_goes_by_upright_walls(void **state)
{
    struct fixture *f = *state;
    char right[128], *more[] = {"--array", right, NULL};
    double errors_m[2 * N][3];
    before_two_walls(f, LEVEL("0.43"), LEVEL("-0.43"), "errors: {element_m: 0.01}\n",
                     right);
    run(f, "array", more);
    expect(f, 0, "not told: y, up");
    measure_errors(f, errors_m);
    assert_true(rms_of((const double(*)[3])errors_m, 2) < 1e-3);
    struct calibration *c = load(f);
    for (int e = 0; e < 2 * N; e++)
        assert_near(c->places_m[e][1], 0.0, 2e-3);
    assert_true(c->places_sigma_m > 4e-3); /* 10 mm of one axis of three: 5.8 */
    calibration_destroy(c);
}

static void what_tells_no_places_is_refused(void **state)
{
    struct fixture *f = *state;
    char right[128], *more[] = {"--array", right, NULL};
    before_two_walls(f, TURNED("0.43"), TURNED("-0.43"), "", right);
    run(f, "time-zero", more);
    expect(f, 2, "time-zero takes one array");
    write_scene(f, QUIET, "");
    run(f, "array", more);
    expect(f, 2, "has another stage than");
    char *scene = strdup(SCENE "noise: {rms: 1.0e-4}\n");
    assert_non_null(scene);
    memcpy(strstr(scene, "echo: 0.8"), "echo: 0.0", 9);
    write_scene(f, scene, "");
    free(scene);
    run(f, "array", NULL);
    expect(f, 1, "no wall is heard within 5 m");
    /* Objects and clutter, and a wall that does not mirror the array to itself. */
    char *corner[] = {
        "calibrate", "array", "--array", "sim:" SOURCE_DIR "/launch/scenes/corner.yaml",
        "--out",     f->out,  "--takes", "1",
        NULL};
    command_run(&f->r, command_calibrate, corner);
    expect(f, 1, "no wall is heard within 5 m");
    assert_int_equal(access(f->out, F_OK), -1);
}

static void a_recording_can_be_calibrated(void **state)
{
    struct fixture *f = *state;
    char recording[128], *more[] = {"--takes", "1", NULL};
    struct array_ping ping;
    write_scene(f, QUIET,
                "faults: {latency_samples: 71.3, microphones: [{channel: 4, inverted: "
                "true}]}\n");
    snprintf(recording, sizeof recording, "%s/recording", f->folder);
    char *sim[] = {"sim", f->scene + 4, "--out", recording, NULL};
    command_run(&f->r, command_sim, sim);
    assert_int_equal(f->r.code, 0);
    snprintf(f->scene, sizeof f->scene, "wav:%.100s/scene", recording);
    run(f, "time-zero", more);
    expect(f, 0, "good: latency_samples");
    struct calibration *c = load(f);
    assert_near(c->latency_samples, 71.3, 0.1);
    calibration_destroy(c);
    run(f, "channels", more);
    expect(f, 0, "noise cannot be told: that takes --takes 2");
    run(f, "channels", NULL);
    expect(f, 0, "noise cannot be told: all takes are the same");

    char uri[256];
    double rest;
    struct array *raw = open_array(f->scene);
    hear(raw, 2, &ping);
    size_t n = ping.n_samples;
    float *before = malloc(N * n * sizeof *before);
    assert_non_null(before);
    memcpy(before, ping.samples, N * n * sizeof *before);
    snprintf(uri, sizeof uri, "%s?calibrated=%s", f->scene, f->out);
    struct array *a = open_array(uri);
    assert_near(array_survey(a)->latency_samples, 71.3, 0.1);
    hear(a, 2, &ping);
    for (size_t m = 0; m < N; m++)
        assert_near(factor(before + m * n, ping.samples + m * ping.n_samples, n, &rest),
                    m == 4 ? -1.0 : 1.0, 1e-6);
    free(before);
    array_close(a);
    array_close(raw);
}

static void an_array_that_records_nothing_is_said_to(void **state)
{
    static const char *const all[] = {"time-zero", "channels", "gains"};
    struct fixture *f = *state;
    for (size_t i = 0; i < 3; i++) {
        write_scene(f, SCENE, "");
        FILE *file = fopen(f->scene + 4, "a");
        assert_non_null(file);
        fputs("direct_level: 0\nfaults: {microphones: [", file);
        for (int m = 0; m < N; m++)
            fprintf(file, "%s{channel: %d, dead: true}", m ? ", " : "", m);
        fputs("]}\n", file);
        fclose(file);
        run(f, all[i], NULL);
        expect(f, 1, "the array records nothing: every sample is 0");
        write_scene(f, QUIET,
                    "faults: {microphones: [{channel: 0, dead: true}, {channel: 1, dead: "
                    "true}, {channel: 2, dead: true}, {channel: 3, dead: true}, "
                    "{channel: 4, dead: true}, {channel: 5, dead: true}]}\n");
        run(f, all[i], NULL);
        expect(f, 1, "no microphone hears any speaker");
        assert_int_equal(access(f->out, F_OK), -1);
    }
}

static void a_file_of_another_array_is_refused(void **state)
{
    struct fixture *f = *state;
    char other[2048] = QUIET;
    write_scene(f, QUIET, "");
    assert_int_equal(run(f, "time-zero", NULL), 0);
    memcpy(strstr(other, "0.12, 0]"), "0.13, 0]", 8);
    write_scene(f, other, "");
    run(f, "channels", NULL);
    expect(f, 2, "made with speakers and microphones at other places");
    FILE *file = fopen(f->out, "w");
    fputs("latency_samples: 3\n", file);
    fclose(file);
    run(f, "channels", NULL);
    expect(f, 2, "array.yaml:1: the key \"array\" is missing");
}

static void wrong_arguments_are_refused(void **state)
{
    struct fixture *f = *state;
    static const struct {
        const char *words[10], *text;
    } cases[] = {
        {{"calibrate"}, "what? time-zero"},
        {{"calibrate", "gain"}, "gain: expected time-zero"},
        {{"calibrate", "gains", "channels"}, "channels: unexpected argument"},
        {{"calibrate", "gains"}, "--out FILE.yaml is missing"},
        {{"calibrate", "gains", "--out", "x"}, "--array URI is missing"},
        {{"calibrate", "gains", "--outt", "x"}, "did you mean --out?"},
        {{"calibrate", "gains", "--out", "x", "--pair", "0,1"},
         "--pair is not for gains"},
        {{"calibrate", "time-zero", "--pair", "1"}, "--pair 1: expected the numbers"},
        {{"calibrate", "gains", "--range-m", "0"}, "expected a number from 0.05 to 100"},
        {{"calibrate", "sound-speed", "--temperature-c", "99"}, "from -40 to 60"},
        {{"calibrate", "gains", "--takes", "0"}, "from 1 to 1000"},
        {{"calibrate", "show"}, "show: which file? show FILE.yaml"},
        {{"calibrate", "show", "/nowhere/x.yaml"}, "no such file"},
        {{"calibrate", "show", "a.yaml", "b.yaml"}, "b.yaml: unexpected argument"},
        {{"calibrate", "show", "--out", "/nowhere/x.yaml"}, "no such file"},
        {{"calibrate", "channels", "--out", "/tmp/x.yaml", "--array",
          "sim:/nowhere.yaml"},
         "anlos calibrate: sim:/nowhere.yaml: /nowhere.yaml: No such file"},
        {{"calibrate", "channels", "--out", "/nowhere/x.yaml", "--array",
          "sim:" SOURCE_DIR "/launch/scenes/corner.yaml"},
         "/nowhere/x.yaml cannot be written: No such file or directory"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        command_run(&f->r, command_calibrate, (char *const *)cases[i].words);
        expect(f, 2, cases[i].text);
        assert_string_equal(f->r.out, ""); /* nothing was measured for nothing */
    }
    write_scene(f, QUIET, "");
    char *position[] = {"--position", "2", NULL}, *pair[] = {"--pair", "0,6", NULL};
    char *distance[] = {"--distance-m", "0.1", NULL};
    run(f, "time-zero", position);
    expect(f, 2, "--position 2: there are 0 to 1");
    run(f, "time-zero", pair);
    expect(f, 2, "microphones 0 to 5");
    run(f, "time-zero", distance);
    expect(f, 2, "of which speaker and microphone?");
    run(f, "background", NULL);
    expect(f, 2, "--folder DIR is missing");
}

#define test(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        test(time_zero_is_found_to_a_tenth_of_a_sample),
        test(time_zero_bears_a_room),
        test(one_pair_at_a_known_distance_is_enough),
        test(a_wrong_speed_of_sound_is_noticed_and_can_be_fitted),
        test(distances_that_are_too_equal_do_not_tell_the_speed),
        test(faulty_channels_are_named),
        test(channels_without_a_fault_are_good),
        test(swapped_channels_are_told_apart),
        test(what_arrivals_cannot_tell_apart_is_said),
        test(gains_are_found_facing_a_flat_target),
        test(a_target_that_is_not_there_gives_no_gains),
        test(the_speed_of_sound_comes_from_the_air),
        test(the_speed_of_sound_comes_from_a_reflector),
        test(each_command_renews_its_part_and_keeps_the_rest),
        test(a_background_is_a_recording_with_its_temperature),
        test(a_background_can_be_carried_along_and_must_not_clip),
        test(the_background_of_a_stage_that_does_not_stop_is_left_to_the_scan),
        test(a_calibrated_array_hears_what_a_good_one_hears),
        test(elements_that_stand_elsewhere_are_found),
        test(a_level_line_goes_by_upright_walls),
        test(what_tells_no_places_is_refused),
        test(a_recording_can_be_calibrated),
        test(an_array_that_records_nothing_is_said_to),
        test(a_file_of_another_array_is_refused),
        test(wrong_arguments_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
