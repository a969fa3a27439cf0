/* SPDX-License-Identifier: MIT */
/* A disk that fills ends the recording, and not what is kept in memory beside it. */
#include "snapshot_launch.h"
#include "tests/optional.h"

static bool mounts(const char *folder)
{
    pid_t pid = fork();

    if (!pid)
        _exit(small_disk_mount(folder) ? 1 : 0);
    return !end_of(pid);
}

/* The recorder's word that its file has ended and the ring goes on. */
static void await_stop(struct system *y)
{
    bool stopped = false;

    while (!stopped) {
        Anlos__Health *h = (Anlos__Health *)hear(y, topic_health());
        stopped = !strcmp(h->node, "record") &&
                  h->state == ANLOS__HEALTH__STATE__DEGRADED &&
                  strstr(h->text, "No space left on device") &&
                  strstr(h->text, "the last seconds are kept on");
        anlos__health__free_unpacked(h, NULL);
    }
}

static void a_full_disk_of_the_recording_leaves_the_last_seconds(void **state)
{
    struct system y = {.s = *state};
    char line[512], path[512];

    scratch_folder(y.s, "small");
    if (!mounts(scratch_path(y.s, "small")))
        optional_skip("mounting is not allowed here", "");
    start(&y, true);
    await_stop(&y);
    if (run(&y, line, (char *[]){"anlos", "bag", "save", "--run-dir", y.s->folder, NULL}))
        fail_msg("%s", line);
    snprintf(path, sizeof path, "%s", line);
    check_image(&y, path, "one");
    kill(y.pid, SIGINT);
    assert_int_equal(end_of(y.pid), 1); /* not all was recorded that should have been */
    bus_destroy(y.bus);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        SCRATCH_TEST(a_full_disk_of_the_recording_leaves_the_last_seconds),
    };

    return optional_code(cmocka_run_group_tests(tests, NULL, NULL));
}
