/* SPDX-License-Identifier: MIT */
#include "scratch.h"

#include <errno.h>
#include <math.h>

#include "hal/survey/file.h"

#define HEAD                                                                             \
    "temperature_c: 20\n"                                                                \
    "sample_rate_hz: 48000\n"                                                            \
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.0625}\n"                      \
    "slot_samples: 3000\n"
#define ARRAY                                                                            \
    "speakers_m: [[0, 0, 0], [0, 0.5, 0]]\n"                                             \
    "microphones_m: [[0.08, 0, 0], [0.08, 0.5, 0]]\n"
#define STAGE "stage: {axis: [2, 0, 0], positions_m: [0, 0.5, 1]}\n"

static int load(struct scratch *s, const char *text, struct survey *out,
                struct error *why)
{
    why->text[0] = 0;
    return survey_load(out, scratch_write(s, "survey.yaml", text), why);
}

static void a_survey_is_read_with_its_defaults(void **state)
{
    struct error why;
    struct survey s;
    if (load(*state, HEAD ARRAY, &s, &why))
        fail_msg("%s", why.text);
    /* Dry air of 20 C: 343.2 m/s (Cramer 1993). */
    assert_true(fabs(s.sound_speed_m_s - 343.2) < 0.4);
    assert_true(s.temperature_c == 20);
    assert_true(s.sample_rate_hz == 48000);
    assert_true(s.chirp_start_hz == 2000 && s.chirp_stop_hz == 20000);
    assert_false(s.chirp_sine);
    assert_int_equal(s.slot_samples, 3000);
    assert_true(s.latency_samples == 0);
    assert_int_equal(s.n_speakers, 2);
    assert_true(s.microphones_m[1][1] == 0.5);
    assert_int_equal(s.n_positions, 1);
    assert_true(s.stage_positions_m[0] == 0);
    assert_false(s.has_gate || s.has_volume || s.has_wall || s.has_mount);
    assert_int_equal(s.n_responses, 0);
    survey_clear(&s);
}

static void a_measured_speed_wins_over_the_temperature(void **state)
{
    struct error why;
    struct survey s;
    assert_int_equal(load(*state, HEAD ARRAY "sound_speed_m_s: 340\n", &s, &why), 0);
    assert_true(s.sound_speed_m_s == 340);
    assert_true(s.temperature_c == 20);
    survey_clear(&s);
}

static void directions_get_length_1(void **state)
{
    struct error why;
    struct survey s;
    if (load(*state,
             HEAD ARRAY STAGE "wall: {normal: [3, 0, 4], distance_m: 1.5}\n"
                              "mount: {origin_m: [1, 2, 3], x_axis: [0, 2, 0], y_axis: "
                              "[0, 0, 0.5]}\n",
             &s, &why))
        fail_msg("%s", why.text);
    assert_true(s.stage_axis[0] == 1);
    assert_true(fabs(s.wall_normal[0] - 0.6) < 1e-15);
    assert_true(fabs(s.wall_normal[2] - 0.8) < 1e-15);
    assert_true(s.wall_distance_m == 1.5);
    assert_true(s.mount_x_axis[1] == 1 && s.mount_y_axis[2] == 1);
    survey_clear(&s);
}

