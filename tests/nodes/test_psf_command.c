/* SPDX-License-Identifier: MIT */
/* `anlos psf` on a simulated recording of one point, and its file. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "nodes/anlos/psf/file.h"
#include "tests/nodes/near.h"
#include "tests/nodes/recorded.h"

/* point.yaml: the point at z = 0.4 shows at 1.6 - 0.4; midpoints over 0.2 x 0.24 m. */
static const double point_m[3] = {0.13, 0.11, 1.2};
static const double speed_m_s = 343.0, middle_hz = 11000.0, band_hz = 18000.0;
static const double aperture_m[2] = {0.2, 0.24};

static void psf_path(const struct recorded *f, char path[192])
{
    snprintf(path, 192, "%s/psf.json", f->out);
}

/* A rectangular aperture's 1.207 lambda R / 2 D, and c / B of a Hann-windowed band. */
static double expected_width(int axis)
{
    double wavelength_m = speed_m_s / middle_hz;
    return axis == 2 ? speed_m_s / band_hz
                     : 1.207 * wavelength_m * point_m[2] / (2.0 * aperture_m[axis]);
}

static void expect_point(const struct psf *p, double centre_m, double tolerance)
{
    double width_m[3];
    psf_widths(p, width_m);
    for (int a = 0; a < 3; a++) {
        assert_near(p->centre_m[a], point_m[a], centre_m);
        assert_near(width_m[a], expected_width(a), tolerance * expected_width(a));
    }
}

static void load(const struct recorded *f, struct psf_file *p)
{
    struct error why = {""};
    char path[192];
    psf_path(f, path);
    if (psf_file_load(p, path, &why))
        fail_msg("%s", why.text);
}

static void measure(struct recorded *f, struct command_result *r)
{
    char *words[] = {"psf",          "--survey",    f->survey, "--wav", f->scene,
                     "--background", f->background, "--out",   f->out,  NULL};
    command_run(r, command_psf, words);
    if (r->code)
        print_error("%s", r->err);
}

static void a_recorded_point_has_the_aperture_s_widths(void **state)
{
    struct recorded *f = *state;
    struct command_result r;
    struct psf_file p;
    measure(f, &r);
    assert_int_equal(r.code, 0);
    assert_string_equal(r.err, "");
    assert_non_null(strstr(r.out, "24 of 24 pings, method fast"));
    load(f, &p);
    assert_true(p.measured);
    assert_string_equal(p.method, "fast");
    assert_true(p.band_hz[0] == 2000.0 && p.band_hz[1] == 20000.0);
    expect_point(&p.psf, 4e-3, 0.25);
    char path[192];
    snprintf(path, sizeof path, "%s/projection_xy.png", f->out);
    assert_int_equal(access(path, R_OK), 0);
}

static void a_method_may_be_chosen_for_it(void **state)
{
    struct recorded *f = *state;
    struct command_result r;
    char *words[] = {"psf",      "--survey", f->survey, "--wav", f->scene,
                     "--method", "auto",     "--out",   f->out,  NULL};
    command_run(&r, command_psf, words);
    assert_string_equal(r.err, "");
    assert_int_equal(r.code, 0);
}

static void the_geometry_alone_gives_them_too(void **state)
{
    struct recorded *f = *state;
    struct command_result r;
    struct psf_file p;
    char *words[] = {"psf",           "--survey", f->survey, "--at",
                     "0.13,0.11,1.2", "--out",    f->out,    NULL};
    command_run(&r, command_psf, words);
    if (r.code)
        print_error("%s", r.err);
    assert_int_equal(r.code, 0);
    load(f, &p);
    assert_false(p.measured);
    expect_point(&p.psf, 1e-3, 0.25);
}

