/* SPDX-License-Identifier: MIT */
/* `anlos launch` with shell scripts in the place of the nodes.  A script that is to wait
 * reads from a pipe; a script that is to tell something writes into one. */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "nodes/rt/log_history.h"

#define DEADLINE_MS 60000

struct rig {
    struct scratch *scratch;
    pid_t pid;
    int out;            /* what the launcher says, stdout and stderr */
    const char *option; /* more for its command line, or NULL */
    bool nohup;
    char text[16384];
};

/* Runs until it is stopped, and says so when it is.  The trap is set before anything is
 * told to others, who may stop it at once. */
#define TRAP "trap 'echo info stopped; test -z \"$!\" || kill $!; exit 0' TERM\n"
#define STAY                                                                             \
    "tail -f --pid=$$ /dev/null >/dev/null 2>&1 &\n"                                     \
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
    signal(SIGHUP, r->nohup ? SIG_IGN : SIG_DFL);
    dup2(out, STDOUT_FILENO);
    dup2(out, STDERR_FILENO);
    setenv("ANLOS_BIN_DIR", r->scratch->folder, 1);
    execl(BINARY_DIR "/bin/anlos", "anlos", "launch", launch, "--run-dir",
          r->scratch->folder, "--out", out_dir, r->option, NULL);
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

/* `anlos launch` of the same file, to the same folder of results, in a run folder of its
 * own; what it says is in the scratch folder's "second". */