static void wrong_values_are_named_with_line_and_key(void **state)
{
    static const struct {
        const char *text, *place, *part;
    } cases[] = {
        {HEAD ARRAY "colour: red\n", "survey.yaml:7: colour: no such key", "mount"},
        {"sample_rate_hz: 48000\n", "survey.yaml:1: ", "\"chirp\" is missing"},
        {"sample_rate_hz: 480\nchirp: {start_hz: 2000, stop_hz: 20000, duration_s: "
         "0.06}\n"
         "slot_samples: 3000\ntemperature_c: 20\n" ARRAY,
         "survey.yaml:1: ", "sample_rate_hz"},
        {HEAD ARRAY "gate_m: [2, 1]\n", "survey.yaml:7: ", "gate_m"},
        {HEAD ARRAY "\n\ngate_m: [1, 100]\n", "survey.yaml:9: ", "gate beyond the slot"},
        {HEAD ARRAY "volume:\n  x_m: [0, 1, 0.1]\n  y_m: [0, 1, 0]\n  z_m: [1, 2, 0.1]\n",
         "survey.yaml:9: ", "y_m"},
        {HEAD ARRAY "wall: {normal: [0, 0, 0], distance_m: 1}\n",
         "survey.yaml:7: ", "wall.normal: expected a direction"},
        {HEAD ARRAY "wall:\n  normal: [0, 0, 1]\n  distance_m: -2.2\n",
         "survey.yaml:9: ", "wall.distance_m: -2.2 along the normal [0, 0, 1] is behind"},
        {HEAD ARRAY "wall: {normal: [0, 0, -2], distance_m: 2.2}\n",
         "survey.yaml:7: ", "wall.distance_m: 2.2 along the normal [0, 0, -1] is behind"},
        {HEAD ARRAY "walls:\n  - {normal: [0, 0, 1], distance_m: 1, gate_m: [0, 4]}\n"
                    "  - {normal: [1, 0, 1], distance_m: -1, gate_m: [0, 4]}\n",
         "survey.yaml:9: ", "walls[1].distance_m: -1 along the normal [0.707107, "},
        {HEAD ARRAY "stage:\n  axis: [0, 0, 0]\n  positions_m: [0]\n",
         "survey.yaml:8: ", "stage.axis: expected a direction"},
        {HEAD ARRAY "walls:\n  - {normal: [0, 0, 1], distance_m: 1, gate_m: [2, 1]}\n",
         "survey.yaml:7: ", "gate_m is [2, 1]"},
        {HEAD ARRAY "walls:\n  - {normal: [0, 0, 1], distance_m: 1, gate_m: [0, 4]}\n"
                    "  - {normal: [0, 0, 0], distance_m: 1, gate_m: [0, 4]}\n",
         "survey.yaml:9: ", "walls[1].normal: expected a direction"},
        {HEAD ARRAY
         "wall: {normal: [0, 0, 1], distance_m: 1, ends_m: [[2, 1], [2, 3]]}\n",
         "survey.yaml:7: ", "wall.ends_m: [2, 1] and [2, 3] are one place"},
        {HEAD ARRAY "wall: {normal: [0, 0, 1], distance_m: 1, ends_m: [[2, 1]]}\n",
         "survey.yaml:7", "ends_m"},
        {HEAD ARRAY "wall: {normal: [0, 0, 1], distance_m: 1}\n"
                    "walls: [{normal: [0, 0, 1], distance_m: 1, gate_m: [0, 4]}]\n",
         "survey.yaml:8: ", "\"wall\" says this already"},
        {HEAD ARRAY "latency_samples: -1\n", "survey.yaml:7: ", "latency_samples"},
        {HEAD ARRAY "sound_speed_m_s: 34\n", "survey.yaml:7: ", "sound_speed_m_s"},
        {"temperature_c: 200\nsample_rate_hz: 48000\n"
         "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.0625}\n"
         "slot_samples: 3000\n" ARRAY,
         "survey.yaml:1: ", "temperature_c: 200 is outside -60..80"},
        {"sample_rate_hz: 48000\n"
         "chirp:\n  start_hz: 2000\n  stop_hz: 30000\n  duration_s: 0.0625\n"
         "temperature_c: 20\nslot_samples: 3000\n" ARRAY,
         "survey.yaml:4: ", "stop_hz"},
        {"sample_rate_hz: 48000\n"
         "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.0625}\n"
         "slot_samples: 3000\n" ARRAY,
         "survey.yaml: ", "sound_speed_m_s, temperature_c"},
        {HEAD ARRAY "calibration: {folder: curves, serials: [a, b, c]}\n",
         "survey.yaml:7: ", "expected one for each of 2 microphones, found 3"},
        {HEAD ARRAY "calibration: {folder: curves, serials: [a, b]}\n",
         "survey.yaml:7: ", "curves/a.txt: No such file"},
        {HEAD ARRAY "calibration: {folder: curves, serials: [../a, b]}\n",
         "survey.yaml:7: ", "no serial number"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error why;
        struct survey s;
        assert_int_equal(load(*state, cases[i].text, &s, &why) < 0, 1);
        assert_contains(why.text, cases[i].place);
        assert_contains(why.text, cases[i].part);
        assert_null(s.speakers_m);
    }
}

static void curves_are_read_past_their_head_lines(void **state)
{
    struct error why;
    struct survey s;
    scratch_folder(*state, "curves");
    scratch_write(*state, "curves/1.txt", "*1000Hz\t-41.1\n\t\n20.00\t-1.4\n1000\t0\n");
    scratch_write(*state, "curves/2.txt",
                  "\"Sens Factor =-2.8dB, SERNO: 2\"\r\n10.054\t-3.1627\r\n2e4\t5\r\n");
    if (load(*state, HEAD ARRAY "calibration: {folder: curves, serials: [\"1\", '2']}\n",
             &s, &why))
        fail_msg("%s", why.text);
    assert_int_equal(s.n_responses, 2);
    assert_string_equal(s.responses[0].serial, "1");
    assert_int_equal(s.responses[0].n_points, 2);
    assert_true(s.responses[0].frequency_hz[0] == 20 &&
                s.responses[0].gain_db[0] == -1.4);
    assert_int_equal(s.responses[1].n_points, 2);
    assert_true(s.responses[1].frequency_hz[0] == 10.054);
    assert_true(s.responses[1].gain_db[1] == 5);
    survey_clear(&s);
}

static void broken_curves_are_named_with_their_line(void **state)
{
    static const struct {
        const char *text, *part;
    } cases[] = {
        {"20 1\n30 x\n", "1.txt:2: expected a frequency in Hz and dB"},
        {"20 1\n30\n", "1.txt:2: expected a frequency in Hz and dB"},
        {"20 1\n20 2\n", "1.txt:2: frequency 20 Hz does not rise"},
        {"20 1\n30 nan\n", "1.txt:2: expected a frequency"},
        {"head\n", "1.txt: expected lines of frequency"},
        {"", "1.txt: expected lines of frequency"},
    };
    scratch_folder(*state, "curves");
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error why;
        struct survey s;
        scratch_write(*state, "curves/1.txt", cases[i].text);
        assert_int_equal(load(*state,
                              HEAD ARRAY
                              "calibration: {folder: curves, serials: ['1', '1']}\n",
                              &s, &why),
                         -EINVAL);
        assert_contains(why.text, cases[i].part);
    }
}

