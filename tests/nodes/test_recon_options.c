/* SPDX-License-Identifier: MIT */
/* `anlos recon` with and without a method, its options, and a point spread function. */
#include <jansson.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <unistd.h>

#include <cmocka.h>

#include "tests/nodes/recorded.h"

#define WORDS 32

/* Runs recon on the recording with further words. */
static void run(const struct recorded *f, struct command_result *r, char *const more[])
{
    char *words[WORDS] = {"recon",        "--survey",       (char *)f->survey,
                          "--wav",        (char *)f->scene, "--out",
                          (char *)f->out, "--background",   (char *)f->background};
    size_t n = 9;
    while (*more && n + 1 < WORDS)
        words[n++] = *more++;
    command_run(r, command_recon, words);
}
#define MORE(...) ((char *const[]){__VA_ARGS__, NULL})

static void expect_worked(const struct command_result *r)
{
    if (r->code)
        fail_msg("code %d: %s", r->code, r->err);
}

static json_t *load_report(const struct recorded *f)
{
    char path[192];
    snprintf(path, sizeof path, "%s/report.json", f->out);
    json_t *j = json_load_file(path, 0, NULL);
    assert_non_null(j);
    return j;
}

static void options_reach_the_report(void **state)
{
    const struct recorded *f = *state;
    struct command_result r;
    run(f, &r,
        MORE("--method", "iterative", "--set", "base=backprojection", "--set", "l1=0.5",
             "--set", "iterations=5"));
    expect_worked(&r);
    json_t *j = load_report(f);
    const json_t *o = json_object_get(j, "options");
    assert_true(json_number_value(json_object_get(o, "l1")) == 0.5);
    assert_int_equal(json_integer_value(json_object_get(o, "iterations")), 5);
    assert_string_equal(json_string_value(json_object_get(o, "base")), "backprojection");
    assert_true(json_number_value(json_object_get(o, "tv")) == 0.01); /* the default */
    assert_true(json_is_false(json_object_get(o, "tv_isotropic")));
    assert_non_null(json_object_get(o, "coherence")); /* of the base */
    assert_null(json_object_get(o, "snr_db"));
    assert_null(json_object_get(j, "method_because")); /* it was asked for */
    json_decref(j);
}

/* Whether it converged, in the report and in words. */
static void expect_result(const struct recorded *f, const char *limit, bool converged)
{
    struct command_result r;
    run(f, &r,
        MORE("--method", "iterative", "--set", (char *)limit, "--set", "tolerance=0.05"));
    expect_worked(&r);
    json_t *j = load_report(f);
    const json_t *result = json_object_get(j, "result");
    double residual = json_number_value(json_object_get(result, "residual"));
    assert_int_equal(json_is_true(json_object_get(result, "converged")), converged);
    assert_int_equal(residual <= 0.05, converged);
    size_t n = (size_t)json_integer_value(json_object_get(result, "iterations"));
    assert_true(converged ? n > 2 && n < 200 : n == 2);
    assert_string_equal(json_string_value(json_object_get(result, "dmo")), "never");
    assert_int_equal(json_array_size(json_object_get(j, "warnings")), !converged);
    json_decref(j);
    assert_int_equal(strstr(r.err, "iterative has not converged: after 2 iter") != NULL,
                     !converged);
    assert_int_equal(strstr(r.out, ": not converged") != NULL, !converged);
    assert_non_null(strstr(r.out, "dmo never; "));
}

static void how_iterations_ended_is_told(void **state)
{
    expect_result(*state, "iterations=200", true);
    expect_result(*state, "iterations=2", false);
}

static size_t count_lit(const struct recorded *f)
{
    char path[192];
    int before = 0, c;
    size_t lit = 0;
    float v;
    snprintf(path, sizeof path, "%s/volume.nrrd", f->out);
    FILE *volume = fopen(path, "rb");
    assert_non_null(volume);
    while ((c = fgetc(volume)) != EOF && !(before == '\n' && c == '\n'))
        before = c;
    while (fread(&v, sizeof v, 1, volume) == 1)
        lit += v > 0.0f;
    fclose(volume);
    return lit;
}

