#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "dsp/microphone.h"
#include "tests/dsp/near.h"

#define CALIBRATION SOURCE_DIR "/../shared/data/microphone-calibration"

/* Loads a microphone from text by way of a file. */
static int load_text(struct microphone *m, const char *text, size_t *line)
{
    char path[] = "/tmp/anlos-microphone-XXXXXX";
    int fd = mkstemp(path), err;
    FILE *f;

    assert_true(fd >= 0);
    f = fdopen(fd, "w");
    assert_non_null(f);
    assert_true(fputs(text, f) >= 0);
    assert_int_equal(fclose(f), 0);
    err = microphone_load(m, path, line);
    unlink(path);
    return err;
}

static void the_dayton_format_is_read(void **state)
{
    struct microphone m;
    size_t line;

    (void)state;
    assert_int_equal(
        load_text(&m, "*1000Hz\t-41.1\n\t\n20.00\t-1.4\n20.55\t-1.2\n20000.00\t7.6\n",
                  &line),
        0);
    assert_int_equal(m.n_points, 3);
    assert_near(m.frequency_hz[1], 20.55, 1e-12);
    assert_near(m.gain_db[2], 7.6, 1e-12);
    microphone_clear(&m);
    assert_null(m.gain_db);
}

static void the_minidsp_format_is_read_with_its_line_ends(void **state)
{
    struct microphone m;
    size_t line;

    (void)state;
    assert_int_equal(load_text(&m,
                               "\"Sens Factor =-2.790dB, SERNO: 7033921\"\r\n"
                               "10.054\t-3.1627\r\n10.179\t-3.0074\r\n\r\n",
                               &line),
                     0);
    assert_int_equal(m.n_points, 2);
    assert_near(m.gain_db[0], -3.1627, 1e-12);
    microphone_clear(&m);
}

static void a_malformed_line_is_named(void **state)
{
    static const struct {
        const char *text;
        size_t line;
    } cases[] = {
        {"*1000Hz\t-41.1\n20 1\n30 x\n40 2\n", 3},
        {"20 1\n30\n", 2},
        {"20 1\n30 2\n30 3\n", 3},
        {"20 1\n\n19 2\n", 3},
        {"20 1\n30 inf\n", 2},
        {"20 1\n30 nan\n", 2},
        {"20 1\n30 1e9\n", 2},
        {"20 1\n30 2dB\n", 2},
        {"20 1\n*1000Hz\t-41.1\n", 2},
    };
    struct microphone m;
    size_t line;

    (void)state;
    for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
        assert_int_equal(load_text(&m, cases[i].text, &line), -EINVAL);
        assert_int_equal(line, cases[i].line);
    }
}

static void a_file_without_points_is_an_error_of_line_0(void **state)
{
    struct microphone m;
    size_t line = 7;

    (void)state;
    assert_int_equal(load_text(&m, "", &line), -EINVAL);
    assert_int_equal(line, 0);
    line = 7;
    assert_int_equal(load_text(&m, "*1000Hz\t-41.1\nnothing here\n", &line), -EINVAL);
    assert_int_equal(line, 0);
}

static void what_cannot_be_read_says_why(void **state)
{
    struct microphone m;
    size_t line;

    (void)state;
    assert_int_equal(microphone_load(&m, "/nonexistent/microphone.txt", &line), -ENOENT);
    assert_int_equal(microphone_load(&m, "/", &line), -EISDIR);
}

static void gain_is_linear_in_db_between_points_and_constant_outside(void **state)
{
    double f[] = {100.0, 200.0, 1000.0}, g[] = {0.0, 6.0, -20.0};
    struct microphone m = {3, f, g};

    (void)state;
    assert_near(microphone_gain(&m, 1.0), 1.0, 1e-12);
    assert_near(microphone_gain(&m, 150.0), 1.4125375446227544, 1e-12); /* 3 dB */
    assert_near(microphone_gain(&m, 200.0), 1.9952623149688795, 1e-12);
    assert_near(microphone_gain(&m, 600.0), 0.4466835921509631, 1e-12); /* -7 dB */
    assert_near(microphone_gain(&m, 1e5), 0.1, 1e-12);
}

/* Points read with awk from the files themselves: 20 Hz, 20 kHz, and their number. */
static void the_factory_files_are_read(void **state)
{
    struct microphone m;
    size_t line;

    (void)state;
    if (access(CALIBRATION, R_OK)) {
        print_message("skipped: no %s\n", CALIBRATION);
        skip();
    }
    assert_int_equal(microphone_load(&m, CALIBRATION "/15449.txt", &line), 0);
    assert_int_equal(m.n_points, 256);
    assert_near(m.gain_db[0], -1.4, 1e-12);
    assert_near(m.gain_db[255], 7.6, 1e-12);
    microphone_clear(&m);
    assert_int_equal(microphone_load(&m, CALIBRATION "/7033921.txt", &line), 0);
    assert_int_equal(m.n_points, 615);
    assert_near(m.gain_db[614], -0.1468, 1e-12);
    microphone_clear(&m);
    assert_int_equal(microphone_load(&m, CALIBRATION "/channel_mapping.txt", &line),
                     -EINVAL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_dayton_format_is_read),
        cmocka_unit_test(the_minidsp_format_is_read_with_its_line_ends),
        cmocka_unit_test(a_malformed_line_is_named),
        cmocka_unit_test(a_file_without_points_is_an_error_of_line_0),
        cmocka_unit_test(what_cannot_be_read_says_why),
        cmocka_unit_test(gain_is_linear_in_db_between_points_and_constant_outside),
        cmocka_unit_test(the_factory_files_are_read),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
