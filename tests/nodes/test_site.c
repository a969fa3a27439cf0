/* SPDX-License-Identifier: MIT */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <unistd.h>

#include "msgs/endpoint.h"
#include "nodes/launcher/site.h"

static struct launchfile on_two_hosts(struct scratch *s)
{
    struct launchfile l = {.hosts = {.n = 2}};
    char endpoint[128];

    strcpy(l.hosts.list[0].name, "vehicle");
    strcpy(l.hosts.list[1].name, "computer");
    snprintf(endpoint, sizeof endpoint, "ipc://%s", s->folder);
    assert_int_equal(host_set_endpoint(&l.hosts.list[0], endpoint, NULL), 0);
    assert_int_equal(host_set_endpoint(&l.hosts.list[1], "ipc:///elsewhere", NULL), 0);
    return l;
}

static void the_hosts_playback_publisher_the_run_folder_while_it_runs(void **state)
{
    struct scratch *s = *state;
    struct launchfile l = on_two_hosts(s);
    const struct arguments a = {0};
    char run_dir[RUNDIR_SIZE];
    struct hosts read;

    assert_int_equal(site_open(&l, &a, run_dir, NULL), 0);
    assert_string_equal(run_dir, s->folder);
    assert_int_equal(hosts_read(&read, run_dir, NULL), 0);
    assert_int_equal(read.n, 2);
    site_close(&l, run_dir);
    assert_int_equal(access(scratch_path(s, "hosts"), F_OK), -1);
}

static void the_launch_file_is_known_in_the_run_folder_while_it_runs(void **state)
{
    struct scratch *s = *state;
    struct launchfile l = on_two_hosts(s);
    const struct arguments a = {.run_dir = s->folder};
    char run_dir[RUNDIR_SIZE], path[PATH_MAX];

    snprintf(path, sizeof path, "%s",
             scratch_write(s, "launch.yaml", "nodes: [array]\n"));
    l.path = path;
    l.hosts.n = 0;
    assert_int_equal(site_open(&l, &a, run_dir, NULL), 0);
    char *found = rundir_launch(run_dir), *real = realpath(path, NULL);
    assert_non_null(found);
    assert_string_equal(found, real);
    free(found);
    free(real);
    site_close(&l, run_dir);
    assert_null(rundir_launch(run_dir));
    assert_int_equal(access(path, R_OK), 0); /* the file itself may lie there, too */
}

static void what_the_next_launcher_wrote_is_left_alone(void **state)
{
    struct scratch *s = *state;
    struct launchfile l = on_two_hosts(s);
    const struct arguments a = {0};
    char run_dir[RUNDIR_SIZE];

    assert_int_equal(site_open(&l, &a, run_dir, NULL), 0);
    int next = endpoint_lock(run_dir, "launcher", false, NULL);
    assert_true(next >= 0);
    assert_int_equal(site_open(&l, &a, run_dir, NULL), -EADDRINUSE);
    site_close(&l, run_dir);
    assert_int_equal(access(scratch_path(s, "hosts"), F_OK), 0);
    close(next);
}

static void a_folder_of_results_is_one_launchers(void **state)
{
    struct scratch *s = *state;
    struct error why = {""};
    int first, second = -1;

    assert_int_equal(site_lock_results(&first, s->folder, NULL), 0);
    assert_int_equal(site_lock_results(&second, s->folder, &why), -EADDRINUSE);
    assert_non_null(strstr(why.text, "another system writes its results there"));
    assert_non_null(strstr(why.text, s->folder));
    assert_non_null(strstr(why.text, "--out"));
    site_unlock_results(first, s->folder);
    assert_int_equal(access(scratch_path(s, ".anlos-launch.lock"), F_OK), -1);
    assert_int_equal(site_lock_results(&second, s->folder, &why), 0);
    site_unlock_results(second, s->folder);
}

/* Of one that was killed, or that lies on a disk which was full. */
static void a_lock_that_was_left_there_is_nobodys(void **state)
{
    struct scratch *s = *state;
    int lock;

    scratch_write(s, ".anlos-launch.lock", "1\n");
    assert_int_equal(site_lock_results(&lock, s->folder, NULL), 0);
    site_unlock_results(lock, s->folder);
    assert_int_equal(access(scratch_path(s, ".anlos-launch.lock"), F_OK), -1);
    site_unlock_results(-1, s->folder);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(the_hosts_playback_publisher_the_run_folder_while_it_runs),
        TEST(the_launch_file_is_known_in_the_run_folder_while_it_runs),
        TEST(what_the_next_launcher_wrote_is_left_alone),
        TEST(a_folder_of_results_is_one_launchers),
        TEST(a_lock_that_was_left_there_is_nobodys),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
