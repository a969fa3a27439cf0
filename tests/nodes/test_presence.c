/* SPDX-License-Identifier: MIT */
/* Whether a node lives, with real locks of real processes. */
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "msgs/endpoint.h"
#include "nodes/rt/rundir.h"
#include "tests/hal/scratch.h"

static enum presence look(const char *folder, const char *node)
{
    static struct presence_locks locks;

    presence_read(&locks, NULL);
    return presence_of(&locks, folder, node);
}

static void a_node_without_a_lock_file_never_ran(void **state)
{
    struct scratch *s = *state;

    assert_int_equal(look(s->folder, "dsp"), PRESENCE_NEVER);
}

/* The child holds the lock until it is killed; looking does not take it. */
static void a_killed_process_is_gone(void **state)
{
    struct scratch *s = *state;
    struct error why = {.text = ""};
    int ready[2], status;
    char byte;

    assert_int_equal(pipe(ready), 0);
    pid_t child = fork();
    if (!child) {
        bool held = endpoint_lock(s->folder, "dsp", false, &why) >= 0;
        if (held && write(ready[1], "x", 1) == 1)
            pause();
        _exit(1);
    }
    assert_int_equal(read(ready[0], &byte, 1), 1);
    assert_int_equal(look(s->folder, "dsp"), PRESENCE_ALIVE);
    kill(child, SIGKILL);
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(look(s->folder, "dsp"), PRESENCE_GONE);
    int fd = endpoint_lock(s->folder, "dsp", false, &why);
    assert_true(fd >= 0);
    assert_int_equal(look(s->folder, "dsp"), PRESENCE_ALIVE);
    close(fd);
    assert_int_equal(look(s->folder, "dsp"), PRESENCE_GONE);
    close(ready[0]);
    close(ready[1]);
}

/* The same inode on another file system is held by somebody else, and one who only waits
 * for a lock does not hold it. */
static void a_lock_counts_with_its_inode_and_its_process(void **state)
{
    static struct presence_locks locks;
    struct scratch *s = *state;
    struct stat st;
    char text[512];

    const char *file = scratch_write(s, "dsp.lock", "4711\n");
    assert_int_equal(stat(file, &st), 0);
    unsigned long long inode = st.st_ino;
    snprintf(text, sizeof text,
             "1: FLOCK  ADVISORY  WRITE 4712 00:01:%llu 0 EOF\n"
             "2: FLOCK  ADVISORY  WRITE 4711 00:01:%llu 0 EOF\n"
             "2: -> FLOCK  ADVISORY  WRITE 4711 00:01:%llu 0 EOF\n"
             "3: POSIX  ADVISORY  WRITE 4711 00:01:%llu 0 EOF\n",
             inode, inode + 1, inode, inode);
    presence_read(&locks, scratch_write(s, "locks", text));
    assert_int_equal(locks.n, 2);
    assert_int_equal(presence_of(&locks, s->folder, "dsp"), PRESENCE_GONE);
    snprintf(text, sizeof text, "1: FLOCK  ADVISORY  WRITE 4711 00:01:%llu 0 EOF\n",
             inode);
    presence_read(&locks, scratch_write(s, "locks", text));
    assert_int_equal(presence_of(&locks, s->folder, "dsp"), PRESENCE_ALIVE);
    presence_read(&locks, "/nowhere");
    assert_int_equal(presence_of(&locks, s->folder, "dsp"), PRESENCE_GONE);
}

static void who_lives_in_a_replay_is_told_from_who_is_live(void **state)
{
    struct scratch *s = *state;

    assert_false(presence_replays(s->folder, "dsp"));
    int fd = endpoint_lock(s->folder, "dsp", true, NULL);
    assert_true(fd >= 0);
    assert_int_equal(look(s->folder, "dsp"), PRESENCE_ALIVE);
    assert_true(presence_replays(s->folder, "dsp"));
    close(fd);
    fd = endpoint_lock(s->folder, "dsp", false, NULL);
    assert_int_equal(look(s->folder, "dsp"), PRESENCE_ALIVE);
    assert_false(presence_replays(s->folder, "dsp"));
    close(fd);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_node_without_a_lock_file_never_ran,
                                        scratch_open, scratch_close),
        cmocka_unit_test_setup_teardown(who_lives_in_a_replay_is_told_from_who_is_live,
                                        scratch_open, scratch_close),
        cmocka_unit_test_setup_teardown(a_killed_process_is_gone, scratch_open,
                                        scratch_close),
        cmocka_unit_test_setup_teardown(a_lock_counts_with_its_inode_and_its_process,
                                        scratch_open, scratch_close),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
