/* SPDX-License-Identifier: MIT */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <limits.h>
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

static void assert_refused(const char *asked, const char *reason)
{
    struct error why = {""};
    char got[RUNDIR_SIZE];

    assert_int_equal(rundir_open(got, asked, &why), -EACCES);
    assert_contains(why.text, reason);
    why.text[0] = '\0';
    assert_int_equal(rundir_check(got, &why), -EACCES);
    assert_contains(why.text, reason);
}

static void a_folder_that_others_can_write_is_refused(void **state)
{
    static const mode_t modes[] = {0777, 01777, 0770, 0702};
    struct scratch *s = *state;
    char asked[512];

    setenv("XDG_RUNTIME_DIR", s->folder, 1);
    scratch_folder(s, "anlos");
    snprintf(asked, sizeof asked, "%s", s->path);
    for (size_t i = 0; i < sizeof modes / sizeof *modes; i++) {
        assert_int_equal(chmod(asked, modes[i]), 0);
        assert_refused(asked, "others may write into it");
        assert_refused(NULL, "others may write into it");
    }
    assert_int_equal(chmod(asked, 0755), 0);
    assert_int_equal(rundir_check(asked, NULL), 0);
}

/* But for a folder like /tmp, whose owners of entries alone rename them. */
static void a_folder_that_others_can_replace_is_refused(void **state)
{
    struct scratch *s = *state;
    struct error why = {""};
    char parent[80], asked[88], link[88], got[RUNDIR_SIZE];

    snprintf(parent, sizeof parent, "%s/all", s->folder);
    snprintf(asked, sizeof asked, "%s/run", parent);
    snprintf(link, sizeof link, "%s/link", s->folder);
    assert_int_equal(mkdir(parent, 0700), 0);
    assert_int_equal(chmod(parent, 0777), 0);
    assert_int_equal(rundir_check(asked, &why), -EACCES); /* it is not made yet */
    assert_refused(asked, "is everybody's (mode 777)");
    assert_int_equal(symlink(asked, link), 0);
    assert_refused(link, "is everybody's (mode 777)");
    assert_int_equal(chmod(parent, 01777), 0);
    assert_int_equal(rundir_open(got, asked, NULL), 0);
    assert_int_equal(rundir_open(got, link, NULL), 0);
}

static void a_link_in_the_place_of_the_default_is_refused(void **state)
{
    struct scratch *s = *state;
    struct error why = {""};
    char target[512], got[RUNDIR_SIZE];

    setenv("XDG_RUNTIME_DIR", s->folder, 1);
    scratch_folder(s, "mine");
    snprintf(target, sizeof target, "%s", s->path);
    assert_int_equal(chmod(target, 0700), 0);
    assert_int_equal(symlink(target, scratch_path(s, "anlos")), 0);
    assert_int_equal(rundir_open(got, NULL, &why), -EACCES);
    assert_contains(why.text, "is a link");
}

static void a_file_in_its_place_is_named(void **state)
{
    struct error why = {""};
    char got[RUNDIR_SIZE];
    const char *path = scratch_write(*state, "run", "");

    assert_int_equal(rundir_open(got, path, &why), -EINVAL);
    assert_contains(why.text, path);
}

/* Another process looks, as somebody else; without root it cannot be. */
static void a_folder_of_somebody_else_is_refused(void **state)
{
    struct scratch *s = *state;
    struct error why = {""};
    char asked[512];
    int status;

    if (geteuid()) { /* root's, seen by somebody else */
        assert_int_equal(rundir_check("/usr", &why), -EACCES);
        return;
    }
    scratch_folder(s, "run");
    snprintf(asked, sizeof asked, "%s", s->path);
    assert_int_equal(chmod(asked, 0755), 0);
    assert_int_equal(chmod(s->folder, 0711), 0);
    pid_t pid = fork();
    if (!pid)
        _exit(setuid(65534) || rundir_check(asked, &why) != -EACCES ||
              !strstr(why.text, "is user 0's"));
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_int_equal(status, 0);
    assert_int_equal(chown(asked, 65534, 65534), 0);
    assert_refused(asked, "is user 65534's");
}

static void a_folder_that_is_not_there_may_be_made(void **state)
{
    (void)state;
    assert_int_equal(rundir_check("/nowhere/at/all", NULL), 0);
}

