/* SPDX-License-Identifier: MIT */
#include "tests/nodes/played_bag.h"

#include <poll.h>
#include <pty.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/commands.h"
#include "nodes/play/run.h"
#include "tests/nodes/command.h"

#define DEADLINE_MS 60000

static void run(struct command_result *r, struct scratch *s, const char *option,
                const char *value)
{
    char bag[600];

    snprintf(bag, sizeof bag, "%s", scratch_path(s, "a.mcap"));
    char *const words[] = {
        (char *)"bag", (char *)"play", bag,           (char *)"--run-dir",
        s->folder,     (char *)option, (char *)value, NULL};
    command_run(r, command_bag, words);
}

static void a_bag_is_played_to_nobody_too(void **state)
{
    struct scratch *s = *state;
    struct command_result r;

    played_bag_write(scratch_path(s, "a.mcap"), true);
    run(&r, s, "--rate", "max");
    assert_contains(r.err, "anlos bag play: nobody in ");
    assert_contains(r.err, " heard it: those who are to hear it start with --replay");
    assert_int_equal(r.code, 0);
    assert_string_equal(r.out, "10 messages of 0.9 s\n");
    run(&r, s, "--topics", "ping");
    assert_int_equal(r.code, 0);
    assert_string_equal(r.out, "6 messages of 0.9 s\n");
    run(&r, s, "--end", "0.3");
    assert_string_equal(r.out, "4 messages of 0.3 s\n");
    run(&r, s, "--start", "0.7");
    assert_string_equal(r.out, "3 messages of 0.2 s\n");
}

static void mistakes_are_said_with_what_was_expected(void **state)
{
    static const struct {
        const char *option, *value, *text;
    } cases[] = {
        {"--rate", "0", "--rate 0: expected max, or 0.001 to 1000000"},
        {"--rate", "quick", "--rate quick: expected max"},
        {"--start", "-1", "--start -1: expected seconds, 0 or more"},
        {"--start", "100", "100 s is beyond its end, 0.900 s"},
        {"--topics", "pong", "no topic is called \"pong\""},
        {"--remap", "ping", "remap ping: expected FROM:=TO"},
        {"--remap", "ping:=pong", "\"pong\" is no topic"},
        {"--remap", "pong:=ping", "no topic of the bag is called \"pong\""},
        {"--rates", "1", "did you mean --rate?"},
        {"--topics", NULL, "--topics: expected a value after it"},
        {"more", NULL, "more: unexpected"},
    };
    struct scratch *s = *state;
    struct command_result r;

    played_bag_write(scratch_path(s, "a.mcap"), true);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        run(&r, s, cases[i].option, cases[i].value);
        assert_contains(r.err, cases[i].text);
        assert_int_equal(r.code, 2);
        assert_string_equal(r.out, "");
    }
    assert_int_equal(unlink(scratch_path(s, "a.mcap")), 0);
    run(&r, s, NULL, NULL);
    assert_contains(r.err, "No such file or directory");
    assert_int_equal(r.code, 2);
    scratch_write(s, "a.mcap", "this is no bag at all, whatever it is called");
    run(&r, s, NULL, NULL);
    assert_int_equal(r.code, 2);
}

static void two_cannot_play_in_one_run_folder(void **state)
{
    struct scratch *s = *state;
    struct command_result r;
    char bag[600], byte;
    int out, err;

    snprintf(bag, sizeof bag, "%s", scratch_path(s, "a.mcap"));
    played_bag_write(bag, true);
    char *const words[] = {
        (char *)"bag",    (char *)"play",      bag,       (char *)"--paused",
        (char *)"--loop", (char *)"--run-dir", s->folder, NULL};
    pid_t first = command_start(command_bag, words, &out, &err);
    /* It plays when it holds the lock. */
    for (int i = 0; i < DEADLINE_MS && access(scratch_path(s, "array.lock"), F_OK); i++)
        poll(NULL, 0, 1);
    run(&r, s, NULL, NULL);
    assert_int_equal(r.code, 2);
    assert_contains(r.err, "a node \"play\" already runs here");
    assert_int_equal(kill(first, SIGINT), 0);
    while (read(out, &byte, 1) == 1 || read(err, &byte, 1) == 1)
        ;
    int status;
    assert_int_equal(waitpid(first, &status, 0), first);
    assert_int_equal(WEXITSTATUS(status), 130);
    close(out);
    close(err);
}

