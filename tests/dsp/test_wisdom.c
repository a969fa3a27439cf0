#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <dirent.h>
#include <errno.h>
#include <fftw3.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "dsp/wisdom.h"

static char folder[PATH_MAX];

static int setup(void **state)
{
    (void)state;
    strcpy(folder, "/tmp/anlos-wisdom-XXXXXX");
    fftwf_forget_wisdom();
    return !mkdtemp(folder) || setenv("XDG_CACHE_HOME", folder, 1);
}

static int teardown(void **state)
{
    char path[PATH_MAX + 64];

    (void)state;
    snprintf(path, sizeof(path), "%s/.cache/anlos/fftwf.wisdom", folder);
    unlink(path);
    snprintf(path, sizeof(path), "%s/.cache/anlos", folder);
    rmdir(path);
    snprintf(path, sizeof(path), "%s/.cache", folder);
    rmdir(path);
    snprintf(path, sizeof(path), "%s/anlos/fftwf.wisdom", folder);
    unlink(path);
    snprintf(path, sizeof(path), "%s/anlos", folder);
    rmdir(path);
    return rmdir(folder); /* fails when anything is left over */
}

/* Whether FFTW can plan this length without measuring. */
static int length_is_known(void)
{
    float *a = fftwf_malloc(2 * 96 * sizeof(float)),
          *b = fftwf_malloc(2 * 96 * sizeof(float));
    fftwf_plan p;
    int known;

    assert_true(a && b);
    p = fftwf_plan_dft_1d(96, (fftwf_complex *)a, (fftwf_complex *)b, FFTW_FORWARD,
                          FFTW_MEASURE | FFTW_PRESERVE_INPUT | FFTW_WISDOM_ONLY);
    known = p != NULL;
    if (p)
        fftwf_destroy_plan(p);
    fftwf_free(a);
    fftwf_free(b);
    return known;
}

static void length_learn(void)
{
    float *a = fftwf_malloc(2 * 96 * sizeof(float)),
          *b = fftwf_malloc(2 * 96 * sizeof(float));
    fftwf_plan p;

    assert_true(a && b);
    p = fftwf_plan_dft_1d(96, (fftwf_complex *)a, (fftwf_complex *)b, FFTW_FORWARD,
                          FFTW_MEASURE | FFTW_PRESERVE_INPUT);
    assert_non_null(p);
    fftwf_destroy_plan(p);
    fftwf_free(a);
    fftwf_free(b);
}

static void what_was_saved_is_known_after_loading(void **state)
{
    (void)state;
    assert_false(length_is_known());
    length_learn();
    assert_int_equal(wisdom_save(), 0);
    fftwf_forget_wisdom();
    assert_false(length_is_known());
    assert_int_equal(wisdom_load(), 0);
    assert_true(length_is_known());
    assert_int_equal(wisdom_save(), 0); /* replaces the file */
}

static void without_a_cache_folder_it_goes_into_the_home(void **state)
{
    char path[PATH_MAX + 64];

    (void)state;
    assert_int_equal(setenv("HOME", folder, 1), 0);
    assert_int_equal(setenv("XDG_CACHE_HOME", "relative/is/ignored", 1), 0);
    length_learn();
    assert_int_equal(wisdom_save(), 0);
    snprintf(path, sizeof(path), "%s/.cache/anlos/fftwf.wisdom", folder);
    assert_int_equal(access(path, R_OK), 0);
}

static void nothing_stored_is_no_harm(void **state)
{
    (void)state;
    assert_int_equal(wisdom_load(), -ENOENT);
}

static void no_home_is_no_harm(void **state)
{
    (void)state;
    unsetenv("HOME");
    unsetenv("XDG_CACHE_HOME");
    assert_int_equal(wisdom_load(), -ENOENT);
    assert_int_equal(wisdom_save(), -ENOENT);
}

static void a_file_of_something_else_is_refused(void **state)
{
    char path[PATH_MAX + 64];
    FILE *f;

    (void)state;
    assert_int_equal(wisdom_save(), 0);
    snprintf(path, sizeof(path), "%s/anlos/fftwf.wisdom", folder);
    f = fopen(path, "w");
    assert_non_null(f);
    assert_true(fputs("(no wisdom at all", f) >= 0);
    assert_int_equal(fclose(f), 0);
    assert_int_equal(wisdom_load(), -EINVAL);
}

/* Also for root, whom permissions do not stop: a file stands where the folder should. */
static void an_unwritable_place_is_no_harm(void **state)
{
    char path[PATH_MAX + 64];
    FILE *f;

    (void)state;
    snprintf(path, sizeof(path), "%s/anlos", folder);
    f = fopen(path, "w");
    assert_non_null(f);
    assert_int_equal(fclose(f), 0);
    length_learn();
    assert_true(wisdom_save() < 0);
    assert_int_equal(wisdom_load(), -ENOTDIR);
    assert_int_equal(unlink(path), 0);
    assert_int_equal(setenv("XDG_CACHE_HOME", "/proc/none", 1), 0);
    assert_true(wisdom_save() < 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(what_was_saved_is_known_after_loading, setup,
                                        teardown),
        cmocka_unit_test_setup_teardown(without_a_cache_folder_it_goes_into_the_home,
                                        setup, teardown),
        cmocka_unit_test_setup_teardown(nothing_stored_is_no_harm, setup, teardown),
        cmocka_unit_test_setup_teardown(no_home_is_no_harm, setup, teardown),
        cmocka_unit_test_setup_teardown(a_file_of_something_else_is_refused, setup,
                                        teardown),
        cmocka_unit_test_setup_teardown(an_unwritable_place_is_no_harm, setup, teardown),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
