/* SPDX-License-Identifier: MIT */
/* Who hangs, on a clock of the test's own.  A scan and a dsp run; limits and ticks are
 * those of nodes/launcher/supervisor.h. */
#include <math.h>
#include <sched.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "nodes/launcher/supervisor.h"

#define S    1000000000LL
#define TICK SUPERVISOR_TICK_NS

static struct supervisor_process kernel; /* as it tells of every process */

static void look(pid_t pid, struct supervisor_process *out)
{
    assert_int_equal(pid, 7);
    *out = kernel;
}

struct world {
    struct supervisor s;
    struct process_group c;
    int64_t now_ns;
    uint64_t turns;
    int64_t hung_ns[PROCESS_GROUP_MAX];
};

static void begin(struct world *w)
{
    kernel = (struct supervisor_process){0};
    *w = (struct world){.s = {.alive_ns = 3 * S, .look = look},
                        .c = {.n = 2,
                              .children = {{.name = "scan", .pid = 7, .started_ns = S},
                                           {.name = "dsp", .pid = 7, .started_ns = S}}},
                        .now_ns = 2 * S};
    supervisor_tick(&w->s, &w->c, w->now_ns, w->hung_ns);
}

static void say(struct world *w, const char *node, uint64_t turns, double limit_s)
{
    Anlos__Health h = ANLOS__HEALTH__INIT;

    h.node = (char *)node;
    h.turns = turns;
    h.turn_limit_s = limit_s;
    supervisor_heard(&w->s, &w->c, &h, 2 * S);
}

/* For so long, or until somebody hangs; how long that took. */
static int64_t let_pass(struct world *w, int64_t ns)
{
    int64_t start_ns = w->now_ns;

    for (memset(w->hung_ns, 0, sizeof w->hung_ns);
         w->now_ns - start_ns < ns && !w->hung_ns[0] && !w->hung_ns[1];) {
        w->now_ns += TICK;
        say(w, "scan", ++w->turns, 0.0);
        memset(w->hung_ns, 0x55, sizeof w->hung_ns); /* it need not be cleared before */
        supervisor_tick(&w->s, &w->c, w->now_ns, w->hung_ns);
    }
    return w->now_ns - start_ns;
}

static void assert_hangs_after(struct world *w, int64_t ns)
{
    int64_t took_ns = let_pass(w, 1000 * S);

    assert_true(w->hung_ns[1] > 0);
    assert_int_equal(w->hung_ns[0], 0);
    assert_true(took_ns > ns);
    assert_true(took_ns <= ns + TICK);
}

static void a_node_that_says_nothing_for_three_seconds_hangs(void **state)
{
    struct world w;

    (void)state;
    begin(&w);
    say(&w, "dsp", 1, 0.0);
    assert_hangs_after(&w, 3 * S);
}

static void one_that_goes_on_in_time_does_not(void **state)
{
    struct world w;

    (void)state;
    begin(&w);
    say(&w, "dsp", 1, 0.0);
    for (uint64_t i = 2; i < 6; i++) {
        assert_int_equal(let_pass(&w, 3 * S), 3 * S);
        assert_int_equal(w.hung_ns[1], 0);
        say(&w, "dsp", i, 0.0);
    }
    assert_hangs_after(&w, 3 * S);
}

/* Such as a change of state, said in the middle of a turn that does not end. */
static void what_is_said_without_a_turn_of_the_loop_proves_nothing(void **state)
{
    struct world w;

    (void)state;
    begin(&w);
    say(&w, "dsp", 5, 0.0);
    let_pass(&w, 2 * S);
    say(&w, "dsp", 5, 0.0);
    assert_hangs_after(&w, 1 * S);
}

static void whoever_counts_no_turns_is_taken_at_its_word(void **state)
{
    struct world w;

    (void)state;
    begin(&w);
    say(&w, "dsp", 0, 0.0);
    let_pass(&w, 2 * S);
    say(&w, "dsp", 0, 0.0);
    assert_hangs_after(&w, 3 * S);
}