static int launch_beside(const struct rig *r)
{
    char launch[128], run_dir[128], out_dir[128], says[128];
    int status;
    pid_t pid;

    snprintf(launch, sizeof launch, "%s/launch.yaml", r->scratch->folder);
    snprintf(run_dir, sizeof run_dir, "%s/beside", r->scratch->folder);
    snprintf(out_dir, sizeof out_dir, "%s/out", r->scratch->folder);
    snprintf(says, sizeof says, "%s/second", r->scratch->folder);
    pid = fork();
    assert_true(pid >= 0);
    if (!pid) {
        if (!freopen(says, "w", stderr))
            _exit(98);
        setenv("ANLOS_BIN_DIR", r->scratch->folder, 1);
        execl(BINARY_DIR "/bin/anlos", "anlos", "launch", launch, "--run-dir", run_dir,
              "--out", out_dir, NULL);
        _exit(99);
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static void a_second_system_does_not_write_into_the_same_results(void **state)
{
    struct rig *r = *state;
    char line[512] = "";

    write_launch(r, "scan, report");
    write_node(r, "scan", TRAP "echo it runs\n" STAY);
    write_node(r, "report", "read x < $D/go; exit 0");
    start(r);
    read_until(r, "it runs");
    assert_int_equal(launch_beside(r), 2);
    FILE *f = fopen(scratch_path(r->scratch, "second"), "r");
    assert_non_null(f);
    assert_non_null(fgets(line, sizeof line, f));
    fclose(f);
    assert_contains(line, "/out: another system writes its results there");
    f = fopen(scratch_path(r->scratch, "go"), "w");
    assert_non_null(f);
    fputs("go\n", f);
    fclose(f);
    assert_int_equal(finish(r), 0);
}

static void a_node_whose_output_is_not_whole_makes_the_exit_code_1(void **state)
{
    struct rig *r = *state;

    write_launch(r, "can, report");
    write_node(r, "can",
               "trap 'echo error the log is not whole; kill $!; exit 1' TERM\n"
               "echo go > $D/go\n" STAY);
    write_node(r, "report", "read x < $D/go; exit 0");
    start(r);
    assert_int_equal(finish(r), 1);
    assert_contains(r->text, "the log is not whole");
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

static void a_line_of_a_node_keeps_its_own_stamp(void **state)
{
    struct rig *r = *state;

    write_launch(r, "can");
    write_node(r, "can", "echo '2001-02-03T04:05:06.789Z can     error   it is off' >&2");
    start(r);
    assert_int_equal(finish(r), 0);
    assert_contains(r->text, "2001-02-03T04:05:06.789Z can     error   it is off\n");
    assert_int_equal(count(r->text, "it is off"), 1);
}

static void a_line_that_is_too_long_comes_in_whole_pieces(void **state)
{
    struct rig *r = *state;
    unsigned letters = 0;

    write_launch(r, "can");
    write_node(r, "can", "head -c 2500 /dev/zero | tr '\\0' q; echo");
    start(r);
    assert_int_equal(finish(r), 0);
    letters = count(r->text, "q");
    assert_int_equal(letters, 2500);
    assert_int_equal(count(r->text, "can     info    qq"), 3);
}

static void json_on_request_is_all_json(void **state)
{
    struct rig *r = *state;

    r->option = "--log-format=json";
    write_launch(r, "can");
    write_node(r, "can",
               "echo plain text\n"
               "echo '{\"stamp\":\"2001-02-03T04:05:06.789Z\",\"text\":\"of a node\"}'\n"
               "echo \"$@\"; exit 2");
    start(r);
    assert_int_equal(finish(r), 2);
    assert_contains(r->text,
                    "\"level\":\"info\",\"node\":\"can\",\"text\":\"plain text\"}");
    assert_contains(r->text,
                    "{\"stamp\":\"2001-02-03T04:05:06.789Z\",\"text\":\"of a node\"}\n");
    assert_contains(r->text, "--log-format json");
}

static void a_crashed_node_is_started_again(void **state)
{
    struct rig *r = *state;

    write_launch(r, "can, report");
    write_node(r, "can",
               "if test -e $D/second; then echo go > $D/go; exit 0; fi\n"
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

static void note_crash(void *ctx, const Anlos__Log *line)
{
    bool *known = ctx;

    *known |= line->level == ANLOS__LOG__LEVEL__WARNING && !strcmp(line->node, "can") &&
              strstr(line->text, "ended with exit code 1");
}

static void who_comes_late_finds_what_was_said(void **state)
{
    struct rig *r = *state;
    bool known = false;

    write_launch(r, "can, report");
    write_node(r, "can", "if test -e $D/first; then " STAY "fi\n: > $D/first; exit 1\n");
    write_node(r, "report", "read x < $D/go");
    start(r);
    read_until(r, "ended with exit code 1");
    for (int i = 0; !known && i < DEADLINE_MS / 10; i++) {
        log_history_read(r->scratch->folder, note_crash, &known);
        poll(NULL, 0, 10);
    }
    assert_true(known);
    int fd = open(scratch_path(r->scratch, "go"), O_WRONLY);
    assert_int_equal(write(fd, "go\n", 3), 3);
    close(fd);
    assert_int_equal(finish(r), 0);
    known = false;
    log_history_read(r->scratch->folder, note_crash, &known);
    assert_false(known); /* the system has ended */
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

/* A full disk is as full a moment later. */
static void results_that_cannot_be_written_end_all_at_once(void **state)
{
    struct rig *r = *state;

    write_launch(r, "scan, report");
    write_node(r, "scan", TRAP "echo go > $D/go\n" STAY);
    write_node(r, "report", "read x < $D/go; echo error out: No space left >&2; exit 1");
    start(r);
    assert_int_equal(finish(r), 1);
    assert_contains(r->text, "report  error   out: No space left");
    assert_contains(r->text,
                    "report  error   ended with exit code 1: results are missing in ");
    assert_int_equal(count(r->text, "No space left"), 1);
    assert_int_equal(count(r->text, "starts again"), 0);
    assert_contains(r->text, "scan    info    stopped");
}

static void a_report_that_crashes_is_started_again(void **state)
{
    struct rig *r = *state;

    write_launch(r, "report");
    write_node(r, "report", "test -e $D/first && exit 0\n: > $D/first; kill -SEGV $$");
    start(r);
    assert_int_equal(finish(r), 0);
    assert_contains(r->text, "report  warning ended with signal 11 (Segmentation fault); "
                             "starts again in 0.1 s");
}

static void a_signal_that_comes_twice_at_once_is_one(void **state)
{
    struct rig *r = *state;

    write_launch(r, "scan, can");
    write_node(r, "scan", TRAP "echo go > $D/go\n" STAY);
    write_node(r, "can", TRAP "read x < $D/go; echo info ready\n" STAY);
    start(r);
    read_until(r, "ready");
    kill(r->pid, SIGSTOP); /* so that it finds both */
    assert_int_equal(kill(r->pid, SIGINT), 0);
    assert_int_equal(kill(r->pid, SIGTERM), 0);
    kill(r->pid, SIGCONT);
    assert_int_equal(finish(r), 130);
    assert_contains(r->text, "can     info    stopped");
    assert_null(strstr(r->text, "killed"));
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

/* Lets the node that reads from $D/go go on. */
static void say_go(struct rig *r)
{
    int fd = open(scratch_path(r->scratch, "go"), O_WRONLY | O_CLOEXEC);

    assert_true(fd >= 0);
    assert_int_equal(write(fd, "go\n", 3), 3);
    close(fd);
}

static void a_terminal_that_closes_stops_all(void **state)
{
    struct rig *r = *state;

    write_launch(r, "can");
    write_node(r, "can", TRAP "echo info here\n" STAY);
    start(r);
    read_until(r, "here");
    assert_int_equal(kill(r->pid, SIGHUP), 0);
    assert_int_equal(finish(r), 129);
    assert_contains(r->text, "can     info    stopped");
}

static void under_nohup_it_outlives_its_terminal(void **state)
{
    struct rig *r = *state;

    r->nohup = true;
    write_launch(r, "can, report");
    write_node(r, "can", TRAP "echo info here\n" STAY);
    write_node(r, "report", "read x < $D/go");
    start(r);
    read_until(r, "here");
    assert_int_equal(kill(r->pid, SIGHUP), 0);
    say_go(r);
    assert_int_equal(finish(r), 0);
}

static void a_node_that_ends_by_itself_is_not_passed_over_in_silence(void **state)
{
    struct rig *r = *state;

    write_launch(r, "can, report");
    write_node(r, "can", "exit 0");
    write_node(r, "report", "read x < $D/go");
    start(r);
    read_until(r, "can     info    has ended; it is not started again\n");
    say_go(r);
    assert_int_equal(finish(r), 0);
    assert_int_equal(count(r->text, "has ended"), 1);
}

/* Reads all that is said, however much: was the word among it? */
static bool is_said(struct rig *r, const char *word)
{
    size_t keep = strlen(word), used = 0;
    bool said = false;

    for (ssize_t n; (n = read(r->out, r->text + used, sizeof r->text - used - 1)) > 0;) {
        used += (size_t)n;
        r->text[used] = '\0';
        said |= strstr(r->text, word) != NULL;
        if (used > keep) /* it may go on in what comes next */
            memmove(r->text, r->text + used - keep, keep);
        used = used > keep ? keep : used;
    }
    r->text[0] = '\0';
    return said;
}

/* 200 kB, more than pipes take up: without anybody who reads, it comes to its "go". */
static void a_reader_that_does_not_read_holds_nothing_up(void **state)
{
    struct rig *r = *state;
    struct pollfd go = {.events = POLLIN};

    write_launch(r, "can");
    write_node(r, "can", TRAP "yes info a line | head -c 200000; echo go > $D/go\n" STAY);
    go.fd = open(scratch_path(r->scratch, "go"), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    assert_true(go.fd >= 0);
    start(r);
    int ready = poll(&go, 1, DEADLINE_MS);
    assert_int_equal(kill(r->pid, ready == 1 ? SIGTERM : SIGKILL), 0);
    assert_int_equal(ready, 1);
    close(go.fd);
    assert_true(is_said(r, "lines before this were left out: nobody took them\n"));
    assert_int_equal(finish(r), 143);
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

/* It draws, and the machine is busy: when another was killed it still may. */
static void who_writes_the_results_has_more_time_to_stop(void **state)
{
    struct rig *r = *state;

    write_launch(r, "can, report");
    write_node(r, "can",
               "trap '' TERM; echo info here; mkfifo $D/never; read x < $D/never");
    write_node(r, "report",
               "trap 'read x < $D/go; echo info written; kill $!; exit 0' TERM\n"
               "echo info up\n" STAY);
    start(r);
    read_until(r, "here");
    read_until(r, "up");
    assert_int_equal(kill(r->pid, SIGTERM), 0);
    read_until(r, "can     warning does not stop; killed");
    say_go(r);
    assert_int_equal(finish(r), 143);
    assert_contains(r->text, "report  info    written");
}

/* By what is short of memory, say, while it still may write. */
static void results_that_another_kills_are_missing(void **state)
{
    struct rig *r = *state;
    long pid;

    write_launch(r, "can, report");
    write_node(r, "can",
               "trap '' TERM; echo info here; mkfifo $D/never; read x < $D/never");
    write_node(r, "report", "trap '' TERM; echo info up as $$ now\nread x < $D/go");
    start(r);
    read_until(r, "here");
    read_until(r, "up as ");
    read_until(r, " now");
    assert_int_equal(sscanf(strstr(r->text, "up as "), "up as %ld now", &pid), 1);
    assert_int_equal(kill(r->pid, SIGTERM), 0);
    read_until(r, "can     warning does not stop; killed");
    assert_int_equal(kill((pid_t)pid, SIGKILL), 0);
    assert_int_equal(finish(r), 1);
    assert_contains(r->text, "report  error   ended with signal 9 (Killed) while "
                             "stopping: results are missing in ");
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

static void write_recording_launch(struct rig *r, const char *others)
{
    char text[512];

    snprintf(text, sizeof text,
             "nodes: [record, %s]\narray: {uri: 'wav:/rec'}\nrecord: {path: a.mcap}\n",
             others);
    scratch_write(r->scratch, "launch.yaml", text);
}

static void the_recorder_is_stopped_when_all_others_have_ended(void **state)
{
    struct rig *r = *state;

    write_recording_launch(r, "can, report");
    write_node(r, "record",
               "trap 'echo info has everything; kill $!; exit 0' TERM\n" STAY);
    write_node(r, "can",
               "trap 'echo info last words; kill $!; exit 0' TERM\n"
               "echo go > $D/go\n" STAY);
    write_node(r, "report", "read x < $D/go");
    start(r);
    assert_int_equal(finish(r), 0);
    assert_contains(r->text, "can     info    last words");
    assert_contains(strstr(r->text, "last words"), "record  info    has everything");
}

static void a_recorder_that_gives_up_ends_nothing(void **state)
{
    struct rig *r = *state;

    write_recording_launch(r, "report");
    write_node(r, "record", "exit 1");
    write_node(r, "report", "read x < $D/go");
    start(r);
    read_until(r, "record  error   ended with exit code 1; the others go on without it");
    int go = open(scratch_path(r->scratch, "go"), O_WRONLY);
    assert_true(go >= 0);
    assert_int_equal(write(go, "\n", 1), 1);
    close(go);
    assert_int_equal(finish(r), 1); /* all went well but the recording */
    assert_int_equal(count(r->text, "starts again"), 0);
}

/* Its port may have been taken meanwhile. */
static void a_page_that_cannot_be_started_again_ends_nothing(void **state)
{
    struct rig *r = *state;

    write_launch(r, "view, can");
    write_node(r, "view", "test -e $D/first && exit 2\n: > $D/first; kill -SEGV $$");
    write_node(r, "can", TRAP "echo info here\n" STAY);
    start(r);
    read_until(r, "can     info    here");
    read_until(r, "view    error   ended with exit code 2; the others go on without it");
    assert_int_equal(kill(r->pid, SIGINT), 0);
    assert_int_equal(finish(r), 1);
    assert_contains(r->text, "can     info    stopped");
}

static void a_page_that_is_refused_at_first_is_not_done_without(void **state)
{
    struct rig *r = *state;

    write_launch(r, "view, can");
    write_node(r, "view", "exit 2");
    write_node(r, "can", TRAP STAY);
    start(r);
    assert_int_equal(finish(r), 2);
}

static void a_recorder_that_cannot_end_its_bag_is_told_by_the_exit_code(void **state)
{
    struct rig *r = *state;

    write_recording_launch(r, "report");
    write_node(r, "record", "trap 'kill $!; exit 1' TERM\necho go > $D/go\n" STAY);
    write_node(r, "report", "read x < $D/go");
    start(r);
    assert_int_equal(finish(r), 1);
    assert_contains(r->text, "while stopping: the recording is not whole");
}

static void what_fails_after_ctrl_c_is_told_by_the_exit_code(void **state)
{
    struct rig *r = *state;

    write_launch(r, "report");
    write_node(r, "report", "trap 'kill $!; exit 1' TERM\necho info here\n" STAY);
    start(r);
    read_until(r, "here");
    assert_int_equal(kill(r->pid, SIGINT), 0);
    assert_int_equal(finish(r), 1);
    assert_contains(r->text, "report  error   ended with exit code 1 while stopping: "
                             "results are missing in ");
}

/* As of one that is only just being started, which Ctrl-C reaches like the launcher. */
static void who_ends_by_ctrl_c_himself_has_not_failed(void **state)
{
    struct rig *r = *state;

    write_launch(r, "can");
    write_node(r, "can", "trap 'kill $!; kill -INT $$' TERM\necho info here\n" STAY);
    start(r);
    read_until(r, "here");
    assert_int_equal(kill(r->pid, SIGINT), 0);
    assert_int_equal(finish(r), 130);
    assert_int_equal(count(r->text, "error"), 0);
}

static void a_recording_that_failed_is_told_after_ctrl_c_too(void **state)
{
    struct rig *r = *state;

    write_recording_launch(r, "can");
    write_node(r, "record", "exit 1");
    write_node(r, "can", TRAP STAY);
    start(r);
    read_until(r, "the others go on without it");
    assert_int_equal(kill(r->pid, SIGINT), 0);
    assert_int_equal(finish(r), 1);
}

static void what_a_recorder_refuses_is_not_run_without_it(void **state)
{
    struct rig *r = *state;

    write_recording_launch(r, "report");
    write_node(r, "record", "echo 'error no such folder'; exit 2");
    write_node(r, "report", "echo info started");
    start(r);
    assert_int_equal(finish(r), 2);
    assert_contains(r->text, "no such folder");
    assert_int_equal(count(r->text, "started"), 0);
}

static void a_recorder_that_crashes_is_started_again(void **state)
{
    struct rig *r = *state;

    write_recording_launch(r, "report");
    write_node(r, "record",
               "if test -e $D/first; then\n" TRAP "echo go > $D/go\n" STAY "fi\n"
               ": > $D/first; kill -SEGV $$");
    write_node(r, "report", "read x < $D/go");
    start(r);
    assert_int_equal(finish(r), 0);
    assert_contains(r->text, "record  warning ended with signal 11 (Segmentation fault); "
                             "starts again in 0.1 s");
}

/* The others run, and say something that nobody writes. */
static void a_recorder_that_crashes_has_lost_something(void **state)
{
    struct rig *r = *state;

    write_recording_launch(r, "report");
    write_node(r, "record",
               "if test -e $D/first; then\n" TRAP "echo go > $D/go\n" STAY "fi\n"
               ": > $D/first; read x < $D/runs; kill -SEGV $$");
    write_node(r, "report", "echo runs > $D/runs; read x < $D/go");
    assert_int_equal(mkfifo(scratch_path(r->scratch, "runs"), 0600), 0);
    start(r);
    assert_int_equal(finish(r), 1);
    assert_contains(r->text, "starts again in 0.1 s");
    assert_contains(r->text, "record  error   the recording is not whole");
}

static void a_recording_that_is_there_starts_nothing(void **state)
{
    struct rig *r = *state;
    char option[600];

    snprintf(option, sizeof option, "--record=%s",
             scratch_write(r->scratch, "earlier.mcap", "precious"));
    r->option = option;
    write_launch(r, "can");
    write_node(r, "can", "echo started");
    start(r);
    assert_int_equal(finish(r), 2);
    assert_contains(r->text, "earlier.mcap exists already");
    assert_int_equal(count(r->text, "started"), 0);
}

static int64_t read_ns(clockid_t id)
{
    struct timespec t;

    clock_gettime(id, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

/* What the launcher finds itself in its environment, of a login from another host, is
 * nothing to it or its nodes. */
static void nodes_get_the_clock_of_their_own_launcher(void **state)
{
    struct rig *r = *state;
    long long offset_ns = 0;

    write_launch(r, "can, report");
    write_node(r, "can",
               "test ${ANLOS_CLOCK%:*} = $PPID && echo \"first of $ANLOS_CLOCK\"");
    write_node(r, "report",
               "test -e $D/once && echo \"again of $ANLOS_CLOCK\" && exit 0\n"
               ": > $D/once; kill -SEGV $$");
    setenv("ANLOS_CLOCK", "1:5", 1);
    start(r);
    unsetenv("ANLOS_CLOCK");
    assert_int_equal(finish(r), 0);
    const char *first = strstr(r->text, "first of "),
               *again = strstr(r->text, "again of ");
    assert_non_null(first);
    assert_non_null(again);
    size_t n = strcspn(first + 9, "\n");
    assert_memory_equal(first + 9, again + 9, n + 1);
    assert_int_equal(sscanf(first, "first of %*d:%lld", &offset_ns), 1);
    assert_true(llabs(read_ns(CLOCK_REALTIME) - read_ns(CLOCK_MONOTONIC) - offset_ns) <
                500000000);
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

/* Whoever looks at the folder later would go by them. */
static void a_start_that_fails_leaves_no_hosts_behind(void **state)
{
    struct rig *r = *state;
    char text[512];

    snprintf(text, sizeof text,
             "nodes: [can, report]\n"
             "hosts:\n"
             "  - {name: a, endpoint: 'ipc://%s', nodes: [report]}\n"
             "  - {name: b, endpoint: 'ipc:///elsewhere', nodes: [can]}\n",
             r->scratch->folder);
    scratch_write(r->scratch, "launch.yaml", text);
    scratch_write(r->scratch, "out", "in the place of the folder of results");
    write_node(r, "report", "exit 0");
    r->option = "--host=a";
    start(r);
    assert_int_equal(finish(r), 2);
    assert_contains(r->text, "/out");
    assert_int_equal(access(scratch_path(r->scratch, "launcher.lock"), F_OK), 0);
    assert_int_equal(access(scratch_path(r->scratch, "hosts"), F_OK), -1);
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
        TEST(a_second_system_does_not_write_into_the_same_results),
        TEST(a_node_whose_output_is_not_whole_makes_the_exit_code_1),
        TEST(lines_carry_node_and_level),
        TEST(a_line_of_a_node_keeps_its_own_stamp),
        TEST(a_line_that_is_too_long_comes_in_whole_pieces),
        TEST(json_on_request_is_all_json),
        TEST(a_crashed_node_is_started_again),
        TEST(who_comes_late_finds_what_was_said),
        TEST(a_node_that_always_crashes_is_given_up),
        TEST(bad_configuration_stops_all_at_once),
        TEST(results_that_cannot_be_written_end_all_at_once),
        TEST(a_report_that_crashes_is_started_again),
        TEST(a_signal_that_comes_twice_at_once_is_one),
        TEST(ctrl_c_stops_all_cleanly),
        TEST(a_terminal_that_closes_stops_all),
        TEST(under_nohup_it_outlives_its_terminal),
        TEST(a_node_that_ends_by_itself_is_not_passed_over_in_silence),
        TEST(a_reader_that_does_not_read_holds_nothing_up),
        TEST(a_node_that_will_not_stop_is_killed),
        TEST(who_writes_the_results_has_more_time_to_stop),
        TEST(results_that_another_kills_are_missing),
        TEST(nodes_that_all_end_end_the_launch),
        TEST(nodes_get_their_arguments),
        TEST(the_recorder_is_stopped_when_all_others_have_ended),
        TEST(a_recorder_that_gives_up_ends_nothing),
        TEST(a_page_that_cannot_be_started_again_ends_nothing),
        TEST(a_page_that_is_refused_at_first_is_not_done_without),
        TEST(a_recorder_that_cannot_end_its_bag_is_told_by_the_exit_code),
        TEST(what_fails_after_ctrl_c_is_told_by_the_exit_code),
        TEST(who_ends_by_ctrl_c_himself_has_not_failed),
        TEST(a_recording_that_failed_is_told_after_ctrl_c_too),
        TEST(what_a_recorder_refuses_is_not_run_without_it),
        TEST(a_recorder_that_crashes_is_started_again),
        TEST(a_recorder_that_crashes_has_lost_something),
        TEST(a_recording_that_is_there_starts_nothing),
        TEST(nodes_get_the_clock_of_their_own_launcher),
        TEST(a_program_that_is_missing_is_named),
        TEST(a_start_that_fails_leaves_no_hosts_behind),
        TEST(a_bad_launch_file_starts_nothing),
        TEST(an_output_folder_that_cannot_be_starts_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
