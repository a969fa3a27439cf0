/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <poll.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "nodes/launcher/process_group.h"

#define DEADLINE_MS 60000
#define S           1000000000LL

struct lines {
    char text[20000]; /* all of them, each ended by '|' */
};

static void collect(void *ctx, const struct child *c, const char *line)
{
    struct lines *l = ctx;
    size_t used = strlen(l->text);

    assert_string_equal(c->name, "node");
    snprintf(l->text + used, sizeof l->text - used, "%s|", line);
}

/* Runs a script to its end and returns its status. */
static int run(struct child *c, const char *script, struct lines *lines)
{
    char *argv[] = {(char *)"/bin/sh", (char *)"-c", (char *)script, NULL};
    int status;

    lines->text[0] = '\0';
    c->argv = argv;
    assert_int_equal(child_start(c, 0, NULL), 0);
    while (c->pipes[0].fd >= 0 || c->pipes[1].fd >= 0) {
        struct pollfd fds[2] = {{.fd = c->pipes[0].fd, .events = POLLIN},
                                {.fd = c->pipes[1].fd, .events = POLLIN}};
        assert_true(poll(fds, 2, DEADLINE_MS) > 0);
        for (int i = 0; i < 2; i++)
            child_read(c, &c->pipes[i], collect, lines);
    }
    assert_int_equal(waitpid(c->pid, &status, 0), c->pid);
    c->argv = NULL;
    return status;
}

static void output_comes_line_by_line(void **state)
{
    struct child c;
    struct lines lines;

    (void)state;
    child_init(&c, "node", NULL);
    run(&c, "echo one; echo two; printf 'no end'", &lines);
    assert_string_equal(lines.text, "one|two|no end|");
    run(&c, "echo to stderr >&2", &lines);
    assert_string_equal(lines.text, "to stderr|");
}

static void a_line_without_end_comes_in_pieces(void **state)
{
    struct child c;
    struct lines lines;

    (void)state;
    child_init(&c, "node", NULL);
    run(&c, "head -c 15000 /dev/zero | tr '\\0' x; echo", &lines);
    size_t letters = 0, pieces = 0;
    for (const char *p = lines.text; *p; p++) {
        letters += *p == 'x';
        pieces += *p == '|';
    }
    assert_int_equal(letters, 15000);
    assert_true(pieces >= 3 && pieces <= 4);
}

static void a_program_that_is_not_there_is_named(void **state)
{
    struct child c;
    struct error why = {""};
    char *argv[] = {(char *)"/no/such/program", NULL};

    (void)state;
    child_init(&c, "node", argv);
    assert_int_equal(child_start(&c, 0, &why), -ENOENT);
    assert_non_null(strstr(why.text, "/no/such/program: cannot be started"));
    assert_int_equal(c.pid, 0);
}

static void a_child_inherits_only_its_standard_descriptors(void **state)
{
    struct child c;
    struct lines lines;

    (void)state;
    int fd = dup(STDERR_FILENO);
    assert_true(fd > STDERR_FILENO);
    child_init(&c, "node", NULL);
    run(&c, "for f in /proc/self/fd/*; do test -e $f && echo ${f##*/}; done | sort -n",
        &lines);
    close(fd);
    assert_non_null(strstr(lines.text, "0|1|2|"));
    char word[16];
    snprintf(word, sizeof word, "|%d|", fd);
    assert_null(strstr(lines.text + 6, word + 1));
}

static void exits_decide_what_comes_next(void **state)
{
    struct child c;
    struct lines lines;

    (void)state;
    child_init(&c, "node", NULL);
    assert_int_equal(child_exited(&c, run(&c, "exit 0", &lines), S), CHILD_ENDED);
    assert_int_equal(child_exited(&c, run(&c, "exit 2", &lines), S), CHILD_BAD_CONFIG);
    assert_int_equal(child_exited(&c, run(&c, "exit 1", &lines), S), CHILD_PAUSING);
    assert_int_equal(child_exited(&c, run(&c, "kill -9 $$", &lines), S), CHILD_PAUSING);
    assert_int_equal(c.crashes, 2);
}

static void pauses_double_until_it_is_given_up(void **state)
{
    struct child c;
    int64_t before = 0;
    const int status = 1 << 8; /* exit code 1 */

    (void)state;
    child_init(&c, "node", NULL);
    for (int i = 0; i < CHILD_MAX_CRASHES; i++) {
        assert_int_equal(child_exited(&c, status, 5 * S), CHILD_PAUSING);
        int64_t pause = c.restart_ns - 5 * S;
        assert_true(pause > 0);
        assert_true(!before || pause == 2 * before);
        before = pause;
    }
    assert_int_equal(child_exited(&c, status, 5 * S), CHILD_FAILED);
}

static void a_good_run_makes_up_for_earlier_crashes(void **state)
{
    struct child c;
    const int status = 1 << 8;

    (void)state;
    child_init(&c, "node", NULL);
    for (int i = 0; i < 3 * CHILD_MAX_CRASHES; i++) {
        c.started_ns = i * 100 * S;
        assert_int_equal(child_exited(&c, status, c.started_ns + CHILD_GOOD_RUN_NS),
                         CHILD_PAUSING);
        assert_int_equal(c.crashes, 1);
    }
}

static void exits_are_described_for_a_person(void **state)
{
    char text[64];

    (void)state;
    child_describe_exit(3 << 8, text, sizeof text);
    assert_string_equal(text, "exit code 3");
    child_describe_exit(SIGKILL, text, sizeof text);
    assert_string_equal(text, "signal 9 (Killed)");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(output_comes_line_by_line),
        cmocka_unit_test(a_line_without_end_comes_in_pieces),
        cmocka_unit_test(a_program_that_is_not_there_is_named),
        cmocka_unit_test(a_child_inherits_only_its_standard_descriptors),
        cmocka_unit_test(exits_decide_what_comes_next),
        cmocka_unit_test(pauses_double_until_it_is_given_up),
        cmocka_unit_test(a_good_run_makes_up_for_earlier_crashes),
        cmocka_unit_test(exits_are_described_for_a_person),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