static void assert_same(const struct survey *a, const struct survey *b)
{
    assert_true(a->sound_speed_m_s == b->sound_speed_m_s);
    assert_true(a->temperature_c == b->temperature_c ||
                (isnan(a->temperature_c) && isnan(b->temperature_c)));
    assert_true(a->chirp_sine == b->chirp_sine);
    assert_int_equal(survey_id(a), survey_id(b));
}

static void what_is_saved_loads_as_the_same_survey(void **state)
{
    static const char text[] =
        "sound_speed_m_s: 340.123456789012\n"
        "temperature_c: 17.3\n"
        "sample_rate_hz: 48000\n"
        "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.0625, phase: sine}\n"
        "slot_samples: 3000\n"
        "latency_samples: 12.345678901\n"
        "speakers_m: [[0, 0.1, 0], [0, 0.3333333333333333, 1e-3]]\n"
        "microphones_m: [[0.08, 0.1, 0], [0.08, -7, 0.12345678901234567]]\n"
        "stage: {axis: [1, 2, 3], positions_m: [0, 0.1, 0.2]}\n"
        "gate_m: [0.5, 3.3]\n"
        "volume: {x_m: [0, 1, 0.1], y_m: [0, 1, 0.02], z_m: [1, 3, 0.01]}\n"
        "wall: {normal: [1, 2, 7], distance_m: 1.1}\n"
        "mount: {origin_m: [1, 2, 3], x_axis: [1, 1, 1], y_axis: [1, -1, 0]}\n"
        "calibration: {folder: curves, serials: [one, two]}\n";
    struct error why;
    struct survey s, again;
    char path[512];
    scratch_folder(*state, "curves");
    scratch_write(*state, "curves/one.txt", "20 -1.4\n1000 0.1\n");
    scratch_write(*state, "curves/two.txt", "20.5 0.12345678901234567\n1000 3\n");
    if (load(*state, text, &s, &why))
        fail_msg("%s", why.text);
    strcpy(path, scratch_path(*state, "saved.yaml"));
    if (survey_save(&s, path, "saved curves", &why))
        fail_msg("%s", why.text);
    if (survey_load(&again, path, &why))
        fail_msg("%s", why.text);
    assert_same(&s, &again);
    assert_int_equal(again.n_responses, 2);
    survey_clear(&again);

    assert_int_equal(survey_save(&s, path, NULL, &why), 0);
    assert_int_equal(survey_load(&again, path, &why), 0);
    assert_int_equal(again.n_responses, 0);
    survey_clear(&again);
    survey_clear(&s);
}

static void a_wall_ahead_or_beside_is_taken_however_it_is_written(void **state)
{
    static const char *const texts[] = {
        HEAD ARRAY "wall: {normal: [0, 0, -1], distance_m: -1.5}\n",
        HEAD ARRAY "wall: {normal: [1, 0, 0], distance_m: -3}\n",
        HEAD ARRAY "wall: {normal: [1, 0, -0.02], distance_m: 3}\n",
        HEAD "speakers_m: [[0, 0, -2]]\nmicrophones_m: [[0, 0.1, -2]]\n"
             "wall: {normal: [0, 0, 1], distance_m: -0.5}\n",
    };
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        struct error why;
        struct survey s;
        if (load(*state, texts[i], &s, &why))
            fail_msg("%s", why.text);
        survey_clear(&s);
    }
}

