/* SPDX-License-Identifier: MIT */
/* Who was there, by a file. */
#include "tests/hal/scratch.h"

#include <errno.h>

#include "nodes/anlos/score/drive_truth_file.h"
#include "tests/nodes/near.h"

#define HEAD "time_s,id,kind,x_m,y_m\n"
#define S    INT64_C(1000000000)
#define NOW  (INT64_C(1767225600) * S)

static struct truth_file *load(struct scratch *s, const char *text)
{
    struct error why = {""};
    struct truth_file *f = NULL;

    assert_int_equal(truth_file_load(&f, scratch_write(s, "truth.csv", text), &why), 0);
    return f;
}

static void between_its_rows_a_thing_goes_straight_on(void **state)
{
    struct truth_place p[2];
    struct truth_file *f = load(*state, HEAD "1767225600.25,7,person,2,-1\n"
                                             "1767225600.30,car,car,9,9\n"
                                             "1767225600.75,7,person,2.5,-2\n"
                                             "1767225601.25,7,person,2.5,-2\n"
                                             "1767225601.30,car,car,9,9\n");

    assert_int_equal(truth_file_at(f, NOW + S / 4, p, 2), 1);
    assert_string_equal(p[0].name, "7");
    assert_string_equal(p[0].kind, "person");
    assert_near(p[0].position_m[0], 2.0, 1e-9);
    assert_int_equal(truth_file_at(f, NOW + S / 2, p, 2), 2);
    assert_near(p[0].position_m[0], 2.25, 1e-9);
    assert_near(p[0].position_m[1], -1.5, 1e-9);
    assert_near(p[0].velocity_m_s[0], 1.0, 1e-9);
    assert_near(p[0].velocity_m_s[1], -2.0, 1e-9);
    assert_int_equal(truth_file_at(f, NOW + S, p, 1),
                     2); /* more than there is room for */
    assert_near(p[0].velocity_m_s[0], 0.0, 1e-9);
    truth_file_destroy(f);
}

static void who_has_no_rows_is_not_there(void **state)
{
    struct truth_place p[2];
    struct truth_file *f = load(*state, HEAD "1767225600,a,point,2,-1\n"
                                             "1767225601,a,point,2,-1\n"
                                             "1767225602.5,a,point,2,-1\n"
                                             "1767225603,a,point,2,-1\n");

    assert_int_equal(truth_file_at(f, NOW - 1, p, 2), 0);
    assert_int_equal(truth_file_at(f, NOW, p, 2), 1);
    assert_int_equal(truth_file_at(f, NOW + S + S / 4, p, 2), 0);
    assert_int_equal(truth_file_at(f, NOW + 5 * S / 2, p, 2), 1);
    assert_int_equal(truth_file_at(f, NOW + 3 * S + 1, p, 2), 0);
    truth_file_destroy(f);
}

static void a_file_that_is_wrong_is_refused_by_its_line(void **state)
{
    static const struct {
        const char *text, *said;
    } wrong[] = {
        {"t,x,y\n1,2,3\n", "truth.csv:1: expected time_s,id,kind,x_m,y_m"},
        {HEAD, "no rows"},
        {HEAD "1767225600,a,point,2\n", "truth.csv:2: expected time_s"},
        {HEAD "1767225600,a,point,2,3,4\n", "truth.csv:2: expected time_s"},
        {HEAD "noon,a,point,2,3\n", "truth.csv:2: expected Unix time"},
        {HEAD "-1,a,point,2,3\n", "truth.csv:2: expected Unix time"},
        {HEAD "1767225600,a,point,2,nan\n", "truth.csv:2: expected metres"},
        {HEAD "5,a,point,2,3\n4,a,point,2,3\n", "truth.csv:3: this id has an earlier"},
        {HEAD "4,a,point,2,3\n5,a,car,2,3\n", "truth.csv:3: this id was of another"},
    };

    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        struct error why = {""};
        struct truth_file *f = NULL;
        const char *path = scratch_write(*state, "truth.csv", wrong[i].text);
        assert_int_equal(truth_file_load(&f, path, &why), -EINVAL);
        if (!strstr(why.text, wrong[i].said))
            fail_msg("%s: expected %s", why.text, wrong[i].said);
        assert_null(f);
    }
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(between_its_rows_a_thing_goes_straight_on),
        TEST(who_has_no_rows_is_not_there),
        TEST(a_file_that_is_wrong_is_refused_by_its_line),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
