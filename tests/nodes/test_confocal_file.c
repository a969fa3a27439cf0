/* SPDX-License-Identifier: MIT */
/* Optical scans: points in closed form written as MATLAB files. */
#include <dirent.h>
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "nodes/anlos/commands.h"
#include "nodes/anlos/confocal/confocal.h"
#include "nodes/anlos/confocal/scan.h"
#include "tests/nodes/command.h"
#include "tests/nodes/mat_write.h"
#include "tests/nodes/near.h"
#include "tests/nodes/optical_point.h"

static char path[40];

static int set_up(void **state)
{
    (void)state;
    strcpy(path, "/tmp/anlos-confocal-XXXXXX");
    setenv("XDG_CACHE_HOME", path, 1); /* no folder: nothing is kept */
    int fd = mkstemp(path);
    return fd < 0 || close(fd);
}

static int tear_down(void **state)
{
    (void)state;
    return unlink(path);
}

static void put_counts(mat_t *mat, size_t n_x, size_t n_y, size_t n_bins, double *counts)
{
    size_t dims[3] = {n_x, n_y, n_bins};
    matvar_t *v =
        Mat_VarCreate("rect_data", MAT_C_DOUBLE, MAT_T_DOUBLE, 3, dims, counts, 0);
    assert_non_null(v);
    assert_int_equal(Mat_VarWrite(mat, v, MAT_COMPRESSION_ZLIB), 0);
    Mat_VarFree(v);
}

static double counts[PLACES * PLACES * BINS];

/* With width and bin_s when they are not 0. */
static void write_scan(enum mat_ft version, double width_m, double bin)
{
    mat_t *mat = Mat_CreateVer(path, NULL, version);
    assert_non_null(mat);
    put_counts(mat, PLACES, PLACES, BINS, counts);
    if (width_m != 0.0)
        mat_put_number(mat, "width", width_m);
    if (bin != 0.0)
        mat_put_number(mat, "bin_s", bin);
    Mat_Close(mat);
}

static void scales_and_order_are_those_of_the_file(void **state)
{
    static const enum mat_ft versions[2] = {MAT_FT_MAT5, MAT_FT_MAT73};
    (void)state;
    optical_point_fill(counts);
    for (int v = 0; v < 2; v++) {
        struct confocal_file f;
        struct confocal_scan s;
        struct error why = {""};
        write_scan(versions[v], half_side_m, bin_s);
        assert_int_equal(confocal_file_load(&f, path, &why), 0);
        assert_true(f.nx == PLACES && f.ny == PLACES && f.n_bins == BINS);
        assert_near(f.pitch_x_m, 0.04, 1e-12);
        assert_near(f.bin_m, 0.5 * CONFOCAL_LIGHT_M_S * bin_s, 1e-15);
        const double all_m[2] = {0.0, 10.0};
        assert_int_equal(confocal_scan_create(&s, &f, all_m, BINS, 0.0, &why), 0);
        assert_int_equal(s.n, BINS);
        for (int y = 0; y < PLACES; y++)
            for (int x = 0; x < PLACES; x++)
                for (int b = 0; b < BINS; b += 7)
                    assert_near(
                        s.counts[(y * PLACES + x) * BINS + b],
                        counts[(b * PLACES + PLACES - 1 - y) * PLACES + PLACES - 1 - x],
                        1e-3);
        confocal_scan_clear(&s);
        confocal_file_clear(&f);
    }
}

static void four_picoseconds_are_the_default(void **state)
{
    (void)state;
    struct confocal_file f;
    optical_point_fill(counts);
    write_scan(MAT_FT_MAT5, half_side_m, 0.0);
    assert_int_equal(confocal_file_load(&f, path, NULL), 0);
    assert_near(f.bin_m, 0.5 * CONFOCAL_LIGHT_M_S * 4e-12, 1e-15);
    confocal_file_clear(&f);
}

