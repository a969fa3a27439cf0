/* `anlos launch` with shell scripts in the place of the nodes.  A script that is to wait
 * reads from a pipe; a script that is to tell something writes into one. */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#define DEADLINE_MS 30000

struct rig {
    struct scratch *scratch;
    pid_t pid;
    int out; /* what the launcher says, stdout and stderr */
    char text[16384];
};

/* Runs until it is stopped, and says so when it is.  The trap is set before anything is
 * told to others, who may stop it at once. */
#define TRAP "trap 'echo info stopped; test -z \"$!\" || kill $!; exit 0' TERM\n"
#define STAY                                                                             \
    "sleep 1000 >&- 2>&- &\n"                                                            \
    "wait\n"

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);

    if (!r || scratch_open((void **)&r->scratch) ||
        mkfifo(scratch_path(r->scratch, "go"), 0600))
        return -1;
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;
    void *scratch = r->scratch;

    free(r);
    return scratch_close(&scratch);
}

/* script may name $0's folder as $D. */
static void write_node(struct rig *r, const char *name, const char *script)
{
    char file[32], text[1024];

    snprintf(file, sizeof file, "anlos-%s", name);
    snprintf(text, sizeof text, "#!/bin/sh\nD=${0%%/*}\n%s\n", script);
    assert_int_equal(chmod(scratch_write(r->scratch, file, text), 0755), 0);
}

static void write_launch(struct rig *r, const char *nodes)
{
    char text[512];

    snprintf(text, sizeof text, "nodes: [%s]\narray: {uri: 'wav:/rec'}\n", nodes);
    scratch_write(r->scratch, "launch.yaml", text);
}

static void exec_launcher(const struct rig *r, int out)
{
    char launch[128], out_dir[128];

    snprintf(launch, sizeof launch, "%s/launch.yaml", r->scratch->folder);
    snprintf(out_dir, sizeof out_dir, "%s/out", r->scratch->folder);
    dup2(out, STDOUT_FILENO);
    dup2(out, STDERR_FILENO);
    setenv("ANLOS_BIN_DIR", r->scratch->folder, 1);
    execl(BINARY_DIR "/bin/anlos", "anlos", "launch", launch, "--run-dir",
          r->scratch->folder, "--out", out_dir, NULL);
    _exit(99);
}

static void start(struct rig *r)
{
    int fds[2];

    assert_int_equal(pipe2(fds, O_CLOEXEC), 0);
    r->pid = fork();
    assert_true(r->pid >= 0);
    if (!r->pid)
        exec_launcher(r, fds[1]);
    close(fds[1]);
    r->out = fds[0];
    r->text[0] = '\0';
}

/* Reads what the launcher says until a text comes (NULL: to the end). */
static void read_until(struct rig *r, const char *word)
{
    size_t used = strlen(r->text);

    while (!word || !strstr(r->text, word)) {
        struct pollfd fd = {.fd = r->out, .events = POLLIN};
        if (poll(&fd, 1, DEADLINE_MS) <= 0)
            fail_msg("the launcher does not say \"%s\" but: %s", word ? word : "(end)",
                     r->text);
        ssize_t n = read(r->out, r->text + used, sizeof r->text - 1 - used);
        assert_true(n >= 0);
        if (!n)
            break;
        used += (size_t)n;
        r->text[used] = '\0';
    }
    if (word)
        assert_contains(r->text, word);
}

/* Reads to the end; returns the exit code. */
static int finish(struct rig *r)
{
    int status;

    read_until(r, NULL);
    close(r->out);
    assert_int_equal(waitpid(r->pid, &status, 0), r->pid);
    assert_true(WIFEXITED(status));
    return WEXITSTATUS(status);
}

static unsigned count(const char *text, const char *word)
{
    unsigned n = 0;

    for (const char *p = text; (p = strstr(p, word)); p += strlen(word))
        n++;
    return n;
}

static void when_the_report_is_written_all_others_are_stopped(void **state)
{
    struct rig *r = *state;

    write_launch(r, "scan, can, report");
    write_node(r, "scan", TRAP "echo go > $D/go\n" STAY);
    write_node(r, "can", TRAP STAY);
    write_node(r, "report", "read x < $D/go; exit 0");
    start(r);
    assert_int_equal(finish(r), 0);
    assert_contains(r->text, "scan    info    stopped");
}

static void lines_carry_node_and_level(void **state)
{
    struct rig *r = *state;

    write_launch(r, "can, report");
    write_node(r, "can",
               TRAP "echo warning mind the step >&2; echo plain; echo go > $D/go\n" STAY);
    write_node(r, "report", "read x < $D/go");
    start(r);
    assert_int_equal(finish(r), 0);
    assert_contains(r->text, "can     warning mind the step\n");
    assert_contains(r->text, "can     info    plain\n");
}

