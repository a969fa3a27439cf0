/* SPDX-License-Identifier: MIT */
/* `anlos speed-error` and `anlos bench`, on a scene small enough for a test. */
#include <cairo.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/speed_error/noise.h"
#include "nodes/anlos/speed_error/report.h"
#include "nodes/anlos/speed_error/results.h"
#include "tests/hal/folder.h"
#include "tests/nodes/command.h"
#include "tests/nodes/near.h"

static char folder[64];

static int set_up(void **state)
{
    (void)state;
    strcpy(folder, "/tmp/anlos-bench-XXXXXX");
    return mkdtemp(folder) ? setenv("XDG_CACHE_HOME", folder, 1) : -1;
}

static int tear_down(void **state)
{
    (void)state;
    return folder_remove(folder);
}

static char *path_of(const char *name)
{
    static char paths[8][160];
    static int next;
    char *path = paths[next = (next + 1) % 8];
    snprintf(path, sizeof paths[0], "%s/%s", folder, name);
    return path;
}

static char *read_file(const char *name)
{
    static char text[65536];
    FILE *f = fopen(path_of(name), "r");
    if (!f)
        fail_msg("%s is not there", name);
    text[fread(text, 1, sizeof text - 1, f)] = 0;
    fclose(f);
    return text;
}

/* -- the plan ---------------------------------------------------------------------------
 */

static void one_parameter_is_varied_at_a_time(void **state)
{
    (void)state;
    struct bench_case cases[BENCH_MAX_CASES], base = {0};
    size_t n = bench_plan(cases, "iterative", 2, false), bases = 0;
    assert_true(n > 8 && n <= BENCH_MAX_CASES);
    for (size_t i = 0; i < n; i++)
        if (!strcmp(cases[i].varied, "base")) {
            base = cases[i];
            bases++;
        }
    assert_int_equal(bases, 1);
    for (size_t i = 0; i < n; i++) {
        const struct bench_case *c = &cases[i];
        int different =
            (c->step != base.step) + (c->speaker_stride != base.speaker_stride) +
            (c->position_stride != base.position_stride) +
            (c->band_hz[1] != base.band_hz[1] || c->band_hz[0] != base.band_hz[0]) +
            (c->iterations != base.iterations) + (c->threads != base.threads);
        assert_int_equal(different, strcmp(c->varied, "base") ? 1 : 0);
    }
    assert_true(bench_plan(cases, "fast", 2, false) <= BENCH_MAX_CASES);
    assert_true(bench_plan(cases, "fast", 2, true) < bench_plan(cases, "fast", 2, false));
}

static void auto_is_given_goals_and_nothing_else(void **state)
{
    (void)state;
    struct bench_case cases[BENCH_MAX_CASES];
    size_t n = bench_plan(cases, "auto", 2, false), free_runs = 0, budgets = 0,
           errors = 0, equal = 0;
    for (size_t i = 0; i < n; i++) {
        const struct bench_case *c = &cases[i];
        assert_int_equal(c->speaker_stride * c->position_stride, 1);
        assert_true(c->band_hz[1] == 0.0);
        assert_int_equal(c->iterations, 0);
        free_runs += c->budget_s == 0.0 && c->error_m == 0.0 && !c->in_time_of_fast;
        equal += c->in_time_of_fast;
        budgets += c->budget_s > 0.0;
        errors += c->error_m > 0.0;
    }
    assert_int_equal(free_runs, 1);
    assert_int_equal(equal, 1);
    assert_true(budgets >= 3 && errors >= 3);
    n = bench_plan(cases, "fast", 2, false);
    for (size_t i = 0; i < n; i++)
        assert_true(cases[i].budget_s == 0.0 && cases[i].error_m == 0.0 &&
                    !cases[i].in_time_of_fast);
}

static void growth_is_1_4_and_16_times_the_work(void **state)
{
    (void)state;
    struct bench_case cases[BENCH_GROWTH_CASES];
    bench_plan_growth(cases, "fast", 2);
    for (int i = 0; i < BENCH_GROWTH_CASES; i++)
        assert_near(bench_plan_work(&cases[i]), (double)(1 << 2 * (i % 3)), 1e-9);
}

