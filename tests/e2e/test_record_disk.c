/* SPDX-License-Identifier: MIT */
/* A system that records itself onto a file system that fills up. */
#include "record_launch.h"
#include "tests/optional.h"
#include "tests/small_disk.h"

/* In a process of its own: the mount is its own too. */
static int record_onto_a_small_disk(struct scratch *s)
{
    char bag[128];
    uint64_t n_faults;
    struct bag_catalog *c;

    snprintf(bag, sizeof bag, "%s/small", s->folder);
    if (mkdir(bag, 0777))
        return 5;
    if (small_disk_mount(bag))
        return 77;
    strcat(bag, "/a.mcap");
    if (launch(s, bag) != 1) /* the results are there, and the bag is short */
        return 1;
    if (!said(s, "recording stops: ", false) || !said(s, "No space left", false))
        return 2;
    /* Nobody asked for the last seconds. */
    if (said(s, "kept on", false) || said(s, " saved, ", false) ||
        !said(s, "MB in 1 file", false))
        return 7;
    /* On a busy machine the scan may be done before the launcher sees it. */
    if (!said(s, "the others go on without it", false) &&
        !said(s, "the recording is not whole", false))
        return 6;
    if (bag_check(&n_faults, bag, NULL, NULL) || n_faults ||
        bag_catalog_open(&c, bag, NULL))
        return 3;
    bool whole = !c->scanned && c->n_messages > 0;
    bag_catalog_close(c);
    return whole ? 0 : 4;
}

static void a_full_disk_stops_the_recording_and_nothing_else(void **state)
{
    struct scratch *s = *state;
    int status;
    pid_t pid;

    write_launch(s);
    pid = fork();
    assert_true(pid >= 0);
    if (!pid)
        _exit(record_onto_a_small_disk(s));
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFEXITED(status));
    if (WEXITSTATUS(status) == 77)
        optional_skip("mounting is not allowed here", "");
    if (WEXITSTATUS(status))
        said(s, "", true);
    assert_int_equal(WEXITSTATUS(status), 0);
    assert_int_equal(access(scratch_path(s, "out/detections.json"), F_OK), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_full_disk_stops_the_recording_and_nothing_else,
                                        scratch_open, scratch_close),
    };

    return optional_code(cmocka_run_group_tests(tests, NULL, NULL));
}
