/* SPDX-License-Identifier: MIT */
/* A simulated array with faults, against the same one without: what each does follows
 * from its definition. */
#include "scratch.h"

#include <math.h>

#include "hal/array.h"
#include "hal/room/room.h"
#include "hal/survey/calibration.h"
#include "tests/worse.h"

enum { SLOT = 1500, N = 3 };

/* 3 speakers and 3 microphones at different heights: no two pairs are equally far. */
#define SCENE                                                                            \
    "sound_speed_m_s: 340\nsample_rate_hz: 48000\n"                                      \
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.025}\n"                       \
    "slot_samples: 1500\ngate_m: [0.2, 2]\n"                                             \
    "wall: {normal: [0, 0, 1], distance_m: 1}\n"                                         \
    "speakers_m: [[0, 0, 0], [0, 0.2, 0], [0, 0.5, 0]]\n"                                \
    "microphones_m: [[0.1, 0, 0], [0.1, 0.31, 0], [0.1, 0.73, 0]]\n"                     \
    "level: 0.1\n"

static struct room *load(void **state, const char *faults)
{
    struct error why = {.text = ""};
    char text[2048];
    struct room *r;
    snprintf(text, sizeof text, SCENE "%s", faults);
    if (room_load(&r, scratch_write(*state, "scene.yaml", text), &why))
        fail_msg("%s", why.text);
    return r;
}

/* samples [n_microphones][room_frames(1)]; free() it. */
static float *record(struct room *r, uint32_t speaker, uint32_t take)
{
    float *x = malloc(N * room_frames(r, 1) * sizeof *x);
    assert_non_null(x);
    assert_int_equal(room_record(r, PASS_SCENE, 0, &speaker, 1, take, x), 0);
    return x;
}

/* Largest |x - gain * y| over a channel of one and one of the other. */
static double difference(const float *x, const float *y, double gain, size_t n)
{
    double most = 0;
    for (size_t i = 0; i < n; i++)
        most = worse(most, fabs((double)x[i] - gain * (double)y[i]));
    return most;
}

static void assert_pair(struct room *faulty, uint32_t speaker, size_t microphone,
                        struct room *sound, uint32_t as_speaker, size_t as_microphone,
                        double gain)
{
    size_t n_x = room_frames(faulty, 1), n_y = room_frames(sound, 1);
    float *x = record(faulty, speaker, 0), *y = record(sound, as_speaker, 0);
    float *heard = x + microphone * n_x, *expected = y + as_microphone * n_y;
    assert_true(difference(heard, expected, gain, n_x < n_y ? n_x : n_y) < 1e-6);
    assert_true(difference(expected, expected, 0, n_y) > 0.05); /* not silence */
    free(x);
    free(y);
}

static void gain_inversion_and_death_are_factors(void **state)
{
    struct room *sound = load(state, "");
    struct room *r =
        load(state,
             "faults:\n"
             "  speakers: [{channel: 0, gain_db: 6.0205999}, {channel: 1, dead: true}]\n"
             "  microphones: [{channel: 2, gain_db: -6.0205999, inverted: true}]\n");
    assert_pair(r, 0, 0, sound, 0, 0, 2);
    assert_pair(r, 0, 2, sound, 0, 2, -1);
    assert_pair(r, 1, 1, sound, 1, 1, 0);
    assert_pair(r, 2, 2, sound, 2, 2, -0.5);
    room_destroy(r);
    room_destroy(sound);
}

static void swapped_channels_sound_from_each_others_places(void **state)
{
    struct room *sound = load(state, "");
    struct room *r = load(state, "faults:\n  speakers: [{channel: 0, swapped_with: 2}]\n"
                                 "  microphones: [{channel: 1, swapped_with: 2}]\n");
    for (uint32_t j = 0; j < N; j++)
        for (size_t m = 0; m < N; m++)
            assert_pair(r, j, m, sound, 2 - j, m ? 3 - m : 0, 1);
    room_destroy(r);
    room_destroy(sound);
}

