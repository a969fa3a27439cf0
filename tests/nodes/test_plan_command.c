/* SPDX-License-Identifier: MIT */
/* `anlos plan`: what it says to write is what `anlos sim` then does. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>
#include <jansson.h>

#include "hal/survey/file.h"
#include "nodes/anlos/commands.h"
#include "tests/hal/folder.h"
#include "tests/nodes/command.h"
#include "tests/nodes/near.h"

static char folder[64], scene[160];

/* Four speakers and four microphones upright, ten positions 4 cm apart: 0.25 s each, and
 * 0.57 to the next. */
static const char text[] =
    "sound_speed_m_s: 340\nsample_rate_hz: 48000\nslot_samples: 3000\n"
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.0625}\n"
    "speakers_m: [[0, 0, 0], [0, 0.1, 0], [0, 0.2, 0], [0, 0.3, 0]]\n"
    "microphones_m: [[0.05, 0, 0], [0.05, 0.1, 0], [0.05, 0.2, 0], [0.05, 0.3, 0]]\n"
    "stage: {axis: [1, 0, 0], positions_m: [0, 0.04, 0.08, 0.12, 0.16, 0.2, 0.24, 0.28, "
    "0.32, 0.36]}\n"
    "wall: {normal: [0, 0, 1], distance_m: 0.8}\ngate_m: [0.9, 2]\nlevel: 0.1\n"
    "volume: {x_m: [-0.1, 0.5, 0.02], y_m: [-0.1, 0.4, 0.02], z_m: [1, 1.8, 0.01]}\n"
    "objects: [{name: p, kind: point, position_m: [0.2, 0.1, 0.2], "
    "scattering_length_m: 0.1}]\n";

static int set_up(void **state)
{
    (void)state;
    strcpy(folder, "/tmp/anlos-plan-XXXXXX");
    if (!mkdtemp(folder))
        return -1;
    snprintf(scene, sizeof scene, "%s/scene.yaml", folder);
    FILE *f = fopen(scene, "w");
    return f && fputs(text, f) >= 0 && !fclose(f) ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    return folder_remove(folder);
}

static struct command_result plan(const char *a, const char *b)
{
    char *words[] = {"plan",      "--scene", scene,     "--reach", "-0.2,2",
                     "--threads", "1",       (char *)a, (char *)b, NULL};
    struct command_result r;
    command_run(&r, command_plan, words);
    return r;
}

/* The scene with its options, between sim: and the quote. */
static void find_scene(const struct command_result *r, char *out, size_t size)
{
    const char *from = strstr(r->out, "\"sim:");
    assert_non_null(from);
    snprintf(out, size, "%.*s", (int)strcspn(from + 5, "\""), from + 5);
}

static void what_it_says_can_be_simulated(void **state)
{
    (void)state;
    char planned[300], out[160], path[200];
    struct command_result r = plan("--time-s", "4.5"), sim;
    struct error why = {""};
    struct survey s;
    if (r.code)
        fail_msg("%s", r.err);
    find_scene(&r, planned, sizeof planned);
    snprintf(out, sizeof out, "%s/out", folder);
    char *words[] = {"sim", planned, "--out", out, NULL};
    command_run(&sim, command_sim, words);
    if (sim.code)
        fail_msg("%s: %s", planned, sim.err);
    snprintf(path, sizeof path, "%s/survey.yaml", out);
    assert_int_equal(survey_load(&s, path, &why), 0);
    /* Nine moves take 5 s. */
    assert_true(s.continuous);
    assert_true(survey_duration_s(&s) < 4.5 && survey_duration_s(&s) > 0.5);
    assert_int_equal(s.n_positions, 10);
    survey_clear(&s);
}

static void what_is_enough_as_it_is_stays(void **state)
{
    (void)state;
    char planned[300];
    struct command_result r = plan("--time-s", "60");
    assert_int_equal(r.code, 0);
    find_scene(&r, planned, sizeof planned);
    assert_string_equal(planned, scene);
}

static void what_cannot_be_had_is_said(void **state)
{
    (void)state;
    double least_s;
    char enough[32];
    struct command_result r = plan("--time-s", "0.2");
    assert_int_equal(r.code, 1);
    const char *said = strstr(r.out, "none will do: the quickest takes ");
    assert_non_null(said);
    assert_int_equal(
        sscanf(said, "none will do: the quickest takes %lf s; allow more", &least_s), 1);
    assert_null(strstr(r.out, "positions"));
    snprintf(enough, sizeof enough, "%.1f", least_s + 0.1);
    r = plan("--time-s", enough);
    assert_null(strstr(r.out, "the quickest takes"));
    r = plan("--error-cm", "0.000001");
    assert_int_equal(r.code, 1);
    assert_non_null(strstr(r.out, "none will do: the most exact of these is 0.0"));
}