static void what_takes_pairs_and_voxels_grows_with_their_product(void **state)
{
    (void)state;
    struct bench_result known = {.c = {.method = "backprojection", .threads = 2},
                                 .voxels = 1000,
                                 .pairs = 100,
                                 .cost = {.compress_s = 1, .stack_s = 1, .image_s = 10}};
    struct bench_case c = known.c;
    assert_near(bench_case_predict(&c, 3000, 50, &known), 10 * 1.5 + 2 * 0.5, 1e-12);
    c.threads = 1;
    assert_near(bench_case_predict(&c, 1000, 100, &known), 24, 1e-12);
    known.c.method = c.method = "fast";
    c.threads = 2;
    assert_near(bench_case_predict(&c, 3000, 50, &known), 10 * 3 + 2 * 0.5, 1e-12);
}

static void the_front_is_what_nothing_beats(void **state)
{
    (void)state;
    static const double time_s[6] = {1, 2, 3, 4, 2, 0.5}, error_m[6] = {4, 2, 3, 1, 2, 9};
    static const bool expected[6] = {true, true, false, true, true, false};
    struct bench_result r[6] = {{.scene = "s"}};
    struct bench_results all = {.r = r, .n = 6};
    bool front[6];
    for (int i = 0; i < 6; i++) {
        r[i] = (struct bench_result){.scene = "s", .c = {.varied = "base"}};
        r[i].cost.total_s = time_s[i];
        r[i].score = (struct bench_score){.lateral_m = error_m[i], .iou = NAN};
    }
    r[5].c.varied = "growth, pairs"; /* faster than all, but not one that counts */
    bench_results_front(&all, "s", front);
    for (int i = 0; i < 6; i++)
        assert_int_equal(front[i], expected[i]);
    bench_results_front(&all, "another", front);
    for (int i = 0; i < 6; i++)
        assert_false(front[i]);
}

static void the_rival_of_auto_is_the_best_fast_in_its_time(void **state)
{
    (void)state;
    static const double time_s[6] = {1, 2, 3, 5, 1, 1}, error_m[6] = {4, 2, 3, 1, 1, 1};
    struct bench_result r[7] = {{.scene = "s"}};
    struct bench_results all = {.r = r, .n = 7};
    for (int i = 0; i < 6; i++) {
        r[i] = (struct bench_result){.scene = "s",
                                     .c = {.varied = "grid", .method = "fast"}};
        r[i].cost.total_s = time_s[i];
        r[i].score = (struct bench_score){.lateral_m = error_m[i], .iou = NAN};
    }
    r[4].c.method = "paper";
    strcpy(r[5].scene, "another");
    r[6] = (struct bench_result){.scene = "s", .c = {.varied = "base", .method = "auto"}};
    r[6].cost.total_s = 4;
    assert_ptr_equal(bench_results_rival(&all, &r[6]), &r[1]);
    r[6].cost.total_s = 0.5;
    assert_null(bench_results_rival(&all, &r[6]));
    r[6].c.in_time_of_fast = true;
    assert_null(bench_results_rival(&all, &r[6]));
    r[2].c.varied = "base";
    assert_ptr_equal(bench_results_rival(&all, &r[6]), &r[2]);
}

/* -- the command ------------------------------------------------------------------------
 */

static void expect_picture(const char *name)
{
    char file[96];
    snprintf(file, sizeof file, "%s.png", name);
    cairo_surface_t *s = cairo_image_surface_create_from_png(path_of(file));
    assert_int_equal(cairo_surface_status(s), CAIRO_STATUS_SUCCESS);
    cairo_surface_destroy(s);
    snprintf(file, sizeof file, "%s.svg", name);
    assert_non_null(strstr(read_file(file), "<svg"));
}

static void a_recording_is_measured_tabled_and_drawn(void **state)
{
    (void)state;
    struct command_result r;
    char *sim[] = {"sim", SOURCE_DIR "/launch/scenes/point.yaml", "--out",
                   path_of("all/small"), NULL};
    assert_int_equal(mkdir(path_of("all"), 0777), 0);
    command_run(&r, command_sim, sim);
    if (r.code)
        fail_msg("%s", r.err);
    char *words[] = {"speed-error",
                     "--recordings",
                     path_of("all"),
                     "--methods",
                     "fast,auto,backprojection",
                     "--quick",
                     "--seeds",
                     "0",
                     "--out",
                     path_of("out"),
                     NULL};
    command_run(&r, command_speed_error, words);
    if (r.code)
        fail_msg("%s", r.err);
    const char *csv = read_file("out/speed-error.csv");
    const char *base = strstr(csv, "small,fast,\"base\",1/1,1/1,0.45,");
    assert_non_null(base);
    assert_non_null(strstr(csv, "small,auto,\"base\",1/1,1/1,"));
    assert_non_null(strstr(csv, "small,backprojection,\"growth, pairs\",1/4,1/4,"));
    const char *table = read_file("out/speed-error.md");
    assert_non_null(strstr(table, "## small"));
    assert_non_null(strstr(table, "fftw-3"));
    assert_non_null(strstr(table, "| no goal, "));
    assert_non_null(strstr(table, "| within 100 ms, "));
    expect_picture("out/speed-error-small");
    expect_picture("out/growth-time");
    expect_picture("out/growth-memory");
}

