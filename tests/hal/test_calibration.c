/* SPDX-License-Identifier: MIT */
#include "scratch.h"

#include <errno.h>
#include <math.h>

#include "hal/survey/calibration.h"
#include "hal/survey/rig_file.h"

static double speakers_m[2][3] = {{0, 0, 0}, {0, 0.1, 0}};
static double microphones_m[3][3] = {{0.08, 0, 0}, {0.08, 0.1, 0}, {0.08, 0.2, 0}};
static double positions_m[1] = {0};

static struct survey example(void)
{
    return (struct survey){.source = SURVEY_REPLAY,
                           .sound_speed_m_s = 343,
                           .temperature_c = NAN,
                           .sample_rate_hz = 48000,
                           .chirp_start_hz = 2000,
                           .chirp_stop_hz = 20000,
                           .chirp_duration_s = 0.03,
                           .slot_samples = 1500,
                           .n_speakers = 2,
                           .n_microphones = 3,
                           .n_positions = 1,
                           .speakers_m = speakers_m,
                           .microphones_m = microphones_m,
                           .stage_axis = {1, 0, 0},
                           .stage_positions_m = positions_m};
}

static struct calibration *made(void)
{
    struct survey s = example();
    struct calibration *c;
    assert_int_equal(calibration_create(&c, 2, 3), 0);
    calibration_name(c, &s, "alsa:\"a\\b\"?rig=x.yaml");
    strcpy(c->made, "2026-05-01T12:00:00Z");
    return c;
}

static struct calibration *load(const char *path)
{
    struct error why = {.text = ""};
    struct calibration *c;
    if (calibration_load(&c, path, &why))
        fail_msg("%s", why.text);
    return c;
}

static void assert_same(double a, double b)
{
    assert_true(a == b || (isnan(a) && isnan(b)));
}

static void assert_equal(const struct calibration *a, const struct calibration *b)
{
    assert_string_equal(a->array, b->array);
    assert_string_equal(a->made, b->made);
    assert_string_equal(a->geometry, b->geometry);
    assert_same(a->sample_rate_hz, b->sample_rate_hz);
    assert_same(a->latency_samples, b->latency_samples);
    assert_same(a->temperature_c, b->temperature_c);
    assert_same(a->humidity_percent, b->humidity_percent);
    assert_same(a->sound_speed_m_s, b->sound_speed_m_s);
    assert_int_equal(a->has_gains, b->has_gains);
    assert_int_equal(a->has_channels, b->has_channels);
    for (size_t j = 0; j < 2; j++) {
        assert_same(a->speakers[j].gain_db, b->speakers[j].gain_db);
        assert_int_equal(a->speakers[j].faults, b->speakers[j].faults);
    }
    for (size_t m = 0; m < 3; m++) {
        assert_same(a->microphones[m].gain_db, b->microphones[m].gain_db);
        assert_int_equal(a->microphones[m].faults, b->microphones[m].faults);
    }
    assert_same(a->places_sigma_m, b->places_sigma_m);
    assert_true(!a->places_m == !b->places_m);
    if (a->places_m)
        assert_memory_equal(a->places_m, b->places_m, 5 * sizeof *a->places_m);
    assert_true(!a->background == !b->background);
    if (a->background)
        assert_string_equal(a->background, b->background);
}

static void what_is_saved_is_loaded(void **state)
{
    struct error why = {.text = ""};
    struct calibration *c = made(), *back;
    const char *path = scratch_path(*state, "c.yaml");
    for (int part = 0; part < 6; part++) {
        if (part == 1)
            c->latency_samples = 123.4567;
        if (part == 2) {
            c->temperature_c = -3.25;
            c->humidity_percent = 80;
            c->sound_speed_m_s = 329.6;
        }
        if (part == 3) {
            c->has_channels = true;
            c->speakers[1].faults = CALIBRATION_INVERTED | CALIBRATION_CLIPPED;
            c->microphones[0].faults = CALIBRATION_DEAD;
            c->microphones[2].faults = CALIBRATION_NOISY | CALIBRATION_INVERTED;
        }
        if (part == 4) {
            c->has_gains = true;
            c->speakers[0].gain_db = 1.25;
            c->speakers[1].gain_db = -1.25;
            c->microphones[2].gain_db = -19.9;
            c->background = strdup("empty \"room\"");
        }
        if (part == 5) {
            c->places_m = malloc(5 * sizeof *c->places_m);
            assert_non_null(c->places_m);
            for (int e = 0; e < 5; e++)
                for (int a = 0; a < 3; a++)
                    c->places_m[e][a] = 0.1 * e - 1e-5 * a;
            c->places_sigma_m = 0.0005;
        }
        assert_int_equal(calibration_save(c, path, &why), 0);
        back = load(path);
        assert_equal(c, back);
        calibration_destroy(back);
    }
    calibration_destroy(c);
}

