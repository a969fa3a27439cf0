/* SPDX-License-Identifier: MIT */
/* A recording onto a file system that fills up. */
#include "recorder_full.h"
#include "tests/optional.h"
#include "tests/small_disk.h"

#include <errno.h>

static int fill_tmpfs(struct rig *g)
{
    return small_disk_mount(g->scratch->folder) ? 77 : fill_disk(g, -ENOSPC);
}

static void a_full_disk_ends_the_recording_with_a_whole_file(void **state)
{
    int code = run_child(*state, fill_tmpfs);

    if (code == 77)
        optional_skip("mounting is not allowed here", "");
    assert_int_equal(code, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        RIG_TEST(a_full_disk_ends_the_recording_with_a_whole_file),
    };
    return optional_code(cmocka_run_group_tests(tests, NULL, NULL));
}
