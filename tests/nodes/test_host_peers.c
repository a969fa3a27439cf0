/* SPDX-License-Identifier: MIT */
/* Two launchers that hear each other over a link with a delay each way, whose clocks
 * differ. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/launcher/host_peers.h"
#include "tests/nodes/near.h"

#define MS      1000000LL
#define RUNNING ANLOS__HOST_STATUS__STATE__RUNNING
#define DONE    ANLOS__HOST_STATUS__STATE__DONE
#define FAILED  ANLOS__HOST_STATUS__STATE__FAILED
#define LEFT    ANLOS__HOST_STATUS__STATE__LEFT

struct pair {
    struct host_peers a, b;
    int64_t now_ns;   /* by a's clock */
    int64_t ahead_ns; /* b's clock over a's */
    int64_t there_ns; /* a to b */
    int64_t back_ns;  /* b to a */
};

static void setup(struct pair *p, uint64_t file_of_b)
{
    struct hosts h = {.n = 2};

    strcpy(h.list[0].name, "a");
    strcpy(h.list[1].name, "b");
    *p = (struct pair){.now_ns = 1000000 * MS,
                       .ahead_ns = 7 * MS,
                       .there_ns = 20 * MS,
                       .back_ns = 20 * MS};
    host_peers_init(&p->a, &h, 1, 42);
    h.here = 1;
    host_peers_init(&p->b, &h, 2, file_of_b);
}

static void a_speaks(struct pair *p)
{
    Anlos__HostStatus m;
    int64_t sent_ns = p->now_ns;

    host_peers_say(&p->a, &m);
    p->now_ns += p->there_ns;
    host_peers_hear(&p->b, &m, p->a.epoch_ns, sent_ns, p->now_ns + p->ahead_ns);
}

static void b_speaks(struct pair *p)
{
    Anlos__HostStatus m;
    int64_t sent_ns = p->now_ns + p->ahead_ns;

    host_peers_say(&p->b, &m);
    p->now_ns += p->back_ns;
    host_peers_hear(&p->a, &m, p->b.epoch_ns, sent_ns, p->now_ns);
}

static void talk(struct pair *p, int n)
{
    for (int i = 0; i < n; i++) {
        a_speaks(p);
        b_speaks(p);
        p->now_ns += 460 * MS;
    }
}

static void assert_judged(struct pair *p, enum host_peers_verdict verdict,
                          const char *text)
{
    char found[HOST_PEERS_TEXT_SIZE] = "";

    assert_int_equal(host_peers_judge(&p->a, p->now_ns, found), verdict);
    assert_string_equal(found, text);
}

static void measured(struct pair *p, double *ahead_s, double *round_trip_s)
{
    Anlos__HostStatus m;

    host_peers_say(&p->a, &m);
    assert_int_equal(m.n_sights, 1);
    assert_string_equal(m.sights[0]->host, "b");
    *ahead_s = m.sights[0]->clock_ahead_s;
    *round_trip_s = m.sights[0]->round_trip_s;
}

static void the_difference_of_the_clocks_is_measured_and_told_once(void **state)
{
    struct pair p;
    double ahead_s, round_trip_s;

    (void)state;
    setup(&p, 42);
    talk(&p, 10);
    measured(&p, &ahead_s, &round_trip_s);
    assert_near(ahead_s, 0.007, 1e-9);
    assert_near(round_trip_s, 0.040, 1e-9);
    assert_judged(&p, HOST_PEERS_NOTE,
                  "host b: its clock is 7.0 ms ahead of this one's, to within 20.0 ms");
    assert_judged(&p, HOST_PEERS_GO_ON, "");
}

