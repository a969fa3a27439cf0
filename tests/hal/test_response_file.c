/* SPDX-License-Identifier: MIT */
#include "scratch.h"

#include <errno.h>
#include <math.h>

#include "hal/survey/response_file.h"

static void load_text(struct scratch *s, const char *text, struct survey_response *out)
{
    struct error why = {.text = ""};
    scratch_write(s, "mic.txt", text);
    if (response_load(out, s->folder, "mic", &why))
        fail_msg("%s", why.text);
}

static void the_dayton_format_is_read(void **state)
{
    struct survey_response r;
    load_text(*state, "*1000Hz\t-41.1\n\t\n20.00\t-1.4\n20.55\t-1.2\n20000.00\t7.6\n",
              &r);
    assert_string_equal(r.serial, "mic");
    assert_int_equal(r.n_points, 3);
    assert_true(r.frequency_hz[1] == 20.55 && r.gain_db[2] == 7.6);
    response_clear(&r);
    assert_null(r.gain_db);
}

static void the_minidsp_format_is_read_with_its_line_ends(void **state)
{
    struct survey_response r;
    load_text(*state,
              "\"Sens Factor =-2.790dB, SERNO: 7033921\"\r\n"
              "10.054\t-3.1627\r\n10.179\t-3.0074\r\n\r\n",
              &r);
    assert_int_equal(r.n_points, 2);
    assert_true(r.gain_db[0] == -3.1627);
    response_clear(&r);
}

static void a_malformed_line_is_named(void **state)
{
    static const struct {
        const char *text, *rest;
    } cases[] = {
        {"*1000Hz\t-41.1\n20 1\n30 x\n40 2\n", ":3: expected a frequency in Hz and dB"},
        {"20 1\n30\n", ":2: expected a frequency in Hz and dB"},
        {"20 1\n30 inf\n", ":2: expected a frequency in Hz and dB"},
        {"20 1\n30 nan\n", ":2: expected a frequency in Hz and dB"},
        {"20 1\n30 2dB\n", ":2: expected a frequency in Hz and dB"},
        {"20 1\n*1000Hz\t-41.1\n", ":2: expected a frequency in Hz and dB"},
        {"20 1\n30 2\n30 3\n", ":3: frequency 30 Hz does not rise"},
        {"20 1\n\n19 2\n", ":3: frequency 19 Hz does not rise"},
        {"", ": expected lines of frequency in Hz and dB"},
        {"*1000Hz\t-41.1\nnothing here\n", ": expected lines of frequency in Hz and dB"},
    };
    struct scratch *s = *state;
    struct survey_response r;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error why = {.text = ""};
        scratch_write(s, "mic.txt", cases[i].text);
        assert_int_equal(response_load(&r, s->folder, "mic", &why), -EINVAL);
        assert_error(why.text, s->path, cases[i].rest);
    }
}

static void what_cannot_be_read_says_why(void **state)
{
    struct scratch *s = *state;
    struct error why = {.text = ""};
    struct survey_response r;
    assert_int_equal(response_load(&r, s->folder, "none", &why), -ENOENT);
    assert_contains(why.text, "none.txt");
    assert_int_equal(response_load(&r, s->folder, "../mic", &why), -EINVAL);
    scratch_folder(s, "folder.txt");
    assert_true(response_load(&r, s->folder, "folder", &why) < 0);
    assert_contains(why.text, "folder.txt");
}

static void gains_are_linear_in_db_between_points_and_constant_outside(void **state)
{
    struct survey_response r;
    double middle_hz = (10.054 + 10.179) / 2, middle_db = (-3.1627 - 3.0074) / 2;
    load_text(*state, "10.054 -3.1627\n10.179 -3.0074\n20000 7.6\n", &r);
    assert_true(fabs(response_gain(&r, middle_hz) / pow(10, middle_db / 20) - 1) < 1e-12);
    assert_true(fabs(response_gain(&r, 1) / pow(10, -3.1627 / 20) - 1) < 1e-12);
    assert_true(fabs(response_gain(&r, 1e6) / pow(10, 7.6 / 20) - 1) < 1e-12);
    response_clear(&r);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(the_dayton_format_is_read),
        TEST(the_minidsp_format_is_read_with_its_line_ends),
        TEST(a_malformed_line_is_named),
        TEST(what_cannot_be_read_says_why),
        TEST(gains_are_linear_in_db_between_points_and_constant_outside),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
