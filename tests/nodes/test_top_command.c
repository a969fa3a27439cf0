/* SPDX-License-Identifier: MIT */
/* `anlos top` on a real pseudo terminal and in a pipe, beside a node that this process
 * plays. */
#include <errno.h>
#include <poll.h>
#include <pty.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>
#include <utmp.h>

#include <cmocka.h>

#include "msgs/bus.h"
#include "nodes/anlos/commands.h"
#include "tests/hal/scratch.h"
#include "tests/nodes/command.h"
#include "tests/nodes/health.h"
#include "tests/nodes/screen.h"

#define DEADLINE_MS 60000
#define PERIOD_MS   200 /* of the node's health */

struct rig {
    struct scratch *scratch;
    int master, slave; /* slave: kept open, to see how the terminal is left */
    pid_t pid;
    struct termios before;
    struct screen screen;
    struct bus *bus; /* the node's; NULL: it does not live */
    uint64_t n_states;
};

static int64_t now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000 + t.tv_nsec / 1000000;
}

static int set_up(void **state)
{
    struct rig *r = calloc(1, sizeof *r);
    *state = r;
    unsetenv("NO_COLOR");
    setenv("TERM", "vt100", 1);
    return r ? scratch_open((void **)&r->scratch) : -1;
}

static int tear_down(void **state)
{
    struct rig *r = *state;
    void *scratch = r->scratch;
    bus_destroy(r->bus);
    free(r);
    return scratch_close(&scratch);
}

static void begin_node(struct rig *r, int64_t epoch_ns)
{
    const struct bus_config cfg = {
        .node = "stage", .run_dir = r->scratch->folder, .epoch_ns = epoch_ns};
    struct error why = {.text = ""};
    if (bus_create(&r->bus, &cfg, &why))
        fail_msg("%s", why.text);
    r->n_states = 0;
}

static void end_node(struct rig *r)
{
    bus_destroy(r->bus);
    r->bus = NULL;
}

static void say_health(struct rig *r)
{
    static struct health h;
    health_begin(&h, "stage")->message.text = "stands still";
    r->n_states++;
    health_topic(&h, "stage/state", 1, r->n_states)->bytes = 20 * r->n_states;
    health_device(&h, "stalls", 3);
    assert_int_equal(bus_publish_message(r->bus, topic_health(), 0, 1, &h.message.base),
                     0);
}

/* Starts top on a terminal, before this process has threads. */
static void start_top(struct rig *r, int rows, int columns)
{
    struct winsize size = {.ws_row = (unsigned short)rows,
                           .ws_col = (unsigned short)columns};
    char *words[] = {"top", "--run-dir", r->scratch->folder, "--interval", "0.2", NULL};
    assert_int_equal(openpty(&r->master, &r->slave, NULL, NULL, &size), 0);
    assert_int_equal(tcgetattr(r->slave, &r->before), 0);
    screen_begin(&r->screen, rows, columns);
    fflush(NULL);
    r->pid = fork();
    assert_true(r->pid >= 0);
    if (r->pid)
        return;
    close(r->master);
    if (login_tty(r->slave))
        _exit(99);
    exit(command_top(5, words));
}

/* Reads what top draws, for a moment at most.  false: it has ended. */
static bool read_screen(struct rig *r)
{
    struct pollfd p = {.fd = r->master, .events = POLLIN};
    char text[4096];
    if (poll(&p, 1, PERIOD_MS) <= 0)
        return true;
    ssize_t n = read(r->master, text, sizeof text);
    if (n > 0)
        screen_write(&r->screen, text, (size_t)n);
    return n > 0;
}

/* The node lives on while we wait for the text to come or to go; row -1: anywhere. */
static void await_row(struct rig *r, int row, const char *text, bool there)
{
    int64_t deadline_ms = now_ms() + DEADLINE_MS, due_ms = 0;
    while ((row < 0 ? screen_shows(&r->screen, text)
                    : screen_row_begins(&r->screen, row, text)) != there) {
        if (now_ms() > deadline_ms || !read_screen(r)) {
            for (int y = 0; y < r->screen.rows; y++)
                print_error("|%s\n", r->screen.cells[y]);
            fail_msg("\"%s\" does not %s", text, there ? "come" : "go");
        }
        if (r->bus && now_ms() >= due_ms) {
            say_health(r);
            due_ms = now_ms() + PERIOD_MS;
        }
    }
}

static void await_text(struct rig *r, const char *text, bool there)
{
    await_row(r, -1, text, there);
}

static void press(struct rig *r, const char *keys)
{
    assert_int_equal(write(r->master, keys, strlen(keys)), (ssize_t)strlen(keys));
}