static const char silent_point[] =
    "sound_speed_m_s: 343\nsample_rate_hz: 48000\nslot_samples: 1500\n"
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.03125}\n"
    "speakers_m: [[0, 0, 0], [0, 0.1, 0], [0, 0.2, 0], [0, 0.3, 0]]\n"
    "microphones_m: [[0.05, 0, 0], [0.05, 0.1, 0], [0.05, 0.2, 0], [0.05, 0.3, 0]]\n"
    "stage: {axis: [1, 0, 0], positions_m: [0, 0.06, 0.12, 0.18, 0.24, 0.3]}\n"
    "wall: {normal: [0, 0, 1], distance_m: 0.7}\n"
    "direct_level: 0\n"
    "objects:\n"
    "  - {name: p, kind: point, position_m: [0.17, 0.14, 0.4], scattering_length_m: "
    "0.1}\n";

/* No unbiased place is better than the bound; the mean over the noise is taken of 24, so
 * it strays by some 10 %.  Coherent imaging with Hann's window comes within 2 of it. */
static void noise_moves_a_point_by_little_more_than_the_bound(void **state)
{
    (void)state;
    static struct bench_noise b;
    struct bench_scene point;
    struct error why = {""};
    FILE *f = fopen(path_of("silent.yaml"), "w");
    fputs(silent_point, f);
    fclose(f);
    assert_int_equal(bench_scene_simulate(&point, path_of("silent.yaml"), NULL, 1, &why),
                     0);
    assert_null(point.background);
    int err = bench_noise_run(&b, &point, "fast\0sparse\0", 24, 1, &why);
    if (err)
        fail_msg("%s", why.text);
    bench_scene_clear(&point);
    assert_int_equal(b.n_methods, 1); /* sparse is not about noise */
    for (size_t k = 0; k < b.n_levels; k++) {
        if (b.snr_db[k] < -25.0 || b.snr_db[k] > -15.0)
            continue;
        assert_true(b.lateral_m[0][k] > 0.8 * b.unknown[k].lateral_m);
        assert_true(b.lateral_m[0][k] < 2.0 * b.unknown[k].lateral_m);
        assert_true(b.depth_m[0][k] > 0.8 * b.unknown[k].depth_m);
        assert_true(b.depth_m[0][k] < 2.5 * b.unknown[k].depth_m);
    }
    assert_int_equal(bench_noise_write(&b, folder, &why), 0);
    assert_non_null(strstr(read_file("noise.csv"), "fast,-20,24,"));
    assert_int_equal(bench_chart_noise(&b, folder, &why), 0);
    expect_picture("noise-lateral");
    expect_picture("noise-depth");
}

static void wrong_names_give_the_list(void **state)
{
    (void)state;
    struct command_result r;
    char *scene[] = {"speed-error", "--scenes", "nowhere", "--out", path_of("out"), NULL};
    command_run(&r, command_speed_error, scene);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "nowhere: no such scene; expected one of points, "
                                  "corner_reflectors, letter_H, letters_LT"));
    char *method[] = {"bench", "speed-error",  "--methods", "fast,magic",
                      "--out", path_of("out"), NULL};
    command_run(&r, command_bench, method); /* by its old name */
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "this is `anlos speed-error` now"));
    assert_non_null(strstr(r.err, "magic: no such method; expected one of fast, "));
    char *folder_of[] = {"bench",        "speed-error", "--recordings", folder, "--out",
                         path_of("out"), NULL};
    command_run(&r, command_bench, folder_of);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "expected folders with survey.yaml"));
    char *what[] = {"bench", "everything", NULL};
    command_run(&r, command_bench, what);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "everything: expected drive or detection"));
}

