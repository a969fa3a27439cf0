/* SPDX-License-Identifier: MIT */
/* A node's program in the environment of a launcher, which the test is. */
#include "tests/hal/scratch.h"
#include "tests/nodes/alone.h"

#include <inttypes.h>
#include <time.h>
#include <unistd.h>

#define HOUR_NS INT64_C(3600000000000)

/* When the node says that it is there, by its own clock. */
static int64_t hear_ns(struct alone *a)
{
    struct bus_message m;

    assert_int_equal(bus_receive(a->listener, &m, 60000), 0);
    int64_t published_ns = m.envelope.publish_ns;
    bus_message_free(&m);
    return published_ns;
}

/* How far it is behind this process, and what it says. */
static int64_t behind_ns(const struct scratch *s, const char *clock, char **log)
{
    struct alone a;

    setenv("ANLOS_CLOCK", clock, 1);
    alone_start(&a, s->folder, "track", "nodes: [recon, track]\n");
    unsetenv("ANLOS_CLOCK");
    int64_t began_ns = alone_now_ns(), heard_ns = hear_ns(&a);
    *log = alone_log(&a);
    alone_stop(&a);
    return (began_ns + alone_now_ns()) / 2 - heard_ns;
}

static void a_node_counts_by_the_clock_of_its_launcher(void **state)
{
    char clock[64], *log;
    struct timespec t;

    assert_int_equal(clock_gettime(CLOCK_MONOTONIC, &t), 0);
    snprintf(clock, sizeof clock, "%ld:%" PRId64, (long)getpid(),
             alone_now_ns() - HOUR_NS - t.tv_sec * INT64_C(1000000000) - t.tv_nsec);
    int64_t ns = behind_ns(*state, clock, &log);
    assert_true(ns > HOUR_NS - HOUR_NS / 10 && ns < HOUR_NS + HOUR_NS / 10);
    assert_null(strstr(log, "ANLOS_CLOCK"));
    free(log);
}

static void one_that_is_damaged_is_said_and_not_taken(void **state)
{
    char *log;
    int64_t ns = behind_ns(*state, "noon", &log);

    assert_true(ns > -HOUR_NS / 10 && ns < HOUR_NS / 10);
    assert_contains(log, "warning ANLOS_CLOCK \"noon\" is no clock of the launcher");
    free(log);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_node_counts_by_the_clock_of_its_launcher),
        TEST(one_that_is_damaged_is_said_and_not_taken),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