#define HEAD                                                                             \
    "array: sim:x.yaml\nmade: 2026-05-01T12:00:00Z\ngeometry: 0123456789abcdef\n"        \
    "sample_rate_hz: 48000\nspeakers: 2\nmicrophones: 3\n"

static void implausible_values_are_refused_with_line_and_range(void **state)
{
    static const struct {
        const char *text, *error;
    } cases[] = {
        {"latency_samples: -1\n", ":7: latency_samples: -1 is implausible; expected 0 to "
                                  "48000 samples, a second"},
        {"latency_samples: 48001\n", ":7: latency_samples: 48001 is implausible"},
        {"temperature_c: 61\n", ":7: temperature_c: 61 is implausible; expected -40 to "
                                "60 C"},
        {"humidity_percent: 101\n", ":7: humidity_percent: 101 is implausible; expected "
                                    "0 to 100 %"},
        {"latency_samples: 1\nsound_speed_m_s: 299\n",
         ":8: sound_speed_m_s: 299 is implausible; expected 300 to 360 m/s"},
        {"gains:\n  speakers_db: [0, 0]\n  microphones_db: [0, 20.5, 0]\n",
         ":9: gains.microphones_db[1]: 20.5 is implausible; expected -20 to 20 dB"},
        {"gains:\n  speakers_db: [0]\n  microphones_db: [0, 0, 0]\n",
         ":8: gains.speakers_db: expected 2 gains, one for each, found 1"},
        {"channels: {dead_microphones: [0, 3]}\n",
         ":7: channels.dead_microphones[1]: there is no 3; expected 0 to 2"},
        {"places:\n  speakers_m: [[0, 0, 0]]\n  microphones_m: [[0, 0, 0], [0, 0, 0], "
         "[0, 0, 0]]\n  sigma_m: 0.001\n",
         ":8: places.speakers_m: expected 2 places, one for each, found 1"},
        {"places:\n  speakers_m: [[0, 0, 0], [0, 0, 0]]\n  microphones_m: [[0, 0, 0], "
         "[0, 0, 0], [0, 0, 0]]\n  sigma_m: 0\n",
         ":10: places.sigma_m: 0 is implausible; expected more than 0, up to 0.1 m"},
        {"latencysamples: 3\n", ":7: latencysamples: no such key"},
        {"latency_samples: soon\n", ":7: latency_samples: expected a number"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[1024];
        struct error why = {.text = ""};
        struct calibration *c;
        snprintf(text, sizeof text, "%s%s", HEAD, cases[i].text);
        const char *path = scratch_write(*state, "c.yaml", text);
        assert_int_equal(calibration_load(&c, path, &why), -EINVAL);
        assert_null(c);
        assert_int_equal(strncmp(why.text, path, strlen(path)), 0);
        assert_contains(why.text, cases[i].error);
    }
}

static void a_file_that_is_missing_or_incomplete_is_refused(void **state)
{
    struct error why = {.text = ""};
    struct calibration *c;
    assert_int_equal(calibration_load(&c, scratch_path(*state, "none.yaml"), &why),
                     -ENOENT);
    assert_contains(why.text, "none.yaml");
    assert_int_equal(
        calibration_load(&c, scratch_write(*state, "c.yaml", "array: sim:x\n"), &why),
        -EINVAL);
    assert_contains(why.text, "the key \"made\" is missing");
}

static void it_is_applied_to_its_own_array_only(void **state)
{
    struct error why = {.text = ""};
    struct calibration *c = made();
    struct survey s = example(), other;
    (void)state;
    c->latency_samples = 77.5;
    c->sound_speed_m_s = 345;
    c->temperature_c = 22;
    assert_int_equal(calibration_apply(c, &s, "c.yaml", &why), 0);
    assert_true(s.latency_samples == 77.5 && s.sound_speed_m_s == 345 &&
                s.temperature_c == 22);
    other = example();
    other.n_microphones = 2;
    assert_int_equal(calibration_apply(c, &other, "c.yaml", &why), -EINVAL);
    assert_string_equal(why.text,
                        "c.yaml: made for 2 speakers and 3 microphones, and the array "
                        "has 2 and 2; calibrate anew");
    other = example();
    other.sample_rate_hz = 96000;
    assert_int_equal(calibration_apply(c, &other, "c.yaml", &why), -EINVAL);
    assert_contains(why.text, "made at 48000 Hz, and the array runs at 96000 Hz");
    double moved[2][3] = {{0, 0, 0}, {0, 0.11, 0}};
    other = example();
    other.speakers_m = moved;
    assert_int_equal(calibration_apply(c, &other, "c.yaml", &why), -EINVAL);
    assert_contains(why.text, "at other places");
    assert_true(other.latency_samples == 0);
    calibration_destroy(c);
}

/* In place of the survey's, also in a survey that has them already; farther than a
 * decimetre it is another array. */
static void places_take_the_place_of_the_surveys(void **state)
{
    static const double found[5][3] = {{0.001, 0, 0.002},
                                       {0, 0.103, 0},
                                       {0.08, 0, 0.01},
                                       {0.081, 0.1, 0},
                                       {0.08, 0.21, 0}};
    struct error why = {.text = ""};
    struct calibration *c = made();
    struct survey mine = example(), s;
    (void)state;
    assert_int_equal(survey_copy(&s, &mine), 0);
    c->places_m = malloc(sizeof found);
    assert_non_null(c->places_m);
    memcpy(c->places_m, found, sizeof found);
    for (int again = 0; again < 2; again++) {
        assert_int_equal(calibration_apply(c, &s, "c.yaml", &why), 0);
        assert_memory_equal(s.speakers_m, found, 2 * sizeof *found);
        assert_memory_equal(s.microphones_m, found + 2, 3 * sizeof *found);
    }
    survey_clear(&s);
    assert_int_equal(survey_copy(&s, &mine), 0);
    c->places_m[4][2] = 0.11;
    assert_int_equal(calibration_apply(c, &s, "c.yaml", &why), -EINVAL);
    assert_contains(why.text, "microphone 2 is 0.11");
    assert_memory_equal(s.microphones_m, microphones_m, sizeof microphones_m);
    survey_clear(&s);
    calibration_destroy(c);
}

static void what_is_not_known_leaves_the_survey_alone(void **state)
{
    struct error why = {.text = ""};
    struct calibration *c = made();
    struct survey s = example();
    (void)state;
    assert_int_equal(calibration_apply(c, &s, "c.yaml", &why), 0);
    assert_true(s.latency_samples == 0 && s.sound_speed_m_s == 343);
    c->latency_samples = 1500; /* a whole slot */
    assert_int_equal(calibration_apply(c, &s, "c.yaml", &why), -EINVAL);
    assert_contains(why.text, "latency_samples is 1500");
    assert_true(s.latency_samples == 0);
    calibration_destroy(c);
}

/* Speaker 1 is 6.02 dB loud and inverted, microphone 0 is dead, 1 inverted, 2 soft. */
static void samples_are_set_right(void **state)
{
    struct calibration *c = made();
    float x[3][2] = {{1, 2}, {3, 4}, {5, 6}};
    (void)state;
    c->speakers[1] = (struct calibration_channel){20 * log10(2), CALIBRATION_INVERTED};
    c->microphones[0].faults = CALIBRATION_DEAD;
    c->microphones[1].faults = CALIBRATION_INVERTED | CALIBRATION_CLIPPED;
    c->microphones[2].gain_db = -20 * log10(4);
    calibration_correct(c, 1, 2, x[0]);
    static const double expected[3][2] = {{0, 0}, {1.5, 2}, {-10, -12}};
    for (int m = 0; m < 3; m++)
        for (int i = 0; i < 2; i++)
            assert_true(fabs((double)x[m][i] - expected[m][i]) < 1e-6);
    calibration_correct(NULL, 1, 2, x[0]);
    assert_true(x[1][1] == 2);
    calibration_destroy(c);
}

static void a_failed_save_leaves_the_old_file(void **state)
{
    struct error why = {.text = ""};
    struct calibration *c = made();
    char path[512];
    snprintf(path, sizeof path, "%s", scratch_path(*state, "c.yaml"));
    c->latency_samples = 5;
    assert_int_equal(calibration_save(c, path, &why), 0);
    assert_int_equal(mkdir(scratch_path(*state, "c.yaml.part"), 0777), 0);
    c->latency_samples = 6;
    assert_true(calibration_save(c, path, &why) < 0);
    assert_contains(why.text, "cannot be written");
    struct calibration *back = load(path);
    assert_true(back->latency_samples == 5);
    calibration_destroy(back);
    calibration_destroy(c);
}

static void no_name_is_no_calibration(void **state)
{
    struct error why = {.text = ""};
    struct calibration *c;
    struct survey s = example();
    assert_int_equal(calibration_take(&c, NULL, &s, &why), 0);
    assert_null(c);
    assert_int_equal(calibration_take(&c, "", &s, &why), 0);
    assert_null(c);
    assert_int_equal(
        calibration_take(&c, scratch_write(*state, "c.yaml", HEAD), &s, &why), -EINVAL);
    assert_null(c);
    assert_contains(why.text, "at other places");
}

#define RIG                                                                              \
    "sound_speed_m_s: 343\nsample_rate_hz: 48000\n"                                      \
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.03}\nslot_samples: 1500\n"    \
    "speakers_m: [[0, 0, 0], [0, 0.1, 0]]\n"                                             \
    "microphones_m: [[0.08, 0, 0], [0.08, 0.1, 0], [0.08, 0.2, 0]]\n"