static void several_walls_have_gates_and_the_first_is_the_wall(void **state)
{
    static const char text[] = HEAD ARRAY
        "walls:\n"
        "  - {normal: [0, 0, 2], distance_m: 1.5, gate_m: [1.5, 4]}\n"
        "  - {normal: [1, 0, 1], distance_m: 2, gate_m: [2, 3]}\n";
    struct error why;
    struct survey s, again;
    char path[512];
    if (load(*state, text, &s, &why))
        fail_msg("%s", why.text);
    assert_int_equal(s.n_walls, 2);
    assert_true(s.has_wall && s.wall_normal[2] == 1 && s.wall_distance_m == 1.5);
    assert_true(fabs(s.walls[1].normal[0] - sqrt(0.5)) < 1e-15);
    assert_true(s.walls[1].gate_m[0] == 2 && s.walls[1].gate_m[1] == 3);
    strcpy(path, scratch_path(*state, "saved.yaml"));
    assert_int_equal(survey_save(&s, path, NULL, &why), 0);
    if (survey_load(&again, path, &why))
        fail_msg("%s", why.text);
    assert_same(&s, &again);
    assert_int_equal(again.n_walls, 2);
    again.walls[1].gate_m[0] = 2.5;
    assert_true(survey_id(&s) != survey_id(&again));
    survey_clear(&again);
    survey_clear(&s);
}

/* Written as two points of the floor, which are 0.6 m to the right and 1.4 m to the left
 * of the foot of a wall ahead; along (-0.8, 0.6) of one at an angle. */
static void walls_that_end_are_read_and_saved(void **state)
{
    static const char several[] = HEAD ARRAY
        "walls:\n"
        "  - {normal: [0, 0, 1], distance_m: 1.5, gate_m: [1, 4], ends_m: [[-0.6, 1.5], "
        "[1.4, 1.5]]}\n"
        "  - {normal: [0.6, 0, 0.8], distance_m: 2, gate_m: [2, 3], ends_m: [[2, 1], "
        "[0.4, 2.2]]}\n"
        "  - {normal: [1, 0, 0], distance_m: 2, gate_m: [2, 3]}\n";
    static const char single[] = HEAD ARRAY
        "wall: {normal: [0, 0, 1], distance_m: 1.5, ends_m: [[1.4, 9], [-0.6, 0]]}\n";
    struct error why;
    struct survey s, again;
    if (load(*state, several, &s, &why))
        fail_msg("%s", why.text);
    assert_true(fabs(s.wall_ends_m[0][0] + 1.4) < 1e-6); /* its level axis is -x */
    assert_true(fabs(s.wall_ends_m[0][1] - 0.6) < 1e-6);
    assert_true(fabs(s.wall_ends_m[1][0] + 1.0) < 1e-6);
    assert_true(fabs(s.wall_ends_m[1][1] - 1.0) < 1e-6);
    assert_true(s.wall_ends_m[2][0] == 0 && s.wall_ends_m[2][1] == 0);
    if (survey_save(&s, scratch_path(*state, "ends.yaml"), NULL, &why) ||
        survey_load(&again, scratch_path(*state, "ends.yaml"), &why))
        fail_msg("%s", why.text);
    assert_true(survey_id(&s) == survey_id(&again));
    again.wall_ends_m[1][1] += 0.1;
    assert_true(survey_id(&s) != survey_id(&again));
    survey_clear(&again);
    survey_clear(&s);
    if (load(*state, single, &s, &why))
        fail_msg("%s", why.text);
    assert_int_equal(s.n_walls, 0);
    assert_true(fabs(s.wall_ends_m[0][0] + 1.4) < 1e-6);
    assert_true(fabs(s.wall_ends_m[0][1] - 0.6) < 1e-6);
    if (survey_save(&s, scratch_path(*state, "ends.yaml"), NULL, &why) ||
        survey_load(&again, scratch_path(*state, "ends.yaml"), &why))
        fail_msg("%s", why.text);
    assert_true(survey_id(&s) == survey_id(&again));
    survey_clear(&again);
    survey_clear(&s);
}