static double rms(const float *x, const float *y, size_t n)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++)
        sum += pow((double)x[i] - (double)y[i], 2);
    return sqrt(sum / (double)n);
}

/* A whole number of samples more: the same sound, later; but for the click of the chirp's
 * beginning, which rings differently in transforms of another length. */
static void the_latency_is_on_top_of_the_surveys(void **state)
{
    struct room *sound = load(state, "latency_samples: 3.5\n");
    struct room *r =
        load(state, "latency_samples: 3.5\nfaults: {latency_samples: 100}\n");
    size_t n = room_frames(sound, 1);
    float *x = record(r, 0, 0), *y = record(sound, 0, 0);
    assert_true(room_survey(r)->latency_samples == 3.5);
    assert_int_equal(room_frames(r, 1), n);
    assert_true(rms(x + 100, y, n - 100) < 3e-3 * difference(y, y, 0, n));
    free(x);
    free(y);
    room_destroy(r);
    room_destroy(sound);
}

/* What a survey of that speed would make of it; the survey keeps its own. */
static void sound_runs_at_the_speed_of_the_faults(void **state)
{
    struct room *r = load(state, "faults: {sound_speed_m_s: 350}\n");
    struct error why = {.text = ""};
    struct room *fast;
    char text[2048];
    snprintf(text, sizeof text, "%s", SCENE);
    memcpy(strstr(text, "340"), "350", 3);
    assert_int_equal(room_load(&fast, scratch_write(*state, "fast.yaml", text), &why), 0);
    assert_true(room_survey(r)->sound_speed_m_s == 340);
    for (size_t m = 0; m < N; m++)
        assert_pair(r, 0, m, fast, 0, m, 1);
    room_destroy(fast);
    room_destroy(r);
}

static void noise_is_heard_by_one_microphone_or_of_one_speaker(void **state)
{
    struct room *r = load(state, "faults:\n  speakers: [{channel: 1, noise_rms: 0.02}]\n"
                                 "  microphones: [{channel: 0, noise_rms: 0.01}]\n");
    size_t n = room_frames(r, 1);
    for (uint32_t j = 0; j < 2; j++) {
        float *x = record(r, j, 0), *y = record(r, j, 1), *again = record(r, j, 0);
        assert_memory_equal(x, again, N * n * sizeof *x);
        for (size_t m = 0; m < N; m++) { /* two noises differ by sqrt(2) of one */
            double expected = sqrt(2) * hypot(m == 0 ? 0.01 : 0, j == 1 ? 0.02 : 0);
            assert_true(fabs(rms(x + m * n, y + m * n, SLOT) - expected) <
                        0.06 * expected + 1e-9);
        }
        free(x);
        free(y);
        free(again);
    }
    room_destroy(r);
}

static void a_limit_clips_and_the_array_counts_it(void **state)
{
    struct error why = {.text = ""};
    struct array *a;
    struct array_ping ping;
    struct room *sound = load(state, "");
    char uri[600];
    float *y = record(sound, 0, 0);
    size_t n = room_frames(sound, 1), expected = 0;
    room_destroy(load(state, "faults: {microphones: [{channel: 1, limit: 0.2}]}\n"));
    snprintf(uri, sizeof uri, "sim:%s", scratch_path(*state, "scene.yaml"));
    assert_int_equal(array_open(&a, uri, clock_system(), &why), 0);
    static const uint32_t speaker = 0;
    const struct array_shot shot = {
        .pass = PASS_SCENE, .speakers = &speaker, .n_speakers = 1};
    assert_int_equal(array_fire(a, &shot), 0);
    assert_int_equal(array_next(a, &ping, &why), 0);
    for (size_t i = 0; i < n; i++) {
        double in = (double)y[n + i], out = (double)ping.samples[n + i];
        expected += fabs(in) >= 0.2;
        assert_true(fabs(out - fmax(-0.2, fmin(0.2, in))) < 1e-6);
    }
    assert_true(expected > 100);
    assert_int_equal(ping.clipped[1], expected);
    assert_int_equal(ping.clipped[0], 0);
    array_close(a);
    free(y);
    room_destroy(sound);
}

