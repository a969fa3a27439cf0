/* SPDX-License-Identifier: MIT */
/* Priorities of the processes, each tried in a process of its own. */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "nodes/rt/process.h"

#define DRIVE "nodes: [can]\narray: {uri: 'sim:a.yaml'}\nscan: {mode: fixed}\n"

static struct launchfile *parse(const char *text)
{
    struct launchfile *l = NULL;
    struct error why = {""};

    if (launchfile_parse(&l, "a.yaml", text, strlen(text), &why))
        fail_msg("%s", why.text);
    return l;
}

static bool is_wanted(const char *text)
{
    struct launchfile *l = parse(text);
    bool wanted = priority_wanted(l);

    launchfile_destroy(l);
    return wanted;
}

static void only_what_runs_at_the_pace_of_sound_wants_it(void **state)
{
    (void)state;
    assert_true(is_wanted(DRIVE));
    assert_true(is_wanted(DRIVE "processes: {realtime: auto}\n"));
    assert_true(is_wanted(DRIVE "processes: {realtime: required}\n"));
    assert_false(is_wanted(DRIVE "processes: {realtime: off}\n"));
    assert_false(is_wanted("nodes: [can]\narray: {uri: 'sim:a.yaml'}\n"));
    assert_false(is_wanted("nodes: [can]\narray: {uri: 'sim:a.yaml?pace=fast'}\n"
                           "scan: {mode: fixed}\n"));
    assert_false(is_wanted("nodes: [play, can]\nscan: {mode: fixed}\n"
                           "play: {bag: a.mcap}\n"));
}

static void another_mode_is_refused(void **state)
{
    struct launchfile *l = NULL;
    struct error why = {""};
    const char text[] = "nodes: [can]\nprocesses: {realtime: always}\n";

    (void)state;
    assert_int_equal(launchfile_parse(&l, "a.yaml", text, strlen(text), &why), -EINVAL);
    assert_string_equal(why.text, "a.yaml: processes.realtime: expected auto, off or "
                                  "required, not always");
}

static void *policy_of_thread(void *policy)
{
    *(int *)policy = sched_getscheduler(0);
    return NULL;
}

/* That of a thread started after priority_take, or minus its niceness where it has none.
 * In a process of its own; -128: that failed. */
static int rank(const char *node)
{
    int status;
    pid_t pid = fork();

    if (!pid) {
        char text[PRIORITY_TEXT_SIZE];
        struct sched_param param;
        struct launchfile *l = parse(DRIVE);
        pthread_t thread;
        int policy = -1;
        if (setpriority(PRIO_PROCESS, 0, 0) || priority_take(l, node, text, NULL) ||
            sched_getparam(0, &param) ||
            pthread_create(&thread, NULL, policy_of_thread, &policy) ||
            pthread_join(thread, NULL) || policy != sched_getscheduler(0) ||
            (policy == SCHED_FIFO) != !strncmp(text, "fifo", 4))
            _exit(0);
        _exit(128 + (policy == SCHED_FIFO ? 20 + param.sched_priority
                                          : -getpriority(PRIO_PROCESS, 0)));
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFEXITED(status));
    return WEXITSTATUS(status) - 128;
}

/* It leaves the process as it was. */
static bool is_permitted(void)
{
    struct error why;
    int before = sched_getscheduler(0);
    bool permitted = !priority_permitted(&why);

    assert_int_equal(sched_getscheduler(0), before);
    return permitted;
}

static int try_as_batch(void)
{
    const struct sched_param usual = {.sched_priority = 0};
    struct error why;

    if (sched_setscheduler(0, SCHED_BATCH, &usual))
        return 1;
    priority_permitted(&why);
    return sched_getscheduler(0) != SCHED_BATCH;
}

static void wait_for_child(pid_t pid)
{
    int status;

    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_int_equal(status, 0);
}

static void to_ask_what_is_permitted_changes_nothing(void **state)
{
    (void)state;
    pid_t pid = fork();
    if (!pid)
        _exit(try_as_batch());
    wait_for_child(pid);
}

static void who_may_be_late_least_comes_first(void **state)
{
    static const char *const order[] = {"array", "can",    "dsp", "wall",
                                        "recon", "record", "view"};

    (void)state;
    if (!is_permitted())
        skip();
    for (size_t i = 1; i < sizeof order / sizeof *order; i++)
        if (rank(order[i - 1]) <= rank(order[i]))
            fail_msg("%s does not come before %s", order[i - 1], order[i]);
    assert_int_equal(rank("track"), rank("wall"));
    assert_int_equal(rank("report"), rank("view"));
    assert_int_equal(rank("array"), 20 + 15);
    assert_int_equal(rank("recon"), 5); /* it computes most: never before all others */
}