/* Reads to the end.  Returns the exit code; -1: it was killed. */
static int await_end(struct rig *r)
{
    int status;
    int64_t deadline_ms = now_ms() + DEADLINE_MS;
    while (waitpid(r->pid, &status, WNOHANG) != r->pid) {
        assert_true(now_ms() < deadline_ms);
        read_screen(r);
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static void assert_restored(struct rig *r)
{
    struct termios after;
    assert_int_equal(tcgetattr(r->slave, &after), 0);
    assert_int_equal(after.c_lflag, r->before.c_lflag);
    assert_int_equal(after.c_iflag, r->before.c_iflag);
    assert_int_equal(after.c_oflag, r->before.c_oflag);
    close(r->master);
    close(r->slave);
}

static void it_waits_for_a_system_and_shows_its_nodes(void **state)
{
    struct rig *r = *state;
    start_top(r, 24, 80);
    await_text(r, "nothing is running", true);
    begin_node(r, 1);
    await_text(r, "1 of 1 nodes alive", true);
    await_text(r, ">stage    ready", true);
    await_text(r, "device: stalls 3", true);
    await_text(r, "stage/state   ok", true);
    press(r, "q");
    assert_int_equal(await_end(r), 0);
    assert_restored(r);
}

static void a_node_that_dies_is_shown_dead_and_then_its_next_life(void **state)
{
    struct rig *r = *state;
    start_top(r, 24, 80);
    begin_node(r, 1);
    await_text(r, ">stage    ready", true);
    end_node(r);
    await_text(r, ">stage    dead", true);
    begin_node(r, 2);
    await_text(r, ">stage    ready", true);
    await_text(r, "started again 1 times", true);
    press(r, "q");
    assert_int_equal(await_end(r), 0);
    assert_restored(r);
}

static void keys_do_what_the_help_says(void **state)
{
    struct rig *r = *state;
    start_top(r, 24, 120);
    begin_node(r, 1);
    await_text(r, ">stage ", true);
    press(r, "h");
    await_text(r, "percentile", true);
    press(r, "x");
    await_text(r, "percentile", false);
    press(r, "\t");
    await_text(r, ">stage/state", true);
    press(r, "\033[B"); /* down, as vt100 sends it in cursor mode and others always */
    press(r, "\033OB");
    await_text(r, ">stage/state", false);
    press(r, "s");
    await_text(r, "sorted by load", true);
    press(r, "p");
    await_text(r, "PAUSED", true);
    press(r, " ");
    await_text(r, "PAUSED", false);
    press(r, "/nothing");
    await_text(r, "names with nothing", true);
    await_text(r, "nothing selected", true);
    press(r, "\r");
    await_text(r, "q quit", true);
    press(r, "q");
    assert_int_equal(await_end(r), 0);
    assert_restored(r);
}

static void set_size(struct rig *r, int rows, int columns)
{
    struct winsize size = {.ws_row = (unsigned short)rows,
                           .ws_col = (unsigned short)columns};
    screen_begin(&r->screen, rows, columns);
    assert_int_equal(ioctl(r->master, TIOCSWINSZ, &size), 0);
}

static void it_follows_the_size_of_the_terminal(void **state)
{
    struct rig *r = *state;
    start_top(r, 24, 80);
    begin_node(r, 1);
    await_text(r, "REFUSED", true);
    set_size(r, 30, 140);
    await_text(r, "SAYS", true);
    await_text(r, "stands still", true);
    await_row(r, 29, "q quit", true);
    set_size(r, 5, 30);
    await_text(r, "stage", true);
    set_size(r, 1, 1);
    set_size(r, 24, 80);
    await_text(r, "REFUSED", true);
    press(r, "q");
    assert_int_equal(await_end(r), 0);
    assert_restored(r);
}

static void signals_leave_the_terminal_as_it_was(void **state)
{
    struct rig *r = *state;
    start_top(r, 24, 80);
    await_text(r, "q quit", true);
    press(r, "\003"); /* Ctrl-C: the terminal makes a signal of it */
    assert_int_equal(await_end(r), 130);
    assert_restored(r);
    start_top(r, 24, 80);
    await_text(r, "q quit", true);
    kill(r->pid, SIGTERM);
    assert_int_equal(await_end(r), 130);
    assert_restored(r);
}

static void it_ends_when_its_terminal_is_gone(void **state)
{
    struct rig *r = *state;
    int status;
    start_top(r, 24, 80);
    await_text(r, "q quit", true);
    close(r->slave);
    close(r->master);
    int64_t deadline_ms = now_ms() + DEADLINE_MS;
    while (waitpid(r->pid, &status, WNOHANG) != r->pid) {
        assert_true(now_ms() < deadline_ms);
        poll(NULL, 0, 5);
    }
}

static void colour_is_only_where_it_is_wanted(void **state)
{
    static const struct {
        const char *term, *no_color;
        bool coloured;
    } cases[] = {
        {"vt100", "", false}, {"xterm-color", "", true}, {"xterm-color", "1", false}};
    struct rig *r = *state;
    for (size_t i = 0; i < 3; i++) {
        setenv("TERM", cases[i].term, 1);
        setenv("NO_COLOR", cases[i].no_color, 1);
        r->screen.coloured = false;
        start_top(r, 24, 80);
        begin_node(r, 1);
        await_text(r, "ready", true);
        press(r, "q");
        assert_int_equal(await_end(r), 0);
        assert_int_equal(r->screen.coloured, cases[i].coloured);
        assert_restored(r);
        end_node(r);
    }
}

static void a_terminal_that_cannot_be_drawn_on_is_refused(void **state)
{
    static const char *const kinds[] = {"dumb", "no-such-terminal", ""};
    struct rig *r = *state;
    for (size_t i = 0; i < 3; i++) {
        setenv("TERM", kinds[i], 1);
        start_top(r, 24, 80);
        await_text(r, "cannot be drawn on", true);
        assert_int_equal(await_end(r), 2);
        assert_restored(r);
    }
}

/* Plays the node until the command has ended.  Returns its exit code. */
static int play_until_end(struct rig *r, pid_t pid, int fd, char *text, size_t size)
{
    struct pollfd p = {.fd = fd, .events = POLLIN};
    int64_t deadline_ms = now_ms() + DEADLINE_MS, due_ms = 0;
    size_t used = 0;
    int status;
    for (;;) {
        assert_true(now_ms() < deadline_ms);
        if (poll(&p, 1, PERIOD_MS) > 0) {
            ssize_t n = read(fd, text + used, size - 1 - used);
            if (n <= 0)
                break;
            used += (size_t)n;
        }
        if (now_ms() >= due_ms) {
            say_health(r);
            due_ms = now_ms() + PERIOD_MS;
        }
    }
    text[used] = '\0';
    assert_int_equal(waitpid(pid, &status, 0), pid);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static void a_pipe_gets_plain_tables(void **state)
{
    char *once[] = {"top", "--wait", "--run-dir", NULL, NULL};
    char *batch[] = {"top",    "--batch",   "2",  "--interval", "0.1",
                     "--wait", "--run-dir", NULL, NULL};
    struct rig *r = *state;
    char text[16384];
    int out, err;

    once[3] = batch[7] = r->scratch->folder;
    for (int i = 0; i < 2; i++) {
        pid_t pid = command_start(command_top, i ? batch : once, &out, &err);
        begin_node(r, 1);
        assert_int_equal(play_until_end(r, pid, out, text, sizeof text), 0);
        end_node(r);
        close(out);
        close(err);
        assert_contains(text, "\nstage    ready ");
        assert_contains(text, " stands still\n");
        assert_contains(text, "\nstage/state   ok ");
        assert_contains(text, "\nstage device: stalls 3\n");
        assert_null(strchr(text, 0x1b));
        const char *second = strstr(strstr(text, "NODE") + 1, "NODE ");
        assert_int_equal(second != NULL, i);
    }
}

static void nothing_running_and_wrong_arguments_are_said(void **state)
{
    static const struct {
        char *words[5];
        int code;
        const char *text;
    } cases[] = {
        {{"top", "--once"}, 1, "nothing is running in "},
        {{"top", "--batch", "0"}, 2, "--batch 0"},
        {{"top", "--interval", "0.01"}, 2, "--interval 0.01"},
        {{"top", "--onec"}, 2, "did you mean --once?"},
        {{"top", "dsp"}, 2, "dsp: expected no argument"},
        {{"top", "--run-dir"}, 2, "expected a value"},
    };
    struct rig *r = *state;
    struct command_result result;

    setenv("XDG_RUNTIME_DIR", r->scratch->folder, 1);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        command_run(&result, command_top, cases[i].words);
        assert_int_equal(result.code, cases[i].code);
        assert_contains(result.err, cases[i].text);
        assert_string_equal(result.out, "");
    }
    unsetenv("XDG_RUNTIME_DIR");
    char *help[] = {"top", "--help", NULL};
    command_run(&result, command_top, help);
    assert_int_equal(result.code, 0);
    assert_contains(result.out, "--batch N");
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(it_waits_for_a_system_and_shows_its_nodes),
        TEST(a_node_that_dies_is_shown_dead_and_then_its_next_life),
        TEST(keys_do_what_the_help_says),
        TEST(it_follows_the_size_of_the_terminal),
        TEST(signals_leave_the_terminal_as_it_was),
        TEST(it_ends_when_its_terminal_is_gone),
        TEST(colour_is_only_where_it_is_wanted),
        TEST(a_terminal_that_cannot_be_drawn_on_is_refused),
        TEST(a_pipe_gets_plain_tables),
        TEST(nothing_running_and_wrong_arguments_are_said),
    };
    signal(SIGHUP, SIG_IGN);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