static void alternating_chirps_and_shared_slots_are_read_and_saved(void **state)
{
    static const char text[] =
        "temperature_c: 20\nsample_rate_hz: 48000\nslot_samples: 1152\ntogether: 2\n"
        "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.0625, alternates: "
        "true}\n" ARRAY "gate_m: [0.3, 4]\n";
    struct error why;
    struct survey s, again;
    if (load(*state, text, &s, &why))
        fail_msg("%s", why.text);
    assert_true(s.chirp_alternates);
    assert_int_equal(s.together, 2);
    if (survey_save(&s, scratch_path(*state, "again.yaml"), NULL, &why) ||
        survey_load(&again, scratch_path(*state, "again.yaml"), &why))
        fail_msg("%s", why.text);
    assert_true(again.chirp_alternates);
    assert_int_equal(again.together, 2);
    assert_same(&s, &again);
    survey_clear(&s);
    survey_clear(&again);
    assert_true(load(*state,
                     "temperature_c: 20\nsample_rate_hz: 48000\nslot_samples: 3000\n"
                     "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.0625}\n" ARRAY
                     "together: 2\n",
                     &s, &why) == -EINVAL);
    assert_contains(why.text, "expected chirp.alternates: true");
}

static void a_stage_that_does_not_stop_is_read_and_saved(void **state)
{
    static const char text[] =
        "temperature_c: 20\nsample_rate_hz: 48000\nslot_samples: 1632\n"
        "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.0625}\n"
        "speakers_m: [[0, 0, 0], [0, 0.1, 0]]\nmicrophones_m: [[0.1, 0, 0]]\n"
        "gate_m: [0.3, 4]\n"
        "stage: {axis: [1, 0, 0], positions_m: [0, 0.01], continuous: true}\n";
    struct error why;
    struct survey s, again;
    if (load(*state, text, &s, &why))
        fail_msg("%s", why.text);
    assert_true(s.continuous);
    if (survey_save(&s, scratch_path(*state, "again.yaml"), NULL, &why) ||
        survey_load(&again, scratch_path(*state, "again.yaml"), &why))
        fail_msg("%s", why.text);
    assert_true(again.continuous);
    assert_same(&s, &again);
    survey_clear(&s);
    survey_clear(&again);
    char slow[sizeof text];
    snprintf(slow, sizeof slow, "%s", text);
    memcpy(strstr(slow, "0.01]"), "0.07]", 5);
    assert_true(load(*state, slow, &s, &why) == -EINVAL);
    assert_contains(why.text, "1.02941 m/s");
}

static void saving_never_replaces_another_curve(void **state)
{
    struct error why;
    struct survey s;
    struct stat st;
    scratch_folder(*state, "curves");
    scratch_folder(*state, "others");
    scratch_write(*state, "curves/1.txt", "20 1\n30 2\n");
    scratch_write(*state, "others/1.txt", "20 1\n30 3\n");
    assert_int_equal(
        load(*state, HEAD ARRAY "calibration: {folder: curves, serials: ['1', '1']}\n",
             &s, &why),
        0);
    assert_int_equal(survey_save(&s, scratch_path(*state, "x.yaml"), "others", &why),
                     -EEXIST);
    assert_contains(why.text, "others/1.txt: holds another curve");
    assert_int_equal(stat(scratch_path(*state, "x.yaml"), &st), -1);
    assert_int_equal(survey_save(&s, scratch_path(*state, "x.yaml"), "curves", &why), 0);
    survey_clear(&s);
}

static void an_output_that_cannot_be_written_is_named(void **state)
{
    struct error why;
    struct survey s;
    assert_int_equal(load(*state, HEAD ARRAY, &s, &why), 0);
    assert_int_equal(survey_save(&s, "/nowhere/survey.yaml", NULL, &why), -ENOENT);
    assert_contains(why.text, "/nowhere/survey.yaml cannot be written: No such");
    survey_clear(&s);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_survey_is_read_with_its_defaults),
        TEST(a_measured_speed_wins_over_the_temperature),
        TEST(directions_get_length_1),
        TEST(wrong_values_are_named_with_line_and_key),
        TEST(curves_are_read_past_their_head_lines),
        TEST(broken_curves_are_named_with_their_line),
        TEST(what_is_saved_loads_as_the_same_survey),
        TEST(a_wall_ahead_or_beside_is_taken_however_it_is_written),
        TEST(several_walls_have_gates_and_the_first_is_the_wall),
        TEST(walls_that_end_are_read_and_saved),
        TEST(alternating_chirps_and_shared_slots_are_read_and_saved),
        TEST(a_stage_that_does_not_stop_is_read_and_saved),
        TEST(saving_never_replaces_another_curve),
        TEST(an_output_that_cannot_be_written_is_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