static void a_place_that_is_not_before_the_array_is_refused(void **state)
{
    struct recorded *f = *state;
    static char *const places[] = {"0.13,0.11,-1.2", "0.13,0.11,0"};
    for (size_t i = 0; i < 2; i++) {
        struct command_result r;
        char *words[] = {"psf", "--survey", f->survey, "--at", places[i], NULL};
        command_run(&r, command_psf, words);
        assert_int_equal(r.code, 2);
        assert_non_null(strstr(r.err, places[i]));
        assert_non_null(strstr(r.err, "not before the array; expected z above 0 m"));
    }
}

static void without_a_folder_it_only_prints(void **state)
{
    struct recorded *f = *state;
    struct command_result r;
    struct stat st;
    char *words[] = {"psf", "--survey", f->survey, "--at", "0.13,0.11,1.2", NULL};
    command_run(&r, command_psf, words);
    assert_int_equal(r.code, 0);
    assert_non_null(strstr(r.out, "-6 dB widths"));
    assert_non_null(strstr(r.out, "residual"));
    assert_int_equal(stat(f->out, &st), -1);
}

/* -- what is not one small corner reflector ---------------------------------------------
 */

enum { POINTS = 3 }; /* at most: x, y, z, scattering length, all in m; none: 0 */

/* point.yaml with other points. */
static int print_onto_a_full_disk(int argc, char **argv)
{
    return freopen("/dev/full", "w", stdout) ? command_psf(argc, argv) : 99;
}

static void what_cannot_be_printed_is_no_success(void **state)
{
    struct recorded *f = *state;
    struct command_result r;
    char *words[] = {"psf", "--survey", f->survey, "--at", "0.13,0.11,1.2", NULL};

    command_run(&r, print_onto_a_full_disk, words);
    assert_int_equal(r.code, 1);
    assert_non_null(strstr(r.err, "standard output: No space left on device"));
}

static void write_points(const char *path, const double points[POINTS][4])
{
    char line[256];
    FILE *from = fopen(SOURCE_DIR "/tests/nodes/point.yaml", "r"), *to = fopen(path, "w");
    assert_true(from && to);
    while (fgets(line, sizeof line, from) && strncmp(line, "objects:", 8))
        fputs(line, to);
    fputs("objects:\n", to);
    for (int i = 0; i < POINTS && points[i][3] > 0.0; i++)
        fprintf(to,
                "  - {name: p%d, kind: point, position_m: [%g, %g, %g], "
                "scattering_length_m: %g}\n",
                i, points[i][0], points[i][1], points[i][2], points[i][3]);
    fputs("noise: {snr_db: 30}\n", to);
    fclose(from);
    fclose(to);
}

static void measure_points(const struct recorded *f, const double points[POINTS][4],
                           struct command_result *r)
{
    char scene[96], folder[96], survey[128], wav[128], background[128];
    snprintf(scene, sizeof scene, "%s/points.yaml", f->folder);
    snprintf(folder, sizeof folder, "%s/points", f->folder);
    snprintf(survey, sizeof survey, "%s/survey.yaml", folder);
    snprintf(wav, sizeof wav, "%s/scene", folder);
    snprintf(background, sizeof background, "%s/background", folder);
    write_points(scene, points);
    char *sim[] = {"sim", scene, "--out", folder, NULL};
    command_run(r, command_sim, sim);
    assert_int_equal(r->code, 0);
    char *words[] = {"psf", "--survey",     survey,     "--wav",
                     wav,   "--background", background, NULL};
    command_run(r, command_psf, words);
    recorded_remove(folder);
}

enum { WIDE_X = 1, WIDE_Z = 2, ONE_MORE = 4, TWO_MORE = 8, OFF = 16, NO_FIT = 32 };

static const char *const told[6] = {
    " cm wide along x, and of a point it would be 10.0: no small corner reflector",
    " cm wide along z, and of a point it would be 1.9: no small corner reflector",
    "1 more place is nearly as bright: expected one corner reflector",
    "2 more places are nearly as bright: expected one corner reflector",
    "the brightest place is no point: the fit is off by 1",
    "the brightest place is no point: no Gaussian fits it",
};