static void drives_are_one_at_least_and_noise_may_be_none(void **state)
{
    static const struct {
        const char *what, *seeds, *says;
    } wrong[] = {
        {"drive", "0", "--seeds 0: expected a number from 1 to 1000000"},
        {"drive", "-1", "--seeds -1: expected a number from 1 to 1000000"},
        {"detection", "0", "--seeds 0: expected a number from 1 to 1000000"},
        {"speed-error", "-1", "--seeds -1: expected a number from 0 to 1000000"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        struct command_result r;
        char *words[] = {"bench", "--seeds", (char *)wrong[i].seeds,
                         (char *)wrong[i].what, NULL};
        command_run(&r, command_bench, words);
        assert_int_equal(r.code, 2);
        if (!strstr(r.err, wrong[i].says))
            fail_msg("%s", r.err);
    }
}

static void options_that_a_benchmark_does_not_take_are_refused(void **state)
{
    static const char *const wrong[][5] = {
        {"speed-error", "--rounds", "1"},
        {"speed-error", "--jobs", "1"},
        {"speed-error", "--truth", "truth.csv"},
        {"detection", "--scenes", "points"},
        {"detection", "--recordings", "."},
        {"detection", "--limit-s", "20"},
        {"drive", "--methods", "fast"},
        {"drive", "--recordings", "."},
        {"drive", "--calibration", "."},
        {"drive", "--limit-s", "20"},
        {"drive", "--truth", "truth.csv"},
        {"drive", "--seeds", "3", "--bag", "a.mcap"},
        {"drive", "--rounds", "1", "--bag", "a.mcap"},
        {"drive", "--jobs", "1", "--bag", "a.mcap"},
        {"drive", "--launch", "drive.yaml", "--bag", "a.mcap"},
        {"drive", "--quick", "--bag", "a.mcap"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        struct command_result r;
        char *words[7] = {"bench"};
        for (int k = 0; k < 5; k++)
            words[k + 1] = (char *)wrong[i][k];
        command_run(&r, command_bench, words);
        assert_int_equal(r.code, 2);
        if (!strstr(r.err, wrong[i][1]))
            fail_msg("%s", r.err);
    }
}

static void ctrl_c_keeps_what_is_done(void **state)
{
    (void)state;
    struct command_result sim;
    char text[4096] = "";
    int out, err, status;
    size_t used = 0;
    char *record[] = {"sim", SOURCE_DIR "/launch/scenes/point.yaml", "--out",
                      path_of("all/small"), NULL};
    assert_int_equal(mkdir(path_of("all"), 0777), 0);
    command_run(&sim, command_sim, record);
    char *words[] = {"speed-error", "--recordings", path_of("all"),
                     "--out",       path_of("out"), NULL};
    pid_t pid = command_start(command_speed_error, words, &out, &err);
    ssize_t n = 1;
    while (!strstr(text, "lateral") && n > 0) { /* the first run is done */
        n = read(out, text + used, sizeof text - 1 - used);
        used += n > 0 ? (size_t)n : 0;
    }
    kill(pid, SIGINT);
    char rest[4096];
    while (read(out, rest, sizeof rest) > 0)
        continue;
    n = read(err, text, sizeof text - 1);
    text[n > 0 ? n : 0] = 0;
    close(out);
    close(err);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 130);
    assert_non_null(strstr(text, "interrupted"));
    assert_non_null(strstr(read_file("out/speed-error.csv"), "small,fast,"));
    assert_non_null(strstr(read_file("out/speed-error.md"), "Interrupted"));
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(one_parameter_is_varied_at_a_time),
        TEST(auto_is_given_goals_and_nothing_else),
        TEST(growth_is_1_4_and_16_times_the_work),
        TEST(what_takes_pairs_and_voxels_grows_with_their_product),
        TEST(the_front_is_what_nothing_beats),
        TEST(the_rival_of_auto_is_the_best_fast_in_its_time),
        TEST(a_recording_is_measured_tabled_and_drawn),
        TEST(noise_moves_a_point_by_little_more_than_the_bound),
        TEST(wrong_names_give_the_list),
        TEST(drives_are_one_at_least_and_noise_may_be_none),
        TEST(options_that_a_benchmark_does_not_take_are_refused),
        TEST(ctrl_c_keeps_what_is_done),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