static void a_long_step_that_was_announced_may_take_as_long(void **state)
{
    struct world w;

    (void)state;
    begin(&w);
    say(&w, "dsp", 1, 0.0);
    say(&w, "dsp", 2, 20.0);
    assert_hangs_after(&w, 20 * S);
}

/* Nobody takes himself out of it. */
static void a_limit_that_is_none_is_the_usual_one_or_the_longest(void **state)
{
    static const double none[] = {NAN, -1.0, -INFINITY},
                        endless[] = {INFINITY, 1e300, 1e12};

    (void)state;
    for (size_t i = 0; i < 3; i++) {
        struct world w;
        begin(&w);
        say(&w, "dsp", 1, none[i]);
        assert_hangs_after(&w, 3 * S);
        begin(&w);
        say(&w, "dsp", 1, endless[i]);
        assert_hangs_after(&w, SUPERVISOR_BAG_NS);
    }
}

static void after_it_the_usual_limit_holds_again(void **state)
{
    struct world w;

    (void)state;
    begin(&w);
    say(&w, "dsp", 2, 20.0);
    let_pass(&w, 10 * S);
    say(&w, "dsp", 3, 0.0);
    assert_hangs_after(&w, 3 * S);
}

static void a_start_may_take_a_minute_and_no_longer(void **state)
{
    struct world w;

    (void)state;
    begin(&w);
    assert_hangs_after(&w, 60 * S);
}

static void a_new_process_is_judged_anew(void **state)
{
    struct world w;

    (void)state;
    begin(&w);
    say(&w, "dsp", 9, 0.0);
    assert_hangs_after(&w, 3 * S);
    w.c.children[1].phase = CHILD_PAUSING;
    assert_int_equal(let_pass(&w, 100 * S), 100 * S);
    w.c.children[1].phase = CHILD_RUNNING;
    w.c.children[1].started_ns = w.now_ns;
    say(&w, "dsp", 10, 0.0); /* of the one before */
    assert_hangs_after(&w, 60 * S);
}

/* As after a suspend, or a stop of all of them. */
static void time_in_which_the_launcher_did_not_run_is_held_against_nobody(void **state)
{
    struct world w;

    (void)state;
    begin(&w);
    say(&w, "dsp", 1, 0.0);
    for (int i = 0; i < 8; i++) {
        w.now_ns += 100 * S;
        say(&w, "scan", ++w.turns, 0.0);
        supervisor_tick(&w.s, &w.c, w.now_ns, w.hung_ns);
        assert_int_equal(w.hung_ns[1], 0);
    }
    assert_hangs_after(&w, 3 * S - 8 * TICK);
}

/* It waits all the time: five times the limit, no longer. */
static void who_waits_for_a_processor_has_more_time_but_not_for_ever(void **state)
{
    struct world w;

    (void)state;
    begin(&w);
    say(&w, "dsp", 1, 0.0);
    int64_t start_ns = w.now_ns;
    struct supervisor_starved starved;
    int n_told = 0;
    do {
        kernel.waited_ns += TICK;
        let_pass(&w, TICK);
        assert_false(supervisor_starves(&w.s, 0, &starved));
        if (!supervisor_starves(&w.s, 1, &starved))
            continue;
        n_told++;
        assert_true(w.now_ns - start_ns == 3 * S + TICK);
        assert_true(fabs(starved.silent_s - 3.25) < 1e-6);
        assert_true(fabs(starved.waited_s - 1.75) < 1e-6); /* since it was looked at */
        assert_true(fabs(starved.killed_s - 15.0) < 1e-6);
    } while (!w.hung_ns[1]);
    assert_int_equal(n_told, 1);
    assert_true(w.now_ns - start_ns > 15 * S);
    assert_true(w.now_ns - start_ns <= 15 * S + TICK);
}

/* It gets a processor every two seconds, and only then the kernel says how long it
 * waited; or never, as beside what has a higher priority. */
