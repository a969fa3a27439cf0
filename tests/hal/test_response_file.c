/* The factory files of the paper's microphones; skipped where they are not. */
#include "scratch.h"

#include <errno.h>
#include <math.h>

#include "hal/response_file.h"

#define FOLDER SOURCE_DIR "/../shared/data/microphone-calibration"

static struct survey_response load(const char *serial)
{
    struct complaint why = {.text = ""};
    struct survey_response r;
    if (response_load(&r, FOLDER, serial, &why))
        fail_msg("%s", why.text);
    return r;
}

static void a_dayton_file_begins_after_its_sensitivity(void **state)
{
    struct survey_response r = load("15449");
    (void)state;
    assert_string_equal(r.serial, "15449");
    assert_true(r.frequency_hz[0] == 20 && r.gain_db[0] == -1.4);
    response_clear(&r);
}

static void a_minidsp_file_begins_after_its_quoted_line(void **state)
{
    struct survey_response r = load("7033921");
    (void)state;
    assert_true(r.frequency_hz[0] == 10.054 && r.gain_db[0] == -3.1627);
    assert_true(r.frequency_hz[1] == 10.179 && r.gain_db[1] == -3.0074);
    response_clear(&r);
}

static void gains_are_linear_in_db_between_points_and_constant_outside(void **state)
{
    struct survey_response r = load("7033921");
    double middle_hz = (10.054 + 10.179) / 2, middle_db = (-3.1627 - 3.0074) / 2;
    size_t last = r.n_points - 1;
    (void)state;
    assert_true(fabs(response_gain(&r, middle_hz) / pow(10, middle_db / 20) - 1) < 1e-12);
    assert_true(fabs(response_gain(&r, 1) / pow(10, -3.1627 / 20) - 1) < 1e-12);
    assert_true(fabs(response_gain(&r, 1e6) / pow(10, r.gain_db[last] / 20) - 1) < 1e-12);
    response_clear(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_dayton_file_begins_after_its_sensitivity),
        cmocka_unit_test(a_minidsp_file_begins_after_its_quoted_line),
        cmocka_unit_test(gains_are_linear_in_db_between_points_and_constant_outside),
    };
    struct stat st;
    if (stat(FOLDER, &st)) {
        printf("skipped: %s is not there\n", FOLDER);
        return 77;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