static void clocks_that_are_far_apart_are_warned_of(void **state)
{
    struct pair p;
    char text[HOST_PEERS_TEXT_SIZE];

    (void)state;
    setup(&p, 42);
    p.ahead_ns = -3000 * MS;
    talk(&p, 10);
    assert_int_equal(host_peers_judge(&p.a, p.now_ns, text), HOST_PEERS_WARNING);
    assert_non_null(strstr(text, "3000.0 ms behind this one's"));
    assert_non_null(strstr(text, "NTP"));
}

/* One way is resent: only the stamps of that message are wrong, by half of it. */
static void a_message_that_was_held_up_does_not_spoil_the_measurement(void **state)
{
    struct pair p;
    double ahead_s, round_trip_s;

    (void)state;
    setup(&p, 42);
    talk(&p, 3);
    p.back_ns = 900 * MS;
    talk(&p, 1);
    p.back_ns = 20 * MS;
    talk(&p, 2);
    measured(&p, &ahead_s, &round_trip_s);
    assert_near(ahead_s, 0.007, 1e-9);
    assert_near(round_trip_s, 0.040, 1e-9);
}

static void one_that_is_done_ends_the_others_when_it_was_heard_to_run(void **state)
{
    struct pair p;

    (void)state;
    setup(&p, 42);
    talk(&p, 2);
    assert_judged(&p, HOST_PEERS_GO_ON, "");
    host_peers_end(&p.b, DONE, "done, results are in out", p.now_ns + p.ahead_ns);
    host_peers_end(&p.b, FAILED, "no", p.now_ns + p.ahead_ns); /* the first one counts */
    assert_false(host_peers_may_leave(&p.b, p.now_ns + p.ahead_ns));
    b_speaks(&p);
    assert_judged(&p, HOST_PEERS_DONE, "host b: done, results are in out");
    assert_judged(&p, HOST_PEERS_GO_ON, "");
    a_speaks(&p); /* b has its answer */
    assert_true(host_peers_may_leave(&p.b, p.now_ns + p.ahead_ns));
    host_peers_end(&p.a, DONE, "done", p.now_ns);
    assert_true(host_peers_may_leave(&p.a, p.now_ns)); /* b has ended: it needs no word */
}

static void the_end_of_an_earlier_run_ends_nothing(void **state)
{
    struct pair p;

    (void)state;
    setup(&p, 42);
    host_peers_end(&p.b, DONE, "done", p.now_ns);
    talk(&p, 2);
    assert_judged(&p, HOST_PEERS_GO_ON, "");
}

static void one_that_fails_ends_the_others(void **state)
{
    struct pair p;

    (void)state;
    setup(&p, 42);
    talk(&p, 1);
    host_peers_end(&p.b, FAILED, "ended with exit code 2", p.now_ns);
    b_speaks(&p);
    assert_judged(&p, HOST_PEERS_FAILED, "host b: ended with exit code 2");
}

static void one_that_was_stopped_is_waited_for_and_may_come_back(void **state)
{
    struct pair p;

    (void)state;
    setup(&p, 42);
    talk(&p, 1);
    host_peers_end(&p.b, LEFT, "stopped", p.now_ns);
    b_speaks(&p);
    assert_judged(&p, HOST_PEERS_WARNING,
                  "host b was stopped; this one waits 60 s for it to come back");
    p.now_ns += HOST_PEERS_PATIENCE_NS - 1000 * MS;
    assert_judged(&p, HOST_PEERS_GO_ON, "");
    p.b.epoch_ns = 3;
    p.b.state = RUNNING;
    b_speaks(&p);
    assert_judged(&p, HOST_PEERS_NOTE, "host b was started again");
    p.now_ns += 1000 * MS;
    assert_judged(&p, HOST_PEERS_GO_ON, "");
}