static void a_crashed_node_is_started_again(void **state)
{
    struct rig *r = *state;

    write_launch(r, "can, report");
    write_node(r, "can",
               "if test -e $D/second; then echo go > $D/go; fi\n"
               "if test -e $D/first; then : > $D/second; kill -SEGV $$; fi\n"
               ": > $D/first; exit 1\n");
    write_node(r, "report", "read x < $D/go");
    start(r);
    assert_int_equal(finish(r), 0);
    assert_contains(r->text,
                    "can     warning ended with exit code 1; starts again in 0.1 s");
    assert_contains(r->text, "can     warning ended with signal 11 (Segmentation fault); "
                             "starts again in 0.2 s");
}

static void a_node_that_always_crashes_is_given_up(void **state)
{
    struct rig *r = *state;

    write_launch(r, "scan, can");
    write_node(r, "scan", TRAP STAY);
    write_node(r, "can", "exit 1");
    start(r);
    assert_int_equal(finish(r), 1);
    assert_int_equal(count(r->text, "starts again"), 5);
    assert_contains(r->text,
                    "can     error   ended with exit code 1 6 times; it is given up");
    assert_contains(r->text, "scan    info    stopped");
}

static void bad_configuration_stops_all_at_once(void **state)
{
    struct rig *r = *state;

    write_launch(r, "scan, can");
    write_node(r, "scan", TRAP "echo go > $D/go\n" STAY);
    write_node(r, "can", "read x < $D/go; echo error a.yaml:3: what is this >&2; exit 2");
    start(r);
    assert_int_equal(finish(r), 2);
    assert_contains(r->text, "can     error   a.yaml:3: what is this");
    assert_contains(r->text, "scan    info    stopped");
    assert_int_equal(count(r->text, "starts again"), 0);
}

static void ctrl_c_stops_all_cleanly(void **state)
{
    struct rig *r = *state;

    write_launch(r, "scan, can, report");
    write_node(r, "scan", TRAP "read x < $D/go; echo info scan is here\n" STAY);
    write_node(r, "can", TRAP "echo go > $D/go\n" STAY);
    write_node(r, "report", TRAP STAY);
    start(r);
    read_until(r, "scan is here");
    assert_int_equal(kill(r->pid, SIGINT), 0);
    assert_int_equal(finish(r), 130);
    assert_contains(r->text, "scan    info    stopped");
}

static void a_node_that_will_not_stop_is_killed(void **state)
{
    struct rig *r = *state;

    write_launch(r, "can");
    write_node(r, "can",
               "trap '' TERM; echo info here; mkfifo $D/never; read x < $D/never");
    start(r);
    read_until(r, "here");
    assert_int_equal(kill(r->pid, SIGTERM), 0);
    assert_int_equal(finish(r), 143);
    assert_contains(r->text, "can     warning does not stop; killed");
}

static void nodes_that_all_end_end_the_launch(void **state)
{
    struct rig *r = *state;

    write_launch(r, "can, scan");
    write_node(r, "can", "exit 0");
    write_node(r, "scan", "exit 0");
    start(r);
    assert_int_equal(finish(r), 0);
}

static void nodes_get_their_arguments(void **state)
{
    struct rig *r = *state;
    char expected[600];

    write_launch(r, "can");
    write_node(r, "can", "echo info \"$@\"");
    start(r);
    assert_int_equal(finish(r), 0);
    const char *d = r->scratch->folder;
    snprintf(
        expected, sizeof expected,
        "info    --launch %s/launch.yaml --run-dir %s --log-level info --out %s/out\n", d,
        d, d);
    assert_contains(r->text, expected);
}

static void a_program_that_is_missing_is_named(void **state)
{
    struct rig *r = *state;

    write_launch(r, "scan, can");
    write_node(r, "scan", TRAP STAY);
    start(r);
    assert_int_equal(finish(r), 2);
    assert_contains(r->text, "anlos-can: cannot be started: No such file or directory");
}

static void a_bad_launch_file_starts_nothing(void **state)
{
    struct rig *r = *state;

    write_launch(r, "can, radar");
    write_node(r, "can", "echo info never");
    start(r);
    assert_int_equal(finish(r), 2);
    assert_contains(r->text, "launch.yaml:1: ");
    assert_int_equal(count(r->text, "never"), 0);
}

static void an_output_folder_that_cannot_be_starts_nothing(void **state)
{
    struct rig *r = *state;

    write_launch(r, "can, report");
    write_node(r, "can", "echo info never");
    write_node(r, "report", "echo info never");
    scratch_write(r->scratch, "out", "a file where the folder should be");
    start(r);
    assert_int_equal(finish(r), 2);
    assert_contains(r->text, "/out");
    assert_int_equal(count(r->text, "never"), 0);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(when_the_report_is_written_all_others_are_stopped),
        TEST(lines_carry_node_and_level),
        TEST(a_crashed_node_is_started_again),
        TEST(a_node_that_always_crashes_is_given_up),
        TEST(bad_configuration_stops_all_at_once),
        TEST(ctrl_c_stops_all_cleanly),
        TEST(a_node_that_will_not_stop_is_killed),
        TEST(nodes_that_all_end_end_the_launch),
        TEST(nodes_get_their_arguments),
        TEST(a_program_that_is_missing_is_named),
        TEST(a_bad_launch_file_starts_nothing),
        TEST(an_output_folder_that_cannot_be_starts_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