/* Each kind of program, with its sentence. */
static void every_program_refuses_and_ends_with_2(void **state)
{
    static const char *const programs[][8] = {
        {"anlos", "launch", "LAUNCH"},
        {"anlos-can", "--launch", "LAUNCH"},
        {"anlos", "top", "--once"},
        {"anlos", "topic", "hz", "ping"},
        {"anlos", "node", "list"},
        {"anlos", "stage", "status"},
        {"anlos", "bag", "record", "-o", "a.mcap"},
        {"anlos", "view", "--port", "0"},
    };
    struct scratch *s = *state;
    char asked[512], launch[512], line[3000], text[2000];

    snprintf(launch, sizeof launch, "%s",
             scratch_write(s, "a.yaml", "nodes: [can]\narray: {uri: 'sim:x'}\n"));
    scratch_folder(s, "run");
    snprintf(asked, sizeof asked, "%s", s->path);
    assert_int_equal(chmod(asked, 0777), 0);
    for (size_t i = 0; i < sizeof programs / sizeof *programs; i++) {
        size_t used = (size_t)snprintf(line, sizeof line, "cd %s && %s/bin/", s->folder,
                                       BINARY_DIR);
        for (size_t k = 0; programs[i][k]; k++)
            used += (size_t)snprintf(line + used, sizeof line - used, "%s ",
                                     strcmp(programs[i][k], "LAUNCH") ? programs[i][k]
                                                                      : launch);
        snprintf(line + used, sizeof line - used, "--run-dir %s 2>&1 </dev/null", asked);
        FILE *f = popen(line, "r");
        assert_non_null(f);
        text[fread(text, 1, sizeof text - 1, f)] = '\0';
        int status = pclose(f);
        if (!WIFEXITED(status) || WEXITSTATUS(status) != 2 ||
            !strstr(text, "others may write into it (mode 777)"))
            fail_msg("%s: status %x, %s", line, (unsigned)status, text);
    }
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

static void the_launch_file_is_found_from_any_folder_while_it_is_there(void **state)
{
    struct scratch *s = *state;
    char here[PATH_MAX];

    assert_null(rundir_launch(s->folder));
    scratch_write(s, "sub.yaml", "nodes: [array]\n");
    scratch_write(s, "other.yaml", "nodes: [array]\n");
    assert_non_null(getcwd(here, sizeof here));
    assert_int_equal(chdir(s->folder), 0); /* as the launcher was told it: relative */
    assert_int_equal(rundir_set_launch(s->folder, "other.yaml", NULL), 0);
    assert_int_equal(rundir_set_launch(s->folder, "sub.yaml", NULL), 0);
    assert_int_equal(chdir(here), 0);

    char *found = rundir_launch(s->folder), *real = realpath(s->folder, NULL);
    char expected[PATH_MAX];
    snprintf(expected, sizeof expected, "%s/sub.yaml", real);
    assert_non_null(found);
    assert_string_equal(found, expected);
    free(found);
    free(real);

    assert_int_equal(unlink(expected), 0);
    assert_null(rundir_launch(s->folder));
    assert_int_equal(rundir_set_launch(s->folder, NULL, NULL), 0);
    assert_int_equal(rundir_set_launch(s->folder, NULL, NULL), 0);
    assert_int_equal(rundir_set_launch(s->folder, expected, NULL), -ENOENT);
}

static void a_file_of_the_user_is_not_replaced_by_the_link(void **state)
{
    struct scratch *s = *state;
    char path[PATH_MAX];

    snprintf(path, sizeof path, "%s", scratch_write(s, "launch-file", "precious"));
    assert_int_equal(rundir_set_launch(s->folder, path, NULL), -EEXIST);
    assert_int_equal(rundir_set_launch(s->folder, NULL, NULL), -EEXIST);
    struct stat st;
    assert_int_equal(lstat(path, &st), 0);
    assert_true(S_ISREG(st.st_mode) && st.st_size == 8);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_folder_asked_for_is_made),
        TEST(the_default_is_in_the_runtime_folder),
        TEST(a_folder_that_others_can_write_is_refused),
        TEST(a_folder_that_others_can_replace_is_refused),
        TEST(a_link_in_the_place_of_the_default_is_refused),
        TEST(a_file_in_its_place_is_named),
        TEST(a_folder_of_somebody_else_is_refused),
        TEST(a_folder_that_is_not_there_may_be_made),
        TEST(every_program_refuses_and_ends_with_2),
        TEST(a_name_too_long_for_sockets_is_refused),
        TEST(the_launch_file_is_found_from_any_folder_while_it_is_there),
        TEST(a_file_of_the_user_is_not_replaced_by_the_link),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
