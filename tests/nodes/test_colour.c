/* SPDX-License-Identifier: MIT */
/* On a terminal of its own, what is shown there has colours where they are wanted. */
#include <pty.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "nodes/launcher/screen.h"
#include "nodes/rt/terminal.h"

static const struct {
    const char *term, *no_color;
    bool coloured;
} cases[] = {
    {"xterm", NULL, true}, {"xterm", "", true}, {"xterm", "1", false},
    {"dumb", NULL, false}, {"", NULL, false},   {NULL, NULL, false},
};

static void set(const char *name, const char *value)
{
    if (value)
        setenv(name, value, 1);
    else
        unsetenv(name);
}

/* The child's exit code tells whether colour is wanted; what it shows goes into text. */
static bool show_on_terminal(size_t k, char *text, size_t size)
{
    int master, status;
    size_t n = 0;
    ssize_t got;
    pid_t pid = forkpty(&master, NULL, NULL, NULL);

    assert_true(pid >= 0);
    if (pid == 0) {
        struct screen s;
        const struct log_line line = {
            .level = LOG_LEVEL_WARNING, .node = "dsp", .text = "a word"};
        set("TERM", cases[k].term);
        set("NO_COLOR", cases[k].no_color);
        screen_init(&s, LOG_FORMAT_TEXT);
        screen_log(&s, &line);
        _exit(colour_wanted(STDERR_FILENO));
    }
    while (n + 1 < size && (got = read(master, text + n, size - 1 - n)) > 0)
        n += (size_t)got; /* EIO: the other end is closed */
    text[n] = '\0';
    close(master);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFEXITED(status));
    return WEXITSTATUS(status);
}

static void colour_is_for_terminals_that_have_it_unless_it_is_not_wanted(void **state)
{
    char text[1024];

    (void)state;
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        assert_int_equal(show_on_terminal(k, text, sizeof text), cases[k].coloured);
        assert_non_null(strstr(text, "a word"));
        assert_non_null(strstr(text, "warning"));
        assert_int_equal(strchr(text, '\033') != NULL, cases[k].coloured);
    }
}

static void a_pipe_never_has_any(void **state)
{
    int fds[2];

    (void)state;
    assert_int_equal(pipe(fds), 0);
    set("TERM", "xterm");
    set("NO_COLOR", NULL);
    assert_false(colour_wanted(fds[1]));
    close(fds[0]);
    close(fds[1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(colour_is_for_terminals_that_have_it_unless_it_is_not_wanted),
        cmocka_unit_test(a_pipe_never_has_any),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
