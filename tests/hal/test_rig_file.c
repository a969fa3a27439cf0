/* SPDX-License-Identifier: MIT */
#include "scratch.h"

#include <errno.h>
#include <math.h>

#include "hal/survey/rig_file.h"
#include "rig.h"

static int load(struct scratch *s, const char *device, struct rig *rig, struct error *why)
{
    char text[2000];
    snprintf(text, sizeof text, RIG_SURVEY "%s", device);
    *why = (struct error){.text = ""};
    return rig_load(rig, scratch_write(s, "rig.yaml", text), why);
}

static void a_rig_without_a_device_has_the_defaults(void **state)
{
    struct rig r;
    struct error why;
    assert_int_equal(load(*state, "", &r, &why), 0);
    assert_int_equal(r.survey.source, SURVEY_LIVE);
    assert_int_equal(r.survey.n_microphones, 3);
    assert_false(r.has_format);
    assert_int_equal(r.access, RIG_ACCESS_ANY);
    assert_int_equal(r.period_frames, 480);
    assert_int_equal(r.buffer_frames, 9600);
    assert_null(r.calibration);
    for (size_t i = 0; i < 2; i++) {
        assert_int_equal(r.outputs[i], i);
        assert_true(fabsf(r.output_gain[i] - 0.50118723f) < 1e-6f); /* -6 dB */
    }
    for (size_t i = 0; i < 3; i++) {
        assert_int_equal(r.inputs[i], i);
        assert_true(r.input_gain[i] == 1);
    }
    assert_int_equal(rig_output_channels(&r), 2);
    assert_int_equal(rig_input_channels(&r), 3);
    rig_clear(&r);
}

static void every_key_of_the_device_is_read(void **state)
{
    struct rig r;
    struct error why;
    if (load(*state,
             "device:\n"
             "  format: S24_3\n"
             "  access: rw\n"
             "  period_frames: 256\n"
             "  buffer_ms: 500\n"
             "  level_db: -20\n"
             "  outputs: [7, 4]\n"
             "  inputs: [1, 30, 0]\n"
             "  output_gain_db: [0, 20]\n"
             "  input_gain_db: [20, 0, -20]\n"
             "  invert_outputs: [1]\n"
             "  invert_inputs: [2, 0]\n",
             &r, &why))
        fail_msg("%s", why.text);
    assert_true(r.has_format && r.format == SAMPLE_FORMAT_S24_3);
    assert_int_equal(r.access, RIG_ACCESS_RW);
    assert_int_equal(r.period_frames, 256);
    assert_int_equal(r.buffer_frames, 24000);
    assert_true(r.outputs[0] == 7 && r.outputs[1] == 4);
    assert_true(r.inputs[0] == 1 && r.inputs[1] == 30 && r.inputs[2] == 0);
    assert_true(fabsf(r.output_gain[0] - 0.1f) < 1e-6f);
    assert_true(fabsf(r.output_gain[1] + 1.0f) < 1e-6f);
    assert_true(fabsf(r.input_gain[0] + 10.0f) < 1e-5f);
    assert_true(r.input_gain[1] == 1);
    assert_true(fabsf(r.input_gain[2] + 0.1f) < 1e-6f);
    assert_int_equal(rig_output_channels(&r), 8);
    assert_int_equal(rig_input_channels(&r), 31);
    rig_clear(&r);
}

/* The survey has 6 lines. */
static void what_cannot_be_is_refused_with_file_and_line(void **state)
{
    static const struct {
        const char *device, *error;
    } cases[] = {
        {"device: {format: S8}\n",
         ":7: device.format: expected one of S16, S24_3, S24, S32, float, "
         "found \"S8\""},
        {"device: {access: fast}\n",
         ":7: device.access: expected one of mmap, rw, found \"fast\""},
        {"device:\n  outputs: [0]\n",
         ":8: device.outputs: expected one for each of 2 speakers, found 1"},
        {"device:\n  outputs: [3, 3]\n",
         ":8: device.outputs[1]: channel 3 is there twice"},
        {"device:\n  outputs: [0, -1]\n",
         ":8: device.outputs[1]: expected 0 or more, not -1"},
        {"device:\n  inputs: [0, 256, 1]\n",
         ":8: device.inputs[1]: channel 256 is outside 0..255"},
        {"device:\n  inputs: [0, 1, 2, 3]\n",
         ":8: device.inputs: expected one for each of 3 microphones, found 4"},
        {"device:\n  output_gain_db: [0]\n",
         ":8: device.output_gain_db: expected one for each of 2 speakers, found 1"},
        {"device:\n  input_gain_db: [0, 41, 0]\n",
         ":8: device.input_gain_db[1]: 41 dB is outside -40..40"},
        {"device:\n  level_db: 1\n", ":8: device.level_db: 1 is outside -120..0"},
        {"device:\n  level_db: -6\n  output_gain_db: [0, 16]\n",
         ":9: device.output_gain_db[1]: with level_db the chirp is 10 dB above full "
         "scale"},
        {"device:\n  invert_outputs: [2]\n",
         ":8: device.invert_outputs[0]: there is no 2; they count from 0"},
        {"device:\n  invert_inputs: [1, 1]\n",
         ":8: device.invert_inputs[1]: 1 is there twice"},
        {"device:\n  period_frames: 8\n",
         ":8: device.period_frames: 8 is outside 16..65536"},
        {"device:\n  buffer_ms: 5\n", ":8: device.buffer_ms: 5 is outside 10..10000"},
        {"device:\n  buffer_ms: 15\n",
         ":8: device.buffer_ms: 15 ms are less than two periods of 480 frames"},
        {"device: {volume: 3}\n", ":7: device.volume: no such key; expected one of"},
        {"calibrated: nowhere.yaml\n", ":7: calibrated: "},
        {"speed: 3\n", ":7: speed: no such key; expected one of"},
    };
    struct scratch *s = *state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char expected[600];
        struct error why;
        struct rig r;
        int err = load(s, cases[i].device, &r, &why);
        snprintf(expected, sizeof expected, "%s%s", s->path, cases[i].error);
        if (!err || strncmp(why.text, expected, strlen(expected)))
            fail_msg("expected \"%s\", found \"%s\"", expected, why.text);
        assert_int_equal(err, strstr(cases[i].device, "nowhere") ? -ENOENT : -EINVAL);
        assert_null(r.outputs);
    }
}

static void a_rig_needs_the_keys_of_a_survey(void **state)
{
    struct scratch *s = *state;
    struct rig r;
    struct error why = {.text = ""};
    const char *path = scratch_write(s, "rig.yaml", "device: {format: S16}\n");
    assert_int_equal(rig_load(&r, path, &why), -EINVAL);
    assert_error(why.text, path, ":1: the key \"sample_rate_hz\" is missing");
    assert_int_equal(rig_load(&r, "/nowhere/rig.yaml", &why), -ENOENT);
    assert_contains(why.text, "/nowhere/rig.yaml");
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_rig_without_a_device_has_the_defaults),
        TEST(every_key_of_the_device_is_read),
        TEST(what_cannot_be_is_refused_with_file_and_line),
        TEST(a_rig_needs_the_keys_of_a_survey),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