static void what_is_no_lone_point_is_told(void **state)
{
    static const struct {
        double points[POINTS][4];
        int code, told;
    } cases[] = {
        {{{.13, .11, .25, .05}, {.13, .11, .45, .01}}, 0, 0}, /* 14 dB fainter */
        {{{.13, .11, .25, .05}, {.13, .11, .45, .05}}, 0, ONE_MORE},
        {{{.13, .11, .2, .05}, {.13, .11, .4, .05}, {.13, .11, .6, .05}}, 0, TWO_MORE},
        {{{.07, .11, .4, .05}, {.13, .11, .4, .05}, {.19, .11, .4, .05}}, 0, WIDE_X},
        {{{.13, .11, .4, .05}, {.13, .11, .42, .05}}, 0, WIDE_Z | OFF},
        {{{.09, .07, .4, .05}, {.17, .15, .415, .05}}, 0, OFF},
        {{{.08, .06, .4, .05}, {.18, .16, .42, .05}, {.13, .11, .43, .05}}, 2, NO_FIT},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct command_result r;
        int seen = 0;
        measure_points(*state, cases[i].points, &r);
        for (int k = 0; k < 6; k++)
            seen |= strstr(r.err, told[k]) ? 1 << k : 0;
        if (r.code != cases[i].code || seen != cases[i].told)
            fail_msg("case %zu: code %d: %s", i, r.code, r.err);
    }
}

static void silence_is_no_point(void **state)
{
    struct recorded *f = *state;
    struct command_result r;
    char *words[] = {"psf",         "--survey",     f->survey,     "--wav",
                     f->background, "--background", f->background, NULL};
    command_run(&r, command_psf, words);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "the image is empty"));
}

static void expect_refusal(char *const words[], const char *part)
{
    struct command_result r;
    command_run(&r, command_psf, words);
    if (r.code != 2 || !strstr(r.err, part))
        fail_msg("code %d: \"%s\" has no \"%s\"", r.code, r.err, part);
}

static void wrong_arguments_are_told(void **state)
{
    struct recorded *f = *state;
#define PSF(...) ((char *const[]){"psf", __VA_ARGS__, NULL})
    expect_refusal(PSF("--at", "1,2,3"), "--survey FILE is missing");
    expect_refusal(PSF("--survey", f->survey), "--wav DIR or --at X,Y,Z is missing");
    expect_refusal(PSF("--survey", f->survey, "--at", "1,2"), "--at 1,2: expected X,Y,Z");
    expect_refusal(PSF("--survey", f->survey, "--at", "1,2,3", "--wav", f->scene),
                   "--at stands in place of --wav");
    expect_refusal(PSF("--survey", f->survey, "--at", "1,2,3", "--window", "hamming"),
                   "--at stands in place of --window");
    expect_refusal(PSF("--survey", f->survey, "--at", "1,2,3", "--compression", "deramp"),
                   "--at stands in place of --compression");
    expect_refusal(PSF("--survey", f->survey, "--at", "1,2,3", "--set", "sharpen=1"),
                   "--at stands in place of --set");
    expect_refusal(PSF("--survye", f->survey), "did you mean --survey?");
    expect_refusal(PSF("--survey", f->survey, "more"), "more: unexpected");
    expect_refusal(PSF("--survey", f->survey, "--wav", f->scene, "--set", "l1=0.1",
                       "--method", "fast"),
                   "method 'fast' does not use it");
    expect_refusal(PSF("--survey", "/none.yaml", "--at", "1,2,3"),
                   "/none.yaml: No such file");
    expect_refusal(PSF("--survey", f->survey, "--wav", "/none"), "/none");
    expect_refusal(PSF("--survey", f->survey, "--at", "0.1,0.1,1", "--out", f->survey),
                   "cannot be written");
    expect_refusal(PSF("--survey", f->survey, "--wav", f->scene, "--background",
                       f->background, "--volume", "0.02,.24,.02,0,.22,.02,1.0,1.2,0.01"),
                   "lies on the rim of the volume");
#undef PSF
}

