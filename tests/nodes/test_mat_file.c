/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "nodes/anlos/mat_file.h"
#include "tests/nodes/mat_write.h"

static char path[64];

static int set_up(void **state)
{
    (void)state;
    strcpy(path, "/tmp/anlos-mat-XXXXXX");
    int fd = mkstemp(path);
    return fd < 0 || close(fd);
}

static int tear_down(void **state)
{
    (void)state;
    return unlink(path);
}

static struct mat_file *open_file(void)
{
    struct mat_file *f;
    struct error why = {""};
    if (mat_file_open(&f, path, &why))
        fail_msg("%s", why.text);
    return f;
}

static const enum mat_ft versions[2] = {MAT_FT_MAT5, MAT_FT_MAT73};

#define EXPECT_CLASS(class, type)                                                        \
    do {                                                                                 \
        type x[6] = {0, 1, 2, 3, 100, 127};                                              \
        mat_t *mat = Mat_CreateVer(path, NULL, versions[v]);                             \
        mat_put(mat, "x", class, 2, 3, x, NULL);                                         \
        Mat_Close(mat);                                                                  \
        expect_numbers();                                                                \
    } while (0)

/* 2 x 3: 0 2 100 / 1 3 127. */
static void expect_numbers(void)
{
    static const double expected[6] = {0, 1, 2, 3, 100, 127};
    struct mat_file *f = open_file();
    size_t n[2];
    float *x;
    double *y;
    float complex *z;
    assert_int_equal(mat_file_read_float(f, "x", 2, n, &x, NULL), 0);
    assert_int_equal(n[0], 2);
    assert_int_equal(n[1], 3);
    assert_int_equal(mat_file_read_double(f, "x", 2, n, &y, NULL), 0);
    assert_int_equal(mat_file_read_complex(f, "x", 2, n, &z, NULL), 0);
    for (int i = 0; i < 6; i++)
        assert_true((double)x[i] == expected[i] && y[i] == expected[i] &&
                    (double)crealf(z[i]) == expected[i] && cimagf(z[i]) == 0.0f);
    free(x);
    free(y);
    free(z);
    mat_file_close(f);
}

static void every_class_is_read_in_both_formats(void **state)
{
    (void)state;
    for (int v = 0; v < 2; v++) {
        EXPECT_CLASS(MAT_C_DOUBLE, double);
        EXPECT_CLASS(MAT_C_SINGLE, float);
        EXPECT_CLASS(MAT_C_INT8, int8_t);
        EXPECT_CLASS(MAT_C_UINT8, uint8_t);
        EXPECT_CLASS(MAT_C_INT16, int16_t);
        EXPECT_CLASS(MAT_C_UINT16, uint16_t);
        EXPECT_CLASS(MAT_C_INT32, int32_t);
        EXPECT_CLASS(MAT_C_UINT32, uint32_t);
        EXPECT_CLASS(MAT_C_INT64, int64_t);
        EXPECT_CLASS(MAT_C_UINT64, uint64_t);
    }
}

static void complex_data_keep_their_parts(void **state)
{
    (void)state;
    for (int v = 0; v < 2; v++) {
        float re[4] = {1, 2, 3, 4}, im[4] = {-1, 0.5f, 0, 1e-20f};
        mat_t *mat = Mat_CreateVer(path, NULL, versions[v]);
        mat_put(mat, "z", MAT_C_SINGLE, 4, 1, re, im);
        Mat_Close(mat);
        struct mat_file *f = open_file();
        struct error why = {""};
        size_t n[2];
        float complex *z;
        float *x;
        assert_int_equal(mat_file_read_complex(f, "z", 2, n, &z, NULL), 0);
        assert_true(n[0] == 4 && n[1] == 1);
        for (int i = 0; i < 4; i++)
            assert_true(crealf(z[i]) == re[i] && cimagf(z[i]) == im[i]);
        free(z);
        assert_int_equal(mat_file_read_float(f, "z", 2, n, &x, &why), -EINVAL);
        assert_non_null(strstr(why.text, "z: is complex"));
        mat_file_close(f);
    }
}

