/* SPDX-License-Identifier: MIT */
/* processors_usable, and that the recon node's steps go by it. */
#include "tests/hal/scratch.h"

#include <dirent.h>
#include <sched.h>

#include "nodes/recon/recon.h"
#include "nodes/recon/steady.h"
#include "nodes/rt/process.h"

static cpu_set_t all;

static void use_one(void)
{
    cpu_set_t one;
    int first = 0;

    while (!CPU_ISSET(first, &all))
        first++;
    CPU_ZERO(&one);
    CPU_SET(first, &one);
    assert_int_equal(sched_setaffinity(0, sizeof one, &one), 0);
}

static void use_all(void)
{
    assert_int_equal(sched_setaffinity(0, sizeof all, &all), 0);
}

/* Of this process. */
static size_t count_threads(void)
{
    DIR *tasks = opendir("/proc/self/task");
    size_t n = 0;

    assert_non_null(tasks);
    for (const struct dirent *e = readdir(tasks); e; e = readdir(tasks))
        n += e->d_name[0] != '.';
    closedir(tasks);
    return n;
}

/* Threads beside the caller's that a recon has, and a steady.  None ends before the
 * count: the kernel lists one that was joined for a while yet. */
static void count_of_steps(size_t asked, size_t *of_recon, size_t *of_steady)
{
    const struct scan_imager_config recon_cfg = {.method = "fast", .threads = asked};
    const struct static_array_config steady_cfg = {.threads = asked};
    struct recon *recon;
    struct steady *steady;
    size_t none = count_threads();

    assert_int_equal(recon_create(&recon, NULL, &recon_cfg), 0);
    size_t one = count_threads();
    assert_int_equal(steady_create(&steady, NULL, &steady_cfg), 0);
    size_t both = count_threads();
    *of_recon = one - none;
    *of_steady = both - one;
    recon_destroy(recon);
    steady_destroy(steady);
}

static void every_processor_that_may_be_used_is_counted(void **state)
{
    (void)state;
    assert_int_equal(processors_usable(), CPU_COUNT(&all));
}

static void where_one_may_be_used_there_is_one(void **state)
{
    (void)state;
    use_one();
    size_t n = processors_usable();
    use_all();
    assert_int_equal(n, 1);
}

static void steps_that_may_use_one_processor_start_no_thread(void **state)
{
    (void)state;
    size_t recon, steady;
    use_one();
    count_of_steps(0, &recon, &steady);
    use_all();
    assert_int_equal(recon, 0);
    assert_int_equal(steady, 0);
}

static void steps_that_are_told_a_number_go_by_it(void **state)
{
    (void)state;
    size_t recon, steady;
    use_one();
    count_of_steps(3, &recon, &steady);
    use_all();
    assert_int_equal(recon, 2);
    assert_int_equal(steady, 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_processor_that_may_be_used_is_counted),
        cmocka_unit_test(where_one_may_be_used_there_is_one),
        cmocka_unit_test(steps_that_may_use_one_processor_start_no_thread),
        cmocka_unit_test(steps_that_are_told_a_number_go_by_it),
    };
    if (sched_getaffinity(0, sizeof all, &all))
        return 1;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