/* The one that it names, beside it; another one; none, though the one it names is not
 * there. */
static void a_rig_takes_the_file_that_it_is_told(void **state)
{
    struct error why = {.text = ""};
    struct calibration *c = made();
    struct rig r;
    char path[512], other[512];
    snprintf(path, sizeof path, "%s",
             scratch_write(*state, "rig.yaml", RIG "calibrated: own.yaml\n"));
    assert_int_equal(rig_load_calibrated(&r, path, "", &why), 0);
    assert_true(r.survey.latency_samples == 0 && !r.calibration);
    rig_clear(&r);
    assert_int_equal(rig_load(&r, path, &why), -ENOENT);
    assert_contains(why.text, "rig.yaml:7: calibrated: ");
    c->latency_samples = 12;
    assert_int_equal(calibration_save(c, scratch_path(*state, "own.yaml"), &why), 0);
    c->latency_samples = 34;
    snprintf(other, sizeof other, "%s", scratch_path(*state, "other.yaml"));
    assert_int_equal(calibration_save(c, other, &why), 0);
    assert_int_equal(rig_load(&r, path, &why), 0);
    assert_true(r.survey.latency_samples == 12 && r.calibration);
    rig_clear(&r);
    assert_int_equal(rig_load_calibrated(&r, path, other, &why), 0);
    assert_true(r.survey.latency_samples == 34);
    rig_clear(&r);
    calibration_destroy(c);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_is_saved_is_loaded),
        TEST(implausible_values_are_refused_with_line_and_range),
        TEST(a_file_that_is_missing_or_incomplete_is_refused),
        TEST(it_is_applied_to_its_own_array_only),
        TEST(what_is_not_known_leaves_the_survey_alone),
        TEST(places_take_the_place_of_the_surveys),
        TEST(samples_are_set_right),
        TEST(a_failed_save_leaves_the_old_file),
        TEST(no_name_is_no_calibration),
        TEST(a_rig_takes_the_file_that_it_is_told),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