static void a_silence_is_told_and_one_of_a_minute_is_the_end(void **state)
{
    struct pair p;
    char text[HOST_PEERS_TEXT_SIZE];

    (void)state;
    setup(&p, 42);
    talk(&p, 1);
    p.now_ns += 3000 * MS;
    assert_judged(&p, HOST_PEERS_WARNING, "host b is not heard any more");
    assert_judged(&p, HOST_PEERS_GO_ON, "");
    talk(&p, 1);
    assert_int_equal(host_peers_judge(&p.a, p.now_ns, text), HOST_PEERS_WARNING);
    assert_non_null(strstr(text, "host b is heard again, after 3."));
    p.now_ns += 3000 * MS;
    assert_judged(&p, HOST_PEERS_WARNING, "host b is not heard any more");
    p.now_ns += HOST_PEERS_PATIENCE_NS;
    assert_judged(&p, HOST_PEERS_FAILED, "host b has not been heard for 60 s");
}

/* Without a battery its clock restarts. */
static void one_that_comes_back_with_its_clock_behind_is_heard(void **state)
{
    struct pair p;

    (void)state;
    setup(&p, 42);
    talk(&p, 1);
    p.now_ns += 3000 * MS;
    assert_judged(&p, HOST_PEERS_WARNING, "host b is not heard any more");
    p.b.epoch_ns = 1;
    p.ahead_ns -= 3600000 * MS;
    b_speaks(&p);
    assert_judged(&p, HOST_PEERS_NOTE, "host b was started again");
    p.b.epoch_ns = 0; /* and this is one that was late */
    b_speaks(&p);
    p.b.epoch_ns = 1;
    b_speaks(&p);
    char text[HOST_PEERS_TEXT_SIZE];
    assert_int_equal(host_peers_judge(&p.a, p.now_ns, text), HOST_PEERS_WARNING);
    assert_non_null(strstr(text, "host b is heard again"));
    assert_judged(&p, HOST_PEERS_GO_ON, "");
}

static void one_that_was_never_heard_is_waited_for_without_end(void **state)
{
    struct pair p;

    (void)state;
    setup(&p, 42);
    p.now_ns += 100 * HOST_PEERS_PATIENCE_NS;
    assert_judged(&p, HOST_PEERS_GO_ON, "");
    host_peers_end(&p.a, LEFT, "stopped", p.now_ns);
    assert_true(host_peers_may_leave(&p.a, p.now_ns));
}

static void nobody_waits_for_ever_to_say_farewell(void **state)
{
    struct pair p;

    (void)state;
    setup(&p, 42);
    talk(&p, 1);
    host_peers_end(&p.a, DONE, "done", p.now_ns);
    assert_false(host_peers_may_leave(&p.a, p.now_ns));
    p.now_ns += HOST_PEERS_FAREWELL_NS + MS;
    assert_true(host_peers_may_leave(&p.a, p.now_ns));
}

static void another_launch_file_is_warned_of(void **state)
{
    struct pair p;

    (void)state;
    setup(&p, 43);
    talk(&p, 2);
    assert_judged(&p, HOST_PEERS_WARNING, "host b runs from another launch file");
    assert_judged(&p, HOST_PEERS_GO_ON, "");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_difference_of_the_clocks_is_measured_and_told_once),
        cmocka_unit_test(clocks_that_are_far_apart_are_warned_of),
        cmocka_unit_test(a_message_that_was_held_up_does_not_spoil_the_measurement),
        cmocka_unit_test(one_that_is_done_ends_the_others_when_it_was_heard_to_run),
        cmocka_unit_test(the_end_of_an_earlier_run_ends_nothing),
        cmocka_unit_test(one_that_fails_ends_the_others),
        cmocka_unit_test(one_that_was_stopped_is_waited_for_and_may_come_back),
        cmocka_unit_test(a_silence_is_told_and_one_of_a_minute_is_the_end),
        cmocka_unit_test(one_that_comes_back_with_its_clock_behind_is_heard),
        cmocka_unit_test(one_that_was_never_heard_is_waited_for_without_end),
        cmocka_unit_test(nobody_waits_for_ever_to_say_farewell),
        cmocka_unit_test(another_launch_file_is_warned_of),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
