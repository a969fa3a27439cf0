/* SPDX-License-Identifier: MIT */
#include <sched.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "hal/realtime.h"

struct seen {
    int policy;
    sigset_t blocked;
};

static void *look(void *arg)
{
    struct seen *seen = arg;
    struct sched_param priority;
    pthread_getschedparam(pthread_self(), &seen->policy, &priority);
    pthread_sigmask(SIG_SETMASK, NULL, &seen->blocked);
    return NULL;
}

static struct seen run(bool urgent, struct error *missing)
{
    struct seen seen = {.policy = -1};
    pthread_t thread;
    assert_int_equal(realtime_start(&thread, look, &seen, urgent, missing), 0);
    pthread_join(thread, NULL);
    return seen;
}

static void signals_are_left_to_the_caller(void **state)
{
    struct error missing = {.text = ""};
    sigset_t before, after;
    (void)state;
    pthread_sigmask(SIG_SETMASK, NULL, &before);
    struct seen seen = run(false, &missing);
    pthread_sigmask(SIG_SETMASK, NULL, &after);
    assert_true(sigismember(&seen.blocked, SIGINT) &&
                sigismember(&seen.blocked, SIGTERM));
    assert_int_equal(sigismember(&after, SIGINT), sigismember(&before, SIGINT));
    assert_int_equal(seen.policy, SCHED_OTHER);
    assert_string_equal(missing.text, "");
}

/* In a child without any right. */
static int without_rights(void)
{
    struct rlimit none = {0, 0};
    struct error missing = {.text = ""};
    if (setrlimit(RLIMIT_RTPRIO, &none) || setrlimit(RLIMIT_MEMLOCK, &none) ||
        (!getuid() && setuid(65534)))
        return 2;
    struct seen seen = run(true, &missing);
    /* Sanitizers say that memory is locked, and do not lock it. */
    return seen.policy != SCHED_OTHER ||
           strncmp(missing.text, "real-time priority", 18) ||
           !strstr(missing.text, " not permitted: ");
}

static void what_is_not_permitted_is_done_without_and_said(void **state)
{
    int status;
    (void)state;
    pid_t child = fork();
    assert_true(child >= 0);
    if (!child)
        _exit(without_rights());
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(status, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(signals_are_left_to_the_caller),
        cmocka_unit_test(what_is_not_permitted_is_done_without_and_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
