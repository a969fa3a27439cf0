/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>
#include <unistd.h>

#include "command.h"
#include "nodes/anlos/usage.h"
#include "nodes/rt/arguments.h"

static void a_name_that_is_nearly_one_is_found_and_others_are_not(void **state)
{
    static const char *const names[] = {"launch", "topic", "top", "view", NULL};

    (void)state;
    assert_string_equal(usage_nearest("tpoic", names), "topic"); /* two changes */
    assert_string_equal(usage_nearest("launhc", names), "launch");
    assert_string_equal(usage_nearest("to", names), "top");
    assert_null(usage_nearest("xyzzy", names));
    assert_null(usage_nearest("v", names)); /* a letter is near to everything */
    assert_null(usage_nearest("", names));
}

static void a_wrong_argument_of_a_launch_is_told_from_a_missing_value(void **state)
{
    static const struct {
        const char *words[6];
        const char *text;
    } cases[] = {
        {{"launch", "a.yaml", "--nosuch"}, "--nosuch: no such option; see --help"},
        {{"launch", "a.yaml", "--rate"}, "--rate: its value is missing; see --help"},
        {{"launch", "a.yaml", "--out", "--realtime"},
         "--out: its value is missing; see --help"},
        {{"launch", "a.yaml", "b.yaml"},
         "b.yaml: unexpected, a.yaml is the launch file; see --help"},
    };

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct arguments a;
        struct error why = {""};
        char *argv[7] = {NULL};
        int argc = 0;
        for (; argc < 6 && cases[i].words[argc]; argc++)
            argv[argc] = (char *)cases[i].words[argc];
        assert_int_equal(arguments_parse(&a, argc, argv, &why), -EINVAL);
        assert_string_equal(why.text, cases[i].text);
    }
}

static int run_anlos(int argc, char **argv)
{
    (void)argc;
    execv(BINARY_DIR "/bin/anlos", argv);
    return 127;
}

static void a_command_that_is_nearly_one_is_named(void **state)
{
    char *const near[] = {(char *)"anlos", (char *)"lanuch", NULL};
    char *const far[] = {(char *)"anlos", (char *)"xyzzy", NULL};
    struct command_result r;

    (void)state;
    command_run(&r, run_anlos, near);
    assert_int_equal(r.code, 2);
    assert_string_equal(r.err, "anlos: lanuch: no such command; did you mean launch?; "
                               "see anlos --help\n");
    command_run(&r, run_anlos, far);
    assert_int_equal(r.code, 2);
    assert_string_equal(r.err, "anlos: xyzzy: no such command; see anlos --help\n");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_name_that_is_nearly_one_is_found_and_others_are_not),
        cmocka_unit_test(a_command_that_is_nearly_one_is_named),
        cmocka_unit_test(a_wrong_argument_of_a_launch_is_told_from_a_missing_value),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
