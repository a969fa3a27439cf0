/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "nodes/rt/uri.h"

static void assert_text(char *got, const char *expected)
{
    assert_non_null(got);
    assert_string_equal(got, expected);
    free(got);
}

static void a_scheme_ends_at_the_colon(void **state)
{
    (void)state;
    assert_true(uri_has_scheme("sim:a.yaml", "sim"));
    assert_false(uri_has_scheme("simulated:a.yaml", "sim"));
    assert_false(uri_has_scheme("sim", "sim"));
}

static void the_path_stands_between_scheme_and_options(void **state)
{
    (void)state;
    assert_text(uri_path("sim:scenes/a.yaml?pace=real"), "scenes/a.yaml");
    assert_text(uri_path("sim:?pace=real"), "");
}

static void relative_paths_are_put_into_the_folder(void **state)
{
    (void)state;
    assert_text(uri_in_folder("sim:a.yaml", "/launch"), "sim:/launch/a.yaml");
    assert_text(uri_in_folder("log:a?interface=can1", "out"), "log:out/a?interface=can1");
}

static void absolute_and_empty_paths_stay(void **state)
{
    (void)state;
    assert_text(uri_in_folder("sim:/a.yaml", "/launch"), "sim:/a.yaml");
    assert_text(uri_in_folder("sim:?pace=fast", "/launch"), "sim:?pace=fast");
    assert_text(uri_in_folder("none:", "/launch"), "none:");
}

static void a_path_in_an_option_is_put_into_the_folder(void **state)
{
    (void)state;
    assert_text(uri_option_in_folder("wav:/a?background=b&x=y", "/l", "background"),
                "wav:/a?background=/l/b&x=y");
    assert_text(uri_option_in_folder("wav:a?x=1&background=/b", "/l", "background"),
                "wav:a?x=1&background=/b");
    assert_text(uri_option_in_folder("wav:a?notbackground=b", "/l", "background"),
                "wav:a?notbackground=b");
}

static void an_option_is_added_or_replaced(void **state)
{
    (void)state;
    assert_text(uri_set_option("sim:a", "pace", "real"), "sim:a?pace=real");
    assert_text(uri_set_option("sim:a?x=1", "pace", "real"), "sim:a?x=1&pace=real");
    assert_text(uri_set_option("sim:?pace=fast&x=1", "pace", "real"),
                "sim:?pace=real&x=1");
}

static void what_there_is_no_memory_for_replaces_nothing(void **state)
{
    (void)state;
    char *uri = uri_set_option("sim:a", "pace", "fast");
    assert_int_equal(uri_replace(&uri, NULL), -ENOMEM);
    assert_string_equal(uri, "sim:a?pace=fast");
    assert_int_equal(uri_replace(&uri, uri_set_option(uri, "pace", "real")), 0);
    assert_text(uri, "sim:a?pace=real");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_scheme_ends_at_the_colon),
        cmocka_unit_test(the_path_stands_between_scheme_and_options),
        cmocka_unit_test(relative_paths_are_put_into_the_folder),
        cmocka_unit_test(absolute_and_empty_paths_stay),
        cmocka_unit_test(a_path_in_an_option_is_put_into_the_folder),
        cmocka_unit_test(an_option_is_added_or_replaced),
        cmocka_unit_test(what_there_is_no_memory_for_replaces_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
