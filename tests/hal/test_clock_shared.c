/* SPDX-License-Identifier: MIT */
/* Processes that count from the clock of the one that started them.  Each is this program
 * again, as a new one. */
#include <errno.h>
#include <inttypes.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "hal/clock.h"

#define HOUR_NS INT64_C(3600000000000)
#define NEAR_NS INT64_C(500000000) /* a process may be kept waiting */

struct told { /* by a process, of its clock */
    int64_t before_ns, now_ns,
        after_ns; /* now by that clock, and around it by monotonic */
    int64_t ahead_ns;
    int check;
    char text[1024];
};

static int64_t read_ns(clockid_t id)
{
    struct timespec t;
    clock_gettime(id, &t);
    return (int64_t)t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

/* The process: tells, or has another one tell whom it shares its clock with. */
static int tell(void)
{
    struct error why = {""};
    struct told t = {.before_ns = read_ns(CLOCK_MONOTONIC)};

    t.now_ns = clock_now_ns(clock_system());
    t.after_ns = read_ns(CLOCK_MONOTONIC);
    t.ahead_ns = clock_wall_ahead_ns();
    t.check = clock_check_shared(&why);
    memcpy(t.text, why.text, sizeof t.text);
    return write(STDOUT_FILENO, &t, sizeof t) != sizeof t;
}

static struct told start(const char *how)
{
    struct told t;
    int fds[2], status;

    assert_int_equal(pipe(fds), 0);
    pid_t pid = fork();
    assert_true(pid >= 0);
    if (!pid) {
        dup2(fds[1], STDOUT_FILENO);
        execl("/proc/self/exe", "clock", how, (char *)NULL);
        _exit(99);
    }
    close(fds[1]);
    assert_int_equal(read(fds[0], &t, sizeof t), sizeof t);
    close(fds[0]);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_int_equal(status, 0);
    return t;
}

static int share(void)
{
    int err = clock_share();
    struct told t = start("tell");

    return err || write(STDOUT_FILENO, &t, sizeof t) != sizeof t;
}

/* As if the wall clock had been set by so much since the parent began. */
static int64_t give(long parent, int64_t set_by_ns)
{
    char text[64];
    int64_t offset_ns = read_ns(CLOCK_REALTIME) - read_ns(CLOCK_MONOTONIC) - set_by_ns;

    snprintf(text, sizeof text, "%ld:%" PRId64, parent, offset_ns);
    setenv("ANLOS_CLOCK", text, 1);
    return offset_ns;
}

static void assert_counts_from(const struct told *t, int64_t offset_ns)
{
    assert_true(t->now_ns >= t->before_ns + offset_ns);
    assert_true(t->now_ns <= t->after_ns + offset_ns);
    assert_int_equal(t->check, 0);
    assert_string_equal(t->text, "");
}

static void assert_near(int64_t a_ns, int64_t b_ns)
{
    assert_true(a_ns - b_ns < NEAR_NS && b_ns - a_ns < NEAR_NS);
}

static void assert_counts_from_the_wall_clock(const struct told *t)
{
    assert_near(t->now_ns - t->before_ns,
                read_ns(CLOCK_REALTIME) - read_ns(CLOCK_MONOTONIC));
    assert_near(t->ahead_ns, 0);
}

static void processes_that_were_given_a_clock_agree_wherever_the_wall_clock_is(void **s)
{
    static const int64_t set_by_ns[] = {HOUR_NS, -HOUR_NS, 400000 * HOUR_NS};

    (void)s;
    for (size_t i = 0; i < 3; i++) {
        int64_t offset_ns = give((long)getpid(), set_by_ns[i]);
        struct told one = start("tell"), restarted = start("tell");
        assert_counts_from(&one, offset_ns);
        assert_counts_from(&restarted, offset_ns);
        assert_near(one.ahead_ns, set_by_ns[i]);
        assert_near(restarted.ahead_ns, set_by_ns[i]);
    }
}

static void a_process_shares_the_clock_by_which_it_counts(void **s)
{
    (void)s;
    int64_t offset_ns = give((long)getpid(), HOUR_NS);
    struct told t = start("share");
    assert_counts_from(&t, offset_ns);
    assert_near(t.ahead_ns, HOUR_NS);
}

static void one_that_was_for_the_children_of_another_is_not_taken(void **s)
{
    (void)s;
    give((long)getpid() + 1, HOUR_NS);
    struct told t = start("tell");
    assert_counts_from_the_wall_clock(&t);
    assert_int_equal(t.check, 0);
    t = start("share");
    assert_counts_from_the_wall_clock(&t);
    assert_int_equal(t.check, 0);
}

static void one_that_is_damaged_is_not_taken_and_said(void **s)
{
    static const char *const ends[] = {"",
                                       ":",
                                       ":noon",
                                       ":1h",
                                       ":1 ",
                                       ":99999999999999999999",
                                       ":9000000000000000000",
                                       ":-9000000000000000000",
                                       "+5"};
    char text[64];

    (void)s;
    for (size_t i = 0; i <= sizeof ends / sizeof *ends; i++) {
        if (i < sizeof ends / sizeof *ends)
            snprintf(text, sizeof text, "%ld%s", (long)getpid(), ends[i]);
        else
            text[0] = '\0';
        setenv("ANLOS_CLOCK", text, 1);
        struct told t = start("tell");
        assert_counts_from_the_wall_clock(&t);
        assert_int_equal(t.check, -EINVAL);
        assert_non_null(strstr(t.text, "ANLOS_CLOCK \""));
        assert_non_null(strstr(t.text, text));
    }
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(
            processes_that_were_given_a_clock_agree_wherever_the_wall_clock_is),
        cmocka_unit_test(a_process_shares_the_clock_by_which_it_counts),
        cmocka_unit_test(one_that_was_for_the_children_of_another_is_not_taken),
        cmocka_unit_test(one_that_is_damaged_is_not_taken_and_said),
    };

    if (argc == 2 && !strcmp(argv[1], "tell"))
        return tell();
    if (argc == 2 && !strcmp(argv[1], "share"))
        return share();
    return cmocka_run_group_tests(tests, NULL, NULL);
}