/* Also when nothing but the option differs. */
static void options_reach_the_method(void **state)
{
    const struct recorded *f = *state;
    struct command_result r;
    size_t lit[2];
    char *const weights[2] = {"l1=0", "l1=0.5"};
    for (int i = 0; i < 2; i++) {
        run(f, &r,
            MORE("--method", "iterative", "--set", "tv=0", "--set", "iterations=30",
                 "--set", weights[i]));
        expect_worked(&r);
        lit[i] = count_lit(f);
    }
    assert_true(lit[1] > 0);
    assert_true(4 * lit[1] < lit[0]);
}

static void a_method_that_nobody_named_is_told_with_the_reason(void **state)
{
    const struct recorded *f = *state;
    struct command_result r;
    run(f, &r, MORE("--threads", "1"));
    expect_worked(&r);
    assert_non_null(strstr(r.out, "method fast (the default)"));
    json_t *j = load_report(f);
    assert_string_equal(json_string_value(json_object_get(j, "method")), "fast");
    assert_string_equal(json_string_value(json_object_get(j, "method_because")),
                        "the default");
    const json_t *options = json_object_get(j, "options");
    assert_int_equal(json_object_size(options), 2);
    assert_string_equal(json_string_value(json_object_get(options, "dmo")), "auto");
    const json_t *result = json_object_get(j, "result");
    assert_int_equal(json_object_size(result), 1);
    assert_string_equal(json_string_value(json_object_get(result, "dmo")), "never");
    assert_true(json_number_value(json_object_get(options, "sharpen")) == 0.0);
    json_decref(j);
}

static void an_option_of_another_method_is_refused(void **state)
{
    const struct recorded *f = *state;
    struct command_result r;
    run(f, &r, MORE("--set", "l1=0.1")); /* also when the method is the default */
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "--set l1: method 'fast' does not use it"));
    assert_int_equal(access(f->out, F_OK), -1);
}

static void make_psf(const struct recorded *f, char path[192])
{
    struct command_result r;
    char folder[192];
    snprintf(folder, sizeof folder, "%s/psf", f->folder);
    char *words[] = {"psf",
                     "--survey",
                     (char *)f->survey,
                     "--wav",
                     (char *)f->scene,
                     "--background",
                     (char *)f->background,
                     "--out",
                     folder,
                     NULL};
    command_run(&r, command_psf, words);
    expect_worked(&r);
    snprintf(path, 192, "%.160s/psf/psf.json", f->folder);
}

static void a_measured_function_is_used(void **state)
{
    const struct recorded *f = *state;
    struct command_result r;
    char path[192];
    run(f, &r, MORE("--method", "iterative", "--set", "iterations=5"));
    size_t without = count_lit(f);
    make_psf(f, path);
    run(f, &r, MORE("--method", "iterative", "--psf", path, "--set", "iterations=5"));
    expect_worked(&r);
    assert_null(strstr(r.err, "psf.json"));
    assert_int_not_equal(count_lit(f), without);
    json_t *j = load_report(f);
    assert_string_equal(json_string_value(json_object_get(j, "psf")), path);
    json_decref(j);
    run(f, &r,
        MORE("--method", "iterative", "--psf", path, "--set", "iterations=5", "--set",
             "base=backprojection"));
    expect_worked(&r);
    assert_non_null(strstr(r.err, "of an image by fast, but the base is backprojection"));
}

static void a_function_that_is_not_there_is_told(void **state)
{
    const struct recorded *f = *state;
    struct command_result r;
    run(f, &r, MORE("--method", "iterative", "--psf", "/none/psf.json"));
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "/none/psf.json: No such file"));
    run(f, &r, MORE("--method", "iterative", "--psf", (char *)f->survey));
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "expected psf.json as anlos psf wrote it"));
    assert_int_equal(access(f->out, F_OK), -1);
}

#define test(name) cmocka_unit_test_teardown(name, recorded_forget_results)

int main(void)
{
    const struct CMUnitTest tests[] = {
        test(options_reach_the_report),
        test(how_iterations_ended_is_told),
        test(options_reach_the_method),
        test(a_method_that_nobody_named_is_told_with_the_reason),
        test(an_option_of_another_method_is_refused),
        test(a_measured_function_is_used),
        test(a_function_that_is_not_there_is_told),
    };
    return cmocka_run_group_tests(tests, recorded_create, recorded_destroy);
}
