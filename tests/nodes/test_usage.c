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

struct kept {
    const char *out;
    bool json;
    size_t jobs;
};

static const struct usage_option options[] = {
    {"out", USAGE_TEXT(struct kept, out), .letter = 'o'},
    {"json", USAGE_FLAG(struct kept, json)},
    {"jobs", USAGE_COUNT(struct kept, jobs, 2, 8), .letter = 'j'},
    {"base", USAGE_VALUE('b')},
    {"wait", USAGE_SWITCH('w')},
    {.name = NULL},
};

static void what_is_only_kept_goes_where_the_table_says(void **state)
{
    char *argv[] = {(char *)"x",      (char *)"--out", (char *)"a",      (char *)"word",
                    (char *)"--base", (char *)"7",     (char *)"--json", (char *)"-j3",
                    (char *)"--wait", (char *)"-o",    (char *)"b",      NULL};
    struct kept k = {.jobs = 5};
    struct usage u = {.command = "x", .options = options, .into = &k};
    const int argc = sizeof argv / sizeof *argv - 1;

    (void)state;
    assert_int_equal(usage_next(&u, argc, argv), 'b');
    assert_string_equal(optarg, "7");
    assert_string_equal(k.out, "a");
    assert_false(k.json);
    assert_int_equal(k.jobs, 5);
    assert_int_equal(usage_next(&u, argc, argv), 'w');
    assert_true(k.json);
    assert_int_equal(k.jobs, 3);
    assert_int_equal(usage_next(&u, argc, argv), 0);
    assert_string_equal(k.out, "b");
    assert_int_equal(optind, argc - 1);
    assert_string_equal(argv[optind], "word");
}

static int read_options(int argc, char **argv)
{
    struct kept k = {.jobs = 5};
    struct usage u = {
        .command = "x", .help = "how it goes\n", .options = options, .into = &k};
    int code;

    while ((code = usage_next(&u, argc, argv)) > 0)
        ;
    return ~code;
}

static void a_wrong_option_ends_with_what_is_wrong_with_it(void **state)
{
    static const struct {
        const char *word, *err;
    } cases[] = {
        {"--jobs=1", "anlos x: --jobs 1: expected a number from 2 to 8\n"},
        {"-j9", "anlos x: --jobs 9: expected a number from 2 to 8\n"},
        {"--jsno", "anlos x: --jsno: no such option; did you mean --json?\n"},
        {"--hlep", "anlos x: --hlep: no such option; did you mean --help?\n"},
        {"--json=1", "anlos x: --json: takes no value\n"},
        {"--out", "anlos x: --out: expected a value after it\n"},
        {"-w", "anlos x: -w: no such option\n"}, /* it has no short form */
    };
    struct command_result r;

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char *const argv[] = {(char *)"x", (char *)cases[i].word, NULL};
        command_run(&r, read_options, argv);
        assert_int_equal(r.code, 2);
        assert_memory_equal(r.err, cases[i].err, strlen(cases[i].err));
    }
    char *const help[] = {(char *)"x", (char *)"-h", NULL};
    command_run(&r, read_options, help);
    assert_int_equal(r.code, 0);
    assert_string_equal(r.out, "how it goes\n");
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
        cmocka_unit_test(what_is_only_kept_goes_where_the_table_says),
        cmocka_unit_test(a_wrong_option_ends_with_what_is_wrong_with_it),
        cmocka_unit_test(a_wrong_argument_of_a_launch_is_told_from_a_missing_value),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