static void groups_of_bins_keep_all_light_and_their_place(void **state)
{
    (void)state;
    struct confocal_file f;
    struct confocal_scan s;
    optical_point_fill(counts);
    write_scan(MAT_FT_MAT5, half_side_m, bin_s);
    assert_int_equal(confocal_file_load(&f, path, NULL), 0);
    const double gate_m[2] = {9.5 * f.bin_m, 70.5 * f.bin_m}; /* bins 10..70: 61 */
    assert_int_equal(confocal_scan_create(&s, &f, gate_m, 20, 0.0, NULL), 0);
    assert_int_equal(s.n, 15); /* of 4 bins */
    assert_near(s.range_m, 11.5 * f.bin_m, 1e-12);
    assert_near(s.range_step_m, 4.0 * f.bin_m, 1e-12);
    double sum = 0.0;
    for (int g = 0; g < 4; g++)
        sum += counts[(22 + g) * PLACES * PLACES + PLACES * PLACES - 1];
    assert_near(s.counts[3], sum, 1e-3);
    confocal_scan_clear(&s);
    assert_int_equal(confocal_scan_create(&s, &f, gate_m, 20, 6.1 * f.bin_m, NULL), 0);
    assert_int_equal(s.n, 10);
    confocal_scan_clear(&s);
    confocal_file_clear(&f);
}

static void the_gate_begins_between_direct_light_and_echo(void **state)
{
    (void)state;
    struct confocal_file f;
    double gate_m[2];
    optical_point_fill(counts);
    write_scan(MAT_FT_MAT5, half_side_m, bin_s);
    assert_int_equal(confocal_file_load(&f, path, NULL), 0);
    confocal_file_gate(&f, gate_m);
    assert_true(gate_m[0] > 0.15 && gate_m[0] < 0.47);
    assert_near(gate_m[1], BINS * f.bin_m, 1e-9);
    confocal_file_clear(&f);
}

static void a_point_is_where_it_is_with_every_method(void **state)
{
    (void)state;
    optical_point_fill(counts);
    write_scan(MAT_FT_MAT5, half_side_m, bin_s);
    for (const char *m = confocal_methods(); *m; m += strlen(m) + 1) {
        struct recon_options o = {.confocal = path, .method = m, .threads = 2};
        struct confocal_job job;
        struct error why = {""};
        size_t best = 0;
        if (confocal_job_run(&job, &o, &why))
            fail_msg("%s: %s", m, why.text);
        for (size_t v = 0; v < grid_size(&job.grid); v++) {
            assert_true(isfinite(job.intensity[v]) && job.intensity[v] >= 0.0f);
            best = job.intensity[v] > job.intensity[best] ? v : best;
        }
        const struct grid *g = &job.grid;
        const size_t i[3] = {best % g->n[0], best / g->n[0] % g->n[1],
                             best / (g->n[0] * g->n[1])};
        for (int a = 0; a < 3; a++) /* half a voxel of 4 cm; a pulse */
            assert_near(g->origin_m[a] + (double)i[a] * g->step_m[a], at_m[a],
                        a < 2 ? 0.0201 : 0.01);
        confocal_job_clear(&job);
    }
}

static size_t most_threads; /* of this process, as it forked */

static void count_threads(void)
{
    size_t n = 0;
    DIR *d = opendir("/proc/self/task");
    assert_non_null(d);
    for (struct dirent *e = readdir(d); e; e = readdir(d))
        n += e->d_name[0] != '.';
    closedir(d);
    most_threads = n > most_threads ? n : most_threads;
}

/* What a thread has locked stays locked in the child, which would wait for ever: one that
 * was just started held a lock of AddressSanitizer's.  Before there were other threads.
 */
static void who_forks_has_no_threads(void **state)
{
    (void)state;
    struct recon_options o = {.confocal = path, .method = "lct", .threads = 4};
    struct confocal_job job;
    struct error why = {""};
    optical_point_fill(counts);
    write_scan(MAT_FT_MAT5, half_side_m, bin_s);
    assert_int_equal(pthread_atfork(count_threads, NULL, NULL), 0);
    assert_int_equal(confocal_job_run(&job, &o, &why), 0);
    assert_int_equal(most_threads, 1);
    confocal_job_clear(&job);
}

