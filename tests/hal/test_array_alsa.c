/* SPDX-License-Identifier: MIT */
/* `alsa:` on a card of alsa-lib's own (tests/hal/alsa_card.h). */
#include "alsa_card.h"

#include "hal/recording/recording.h"
#include "hal/survey/file.h"
#include "hal/survey/rig_file.h"

/* Speaker 1 is at output 3, speaker 0 at 1; microphones at inputs 2, 0, 1. */
static void what_is_heard_belongs_to_what_is_played_in_every_format(void **state)
{
    static const char *const formats[] = {"S16", "S24_3", "S24", "S32", "float"};
    static const uint32_t speakers[] = {1, 0};
    static const size_t inputs[] = {2, 0, 1}, outputs[] = {3, 1};
    static unsigned char out[FRAMES * 2 * OUTPUTS * 4];
    static float samples[2][3][2 * SLOT];
    for (size_t i = 0; i < 5; i++) {
        struct array_shot shot = {.speakers = speakers, .n_speakers = 2};
        struct array_ping ping;
        struct error why;
        struct card c;
        card_open(&c, *state, formats[i], "", "");
        assert_int_equal(array_fire(c.array, &shot), 0);
        feed(&c, heard);
        size_t n = 0;
        for (size_t j = 0; j < 2; j++) {
            next(&c, &ping);
            n = ping.n_samples;
            assert_true(ping.valid && ping.shot_index == j && n > SLOT && n <= 2 * SLOT);
            for (size_t m = 0; m < 3; m++)
                memcpy(samples[j][m], ping.samples + m * n, n * sizeof(float));
        }
        assert_int_equal(array_next(c.array, &ping, &why), -ENODATA);
        card_close(&c);
        size_t start = read_played(&c, out, sizeof out);
        assert_int_equal(start % BUFFER, 0); /* behind what was written ahead */
        double step = !strcmp(formats[i], "S16") ? 0x1p-16 : 0x1p-24;
        for (size_t j = 0; j < 2; j++)
            for (size_t f = 0; f < SLOT; f++)
                for (size_t k = 0; k < OUTPUTS; k++) {
                    double expected = k == outputs[j] && f < CHIRP ? chirp(f) : 0;
                    double x = played(&c, out, start + j * SLOT + f, k);
                    assert_true(fabs(x - expected) <= 2 * step);
                }
        for (size_t j = 0; j < 2; j++)
            for (size_t m = 0; m < 3; m++)
                for (size_t f = 0; f < n; f++)
                    assert_true(samples[j][m][f] ==
                                (float)heard(start + j * SLOT + f, inputs[m]) / 32768);
    }
}

static int loud(size_t n, size_t c)
{
    return c == 1 && n % 2 ? 32767 : c == 1 ? -32768 : 16384;
}

/* Input 1 is microphone 2: each of its samples is at full scale, which a gain of -20 dB
 * does not hide; input 0 is microphone 1. */
static void clipping_is_counted_at_the_cards_full_scale(void **state)
{
    static const uint32_t speaker = 0;
    struct array_shot shot = {.speakers = &speaker, .n_speakers = 1};
    struct array_ping ping;
    struct card c;
    card_open(&c, *state, "S16", ", input_gain_db: [0, 20, -20], invert_inputs: [1]", "");
    assert_int_equal(array_fire(c.array, &shot), 0);
    feed(&c, loud);
    next(&c, &ping);
    assert_int_equal(ping.clipped[0], 0);
    assert_int_equal(ping.clipped[1], 0);
    assert_int_equal(ping.clipped[2], ping.n_samples);
    assert_true(fabsf(ping.samples[ping.n_samples] + 5) < 1e-5f);
    assert_true(fabsf(fabsf(ping.samples[2 * ping.n_samples]) - 0.1f) < 1e-5f);
    card_close(&c);
}

static void what_cannot_be_linked_is_said_once(void **state)
{
    struct error notice;
    struct device_count counts[DEVICE_MAX_COUNTS];
    struct card c;
    card_open(&c, *state, "S16", "", "");
    assert_true(array_notice(c.array, &notice));
    assert_contains(notice.text, "card: playback and capture cannot be linked");
    assert_false(array_notice(c.array, &notice));
    assert_int_equal(array_condition(c.array, &notice), 0);
    size_t n = array_counts(c.array, counts);
    assert_int_equal(n, 7);
    for (size_t i = 0; i < n; i++)
        assert_int_equal(counts[i].value, 0);
    card_close(&c);
}

static float recorded(size_t m, size_t i)
{
    return (float)(1000 * m + i) / 65536;
}

/* A recording of one position, and the ping of its speaker 1 as the array plays it. */
static void play_recording(struct card *c, struct scratch *s, const char *options,
                           struct array_ping *ping)
{
    static const uint32_t speakers[] = {1};
    static float samples[3][2 * SLOT];
    const struct array_shot shot = {
        .pass = PASS_BACKGROUND, .speakers = speakers, .n_speakers = 1};
    struct error why = {.text = ""};
    scratch_folder(s, "empty");
    for (size_t m = 0; m < 3; m++)
        for (size_t i = 0; i < 2 * SLOT; i++)
            samples[m][i] = recorded(m, i);
    assert_int_equal(recording_write(scratch_path(s, "empty"), 0, 3, 2 * SLOT, 48000,
                                     samples[0], &why),
                     0);
    card_open(c, s, "S16", "", options);
    assert_int_equal(array_fire(c->array, &shot), 0);
    next(c, ping);
    assert_true(ping->valid);
}

