/* SPDX-License-Identifier: MIT */
/* `anlos sim`: a scene of one point, small enough to take no time. */
#include <jansson.h>
#include <setjmp.h>
#include <sndfile.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "hal/recording/recording.h"
#include "hal/survey/file.h"
#include "nodes/anlos/commands.h"
#include "tests/hal/folder.h"
#include "tests/nodes/command.h"
#include "tests/nodes/near.h"

static const char scene_path[] = SOURCE_DIR "/launch/scenes/point.yaml";

struct fixture {
    char folder[64];
    char out[96];
};

static int set_up(void **state)
{
    struct fixture *f = calloc(1, sizeof *f);
    strcpy(f->folder, "/tmp/anlos-sim-XXXXXX");
    if (!f || !mkdtemp(f->folder))
        return -1;
    snprintf(f->out, sizeof f->out, "%s/recording", f->folder);
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

static void run(struct fixture *f, const char *scene, struct command_result *r)
{
    char *words[] = {"sim", (char *)scene, "--out", f->out, "--threads", "2", NULL};
    command_run(r, command_sim, words);
}

static bool exists(const char *folder, const char *name)
{
    char path[256];
    struct stat st;
    snprintf(path, sizeof path, "%.120s/%s", folder, name);
    return !stat(path, &st);
}

static void the_recording_fits_its_own_survey(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    struct error why = {0};
    struct survey s;
    struct recording *scene, *background;
    char path[128];
    run(f, scene_path, &r);
    assert_int_equal(r.code, 0);
    snprintf(path, sizeof path, "%s/survey.yaml", f->out);
    assert_int_equal(survey_load(&s, path, &why), 0);
    snprintf(path, sizeof path, "%s/scene", f->out);
    assert_int_equal(recording_open(&scene, path, &s, &why), 0);
    snprintf(path, sizeof path, "%s/background", f->out);
    assert_int_equal(recording_open(&background, path, &s, &why), 0);
    recording_close(scene);
    recording_close(background);
    survey_clear(&s);
    assert_non_null(strstr(r.out, "anlos recon "));
    assert_non_null(strstr(r.out, f->out));
    assert_string_equal(r.err, ""); /* no progress line in a pipe */
}

static void the_truth_names_the_mirrored_place(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    char path[128];
    run(f, scene_path, &r);
    snprintf(path, sizeof path, "%s/truth.json", f->out);
    json_t *truth = json_load_file(path, 0, NULL);
    assert_non_null(truth);
    const json_t *wall = json_object_get(truth, "wall"), *o, *objects;
    objects = json_object_get(truth, "objects");
    assert_true(json_array_size(objects) > 0);
    double distance = json_number_value(json_object_get(wall, "distance_m"));
    for (size_t i = 0; i < json_array_size(objects); i++) {
        o = json_array_get(objects, i);
        double real = 0.0, mirrored = 0.0;
        for (size_t a = 0; a < 3; a++) {
            double n =
                json_number_value(json_array_get(json_object_get(wall, "normal"), a));
            real += n * json_number_value(
                            json_array_get(json_object_get(o, "position_m"), a));
            mirrored +=
                n * json_number_value(json_array_get(json_object_get(o, "virtual_m"), a));
        }
        assert_near(real + mirrored, 2.0 * distance, 1e-9);
        assert_true(json_is_array(json_object_get(o, "vehicle_m")));
    }
    json_decref(truth);
}

static void equal_scenes_give_equal_recordings_on_any_number_of_threads(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    char second[96], path[2][160];
    static char data[2][1 << 16];
    snprintf(second, sizeof second, "%s/second", f->folder);
    char *words[] = {"sim", (char *)scene_path, "--out", second, "--threads", "1", NULL};
    run(f, scene_path, &r);
    command_run(&r, command_sim, words);
    assert_int_equal(r.code, 0);
    snprintf(path[0], sizeof path[0], "%s/scene/pos03.wav", f->out);
    snprintf(path[1], sizeof path[1], "%s/scene/pos03.wav", second);
    for (int i = 0; i < 2; i++) {
        FILE *file = fopen(path[i], "rb");
        assert_non_null(file);
        assert_int_equal(fread(data[i], 1, sizeof data[i], file), sizeof data[i]);
        fclose(file);
    }
    /* behind the header, which may hold the time */
    assert_memory_equal(data[0] + 256, data[1] + 256, sizeof data[0] - 256);
}

static void a_recording_that_is_there_is_not_overwritten(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    run(f, scene_path, &r);
    assert_int_equal(r.code, 0);
    run(f, scene_path, &r);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "exists already"));
    assert_true(exists(f->out, "scene/pos00.wav"));
}