/* Reads what stands on the terminal until the text is there. */
static void await(int terminal, char *seen, size_t size, const char *text)
{
    size_t used = strlen(seen);

    while (!strstr(seen, text)) {
        struct pollfd p = {.fd = terminal, .events = POLLIN};
        if (poll(&p, 1, DEADLINE_MS) != 1)
            fail_msg("\"%s\" does not come, but: %s", text, seen);
        ssize_t n = read(terminal, seen + used, size - 1 - used);
        if (n <= 0)
            fail_msg("ended before \"%s\" came: %s", text, seen);
        used += (size_t)n;
        seen[used] = '\0';
        assert_true(used < size - 1);
    }
    seen[0] = '\0';
}

static pid_t start_at_terminal(struct scratch *s, int *terminal, char *const words[],
                               int n)
{
    (void)s;
    pid_t pid = forkpty(terminal, NULL, NULL, NULL);
    assert_true(pid >= 0);
    if (!pid)
        _exit(command_bag(n, (char **)words));
    return pid;
}

static void keys_pause_step_seek_and_end(void **state)
{
    struct scratch *s = *state;
    static char seen[65536];
    char bag[600];
    int terminal, status;

    snprintf(bag, sizeof bag, "%s", scratch_path(s, "a.mcap"));
    played_bag_write(bag, true);
    char *const words[] = {(char *)"bag",       (char *)"play", bag, (char *)"--paused",
                           (char *)"--run-dir", s->folder,      NULL};
    pid_t pid = start_at_terminal(s, &terminal, words, 6);
    await(terminal, seen, sizeof seen, "0.0 of 0.9 s  pauses at 1x");
    assert_int_equal(write(terminal, "...", 3), 3);
    await(terminal, seen, sizeof seen, "0.2 of 0.9 s  pauses at 1x");
    assert_int_equal(write(terminal, "+", 1), 1);
    await(terminal, seen, sizeof seen, "pauses at 2x");
    assert_int_equal(write(terminal, "\033[C", 3), 3);
    await(terminal, seen, sizeof seen, "0.9 of 0.9 s");
    assert_int_equal(write(terminal, "\033[H--", 5), 5);
    await(terminal, seen, sizeof seen, "0.0 of 0.9 s  pauses at 0.5x");
    assert_int_equal(write(terminal, "++++++++++ ", 11), 11);
    await(terminal, seen, sizeof seen, "messages of 0.9 s");
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_int_equal(status, 0);
    close(terminal);

    pid = start_at_terminal(s, &terminal, words, 6);
    await(terminal, seen, sizeof seen, "pauses");
    assert_int_equal(write(terminal, "q", 1), 1);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_int_equal(status, 0);
    close(terminal);
}

static void the_line_says_where_it_is_and_who_is_waited_for(void **state)
{
    struct playback_status s = {.phase = PLAYBACK_PLAYS,
                                .start_ns = 1000000000,
                                .at_ns = 3500000000,
                                .end_ns = 61000000000};
    char text[120];

    (void)state;
    s.pings.played = 20;
    s.pings.used = 17;
    s.pings.missing = 1;
    s.pings.unused = 1;
    strcpy(s.text, "waits for 1 receipts");
    play_keys_line(&s, text, sizeof text);
    assert_string_equal(text, "    2.5 of 60.0 s  plays at max  20 pings, 17 used, 2 "
                              "lost  waits for 1 receipts");
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_bag_is_played_to_nobody_too),
        TEST(mistakes_are_said_with_what_was_expected),
        TEST(two_cannot_play_in_one_run_folder),
        TEST(keys_pause_step_seek_and_end),
        TEST(the_line_says_where_it_is_and_who_is_waited_for),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
