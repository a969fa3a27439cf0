/* SPDX-License-Identifier: MIT */
/* Factory curves as two makers deliver them, of ../shared. */
#include "tests/optional.h"

#include "hal/survey/response_file.h"

#define FOLDER SOURCE_DIR "/../shared/data/microphone-calibration"

static struct survey_response load(const char *serial)
{
    struct error why = {.text = ""};
    struct survey_response r;

    optional_needs(FOLDER);
    if (response_load(&r, FOLDER, serial, &why))
        fail_msg("%s", why.text);
    return r;
}

static void a_dayton_file_begins_after_its_sensitivity(void **state)
{
    struct survey_response r = load("15449");
    (void)state;
    assert_string_equal(r.serial, "15449");
    assert_int_equal(r.n_points, 256); /* counted with awk, like the values */
    assert_true(r.gain_db[255] == 7.6);
    assert_true(r.frequency_hz[0] == 20 && r.gain_db[0] == -1.4);
    response_clear(&r);
}

static void a_minidsp_file_begins_after_its_quoted_line(void **state)
{
    struct survey_response r = load("7033921");
    (void)state;
    assert_int_equal(r.n_points, 615);
    assert_true(r.frequency_hz[0] == 10.054 && r.gain_db[0] == -3.1627);
    assert_true(r.frequency_hz[1] == 10.179 && r.gain_db[1] == -3.0074);
    response_clear(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_dayton_file_begins_after_its_sensitivity),
        cmocka_unit_test(a_minidsp_file_begins_after_its_quoted_line),
    };
    return optional_code(cmocka_run_group_tests(tests, NULL, NULL));
}
