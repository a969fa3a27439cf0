#include "tests/hal/scratch.h"

#include <errno.h>
#include <sys/wait.h>
#include <unistd.h>

#include "nodes/rt/rundir.h"

static void a_folder_asked_for_is_made(void **state)
{
    char asked[88], got[RUNDIR_SIZE];
    struct stat st;

    snprintf(asked, sizeof asked, "%s/run", ((struct scratch *)*state)->folder);
    assert_int_equal(rundir_open(got, asked, NULL), 0);
    assert_string_equal(got, asked);
    assert_int_equal(stat(got, &st), 0);
    assert_true(S_ISDIR(st.st_mode));
    assert_int_equal(st.st_mode & 0777, 0700);
    assert_int_equal(rundir_open(got, asked, NULL), 0); /* and found again */
}

static void the_default_is_in_the_runtime_folder(void **state)
{
    struct scratch *s = *state;
    char got[RUNDIR_SIZE];

    setenv("XDG_RUNTIME_DIR", s->folder, 1);
    assert_int_equal(rundir_open(got, NULL, NULL), 0);
    assert_string_equal(got, scratch_path(s, "anlos"));
}

static void a_default_that_others_can_write_is_refused(void **state)
{
    struct scratch *s = *state;
    struct complaint why = {""};
    char got[RUNDIR_SIZE];

    setenv("XDG_RUNTIME_DIR", s->folder, 1);
    scratch_folder(s, "anlos");
    assert_int_equal(chmod(s->path, 0777), 0);
    assert_int_equal(rundir_open(got, NULL, &why), -EACCES);
    assert_contains(why.text, "must be yours alone");
}

static void a_file_in_its_place_is_named(void **state)
{
    struct complaint why = {""};
    char got[RUNDIR_SIZE];
    const char *path = scratch_write(*state, "run", "");

    assert_int_equal(rundir_open(got, path, &why), -EINVAL);
    assert_contains(why.text, path);
}

/* root is let in everywhere: a process of another user looks. */
static void a_folder_of_somebody_else_is_not_taken_for_an_empty_one(void **state)
{
    struct scratch *s = *state;
    struct complaint why = {""};
    int status;

    scratch_folder(s, "run");
    assert_int_equal(chmod(s->path, 0500), 0);
    pid_t pid = fork();
    if (!pid) {
        if (!geteuid() && (chmod(s->folder, 0711) || setuid(65534)))
            _exit(1);
        _exit(rundir_check(s->path, &why) == -EACCES &&
                      strstr(why.text, "closed to others")
                  ? 0
                  : 2);
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
    assert_int_equal(rundir_check("/nowhere/at/all", &why), 0); /* to be made */
}

static void a_name_too_long_for_sockets_is_refused(void **state)
{
    char asked[200], got[RUNDIR_SIZE];

    (void)state;
    memset(asked, 'x', sizeof asked - 1);
    asked[0] = '/';
    asked[sizeof asked - 1] = '\0';
    assert_int_equal(rundir_open(got, asked, NULL), -EINVAL);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_folder_asked_for_is_made),
        TEST(the_default_is_in_the_runtime_folder),
        TEST(a_default_that_others_can_write_is_refused),
        TEST(a_file_in_its_place_is_named),
        TEST(a_folder_of_somebody_else_is_not_taken_for_an_empty_one),
        TEST(a_name_too_long_for_sockets_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