static void what_the_kernel_tells_late_or_not_at_all_is_waiting_too(void **state)
{
    struct world w;

    (void)state;
    for (int never = 0; never < 2; never++) {
        begin(&w);
        kernel.runnable = true;
        say(&w, "dsp", 1, 0.0);
        int64_t start_ns = w.now_ns;
        for (int i = 1; !w.hung_ns[1]; i++) {
            if (i % 8 == 0 && !never) {
                kernel.ran_ns += 1000000;
                kernel.waited_ns += 2 * S - 1000000;
            }
            let_pass(&w, TICK);
        }
        assert_true(w.now_ns - start_ns > 15 * S);
        assert_true(w.now_ns - start_ns <= 15 * S + TICK);
    }
}

/* What the kernel tells of a process is the sum over the threads that it has. */
static void the_waits_of_a_thread_that_ended_are_held_against_nobody(void **state)
{
    struct world w;

    (void)state;
    begin(&w);
    kernel.waited_ns = 100 * S;
    say(&w, "dsp", 1, 0.0);
    assert_int_equal(let_pass(&w, 2 * S), 2 * S);
    kernel.waited_ns = 0;
    assert_hangs_after(&w, 1 * S);
}

/* Eight threads for half a second, from when it is looked at on; then none does. */
static void threads_that_wait_at_once_wait_no_longer_than_one(void **state)
{
    struct world w;

    (void)state;
    begin(&w);
    say(&w, "dsp", 1, 0.0);
    assert_int_equal(let_pass(&w, 2 * S), 2 * S);
    for (int i = 0; i < 2; i++) {
        kernel.waited_ns += 8 * TICK;
        assert_int_equal(let_pass(&w, TICK), TICK);
    }
    int64_t took_ns = let_pass(&w, 1000 * S);
    assert_true(w.hung_ns[1] > 0);
    assert_true(took_ns <= 3 * S + TICK);
}

static void who_computes_for_ever_hangs(void **state)
{
    struct world w;

    (void)state;
    begin(&w);
    kernel.runnable = true;
    say(&w, "dsp", 1, 0.0);
    int64_t start_ns = w.now_ns;
    struct supervisor_starved starved;
    do {
        kernel.ran_ns += TICK;
        let_pass(&w, TICK);
        assert_false(supervisor_starves(&w.s, 1, &starved));
    } while (!w.hung_ns[1]);
    assert_true(w.now_ns - start_ns <= 3 * S + TICK);
}

static void who_is_debugged_is_left_alone(void **state)
{
    struct world w;

    (void)state;
    begin(&w);
    say(&w, "dsp", 1, 0.0);
    kernel.traced = true;
    assert_int_equal(let_pass(&w, 100 * S), 100 * S);
    kernel.traced = false;
    let_pass(&w, 4 * S);
    assert_true(w.hung_ns[1] > 0);
}

/* As the kernel has it, not the look of the others. */
static void a_process_that_is_traced_is_seen_to_be(void **state)
{
    struct world w;
    int status;

    (void)state;
    for (int traced = 0; traced < 2; traced++) {
        pid_t pid = fork();
        assert_true(pid >= 0);
        if (!pid) {
            if (traced)
                ptrace(PTRACE_TRACEME, 0, NULL, NULL);
            raise(SIGSTOP);
            _exit(0);
        }
        assert_int_equal(waitpid(pid, &status, WUNTRACED), pid);
        assert_true(WIFSTOPPED(status));
        begin(&w);
        w.s.look = NULL;
        w.c.children[0].pid = w.c.children[1].pid = pid;
        say(&w, "dsp", 1, 0.0);
        int64_t took_ns = let_pass(&w, 100 * S);
        assert_int_equal(took_ns == 100 * S, traced);
        assert_int_equal(w.hung_ns[1] > 0, !traced);
        assert_int_equal(kill(pid, SIGKILL), 0);
        assert_int_equal(waitpid(pid, &status, 0), pid);
    }
}

static pid_t compute_on(int processor, int policy)
{
    const struct sched_param none = {.sched_priority = 0};
    cpu_set_t one;
    pid_t pid = fork();

    assert_true(pid >= 0);
    if (pid)
        return pid;
    CPU_ZERO(&one);
    CPU_SET(processor, &one);
    prctl(PR_SET_PDEATHSIG, SIGKILL); /* whatever fails meanwhile */
    if (sched_setaffinity(0, sizeof one, &one) || sched_setscheduler(0, policy, &none))
        _exit(1);
    for (volatile unsigned i = 0;; i++)
        ;
}