/* A rig's URI has a ? already. */
static void a_rig_is_told_what_its_card_is_to_do(void **state)
{
    (void)state;
    char path[200], expected[300];
    struct command_result r;
    snprintf(path, sizeof path, "%s/rig.yaml", folder);
    FILE *f = fopen(path, "w");
    const char *end = strstr(text, "level: ");
    assert_true(f && fprintf(f,
                             "%.*sdevice: {format: S32, outputs: [0, 1, 2, 3], inputs: "
                             "[0, 1, 2, 3]}\n",
                             (int)(end - text), text) > 0);
    assert_int_equal(fclose(f), 0);
    char *words[] = {"plan",      "--rig", path,       "--reach", "-0.2,2",
                     "--threads", "1",     "--time-s", "4.5",     NULL};
    command_run(&r, command_plan, words);
    if (r.code)
        fail_msg("%s", r.err);
    snprintf(expected, sizeof expected, "\"alsa:DEVICE?rig=%s&", path);
    assert_non_null(strstr(r.out, expected));
    assert_non_null(strstr(r.out, "continuous=yes\"}"));
}

/* One line of elements sees no heights. */
static void what_is_not_imaged_has_no_width(void **state)
{
    (void)state;
    char path[200];
    struct command_result r;
    snprintf(path, sizeof path, "%s/plane.yaml", folder);
    FILE *f = fopen(path, "w");
    assert_true(f &&
                fputs("sound_speed_m_s: 340\nsample_rate_hz: 48000\nslot_samples: 3000\n"
                      "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.0625}\n"
                      "speakers_m: [[0, 0, 0]]\nmicrophones_m: [[0.05, 0, 0]]\n"
                      "stage: {axis: [1, 0, 0], positions_m: [0, 0.04, 0.08, 0.12, 0.16, "
                      "0.2]}\ngate_m: [0.9, 2]\n"
                      "volume: {x_m: [-0.1, 0.4, 0.02], y_m: [0, 0, 0.1], "
                      "z_m: [1, 1.8, 0.01]}\n",
                      f) >= 0);
    assert_int_equal(fclose(f), 0);
    char *words[] = {"plan", "--survey", path, "--threads", "1", NULL};
    command_run(&r, command_plan, words);
    if (r.code)
        fail_msg("%s", r.err);
    assert_non_null(strstr(r.out, "along x"));
    assert_null(strstr(r.out, "along y"));
}

/* What is drawn is what is printed. */
static void ways_are_written_and_drawn(void **state)
{
    (void)state;
    static const char *const files[] = {"plan-error.svg", "plan-error.png",
                                        "plan-sidelobes.svg", "plan-sidelobes.png"};
    char out[160], path[200], row[64];
    size_t computed = 0, best = 0;
    snprintf(out, sizeof out, "%s/plan", folder);
    struct command_result r = plan("--out", out);
    if (r.code)
        fail_msg("%s", r.err);
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        snprintf(path, sizeof path, "%s/%s", out, files[i]);
        assert_int_equal(access(path, R_OK), 0);
    }
    snprintf(path, sizeof path, "%s/plan.json", out);
    json_t *all = json_load_file(path, 0, NULL), *way;
    size_t i;
    assert_non_null(all);
    json_array_foreach(json_object_get(all, "ways"), i, way)
    {
        double error_m = json_real_value(json_object_get(way, "error_m"));
        best += json_is_true(json_object_get(way, "best"));
        if (!(error_m > 0))
            continue;
        computed++;
        snprintf(row, sizeof row, " %7.1f %8lld %9lld %7.1f",
                 1e3 * json_real_value(json_object_get(way, "slot_s")),
                 json_integer_value(json_object_get(way, "together")),
                 json_integer_value(json_object_get(way, "positions")),
                 json_real_value(json_object_get(way, "time_s")));
        assert_non_null(strstr(r.out, row));
    }
    assert_true(computed > 4);
    assert_int_equal(best, 1);
    json_decref(all);
}

static void what_is_wrong_is_said(void **state)
{
    (void)state;
    static const struct {
        const char *option, *value, *part;
    } cases[] = {
        {"--time-s", "-1", "--time-s -1: expected a number above 0"},
        {"--error-cm", "x", "--error-cm x"},
        {"--at", "1,2", "expected X,Y,Z"},
        {"--at", "5,0.1,1.4", "in the volume"},
        {"--stage", "0.2,0.5", "expected speed, acceleration"},
        {"--reach", "1,0", "--reach 1,0: expected two places"},
        {"--far-m", "0.5", "gate_m"},
        {"x.yaml", NULL, "a file is named by --survey"},
        {"--survey", "x.yaml", "one of --survey, --scene and --rig"},
        {"--snr-db", "loud", "--snr-db loud"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct command_result r = plan(cases[i].option, cases[i].value);
        assert_int_equal(r.code, 2);
        if (!strstr(r.err, cases[i].part))
            fail_msg("%s %s: %s", cases[i].option, cases[i].value, r.err);
    }
    struct command_result r;
    char *nothing[] = {"plan", NULL};
    command_run(&r, command_plan, nothing);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "--survey, --scene or --rig is missing"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_it_says_can_be_simulated),
        cmocka_unit_test(what_is_enough_as_it_is_stays),
        cmocka_unit_test(what_cannot_be_had_is_said),
        cmocka_unit_test(a_rig_is_told_what_its_card_is_to_do),
        cmocka_unit_test(what_is_not_imaged_has_no_width),
        cmocka_unit_test(ways_are_written_and_drawn),
        cmocka_unit_test(what_is_wrong_is_said),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