static void doubles_keep_all_their_digits(void **state)
{
    (void)state;
    double value = 0.1234567890123456;
    mat_t *mat = Mat_CreateVer(path, NULL, MAT_FT_MAT73);
    mat_put_number(mat, "x", value);
    Mat_Close(mat);
    struct mat_file *f = open_file();
    double back;
    assert_int_equal(mat_file_read_number(f, "x", &back, NULL), 0);
    assert_true(back == value);
    mat_file_close(f);
}

static void what_does_not_suit_is_named(void **state)
{
    (void)state;
    double x[8] = {0}, nan = NAN;
    size_t dims[3] = {2, 2, 2}, n[3];
    for (int v = 0; v < 2; v++) {
        struct error why = {""};
        mat_t *mat = Mat_CreateVer(path, NULL, versions[v]);
        matvar_t *cube = Mat_VarCreate("cube", MAT_C_DOUBLE, MAT_T_DOUBLE, 3, dims, x, 0);
        size_t name_dims[2] = {1, 3};
        matvar_t *text =
            Mat_VarCreate("text", MAT_C_CHAR, MAT_T_UINT8, 2, name_dims, "abc", 0);
        Mat_VarWrite(mat, cube, 0);
        Mat_VarWrite(mat, text, 0);
        mat_put(mat, "pair", MAT_C_DOUBLE, 1, 2, x, NULL);
        mat_put(mat, "nan", MAT_C_DOUBLE, 1, 1, &nan, NULL);
        Mat_Close(mat);
        Mat_VarFree(cube);
        Mat_VarFree(text);
        struct mat_file *f = open_file();
        double value;
        assert_true(mat_file_has(f, "cube") && !mat_file_has(f, "none"));
        assert_int_equal(mat_file_extents(f, "cube", 2, n, &why), -EINVAL);
        assert_non_null(strstr(why.text, "cube: 3 dimensions, expected 2"));
        assert_int_equal(mat_file_extents(f, "cube", 3, n, &why), 0);
        assert_true(n[0] == 2 && n[1] == 2 && n[2] == 2);
        assert_int_equal(mat_file_extents(f, "pair", 3, n, &why), 0);
        assert_true(n[0] == 1 && n[1] == 2 && n[2] == 1);
        assert_int_equal(mat_file_extents(f, "none", 2, n, &why), -ENOENT);
        assert_non_null(strstr(why.text, "expected a variable none"));
        assert_int_equal(mat_file_extents(f, "text", 2, n, &why), -EINVAL);
        assert_non_null(strstr(why.text, "text: expected an array of numbers"));
        assert_int_equal(mat_file_read_number(f, "pair", &value, &why), -EINVAL);
        assert_non_null(strstr(why.text, "pair: 1 x 2, expected one number"));
        assert_int_equal(mat_file_read_number(f, "nan", &value, &why), -EINVAL);
        mat_file_close(f);
    }
}

static void other_files_are_refused(void **state)
{
    (void)state;
    struct mat_file *f;
    struct error why = {""};
    assert_int_equal(mat_file_open(&f, "/nowhere/x.mat", &why), -ENOENT);
    assert_non_null(strstr(why.text, "/nowhere/x.mat"));
    assert_int_equal(mat_file_open(&f, path, &why), -EINVAL); /* empty */
    assert_non_null(strstr(why.text, "expected a MATLAB file"));
    FILE *text = fopen(path, "w");
    for (int i = 0; i < 100; i++)
        fputs("this is not a MATLAB file\n", text);
    fclose(text);
    assert_int_equal(mat_file_open(&f, path, &why), -EINVAL);
    assert_int_equal(mat_file_open(&f, "/tmp", &why), -EISDIR);
}

/* Cut anywhere, a file either still reads as it was or says that it does not. */
static void a_truncated_file_is_an_error(void **state)
{
    (void)state;
    static float x[5000];
    unsigned seed = 1;
    for (int i = 0; i < 5000; i++)
        x[i] = (float)(seed = seed * 1664525u + 1013904223u);
    for (int v = 0; v < 2; v++) {
        mat_t *mat = Mat_CreateVer(path, NULL, versions[v]);
        mat_put(mat, "x", MAT_C_SINGLE, 50, 100, x, NULL);
        Mat_Close(mat);
        FILE *whole = fopen(path, "r");
        fseek(whole, 0, SEEK_END);
        long size = ftell(whole);
        fclose(whole);
        for (int part = 9; part >= 0; part -= 3) {
            struct mat_file *f;
            struct error why = {""};
            size_t n[2];
            float *y;
            assert_int_equal(truncate(path, size * part / 10), 0);
            int err = mat_file_open(&f, path, &why);
            if (!err) {
                err = mat_file_read_float(f, "x", 2, n, &y, &why);
                if (!err) {
                    assert_memory_equal(x, y, sizeof x);
                    free(y);
                }
                mat_file_close(f);
            }
            assert_true(err < 0);
            assert_true(why.text[0]);
        }
    }
}