static void end(pid_t pid)
{
    int status;

    assert_int_equal(kill(pid, SIGKILL), 0);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFSIGNALED(status));
}

/* As the kernel has it: one that runs when nobody else wants to, beside another on its
 * processor.  Looks follow at once, and now and then it gets its turn amid them. */
static void a_process_that_gets_no_processor_is_seen_to_wait(void **state)
{
    struct world w;
    cpu_set_t all;
    int processor = 0;
    bool waits = false;

    (void)state;
    assert_int_equal(sched_getaffinity(0, sizeof all, &all), 0);
    while (!CPU_ISSET(processor, &all))
        processor++;
    pid_t busy = compute_on(processor, SCHED_OTHER), starved;
    starved = compute_on(processor, SCHED_IDLE);
    for (int tries = 0; !waits && tries < 10000; tries++) {
        begin(&w);
        w.s.look = NULL;
        w.c.children[0].pid = w.c.children[1].pid = starved;
        say(&w, "dsp", 1, 0.0);
        waits = let_pass(&w, 100 * S) > 15 * S;
    }
    end(starved);
    end(busy);
    assert_true(waits);
}

static void without_supervision_nobody_hangs(void **state)
{
    struct world w;

    (void)state;
    begin(&w);
    w.s.alive_ns = 0;
    say(&w, "dsp", 1, 0.0);
    assert_int_equal(let_pass(&w, 100 * S), 100 * S);
    assert_int_equal(supervisor_tick(&w.s, &w.c, w.now_ns, w.hung_ns), INT64_MAX);
}

static void what_hung_and_what_was_started_again_is_counted(void **state)
{
    struct world w;
    struct device_count counts[DEVICE_MAX_COUNTS];

    (void)state;
    begin(&w);
    assert_int_equal(supervisor_counts(&w.s, counts), 1);
    assert_string_equal(counts[0].name, "restarts");
    assert_int_equal(counts[0].value, 0);
    for (unsigned i = 1; i <= 3; i++) {
        say(&w, "dsp", i, 0.0);
        let_pass(&w, 4 * S);
        w.c.children[1].started_ns += 1;
    }
    supervisor_tick(&w.s, &w.c, w.now_ns, w.hung_ns);
    assert_int_equal(supervisor_counts(&w.s, counts), 2);
    assert_int_equal(counts[0].value, 3);
    assert_string_equal(counts[1].name, "dsp hung");
    assert_int_equal(counts[1].value, 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_node_that_says_nothing_for_three_seconds_hangs),
        cmocka_unit_test(one_that_goes_on_in_time_does_not),
        cmocka_unit_test(what_is_said_without_a_turn_of_the_loop_proves_nothing),
        cmocka_unit_test(whoever_counts_no_turns_is_taken_at_its_word),
        cmocka_unit_test(a_long_step_that_was_announced_may_take_as_long),
        cmocka_unit_test(a_limit_that_is_none_is_the_usual_one_or_the_longest),
        cmocka_unit_test(after_it_the_usual_limit_holds_again),
        cmocka_unit_test(a_start_may_take_a_minute_and_no_longer),
        cmocka_unit_test(a_new_process_is_judged_anew),
        cmocka_unit_test(time_in_which_the_launcher_did_not_run_is_held_against_nobody),
        cmocka_unit_test(who_waits_for_a_processor_has_more_time_but_not_for_ever),
        cmocka_unit_test(what_the_kernel_tells_late_or_not_at_all_is_waiting_too),
        cmocka_unit_test(the_waits_of_a_thread_that_ended_are_held_against_nobody),
        cmocka_unit_test(threads_that_wait_at_once_wait_no_longer_than_one),
        cmocka_unit_test(who_computes_for_ever_hangs),
        cmocka_unit_test(who_is_debugged_is_left_alone),
        cmocka_unit_test(a_process_that_is_traced_is_seen_to_be),
        cmocka_unit_test(a_process_that_gets_no_processor_is_seen_to_wait),
        cmocka_unit_test(without_supervision_nobody_hangs),
        cmocka_unit_test(what_hung_and_what_was_started_again_is_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
