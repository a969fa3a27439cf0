/* SPDX-License-Identifier: MIT */
/* `anlos keys`: what it makes, prints and refuses. */
#include "tests/hal/scratch.h"

#include "msgs/keys.h"
#include "nodes/anlos/commands.h"
#include "tests/nodes/command.h"

static void run(struct command_result *r, const char *verb, const char *folder)
{
    char *words[] = {(char *)"keys", (char *)verb, (char *)"--out", (char *)folder, NULL};

    command_run(r, command_keys, words);
}

static void a_key_is_made_once_and_its_public_line_printed_again(void **state)
{
    char folder[600], line[128];
    struct command_result r;
    struct keys keys;
    char *make[] = {(char *)"keys",
                    (char *)"new",
                    (char *)"--host",
                    (char *)"vehicle",
                    (char *)"--out",
                    folder,
                    NULL};

    snprintf(folder, sizeof folder, "%s", scratch_path(*state, "keys"));
    command_run(&r, command_keys, make);
    assert_int_equal(r.code, 0);
    assert_int_equal(keys_read(&keys, folder, NULL), 0);
    snprintf(line, sizeof line, "vehicle %s\n", keys.public);
    assert_string_equal(r.out, line); /* alone, to be sent on */
    assert_null(strstr(r.err, keys.secret));
    run(&r, "show", folder);
    assert_int_equal(r.code, 0);
    assert_string_equal(r.out, line);
    assert_contains(r.err, "  vehicle, this host");
    assert_null(strstr(r.err, keys.secret));
    command_run(&r, command_keys, make);
    assert_int_equal(r.code, 2);
    assert_contains(r.err, "secret.key is there already, and is kept");
    run(&r, "show", folder);
    assert_string_equal(r.out, line);
}

static void what_is_not_there_or_open_to_others_is_refused(void **state)
{
    struct scratch *s = *state;
    struct command_result r;
    char folder[600];

    snprintf(folder, sizeof folder, "%s", scratch_path(s, "keys"));
    run(&r, "show", folder);
    assert_int_equal(r.code, 2);
    assert_contains(r.err, "there is no key: 'anlos keys new --out");
    run(&r, "new", folder);
    assert_int_equal(r.code, 0);
    assert_int_equal(chmod(scratch_path(s, "keys/secret.key"), 0644), 0);
    run(&r, "show", folder);
    assert_int_equal(r.code, 2);
    assert_contains(r.err, "others may read it (mode 644)");
    run(&r, "revoke", folder);
    assert_int_equal(r.code, 2);
    assert_contains(r.err, "revoke: expected new or show");
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_key_is_made_once_and_its_public_line_printed_again),
        TEST(what_is_not_there_or_open_to_others_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