static void a_background_may_come_from_a_recording(void **state)
{
    static const uint32_t speakers[] = {1};
    const struct array_shot scene = {
        .pass = PASS_SCENE, .speakers = speakers, .n_speakers = 1};
    struct scratch *s = *state;
    struct array_ping ping;
    struct card c;
    char option[200];
    snprintf(option, sizeof option, "&background=%s/empty", s->folder);
    play_recording(&c, s, option, &ping);
    for (size_t m = 0; m < 3; m++)
        for (size_t i = 0; i < SLOT; i++)
            assert_true(ping.samples[m * ping.n_samples + i] == recorded(m, SLOT + i));
    assert_int_equal(array_fire(c.array, &scene), 0);
    feed(&c, heard);
    next(&c, &ping);
    assert_true(ping.samples[0] != recorded(0, SLOT));
    card_close(&c);
}

static void a_background_of_another_chirp_is_refused(void **state)
{
    struct scratch *s = *state;
    struct error why = {.text = ""};
    struct array *a;
    char uri[600];
    scratch_folder(s, "empty");
    scratch_write(s, "empty/survey.yaml",
                  "temperature_c: 20\nsample_rate_hz: 48000\nslot_samples: 1500\n"
                  "chirp: {start_hz: 2000, stop_hz: 18000, duration_s: 0.01}\n"
                  "speakers_m: [[0, 0, 0], [0.1, 0, 0]]\n"
                  "microphones_m: [[0, 0.1, 0], [0.1, 0.1, 0], [0.2, 0.1, 0]]\n");
    scratch_write(s, "rig.yaml", RIG_SURVEY);
    snprintf(uri, sizeof uri, "alsa:card?rig=%s/rig.yaml&background=%s/empty", s->folder,
             s->folder);
    assert_int_equal(array_open(&a, uri, clock_system(), &why), -EINVAL);
    assert_contains(why.text, "recorded with another chirp");
}

/* A calibration whose microphone 1 is 20 dB too loud, and that names the recording. */
static void write_calibration(struct scratch *s)
{
    struct rig rig;
    struct calibration *c;
    struct error why = {.text = ""};
    if (rig_load(&rig, scratch_write(s, "plain.yaml", RIG_SURVEY), &why))
        fail_msg("%s", why.text);
    assert_int_equal(calibration_create(&c, 2, 3), 0);
    calibration_name(c, &rig.survey, "alsa:card");
    c->has_gains = true;
    c->microphones[1].gain_db = 20;
    strcpy(c->made, "2026-05-01T12:00:00Z");
    c->background = strdup("empty");
    if (calibration_save(c, scratch_path(s, "c.yaml"), &why))
        fail_msg("%s", why.text);
    calibration_destroy(c);
    rig_clear(&rig);
}

static void the_calibrations_background_is_played_and_set_right(void **state)
{
    struct scratch *s = *state;
    struct array_ping ping;
    struct card c;
    char option[200];
    write_calibration(s);
    snprintf(option, sizeof option, "&calibrated=%s/c.yaml", s->folder);
    play_recording(&c, s, option, &ping);
    for (size_t m = 0; m < 3; m++)
        for (size_t i = 0; i < SLOT; i++)
            assert_true(fabsf(ping.samples[m * ping.n_samples + i] -
                              recorded(m, SLOT + i) * (m == 1 ? 0.1f : 1)) < 1e-6f);
    card_close(&c);
}

static void what_is_missing_is_said(void **state)
{
    struct scratch *s = *state;
    struct error why = {.text = ""};
    struct array *a;
    char uri[600];
    assert_int_equal(array_open(&a, "alsa:", clock_system(), &why), -EINVAL);
    assert_contains(why.text, "expected a sound card and its rig");
    assert_int_equal(array_open(&a, "alsa:card", clock_system(), &why), -EINVAL);
    assert_contains(why.text, "alsa:DEVICE?rig=FILE.yaml");
    assert_int_equal(array_open(&a, "alsa:card?rig=/nowhere.yaml", clock_system(), &why),
                     -ENOENT);
    assert_contains(why.text, "/nowhere.yaml: No such file");
    snprintf(uri, sizeof uri, "alsa:other?rig=%s",
             scratch_write(s, "r.yaml", RIG_SURVEY));
    assert_int_equal(array_open(&a, uri, clock_system(), &why), -ENOENT);
    assert_contains(why.text, "other: playback: no such device");
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_is_heard_belongs_to_what_is_played_in_every_format),
        TEST(clipping_is_counted_at_the_cards_full_scale),
        TEST(what_cannot_be_linked_is_said_once),
        TEST(a_background_may_come_from_a_recording),
        TEST(a_background_of_another_chirp_is_refused),
        TEST(the_calibrations_background_is_played_and_set_right),
        TEST(what_is_missing_is_said),
    };
    return cmocka_run_group_tests(tests, card_set_up, card_tear_down);
}
