#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "nodes/rt/log.h"

static int pipe_fds[2];

static int setup(void **state)
{
    (void)state;
    return pipe(pipe_fds);
}

static int teardown(void **state)
{
    (void)state;
    close(pipe_fds[0]);
    return 0;
}

/* All that was written; closes the pipe's writing end. */
static const char *written(void)
{
    static char text[4096];

    close(pipe_fds[1]);
    ssize_t n = read(pipe_fds[0], text, sizeof text - 1);
    assert_true(n >= 0);
    text[n] = '\0';
    return text;
}

static void a_line_is_level_and_text(void **state)
{
    const struct log l = {.fd = pipe_fds[1], .least = LOG_LEVEL_INFO};

    (void)state;
    log_write(&l, LOG_LEVEL_WARNING, "%d of %s", 3, "four");
    assert_string_equal(written(), "warning 3 of four\n");
}

static void lines_below_the_level_are_left_out(void **state)
{
    const struct log l = {.fd = pipe_fds[1], .least = LOG_LEVEL_WARNING};

    (void)state;
    log_write(&l, LOG_LEVEL_DEBUG, "no");
    log_write(&l, LOG_LEVEL_INFO, "no");
    log_write(&l, LOG_LEVEL_ERROR, "yes");
    assert_string_equal(written(), "error yes\n");
}

static void a_text_of_two_lines_stays_one(void **state)
{
    const struct log l = {.fd = pipe_fds[1]};

    (void)state;
    log_write(&l, LOG_LEVEL_INFO, "one\ntwo\r");
    assert_string_equal(written(), "info one two \n");
}

static void a_long_text_is_cut_and_still_a_line(void **state)
{
    const struct log l = {.fd = pipe_fds[1]};

    (void)state;
    log_write(&l, LOG_LEVEL_INFO, "%02000d", 0);
    const char *text = written();
    assert_int_equal(strlen(text), strlen("info ") + 1000 + 1);
    assert_true(text[strlen(text) - 1] == '\n');
}

static void levels_have_names(void **state)
{
    enum log_level level;

    (void)state;
    close(pipe_fds[1]);
    for (int i = LOG_LEVEL_DEBUG; i <= LOG_LEVEL_ERROR; i++) {
        assert_int_equal(log_level_parse(&level, log_level_name((enum log_level)i)), 0);
        assert_int_equal(level, i);
    }
    assert_int_equal(log_level_parse(&level, "loud"), -EINVAL);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_line_is_level_and_text),
        TEST(lines_below_the_level_are_left_out),
        TEST(a_text_of_two_lines_stays_one),
        TEST(a_long_text_is_cut_and_still_a_line),
        TEST(levels_have_names),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