static int without_rights(void)
{
    const struct rlimit none = {0, 0};
    char text[PRIORITY_TEXT_SIZE], expected[PRIORITY_TEXT_SIZE];
    struct error why = {""};
    struct launchfile *l = parse(DRIVE),
                      *strict = parse(DRIVE "processes: {realtime: required}\n");

    if (setrlimit(RLIMIT_RTPRIO, &none) || setrlimit(RLIMIT_MEMLOCK, &none) ||
        setrlimit(RLIMIT_NICE, &none) || (!getuid() && setuid(65534)))
        return 1;
    /* Sanitizers say that memory is locked, and do not lock it. */
    if (priority_take(l, "dsp", text, &why) || strncmp(text, "usual", 5) || why.text[0])
        return 2;
    if (priority_take(strict, "dsp", text, &why) != -EPERM ||
        strncmp(why.text, "real-time priority", 18) ||
        !strstr(why.text, "raise the limits rtprio to 20 and memlock"))
        return 3;
    int before = getpriority(PRIO_PROCESS, 0);
    snprintf(expected, sizeof expected, "nice %d", before > 5 ? before : 5);
    if (priority_take(l, "view", text, &why) || strcmp(text, expected))
        return 4;
    launchfile_destroy(l);
    launchfile_destroy(strict);
    return 0;
}

static void what_is_not_permitted_is_done_without_unless_it_is_required(void **state)
{
    (void)state;
    pid_t pid = fork();
    if (!pid)
        _exit(without_rights());
    wait_for_child(pid);
}

/* It ends when its priority has been taken away. */
static int compute(void)
{
    const struct rlimit soon = {50000, RLIM_INFINITY};
    char text[PRIORITY_TEXT_SIZE];
    struct launchfile *l = parse(DRIVE);

    if (priority_take(l, "dsp", text, NULL) || sched_getscheduler(0) != SCHED_FIFO ||
        priority_is_lost() || setrlimit(RLIMIT_RTTIME, &soon))
        return 1;
    while (!priority_is_lost())
        ;
    launchfile_destroy(l);
    return sched_getscheduler(0) != SCHED_OTHER;
}

static void who_computes_without_a_pause_loses_its_priority(void **state)
{
    (void)state;
    if (!is_permitted())
        skip();
    pid_t pid = fork();
    if (!pid)
        _exit(compute());
    wait_for_child(pid);
}

static atomic_bool stops;

/* As the project's threads are, it blocks all signals. */
static void *spin(void *tid)
{
    sigset_t all;

    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, NULL);
    *(atomic_int *)tid = gettid();
    while (!stops)
        ;
    return NULL;
}

/* Of a node whose other thread computes: none of them keeps its priority. */
static int compute_beside(void)
{
    const struct rlimit soon = {50000, RLIM_INFINITY};
    char text[PRIORITY_TEXT_SIZE];
    struct launchfile *l = parse(DRIVE);
    atomic_int tid = 0;
    pthread_t thread;

    if (priority_take(l, "dsp", text, NULL) || setrlimit(RLIMIT_RTTIME, &soon) ||
        pthread_create(&thread, NULL, spin, &tid))
        return 1;
    while (!tid || !priority_is_lost())
        poll(NULL, 0, 1);
    bool kept = sched_getscheduler(tid) == SCHED_FIFO;
    priority_drop();
    bool dropped = sched_getscheduler(tid) == SCHED_OTHER &&
                   sched_getscheduler(0) == SCHED_OTHER;
    stops = true;
    pthread_join(thread, NULL);
    launchfile_destroy(l);
    return kept && dropped ? 0 : 2;
}

static void nor_does_a_node_whose_other_thread_does_so_keep_it(void **state)
{
    (void)state;
    if (!is_permitted())
        skip();
    pid_t pid = fork();
    if (!pid)
        _exit(compute_beside());
    wait_for_child(pid);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(only_what_runs_at_the_pace_of_sound_wants_it),
        cmocka_unit_test(another_mode_is_refused),
        cmocka_unit_test(who_may_be_late_least_comes_first),
        cmocka_unit_test(what_is_not_permitted_is_done_without_unless_it_is_required),
        cmocka_unit_test(to_ask_what_is_permitted_changes_nothing),
        cmocka_unit_test(nor_does_a_node_whose_other_thread_does_so_keep_it),
        cmocka_unit_test(who_computes_without_a_pause_loses_its_priority),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
