/* SPDX-License-Identifier: MIT */
/* `anlos bench drive`, on a drive of three seconds. */
#include "tests/hal/scratch.h"

#include <jansson.h>
#include <unistd.h>

#include "nodes/anlos/commands.h"
#include "tests/nodes/command.h"
#include "tests/nodes/near.h"

/* A person walks 1.5 m/s along a facade, 3.1 to 3.5 m away by way of it. */
static const char scene[] =
    "array: bumper\n"
    "temperature_c: 20\n"
    "wall: {normal: [0, 0, 1], distance_m: 2.2}\n"
    "mount: {origin_m: [3.6, 0, 0.4], x_axis: [0, 1, 0], y_axis: [0, 0, 1]}\n"
    "gate_m: [1.5, 4.1]\n"
    "volume: {x_m: [-2.4, 2.4, 0.05], y_m: [0, 0, 0.1], z_m: [2.4, 3.8, 0.03]}\n"
    "drive: {period_s: 3}\n"
    "objects:\n"
    "  - name: person\n"
    "    kind: person\n"
    "    present_s: [0.5, 2.9]\n"
    "    path:\n"
    "      - {t_s: 0, position_m: [-1.8, 0, 1.3]}\n"
    "      - {t_s: 3, position_m: [2.7, 0, 1.3]}\n"
    "seed: 1\n"
    "level: 0.03\n"
    "wall_sound: {reflectivity: 0.95, echo: 0.5}\n"
    "noise: {snr_db: 10, at_m: 4}\n";

static const char launch[] =
    "nodes: [array, scan, dsp, recon, wall, track]\n"
    "array: {uri: 'sim:person.yaml'}\n"
    "scan: {mode: fixed, background: true, background_frames: 1}\n"
    "dsp: {background: recorded}\n"
    "recon: {frames: {pings: 8, sum: power, every: ping}}\n"
    "wall: {from: topic}\n";

static double figure(const json_t *o, const char *name)
{
    const json_t *x = json_object_get(o, name);

    if (!json_is_number(x))
        fail_msg("%s is not a number", name);
    return json_number_value(x);
}

static void check_lines(const char *path, int expected)
{
    FILE *f = fopen(path, "r");
    int n = 0, c;

    assert_non_null(f);
    while ((c = fgetc(f)) != EOF)
        n += c == '\n';
    fclose(f);
    assert_int_equal(n, expected);
}

static void a_person_is_tracked_and_scored(void **state)
{
    struct scratch *s = *state;
    struct command_result r;

    scratch_write(s, "person.yaml", scene);
    char *settings = strdup(scratch_write(s, "drive.yaml", launch));
    char *out = strdup(scratch_path(s, "out"));
    char *argv[] = {"bench", "drive",     "--launch", settings, "--seeds", "2", "--out",
                    out,     "--threads", "1",        "--jobs", "2",       NULL};
    command_run(&r, command_bench, argv);
    assert_int_equal(r.code, 0);
    assert_non_null(strstr(r.out, "person "));
    assert_non_null(strstr(r.out, "worst of 2 "));
    json_t *all = json_load_file(scratch_path(s, "out/drive.json"), 0, NULL);
    const json_t *o = json_object_get(all, "person");
    assert_non_null(o);
    assert_near(figure(o, "drives"), 2.0, 0.0);
    assert_near(figure(o, "objects_entered"), 2.0, 0.0);
    assert_near(figure(o, "objects_without_track"), 0.0, 0.0);
    assert_near(figure(o, "detection_probability"), 1.0, 0.1);
    assert_near(figure(o, "told"), 0.85, 0.15); /* not before he is confirmed */
    assert_true(figure(json_object_get(json_object_get(o, "nees"), "person"), "n") >
                50.0);
    assert_true(json_array_size(json_object_get(o, "existence")) > 0);
    assert_non_null(strstr(r.out, "existence on CAN"));
    assert_int_equal(access(scratch_path(s, "out/existence.png"), R_OK), 0);
    assert_near(figure(o, "echo_to_track_s"), 0.5, 0.5);
    assert_near(figure(o, "position_rms_m"), 0.1, 0.1);
    assert_near(figure(o, "velocity_rms_m_s"), 0.25, 0.25);
    assert_near(figure(o, "gospa_m"), 0.2, 0.2);
    const json_t *worst = json_object_get(o, "worst");
    assert_true(figure(worst, "gospa_m") > figure(o, "gospa_m"));
    assert_true(figure(worst, "position_rms_m") > figure(o, "position_rms_m"));
    check_lines(scratch_path(s, "out/drives.csv"), 3);
    assert_int_equal(access(scratch_path(s, "out/person.csv"), R_OK), 0);
    assert_int_equal(access(scratch_path(s, "out/person.svg"), R_OK), 0);
    assert_int_equal(access(scratch_path(s, "out/person.png"), R_OK), 0);
    json_decref(all);
    free(settings);
    free(out);
}

static void what_is_not_a_drive_is_refused(void **state)
{
    struct scratch *s = *state;
    struct command_result r;
    char *out = strdup(scratch_path(s, "out"));
    char *argv[] = {"bench", "drive", "--scenes", SOURCE_DIR "/launch/scenes/point.yaml",
                    "--out", out,     NULL};

    command_run(&r, command_bench, argv);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "not a drive"));
    char *nothing[] = {"bench", "drive", "--out", out, NULL};
    command_run(&r, command_bench, nothing);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "expected --scenes FILE,... or --launch FILE"));
    char *both[] = {"bench", "drive", "--seeds", "2", "--hours", "1", NULL};
    command_run(&r, command_bench, both);
    assert_int_equal(r.code, 2);
    char *much[] = {"bench",    "drive",
                    "--launch", SOURCE_DIR "/launch/drive.yaml",
                    "--scenes", SOURCE_DIR "/launch/scenes/drive-nothing.yaml",
                    "--hours",  "1e9",
                    "--out",    out,
                    NULL};
    command_run(&r, command_bench, much);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "--hours 1e+09"));
    free(out);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_person_is_tracked_and_scored),
        TEST(what_is_not_a_drive_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
