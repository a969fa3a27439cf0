/* SPDX-License-Identifier: MIT */
/* `anlos plan`: what it says to write is what `anlos sim` then does. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

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
    char *words[] = {"plan", "--scene", scene,     "--threads",
                     "1",    (char *)a, (char *)b, NULL};
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
    struct command_result r = plan("--time-s", "0.2");
    assert_int_equal(r.code, 1);
    assert_non_null(strstr(r.out, "none will do"));
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
        {"--far-m", "0.5", "gate_m"},
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
        cmocka_unit_test(what_is_wrong_is_said),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