static void write_psf(const struct recorded *f, const char *text)
{
    char path[192];
    psf_path(f, path);
    mkdir(f->out, 0777);
    FILE *file = fopen(path, "w");
    fputs(text, file);
    fclose(file);
}

static void a_damaged_file_is_told_by_key(void **state)
{
    struct recorded *f = *state;
    struct error why = {""};
    struct psf_file p;
    char path[192];
    static const struct {
        const char *text, *part;
    } cases[] = {
        {"", "psf.json:1: "},
        {"sound_speed_m_s: 340\n", "expected psf.json as anlos psf wrote it"},
        {"{}", "centre_m: expected an array of 3 numbers"},
        {"{\"centre_m\": [0, 0, 1], \"covariance_m2\": [1, 0, 0, 1, 0]}",
         "covariance_m2: expected an array of 6 numbers"},
        {"{\"centre_m\": [0, 0, 1], \"covariance_m2\": [1, 2, 0, 1, 0, 1], "
         "\"band_hz\": [2000, 20000]}",
         "positive definite"},
        {"{\"centre_m\": [0, 0, 1], \"covariance_m2\": [1, 0, 0, 1, 0, 1]}", "band_hz"},
        {"{\"centre_m\": [0, 0, 1], \"covariance_m2\": [1, 0, 0, 1, 0, 1], "
         "\"band_hz\": [2000, 20000]}",
         "method: expected"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        write_psf(f, cases[i].text);
        psf_path(f, path);
        assert_int_not_equal(psf_file_load(&p, path, &why), 0);
        if (!strstr(why.text, cases[i].part) || !strstr(why.text, path))
            fail_msg("\"%s\" has no \"%s\"", why.text, cases[i].part);
    }
}

static void what_is_written_is_read_again(void **state)
{
    struct recorded *f = *state;
    struct error why = {""};
    struct psf_file p = {.psf = {.centre_m = {0.1, -0.2, 1.5},
                                 .covariance_m2 = {4e-4, 1e-5, -2e-5, 9e-4, 3e-5, 1e-4},
                                 .residual = 0.02,
                                 .n_voxels = 77},
                         .method = "backprojection",
                         .band_hz = {2000.0, 9000.0},
                         .measured = true},
                    q;
    mkdir(f->out, 0777);
    assert_int_equal(psf_file_write(f->out, &p, &why), 0);
    load(f, &q);
    for (int a = 0; a < 3; a++)
        assert_near(q.psf.centre_m[a], p.psf.centre_m[a], 1e-9);
    for (int i = 0; i < 6; i++)
        assert_near(q.psf.covariance_m2[i], p.psf.covariance_m2[i], 1e-11);
    assert_string_equal(q.method, p.method);
    assert_true(q.measured && q.band_hz[0] == 2000.0 && q.band_hz[1] == 9000.0);
}

#define test(name) cmocka_unit_test_teardown(name, recorded_forget_results)

int main(void)
{
    const struct CMUnitTest tests[] = {
        test(a_recorded_point_has_the_aperture_s_widths),
        test(a_method_may_be_chosen_for_it),
        test(the_geometry_alone_gives_them_too),
        test(a_place_that_is_not_before_the_array_is_refused),
        test(without_a_folder_it_only_prints),
        test(what_cannot_be_printed_is_no_success),
        test(what_is_no_lone_point_is_told),
        test(silence_is_no_point),
        test(wrong_arguments_are_told),
        test(a_damaged_file_is_told_by_key),
        test(what_is_written_is_read_again),
    };
    return cmocka_run_group_tests(tests, recorded_create, recorded_destroy);
}
