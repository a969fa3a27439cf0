/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <fcntl.h>
#include <stdlib.h>
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
    assert_null(usage_nearest("nove", names)); /* a quarter of "view" is left */
}

static void a_wrong_argument_of_a_launch_is_told_from_a_missing_value(void **state)
{
    static const struct {
        const char *words[6];
        const char *text;
    } cases[] = {
        {{"launch", "a.yaml", "--nosuch"}, "--nosuch: no such option; see --help"},
        {{"launch", "a.yaml", "--otu=b"},
         "--otu: no such option; did you mean --out?; see --help"},
        {{"launch", "a.yaml", "--realtme"},
         "--realtme: no such option; did you mean --realtime?; see --help"},
        {{"launch", "a.yaml", "--replay=yes"}, "--replay: takes no value; see --help"},
        {{"launch", "a.yaml", "--rate"}, "--rate: its value is missing; see --help"},
        {{"launch", "a.yaml", "--out", "--realtime"},
         "--out: its value is missing; see --help"},
        {{"launch", "a.yaml", "--log-level", "loud"},
         "--log-level: expected debug, info, warning or error, not loud"},
        {{"launch", "a.yaml", "--log-format", "xml"},
         "--log-format: expected text or json, not xml"},
        {{"launch", "--help=out"}, "--help=out: --out has no list of values"},
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
    const char *form, *folder;
    double length_m, angle_deg;
};

static const char *shape(size_t i)
{
    static const char *const names[] = {"round", "square", "flat", NULL};

    return names[i];
}

static const struct usage_option options[] = {
    {"out", USAGE_TEXT(struct kept, out), .letter = 'o'},
    {"json", USAGE_FLAG(struct kept, json)},
    {"jobs", USAGE_COUNT(struct kept, jobs, 2, 8), .letter = 'j'},
    {"base", USAGE_VALUE('b')},
    {"shape", USAGE_NAME('s', shape)},
    {"wait", USAGE_SWITCH('w')},
    {"form", USAGE_TEXT(struct kept, form), .names = shape, .code = 'f'},
    {"folder", USAGE_TEXT(struct kept, folder), .expected = "a folder"},
    {"length-cm", USAGE_NUMBER(struct kept, length_m, USAGE_ABOVE_0, 100), .unit = 0.01,
     .expected = "a length up to 100"},
    {"angle-deg", USAGE_NUMBER(struct kept, angle_deg, -90, 90)},
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

/* One of some names that is kept, and told besides; a number in another unit. */
static void what_is_kept_may_be_a_name_or_a_number_and_have_a_code(void **state)
{
    char *argv[] = {(char *)"x",
                    (char *)"--form=flat",
                    (char *)"--length-cm=100",
                    (char *)"--angle-deg=-90",
                    (char *)"--folder=a",
                    NULL};
    struct kept k = {.jobs = 5};
    struct usage u = {.command = "x", .options = options, .into = &k};
    const int argc = sizeof argv / sizeof *argv - 1;

    (void)state;
    assert_int_equal(usage_next(&u, argc, argv), 'f');
    assert_string_equal(k.form, "flat");
    assert_int_equal(usage_next(&u, argc, argv), 0);
    assert_true(k.length_m == 1.0);
    assert_true(k.angle_deg == -90.0);
    assert_string_equal(k.folder, "a");
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
        {"--shape=blue", "anlos x: --shape blue: expected round, square or flat\n"},
        {"--shape=", "anlos x: --shape : expected round, square or flat\n"},
        {"--shape=sqaure", "anlos x: --shape sqaure: expected round, square or flat; did "
                           "you mean square?\n"},
        {"--form=blue", "anlos x: --form blue: expected round, square or flat\n"},
        {"--folder=", "anlos x: --folder: expected a folder\n"},
        {"--length-cm=0", "anlos x: --length-cm 0: expected a length up to 100\n"},
        {"--length-cm=101", "anlos x: --length-cm 101: expected a length up to 100\n"},
        {"--length-cm=nan", "anlos x: --length-cm nan: expected a length up to 100\n"},
        {"--length-cm=1m", "anlos x: --length-cm 1m: expected a length up to 100\n"},
        {"--length-cm=", "anlos x: --length-cm : expected a length up to 100\n"},
        {"--angle-deg=90.1",
         "anlos x: --angle-deg 90.1: expected a number from -90 to 90\n"},
        {"--help=shpae", "anlos x: --help=shpae: there is no option --shpae\n"},
        {"--help=out", "anlos x: --help=out: --out has no list of values\n"},
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

static void a_value_that_is_one_of_some_is_taken_and_told(void **state)
{
    char *argv[] = {(char *)"x", (char *)"--shape", (char *)"flat", NULL};
    struct usage u = {.command = "x", .options = options};
    struct command_result r;

    (void)state;
    assert_int_equal(usage_next(&u, 3, argv), 's');
    assert_string_equal(optarg, "flat");
    assert_int_equal(choice_index(shape, optarg), 2);
    char *const help[] = {(char *)"x", (char *)"--help=shape", NULL};
    command_run(&r, read_options, help);
    assert_int_equal(r.code, 0);
    assert_string_equal(r.out, "round\nsquare\nflat\n");
}

static int run_anlos(int argc, char **argv)
{
    (void)argc;
    execv(BINARY_DIR "/bin/anlos", argv);
    return 127;
}

/* As the completion of the shell asks; each of them is in the help, too. */
static void who_asks_is_told_what_a_value_may_be(void **state)
{
    static const struct {
        const char *words[4], *out;
    } cases[] = {
        {{"bag", "export", "--help=format"},
         "wav\ncsv\njson\nnrrd\npng\nfoxglove\nosi\n"},
        {{"bag", "record", "--help=compression"}, "zstd\nlz4\nnone\n"},
        {{"bag", "import", "--help=compression"}, "zstd\nlz4\nnone\n"},
        {{"bag", "merge", "--help=compression"}, "zstd\nlz4\nnone\n"},
        {{"bag", "filter", "--help=compression"}, "zstd\nlz4\nnone\n"},
        {{"recon", "--help=method"},
         "auto\nfast\nbackprojection\nconfocal\nlct\npaper\nincoherent\niterative\n"
         "sparse\nfk\n"},
        {{"recon", "--help=window"}, "rectangular\nhann\nhamming\n"},
        {{"psf", "--help=compression"}, "matched_filter\nderamp\n"},
        {{"launch", "--help=log-level"}, "debug\ninfo\nwarning\nerror\n"},
        {{"launch", "--help=log-format"}, "text\njson\n"},
    };
    static struct command_result r;

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char *words[6] = {(char *)"anlos"};
        size_t n = 1;
        for (const char *const *w = cases[i].words; n < 5 && *w; w++)
            words[n++] = (char *)*w;
        command_run(&r, run_anlos, words);
        assert_string_equal(r.err, "");
        assert_string_equal(r.out, cases[i].out);
        assert_int_equal(r.code, 0);
        words[n - 1] = (char *)"--help";
        command_run(&r, run_anlos, words);
        for (const char *p = cases[i].out; *p; p += strcspn(p, "\n") + 1) {
            char name[32];
            snprintf(name, sizeof name, "%.*s", (int)strcspn(p, "\n"), p);
            if (!strstr(r.out, name))
                fail_msg("%s is not in the help of %s", name, cases[i].words[0]);
        }
    }
}

/* What is wrong in it the command says itself. */
static void the_names_of_a_list_are_told_and_several_are_taken(void **state)
{
    char *ask[] = {(char *)"anlos", (char *)"speed-error", (char *)"--help=methods",
                   NULL};
    char *give[] = {(char *)"anlos",
                    (char *)"speed-error",
                    (char *)"--methods",
                    (char *)"fast,nothing",
                    (char *)"--out",
                    (char *)"/dev/null",
                    NULL};
    static struct command_result r;

    (void)state;
    command_run(&r, run_anlos, ask);
    assert_int_equal(r.code, 0);
    assert_string_equal(r.err, "");
    assert_non_null(strstr(r.out, "auto\nfast\nbackprojection\n"));
    command_run(&r, run_anlos, give);
    assert_int_equal(r.code, 2);
    assert_non_null(strstr(r.err, "nothing: no such method"));
}

static int run_anlos_on_a_full_disk(int argc, char **argv)
{
    int full = open("/dev/full", O_WRONLY);

    return full < 0 || dup2(full, STDOUT_FILENO) < 0 ? 127 : run_anlos(argc, argv);
}

/* The bits of what is not as it should be. */
static int open_after_closing(int argc, char **argv)
{
    char byte = 'x';
    int wrong = 0;

    (void)argc;
    (void)argv;
    for (int fd = 0; fd <= 2; fd++)
        close(fd);
    wrong |= usage_hold_streams() ? 1 : 0;
    int fd = open("/dev/zero", O_RDWR);
    wrong |= fd <= STDERR_FILENO ? 2 : 0;
    wrong |= read(0, &byte, 1) != -1 || errno != EBADF ? 4 : 0;
    wrong |= write(1, &byte, 1) != -1 || errno != EBADF ? 8 : 0;
    wrong |= write(2, &byte, 1) != -1 || errno != EBADF ? 16 : 0;
    return wrong;
}

static void what_is_opened_is_never_a_standard_stream_that_was_closed(void **state)
{
    char *const words[] = {(char *)"x", NULL};
    struct command_result r;

    (void)state;
    command_run(&r, open_after_closing, words);
    assert_int_equal(r.code, 0);
}

static void a_table_that_cannot_be_printed_is_a_failure(void **state)
{
    static const char text[] =
        "sound_speed_m_s: 343\nsample_rate_hz: 48000\nslot_samples: 3000\n"
        "chirp: {start_hz: 2000, stop_hz: 20000, duration_s: 0.01}\n"
        "speakers_m: [[0, 0, 0], [0.1, 0, 0]]\nmicrophones_m: [[0, 0.1, 0]]\n";
    char survey[] = "/tmp/anlos-usage-XXXXXX";
    char *const words[] = {(char *)"anlos", (char *)"resolution", (char *)"--survey",
                           survey, NULL};
    struct command_result r;
    int fd = mkstemp(survey);

    (void)state;
    assert_int_equal(write(fd, text, sizeof text - 1), sizeof text - 1);
    close(fd);
    command_run(&r, run_anlos, words);
    assert_string_equal(r.err, "");
    assert_int_equal(r.code, 0);
    command_run(&r, run_anlos_on_a_full_disk, words);
    unlink(survey);
    assert_int_equal(r.code, 1);
    assert_string_equal(r.err,
                        "anlos resolution: standard output: No space left on device\n");
}

static int end_with(int argc, char **argv)
{
    const struct error why = {"a.yaml: why"};

    (void)argc;
    return usage_outcome("x", atoi(argv[1]), &why);
}

static void what_was_given_is_told_from_what_failed(void **state)
{
    static const struct {
        int err, code;
    } cases[] = {{-EISDIR, 2}, {-EACCES, 2},  {-EROFS, 2},  {-ENAMETOOLONG, 2},
                 {-ELOOP, 2},  {-EBADMSG, 2}, {-EEXIST, 2}, {-ENOSPC, 1},
                 {-EFBIG, 1},  {-EIO, 1},     {-ENOMEM, 1}, {-EINTR, 130}};
    struct command_result r;
    char number[16];

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char *const words[] = {(char *)"x", number, NULL};
        snprintf(number, sizeof number, "%d", cases[i].err);
        command_run(&r, end_with, words);
        assert_int_equal(r.code, cases[i].code);
        assert_string_equal(r.err, "anlos x: a.yaml: why\n");
    }
}

static void help_of_a_command_is_the_commands_help(void **state)
{
    static const struct {
        const char *words[4], *out;
        int code;
    } cases[] = {
        {{"anlos", "help", "keys"}, "anlos keys -- ", 0},
        {{"anlos", "help", "bag", "info"}, "anlos bag info -- ", 0},
        {{"anlos", "help"}, "usage: anlos COMMAND", 0},
        {{"anlos", "version"}, "anlos ", 0},
        {{"anlos", "help", "lanuch"}, "", 2},
        {{"anlos", "--hlp"}, "", 2},
    };
    struct command_result r;

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char *words[5] = {NULL};
        for (size_t k = 0; k < 4; k++)
            words[k] = (char *)cases[i].words[k];
        command_run(&r, run_anlos, words);
        assert_int_equal(r.code, cases[i].code);
        assert_memory_equal(r.out, cases[i].out, strlen(cases[i].out));
    }
    assert_string_equal(r.err, "anlos: --hlp: no such option; see anlos --help\n");
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
        cmocka_unit_test(what_was_given_is_told_from_what_failed),
        cmocka_unit_test(help_of_a_command_is_the_commands_help),
        cmocka_unit_test(a_table_that_cannot_be_printed_is_a_failure),
        cmocka_unit_test(what_is_opened_is_never_a_standard_stream_that_was_closed),
        cmocka_unit_test(what_is_only_kept_goes_where_the_table_says),
        cmocka_unit_test(what_is_kept_may_be_a_name_or_a_number_and_have_a_code),
        cmocka_unit_test(a_wrong_option_ends_with_what_is_wrong_with_it),
        cmocka_unit_test(a_value_that_is_one_of_some_is_taken_and_told),
        cmocka_unit_test(who_asks_is_told_what_a_value_may_be),
        cmocka_unit_test(the_names_of_a_list_are_told_and_several_are_taken),
        cmocka_unit_test(a_wrong_argument_of_a_launch_is_told_from_a_missing_value),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