/* -- what is wrong with a file ----------------------------------------------------------
 */

static void expect_refusal(const char *text)
{
    char out[80];
    struct command_result r;
    snprintf(out, sizeof out, "%s-out", path);
    char *words[] = {"recon", "--confocal", path, "--out", out, NULL};
    command_run(&r, command_recon, words);
    if (r.code != 2 || !strstr(r.err, text))
        print_error("code %d, \"%s\" without \"%s\"\n", r.code, r.err, text);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, path));
    assert_non_null(strstr(r.err, text));
    assert_int_equal(access(out, F_OK), -1);
}

static void bad_files_are_told_by_variable(void **state)
{
    (void)state;
    optical_point_fill(counts);
    write_scan(MAT_FT_MAT5, 0.0, 0.0);
    expect_refusal("width");
    write_scan(MAT_FT_MAT5, -1.0, 0.0);
    expect_refusal("width: -1");
    write_scan(MAT_FT_MAT5, half_side_m, 4.0);
    expect_refusal("bin_s: 4");
    memset(counts, 0, sizeof counts);
    write_scan(MAT_FT_MAT73, half_side_m, bin_s);
    expect_refusal("nothing but zeros");
    mat_t *mat = Mat_CreateVer(path, NULL, MAT_FT_MAT5);
    mat_put_number(mat, "width", half_side_m);
    Mat_Close(mat);
    expect_refusal("rect_data");
    mat = Mat_CreateVer(path, NULL, MAT_FT_MAT5);
    mat_put_number(mat, "width", half_side_m);
    put_counts(mat, PLACES, 1, BINS, counts);
    Mat_Close(mat);
    expect_refusal("16 x 1 x 300");
    assert_int_equal(truncate(path, 0), 0);
    expect_refusal("MATLAB");
    assert_int_equal(truncate(path, 5000), 0);
    expect_refusal("");
}

static void what_is_not_finite_is_no_light_and_is_counted(void **state)
{
    (void)state;
    struct confocal_file f;
    optical_point_fill(counts);
    counts[1234] = NAN;
    counts[5678] = INFINITY;
    write_scan(MAT_FT_MAT5, half_side_m, bin_s);
    assert_int_equal(confocal_file_load(&f, path, NULL), 0);
    assert_int_equal(f.n_not_finite, 2);
    assert_true(f.counts[1234] == 0.0f && f.counts[5678] == 0.0f);
    confocal_file_clear(&f);
}

static void expect_usage(char *const words[], const char *text)
{
    struct command_result r;
    command_run(&r, command_recon, words);
    assert_int_equal(r.code, 2);
    if (!strstr(r.err, text))
        fail_msg("\"%s\" without \"%s\"", r.err, text);
}

static void wrong_arguments_are_told(void **state)
{
    (void)state;
#define WORDS(...) ((char *const[]){"recon", "--confocal", path, __VA_ARGS__, NULL})
    expect_usage(WORDS("--out", "x", "--method", "fast"), "lct, fk or backprojection");
    expect_usage(WORDS("--out", "x", "--gate-m", "1"), "NEAR,FAR");
    expect_usage(WORDS("--out", "x", "--gate-m", "2,1"), "NEAR,FAR");
    expect_usage(WORDS("--out", "x", "--wav", "y"), "--wav");
    expect_usage(WORDS("--method", "lct"), "--out DIR is missing");
    expect_usage(WORDS("--out", "x", "--psf", "y"), "in place of --psf");
    expect_usage(WORDS("--out", "x", "--set", "l1=0.1"), "method 'lct' does not use it");
    expect_usage(WORDS("--out", "x", "--method", "fk", "--set", "snr_db=9"),
                 "method 'fk' does not use it");
    expect_usage(WORDS("--out", "x", "--window", "hann"), "--window is for chirps");
    expect_usage(WORDS("--out", "x", "--compression", "deramp"),
                 "--compression is for chirps");
#undef WORDS
}

