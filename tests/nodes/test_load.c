/* SPDX-License-Identifier: MIT */
/* Can a machine keep the pace of a drive?  The judgement, and what it is made from. */
#include "tests/nodes/launch_load.h"

#include <sched.h>

#include "nodes/anlos/doctor/doctor.h"
#include "tests/nodes/near.h"

#define FIXED                                                                            \
    "scan: {mode: fixed}\nrecon: {frames: {pings: 8, sum: power, every: ping}}\n"

static enum finding_level judge(double needed, double left)
{
    const struct load m = {needed, left};
    struct findings f = {0};

    load_judge(&m, &f);
    assert_int_equal(f.n, 1);
    enum finding_level level = f.list[0].level;
    assert_int_equal(level == FINDING_OK, !f.list[0].todo[0]);
    findings_clear(&f);
    return level;
}

/* 70 % of what there is are the budget; a note comes from 75 % of that on. */
static void more_than_the_budget_is_wrong(void **state)
{
    (void)state;
    assert_int_equal(judge(1.04, 2.0), FINDING_OK);
    assert_int_equal(judge(1.06, 2.0), FINDING_NOTE);
    assert_int_equal(judge(1.39, 2.0), FINDING_NOTE);
    assert_int_equal(judge(1.41, 2.0), FINDING_WRONG);
    assert_int_equal(judge(0.69, 1.0), FINDING_NOTE);
    assert_int_equal(judge(0.71, 1.0), FINDING_WRONG);
    assert_int_equal(judge(0.31, 0.33), FINDING_WRONG);
    assert_int_equal(judge(0.31, 0.0), FINDING_WRONG);
    assert_int_equal(judge((double)NAN, 2.0), FINDING_WRONG);
}

static void what_is_needed_and_what_there_is_are_said(void **state)
{
    const struct load m = {1.5, 2.0};
    struct findings f = {0};

    (void)state;
    load_judge(&m, &f);
    assert_non_null(strstr(f.list[0].what, "need 1.50"));
    assert_non_null(strstr(f.list[0].what, "2.00 are there"));
    assert_non_null(strstr(f.list[0].what, "may take 1.40: lists will be late"));
    assert_non_null(strstr(f.list[0].todo, "real-time priorities"));
    findings_clear(&f);
}

static void idle_processors_count_only_for_who_may_use_them(void **state)
{
    (void)state;
    assert_near(load_left(1.0, 15.0, 16), 2.0, 1e-9); /* no more are kept busy */
    assert_near(load_left(1.0, 1.0, 1), 1.0, 1e-9);
    assert_near(load_left(1.0, 0.0, 2), 1.0, 1e-9);   /* another program has one */
    assert_near(load_left(0.6, 0.1, 2), 0.6, 1e-9);   /* others have both */
    assert_near(load_left(0.5, 15.5, 16), 0.5, 1e-9); /* a limit of half a processor */
}

/* Of values that no other program can change. */
static void a_drive_is_measured_on_the_processors_it_may_use(void **state)
{
    struct error why = {""};
    struct load m = {0};
    cpu_set_t before, one;
    int first = 0;
    struct launchfile *l = launch_load_with(
        *state,
        "nodes: [array, scan, dsp, recon, wall, track]\n" FIXED
        "array: {uri: 'sim:" SOURCE_DIR "/launch/scenes/drive-person.yaml'}\n"
        "processes: {realtime: off}\n",
        NULL);

    assert_int_equal(sched_getaffinity(0, sizeof before, &before), 0);
    while (!CPU_ISSET(first, &before))
        first++;
    CPU_ZERO(&one);
    CPU_SET(first, &one);
    assert_int_equal(sched_setaffinity(0, sizeof one, &one), 0);
    int err = load_measure(l, 0.0, &m, &why);
    assert_int_equal(sched_setaffinity(0, sizeof before, &before), 0);
    if (err)
        fail_msg("%s", why.text);
    assert_true(m.needed > 0.0);
    assert_true(m.left > 0.0 && m.left <= 1.0);
    launchfile_destroy(l);
}

static void what_is_no_drive_is_not_measured(void **state)
{
    struct error why = {""};
    struct load m;
    struct launchfile *l = launch_load_with(*state,
                                            "nodes: [array, scan, dsp, recon]\n" FIXED
                                            "array: {uri: 'sim:" SOURCE_DIR
                                            "/launch/scenes/point.yaml'}\n",
                                            NULL);

    assert_true(load_measure(l, 0.0, &m, &why) < 0);
    assert_true(why.text[0]);
    launchfile_destroy(l);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(more_than_the_budget_is_wrong),
        cmocka_unit_test(what_is_needed_and_what_there_is_are_said),
        cmocka_unit_test(idle_processors_count_only_for_who_may_use_them),
        cmocka_unit_test(a_drive_is_measured_on_the_processors_it_may_use),
        cmocka_unit_test(what_is_no_drive_is_not_measured),
    };
    return cmocka_run_group_tests(tests, scratch_open, scratch_close);
}
