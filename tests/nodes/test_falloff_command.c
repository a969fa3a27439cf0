/* SPDX-License-Identifier: MIT */
/* `anlos falloff` and `anlos resolution`, on simulated scenes and their charts. */
#include <cairo.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "nodes/anlos/commands.h"
#include "nodes/rt/export_chart.h"
#include "tests/hal/folder.h"
#include "tests/nodes/command.h"
#include "tests/nodes/near.h"

static char folder[64];

static int set_up(void **state)
{
    (void)state;
    strcpy(folder, "/tmp/anlos-falloff-XXXXXX");
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

static void simulate(const char *scene, const char *name)
{
    struct command_result r;
    static char path[512];
    snprintf(path, sizeof path, "%s/launch/scenes/%s", SOURCE_DIR, scene);
    char *words[] = {"sim", path, "--out", path_of(name), NULL};
    command_run(&r, command_sim, words);
    if (r.code)
        fail_msg("%s", r.err);
}

static double slope_after(const char *text, const char *set)
{
    const char *at = strstr(text, set);
    at = at ? strstr(at, "slope ") : NULL;
    return at ? strtod(at + 6, NULL) : 0.0;
}

/* A png that cairo reads, with more than one colour. */
static void expect_picture(const char *name)
{
    char path[160];
    snprintf(path, sizeof path, "%s.png", path_of(name));
    cairo_surface_t *s = cairo_image_surface_create_from_png(path);
    assert_int_equal(cairo_surface_status(s), CAIRO_STATUS_SUCCESS);
    const unsigned char *data = cairo_image_surface_get_data(s);
    int stride = cairo_image_surface_get_stride(s), coloured = 0;
    for (int y = 0; y < cairo_image_surface_get_height(s); y++)
        for (int x = 0; x < cairo_image_surface_get_width(s); x++) {
            const unsigned char *p = data + y * stride + 4 * x;
            coloured += abs(p[0] - p[2]) > 60;
        }
    assert_true(coloured > 500);
    cairo_surface_destroy(s);
    snprintf(path, sizeof path, "%s.svg", path_of(name));
    FILE *f = fopen(path, "r");
    char head[200] = "";
    assert_non_null(f);
    assert_true(fread(head, 1, sizeof head - 1, f) > 0);
    fclose(f);
    assert_non_null(strstr(head, "<svg"));
}

/* Lindell 2019, Fig. 4: both mirror, so power falls with the square of the distance. */
static void a_wall_and_a_corner_fall_off_with_the_square(void **state)
{
    (void)state;
    struct command_result r;
    simulate("falloff-wall.yaml", "wall");
    simulate("falloff-corner.yaml", "corner");
    char *words[] = {"falloff", "--set",           "flat",  path_of("wall"), "--set",
                     "retro",   path_of("corner"), "--out", path_of("out"),  NULL};
    command_run(&r, command_falloff, words);
    if (r.code)
        fail_msg("%s", r.err);
    assert_near(slope_after(r.out, "flat"), -2.0, 0.02);
    assert_near(slope_after(r.out, "retro"), -2.0, 0.05);
    assert_non_null(strstr(r.out, "over 12 echoes"));
    expect_picture("out/falloff");
    FILE *csv = fopen(path_of("out/falloff.csv"), "r");
    char line[200];
    int lines = 0;
    assert_non_null(csv);
    while (fgets(line, sizeof line, csv))
        lines++;
    fclose(csv);
    assert_int_equal(lines, 1 + 24);
}

static void falloff_says_what_it_needs(void **state)
{
    (void)state;
    struct command_result r;
    char *nothing[] = {"falloff", NULL};
    command_run(&r, command_falloff, nothing);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "expected one RECORDING or more"));
    char *missing[] = {"falloff", path_of("none"), NULL};
    command_run(&r, command_falloff, missing);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "none/survey.yaml"));
    char *explained[] = {"falloff", path_of("none"), "--help", NULL};
    command_run(&r, command_falloff, explained);
    assert_int_equal(r.code, 0);
    assert_non_null(strstr(r.out, "usage: anlos falloff"));
    char *unknown[] = {"falloff", path_of("none"), "--nosuch", NULL};
    command_run(&r, command_falloff, unknown);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "--nosuch: no such option"));
    char *empty[] = {"falloff", "--set", "lonely", NULL};
    command_run(&r, command_falloff, empty);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "lonely: 0 echoes; expected two or more distances"));
}

static const char survey[] =
    "sound_speed_m_s: 343\nsample_rate_hz: 48000\nslot_samples: 3000\n"
    "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.0625}\n"
    "speakers_m: [[0, 0, 0], [1, 0, 0]]\nmicrophones_m: [[0, 0, 0], [1, 0, 0]]\n";

/* Confocal pairs 0.5 m aside at 3 m: 343 / 36000 * hypot(0.5, 3) / (2 * 0.5) = 2.90 cm.
 */
static void resolution_prints_equation_15(void **state)
{
    (void)state;
    struct command_result r;
    char *path = path_of("survey.yaml");
    FILE *f = fopen(path, "w");
    fputs(survey, f);
    fclose(f);
    char *words[] = {"resolution", "--survey", path, "--out", path_of("chart"), NULL};
    command_run(&r, command_resolution, words);
    if (r.code)
        fail_msg("%s", r.err);
    const char *row = strstr(r.out, "     3.00 ");
    assert_non_null(row);
    double numbers[4] = {0};
    char *end;
    for (int i = 0; i < 2; i++, row = end)
        numbers[i] = strtod(row, &end);
    assert_near(numbers[1], 2.90, 0.005);
    assert_non_null(strstr(row, "-")); /* y: no aperture */
    expect_picture("chart/resolution");
}

static void resolution_says_what_it_needs(void **state)
{
    (void)state;
    struct command_result r;
    char *nothing[] = {"resolution", NULL};
    command_run(&r, command_resolution, nothing);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "--survey FILE is missing"));
    char *missing[] = {"resolution", "--survey", path_of("none.yaml"), NULL};
    command_run(&r, command_resolution, missing);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "none.yaml"));
}

static void a_chart_leaves_out_what_it_cannot_show(void **state)
{
    (void)state;
    struct error why = {""};
    const double x[5] = {1.0, 2.0, NAN, 4.0, 5.0}, y[5] = {1.0, -1.0, 10.0, 1e30, 100.0};
    const struct chart_series series[2] = {
        {.name = "line", .x = x, .y = y, .n = 5, .style = CHART_LINE},
        {.x = x, .y = y, .n = 5, .style = CHART_RINGS, .colour = 1}};
    struct chart chart = {.title = "chart",
                          .label = {"x", "y"},
                          .logarithmic = {false, true},
                          .min = {0.0, 0.1},
                          .max = {6.0, 1000.0},
                          .series = series,
                          .n_series = 2};
    assert_int_equal(export_chart(folder, "chart", &chart, &why), 0);
    expect_picture("chart");
    chart.min[1] = 0.0; /* no logarithm */
    assert_true(export_chart(folder, "other", &chart, &why) < 0);
    assert_non_null(strstr(why.text, "the axis y is empty"));
    chart.min[1] = 0.1;
    chart.max[0] = 0.0;
    assert_true(export_chart(folder, "other", &chart, &why) < 0);
    assert_int_equal(access(path_of("other.svg"), F_OK), -1);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_wall_and_a_corner_fall_off_with_the_square),
        TEST(falloff_says_what_it_needs),
        TEST(resolution_prints_equation_15),
        TEST(resolution_says_what_it_needs),
        TEST(a_chart_leaves_out_what_it_cannot_show),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