/* Voxels above half of the brightest one's amplitude. */
static size_t spot_size(const char *setting)
{
    struct recon_options o;
    struct imager_options imaging;
    struct confocal_job job;
    struct error why = {""};
    char reason[256];
    float most = 0.0f;
    size_t size = 0;
    recon_options_default(&o, &imaging);
    assert_int_equal(imager_option_set(&imaging, setting, reason, sizeof reason), 0);
    o.confocal = path;
    o.method = "lct";
    o.threads = 1;
    if (confocal_job_run(&job, &o, &why))
        fail_msg("%s", why.text);
    for (size_t v = 0; v < grid_size(&job.grid); v++)
        most = fmaxf(most, job.intensity[v]);
    for (size_t v = 0; v < grid_size(&job.grid); v++)
        size += job.intensity[v] > 0.25f * most;
    confocal_job_clear(&job);
    return size;
}

static void a_trusting_wiener_filter_is_sharper(void **state)
{
    (void)state;
    optical_point_fill(counts);
    write_scan(MAT_FT_MAT5, half_side_m, bin_s);
    size_t careful = spot_size("snr_db=-20"), trusting = spot_size("snr_db=30");
    assert_true(trusting > 0 && 2 * trusting < careful);
}

static void a_gate_without_bins_is_refused(void **state)
{
    (void)state;
    struct command_result r;
    char out[80];
    optical_point_fill(counts);
    write_scan(MAT_FT_MAT5, half_side_m, bin_s);
    snprintf(out, sizeof out, "%s-out", path);
    char *words[] = {"recon", "--confocal", path, "--out", out, "--gate-m", "5,6", NULL};
    command_run(&r, command_recon, words);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "--gate-m"));
}

/* The file ends at 0.72 m. */
static void a_report_has_the_gate_that_there_is_and_no_band_of_counts(void **state)
{
    (void)state;
    static char *const methods[2] = {"lct", "fk"};
    optical_point_fill(counts);
    write_scan(MAT_FT_MAT5, half_side_m, bin_s);
    double end_m = 0.5 * CONFOCAL_LIGHT_M_S * bin_s * BINS;
    for (int i = 0; i < 2; i++) {
        struct command_result r;
        char out[80], report[96], remove[96];
        snprintf(out, sizeof out, "%s-out", path);
        snprintf(report, sizeof report, "%s/report.json", out);
        snprintf(remove, sizeof remove, "rm -r '%s'", out);
        char *words[] = {"recon",    "--confocal", path,       "--out",    out,
                         "--gate-m", "0.2,50",     "--method", methods[i], NULL};
        command_run(&r, command_recon, words);
        assert_int_equal(r.code, 0);
        json_t *j = json_load_file(report, 0, NULL);
        const json_t *gate = json_object_get(j, "gate_m");
        assert_near(json_number_value(json_array_get(gate, 0)), 0.2, 1e-9);
        assert_near(json_number_value(json_array_get(gate, 1)), end_m, 1e-6);
        const json_t *band = json_object_get(j, "band_hz");
        assert_int_equal(json_is_null(band), i == 0);
        assert_int_equal(json_array_size(band), i == 0 ? 0 : 2);
        json_decref(j);
        assert_int_equal(system(remove), 0);
    }
}

#define test(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        test(bad_files_are_told_by_variable), /* these fork: before there are threads */
        test(wrong_arguments_are_told),
        test(a_gate_without_bins_is_refused),
        test(a_report_has_the_gate_that_there_is_and_no_band_of_counts),
        test(who_forks_has_no_threads),
        test(scales_and_order_are_those_of_the_file),
        test(four_picoseconds_are_the_default),
        test(groups_of_bins_keep_all_light_and_their_place),
        test(the_gate_begins_between_direct_light_and_echo),
        test(a_point_is_where_it_is_with_every_method),
        test(a_trusting_wiener_filter_is_sharper),
        test(what_is_not_finite_is_no_light_and_is_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