static void a_survey_or_a_truth_made_by_hand_is_not_overwritten(void **state)
{
    static const char *const names[2] = {"survey.yaml", "truth.json"};
    struct fixture *f = *state;
    struct command_result r;
    assert_int_equal(mkdir(f->out, 0777), 0);
    for (int i = 0; i < 2; i++) {
        char path[128], text[16] = "";
        snprintf(path, sizeof path, "%s/%s", f->out, names[i]);
        FILE *file = fopen(path, "w+");
        assert_non_null(file);
        fputs("by hand\n", file);
        fflush(file);
        run(f, scene_path, &r);
        assert_int_equal(r.code, 2);
        assert_non_null(strstr(r.err, names[i]));
        assert_false(exists(f->out, "scene"));
        fclose(file);
        file = fopen(path, "r");
        assert_non_null(fgets(text, sizeof text, file));
        assert_string_equal(text, "by hand\n");
        fclose(file);
        assert_int_equal(unlink(path), 0);
    }
}

static void a_wrong_scene_is_refused_by_name(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    char path[96];
    run(f, "/nowhere/scene.yaml", &r);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "/nowhere/scene.yaml"));
    snprintf(path, sizeof path, "%s/bad.yaml", f->folder);
    FILE *file = fopen(path, "w");
    fputs("walls: 4\n", file);
    fclose(file);
    run(f, path, &r);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "bad.yaml"));
    assert_false(exists(f->folder, "recording"));
}

static void a_drive_is_refused(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    run(f, SOURCE_DIR "/launch/scenes/drive-nothing.yaml", &r);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "drive-nothing.yaml: a drive has no end"));
    assert_false(exists(f->folder, "recording"));
}

static int sim_with_a_full_disk(int argc, char **argv)
{
    struct rlimit limit = {5000, 5000};
    return setrlimit(RLIMIT_FSIZE, &limit) ? 99 : command_sim(argc, argv);
}

static void a_full_disk_ends_with_1_and_leaves_nothing(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    char *words[] = {"sim", (char *)scene_path, "--out", f->out, NULL};
    command_run(&r, sim_with_a_full_disk, words);
    assert_int_equal(r.code, 1);
    assert_non_null(strstr(r.err, ".wav"));
    assert_false(exists(f->folder, "recording"));
}

static void wrong_arguments_are_refused(void **state)
{
    struct fixture *f = *state;
    struct command_result r;
    char *nothing[] = {"sim", NULL}, *no_out[] = {"sim", "x.yaml", NULL};
    char *typo[] = {"sim", "x.yaml", "--outt", f->out, NULL};
    char *two[] = {"sim", "x.yaml", "y.yaml", "--out", f->out, NULL};
    char **all[] = {nothing, no_out, typo, two};
    static const char *const texts[] = {"SCENE.yaml is missing", "--out DIR is missing",
                                        "did you mean --out?", "y.yaml: unexpected"};
    for (size_t i = 0; i < 4; i++) {
        command_run(&r, command_sim, all[i]);
        assert_int_equal(r.code, 2);
        assert_non_null(strstr(r.err, texts[i]));
    }
}

#define test(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        test(the_recording_fits_its_own_survey),
        test(the_truth_names_the_mirrored_place),
        test(equal_scenes_give_equal_recordings_on_any_number_of_threads),
        test(a_recording_that_is_there_is_not_overwritten),
        test(a_survey_or_a_truth_made_by_hand_is_not_overwritten),
        test(a_wrong_scene_is_refused_by_name),
        test(a_drive_is_refused),
        test(a_full_disk_ends_with_1_and_leaves_nothing),
        test(wrong_arguments_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