/* 16384 x 16384 doubles out of 200 bytes. */
static void a_file_that_claims_more_than_it_can_hold_is_refused(void **state)
{
    (void)state;
    static const unsigned char extents[8] = {0, 64, 0, 0, 0, 64, 0, 0};
    double one = 1.0, *out;
    size_t n[2];
    struct error why = {""};
    mat_t *mat = Mat_CreateVer(path, NULL, MAT_FT_MAT5);
    matvar_t *v =
        Mat_VarCreate("x", MAT_C_DOUBLE, MAT_T_DOUBLE, 2, (size_t[]){1, 1}, &one, 0);
    assert_int_equal(Mat_VarWrite(mat, v, MAT_COMPRESSION_NONE), 0);
    Mat_VarFree(v);
    Mat_Close(mat);
    FILE *f = fopen(path, "r+");
    assert_int_equal(fseek(f, 128 + 8 + 16 + 8, SEEK_SET), 0); /* of the dimensions */
    assert_int_equal(fwrite(extents, 1, 8, f), 8);
    fclose(f);
    struct mat_file *file = open_file();
    assert_int_equal(mat_file_read_double(file, "x", 2, n, &out, &why), -EIO);
    assert_non_null(strstr(why.text, "more than the file can hold"));
    mat_file_close(file);
}

static int end_by; /* the signal that ends each process that is forked; 0: none */

static void meet_end(void)
{
    if (end_by) {
        signal(end_by, SIG_DFL);
        raise(end_by);
    }
}

/* What a damaged file can do to libmatio is an error of that file, and no more. */
static void a_crash_of_the_library_is_an_error(void **state)
{
    (void)state;
    static const struct {
        int end_by;
        const char *words;
    } ends[] = {{SIGSEGV, "damaged: the MATLAB library cannot read it"},
                {SIGKILL, "damaged: the MATLAB library cannot read it"},
                {SIGXCPU, "takes longer to read"},
                {SIGALRM, "takes longer to read"}};
    float x[2] = {1, 2}, *out;
    size_t n[2];
    mat_t *mat = Mat_CreateVer(path, NULL, MAT_FT_MAT5);
    mat_put(mat, "x", MAT_C_SINGLE, 1, 2, x, NULL);
    Mat_Close(mat);
    struct mat_file *f = open_file();
    assert_int_equal(pthread_atfork(NULL, NULL, meet_end), 0);
    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++) {
        struct error why = {""};
        end_by = ends[i].end_by;
        assert_int_equal(mat_file_read_float(f, "x", 2, n, &out, &why), -EIO);
        assert_non_null(strstr(why.text, ends[i].words));
        assert_false(mat_file_has(f, "x"));
    }
    end_by = 0;
    assert_int_equal(mat_file_read_float(f, "x", 2, n, &out, NULL), 0);
    free(out);
    mat_file_close(f);
}

static void a_pipe_is_not_waited_for(void **state)
{
    (void)state;
    struct mat_file *f;
    struct error why = {""};
    assert_int_equal(unlink(path), 0);
    assert_int_equal(mkfifo(path, 0600), 0);
    assert_int_equal(mat_file_open(&f, path, &why), -EINVAL);
    assert_non_null(strstr(why.text, "not a regular file"));
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(every_class_is_read_in_both_formats),
        TEST(complex_data_keep_their_parts),
        TEST(doubles_keep_all_their_digits),
        TEST(what_does_not_suit_is_named),
        TEST(other_files_are_refused),
        TEST(a_truncated_file_is_an_error),
        TEST(a_file_that_claims_more_than_it_can_hold_is_refused),
        TEST(a_crash_of_the_library_is_an_error),
        TEST(a_pipe_is_not_waited_for),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