static void faults_of_channels_that_do_not_exist_are_refused(void **state)
{
    static const struct {
        const char *text, *error;
    } cases[] = {
        {"faults:\n  speakers:\n    - {channel: 3}\n",
         "scene.yaml:12: faults.speakers[0].channel: 3 is outside 0..2"},
        {"faults:\n  microphones:\n    - {channel: 0, swapped_with: 4}\n",
         "scene.yaml:12: faults.microphones[0].swapped_with: 4 is outside 0..2"},
        {"faults: {latency_samples: -1}\n",
         "scene.yaml:10: faults.latency_samples: -1 is outside"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error why = {.text = ""};
        char text[2048];
        struct room *r;
        snprintf(text, sizeof text, SCENE "%s", cases[i].text);
        assert_true(room_load(&r, scratch_write(*state, "scene.yaml", text), &why) < 0);
        assert_contains(why.text, cases[i].error);
    }
}

/* Gains, polarity, latency and speed are undone, and nothing of the room changes. */
static void a_calibrated_array_is_as_if_it_had_no_faults(void **state)
{
    struct error why = {.text = ""};
    struct room *sound = load(state, "faults: {latency_samples: 100}\n");
    struct calibration *c;
    struct array *a;
    struct array_ping ping;
    char uri[1200], file[512];
    size_t n = room_frames(sound, 1);
    float *y = record(sound, 2, 0);
    assert_int_equal(calibration_create(&c, N, N), 0);
    calibration_name(c, room_survey(sound), "sim:");
    strcpy(c->made, "now");
    c->has_gains = c->has_channels = true;
    c->latency_samples = 100;
    c->sound_speed_m_s = 341;
    c->speakers[2].gain_db = 6;
    c->microphones[0].faults = CALIBRATION_INVERTED;
    c->microphones[1].faults = CALIBRATION_DEAD;
    snprintf(file, sizeof file, "%s", scratch_path(*state, "c.yaml"));
    assert_int_equal(calibration_save(c, file, &why), 0);
    room_destroy(load(state, "faults:\n  latency_samples: 100\n"
                             "  speakers: [{channel: 2, gain_db: 6}]\n"
                             "  microphones: [{channel: 0, inverted: true}]\n"));
    snprintf(uri, sizeof uri, "sim:%s?calibrated=%s", scratch_path(*state, "scene.yaml"),
             file);
    if (array_open(&a, uri, clock_system(), &why))
        fail_msg("%s", why.text);
    assert_true(array_survey(a)->latency_samples == 100);
    assert_true(array_survey(a)->sound_speed_m_s == 341);
    static const uint32_t speaker = 2;
    const struct array_shot shot = {
        .pass = PASS_SCENE, .speakers = &speaker, .n_speakers = 1};
    assert_int_equal(array_fire(a, &shot), 0);
    assert_int_equal(array_next(a, &ping, &why), 0);
    assert_true(ping.n_samples >= n); /* the tail makes room for the latency */
    for (size_t m = 0; m < N; m++)
        assert_true(difference(ping.samples + m * ping.n_samples, y + m * n, m != 1, n) <
                    1e-5);
    array_close(a);
    calibration_destroy(c);
    free(y);
    room_destroy(sound);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(gain_inversion_and_death_are_factors),
        TEST(swapped_channels_sound_from_each_others_places),
        TEST(the_latency_is_on_top_of_the_surveys),
        TEST(sound_runs_at_the_speed_of_the_faults),
        TEST(noise_is_heard_by_one_microphone_or_of_one_speaker),
        TEST(a_limit_clips_and_the_array_counts_it),
        TEST(faults_of_channels_that_do_not_exist_are_refused),
        TEST(a_calibrated_array_is_as_if_it_had_no_faults),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
