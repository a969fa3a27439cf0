/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <jansson.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "nodes/rt/log.h"

#define S_NS  1000000000LL
#define START 1795292109123000000LL /* `date -ud @1795292109` says when */
#define HEAD  "2026-11-21T20:15:09.123Z "

struct rig {
    int pipe_fds[2];
    int64_t now_ns;
    struct clock_source clock;
    struct log *log;
    struct log_line lines[80]; /* that log_on_line gave */
    size_t n_lines;
    char text[60000];
};

static int64_t rig_now(void *state)
{
    return ((struct rig *)state)->now_ns;
}

static void take_line(void *ctx, const struct log_line *line)
{
    struct rig *r = ctx;

    if (!line->text[0])
        return; /* a tick */
    assert_in_range(r->n_lines, 0, 79);
    r->lines[r->n_lines++] = *line;
}

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);

    if (!r || pipe(r->pipe_fds))
        return -1;
    r->now_ns = START;
    r->clock = (struct clock_source){.now_ns = rig_now, .state = r};
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    log_destroy(r->log);
    close(r->pipe_fds[0]);
    close(r->pipe_fds[1]);
    free(r);
    return 0;
}

static void open_log(struct rig *r, enum log_level least, enum log_format format)
{
    const struct log_config cfg = {.fd = r->pipe_fds[1],
                                   .least = least,
                                   .format = format,
                                   .node = "recon",
                                   .clock = &r->clock};

    assert_int_equal(log_create(&r->log, &cfg), 0);
    log_on_line(r->log, take_line, r);
}

/* What was written since the last call. */
static const char *written(struct rig *r)
{
    assert_int_equal(write(r->pipe_fds[1], "\n", 1), 1); /* so that read does not wait */
    ssize_t n = read(r->pipe_fds[0], r->text, sizeof r->text - 1);
    assert_true(n > 0);
    r->text[n - 1] = '\0';
    return r->text;
}

static void a_line_says_when_who_and_how_bad(void **state)
{
    struct rig *r = *state;

    open_log(r, LOG_LEVEL_INFO, LOG_FORMAT_TEXT);
    log_write(r->log, LOG_LEVEL_WARNING, "%d of %s", 3, "four");
    assert_string_equal(written(r), HEAD "recon   warning 3 of four\n");
}

static void lines_below_the_level_are_left_out(void **state)
{
    struct rig *r = *state;

    open_log(r, LOG_LEVEL_WARNING, LOG_FORMAT_TEXT);
    log_write(r->log, LOG_LEVEL_DEBUG, "no");
    log_write(r->log, LOG_LEVEL_INFO, "no");
    log_write(r->log, LOG_LEVEL_ERROR, "yes");
    assert_string_equal(written(r), HEAD "recon   error   yes\n");
}

static void listeners_get_info_and_above_whatever_is_written(void **state)
{
    struct rig *r = *state;

    open_log(r, LOG_LEVEL_ERROR, LOG_FORMAT_TEXT);
    log_write(r->log, LOG_LEVEL_DEBUG, "a detail");
    log_write(r->log, LOG_LEVEL_INFO, "an event");
    assert_string_equal(written(r), "");
    assert_int_equal(r->n_lines, 1);
    assert_string_equal(r->lines[0].text, "an event");
    assert_string_equal(r->lines[0].node, "recon");
    assert_int_equal(r->lines[0].stamp_ns, START);
    assert_int_equal(r->lines[0].level, LOG_LEVEL_INFO);
}

static void a_text_of_two_lines_stays_one(void **state)
{
    struct rig *r = *state;

    open_log(r, LOG_LEVEL_INFO, LOG_FORMAT_TEXT);
    log_write(r->log, LOG_LEVEL_INFO, "one\ntwo\r\033[2J");
    assert_string_equal(written(r), HEAD "recon   info    one two  [2J\n");
}

static void what_is_no_utf8_becomes_question_marks(void **state)
{
    struct rig *r = *state;

    open_log(r, LOG_LEVEL_INFO, LOG_FORMAT_TEXT);
    /* "é" and "€" stay; a lone continuation, an overlong '/', a surrogate do not. */
    log_write(r->log, LOG_LEVEL_INFO, "%s",
              "\xc3\xa9 \xe2\x82\xac \x80 \xc0\xaf \xed\xa0\x80 \xf0");
    assert_string_equal(r->lines[0].text, "\xc3\xa9 \xe2\x82\xac ? ?? ??? ?");
}

static void a_long_text_is_cut_and_still_a_line(void **state)
{
    struct rig *r = *state;

    open_log(r, LOG_LEVEL_INFO, LOG_FORMAT_TEXT);
    log_write(r->log, LOG_LEVEL_INFO, "%02000d", 0);
    const char *text = written(r);
    assert_int_equal(strlen(text), strlen(HEAD "recon   info    ") + 1000 + 1);
    assert_true(text[strlen(text) - 1] == '\n');
}

static void a_repeated_text_is_written_once_then_counted(void **state)
{
    struct rig *r = *state;

    open_log(r, LOG_LEVEL_INFO, LOG_FORMAT_TEXT);
    for (int i = 0; i < 38; i++) {
        log_write(r->log, LOG_LEVEL_WARNING, "can0 is down");
        log_tick(r->log);
        r->now_ns += S_NS / 4; /* 38 times over 9.5 s */
    }
    log_write(r->log, LOG_LEVEL_WARNING, "something else");
    assert_string_equal(written(r),
                        HEAD "recon   warning can0 is down\n"
                             "2026-11-21T20:15:18.623Z recon   warning something else\n");
    r->now_ns = START + 10 * S_NS;
    log_tick(r->log);
    assert_string_equal(written(r), "2026-11-21T20:15:19.123Z recon   warning can0 is "
                                    "down (37 times more in 10 s)\n");
    assert_int_equal(r->n_lines, 3);
    assert_string_equal(r->lines[2].text, "can0 is down");
    assert_int_equal(r->lines[2].repeats, 37);
    assert_true(r->lines[2].repeats_s == 10.0);
    assert_int_equal(r->lines[1].repeats, 0);
}

static void write_at(struct rig *r, double s, const char *text)
{
    r->now_ns = START + (int64_t)(s * 1e9);
    log_write(r->log, LOG_LEVEL_INFO, "%s", text);
}

static void a_count_that_comes_late_says_how_long_ago_the_last_was(void **state)
{
    struct rig *r = *state;

    open_log(r, LOG_LEVEL_INFO, LOG_FORMAT_TEXT);
    write_at(r, 0.0, "active");
    write_at(r, 2.0, "active");
    write_at(r, 3.0, "faulty");
    written(r);
    r->now_ns = START + 10 * S_NS;
    log_tick(r->log);
    assert_string_equal(written(r), "2026-11-21T20:15:19.123Z recon   info    active "
                                    "(1 time more in 10 s, last 8 s ago)\n");
}

static void what_comes_when_its_count_is_due_is_one_line_with_it(void **state)
{
    struct rig *r = *state;

    open_log(r, LOG_LEVEL_INFO, LOG_FORMAT_TEXT);
    write_at(r, 0.0, "active");
    write_at(r, 4.0, "active");
    written(r);
    write_at(r, 11.0, "active");
    assert_string_equal(written(r), "2026-11-21T20:15:20.123Z recon   info    active "
                                    "(2 times more in 11 s)\n");
    write_at(r, 12.0, "active");
    assert_string_equal(written(r), "");
}

static void counts_come_in_the_order_of_what_they_count(void **state)
{
    struct rig *r = *state;

    open_log(r, LOG_LEVEL_INFO, LOG_FORMAT_TEXT);
    write_at(r, 0.0, "faulty");
    write_at(r, 0.1, "active");
    write_at(r, 0.2, "active");
    write_at(r, 0.3, "faulty");
    log_tell_repeats(r->log);
    assert_int_equal(r->n_lines, 4);
    assert_string_equal(r->lines[2].text, "active");
    assert_string_equal(r->lines[3].text, "faulty");
}

static void write_each(struct rig *r, const char *format, ...)
{
    va_list args;

    va_start(args, format);
    log_vwrite_each(r->log, LOG_LEVEL_INFO, format, args);
    va_end(args);
}

static void each_of_changes_is_written_and_none_is_counted(void **state)
{
    struct rig *r = *state;

    open_log(r, LOG_LEVEL_INFO, LOG_FORMAT_TEXT);
    for (int i = 0; i < 4; i++) {
        write_each(r, "%s", i % 2 ? "faulty" : "active");
        r->now_ns += S_NS;
    }
    log_tell_repeats(r->log);
    assert_int_equal(r->n_lines, 4);
    assert_string_equal(r->lines[2].text, "active");
    assert_string_equal(r->lines[3].text, "faulty");
    assert_int_equal(r->lines[2].repeats, 0);
}

static void a_text_that_comes_back_later_is_new(void **state)
{
    struct rig *r = *state;

    open_log(r, LOG_LEVEL_INFO, LOG_FORMAT_TEXT);
    for (int i = 0; i < 3; i++) {
        log_write(r->log, LOG_LEVEL_INFO, "paused");
        r->now_ns += 10 * S_NS;
    }
    assert_int_equal(r->n_lines, 3);
    for (int i = 0; i < 3; i++)
        assert_int_equal(r->lines[i].repeats, 0);
}

static void levels_and_numbers_tell_texts_apart(void **state)
{
    struct rig *r = *state;

    open_log(r, LOG_LEVEL_INFO, LOG_FORMAT_TEXT);
    log_write(r->log, LOG_LEVEL_WARNING, "ping %d is lost", 1);
    log_write(r->log, LOG_LEVEL_WARNING, "ping %d is lost", 2);
    log_write(r->log, LOG_LEVEL_ERROR, "ping %d is lost", 2);
    assert_int_equal(r->n_lines, 3);
}

static void repeats_are_told_before_they_are_forgotten(void **state)
{
    struct rig *r = *state;
    uint64_t repeats = 0;

    open_log(r, LOG_LEVEL_INFO, LOG_FORMAT_TEXT);
    log_write(r->log, LOG_LEVEL_INFO, "first");
    log_write(r->log, LOG_LEVEL_INFO, "first");
    for (int i = 0; i < 40; i++) { /* more than are remembered */
        r->now_ns += 1000000;
        log_write(r->log, LOG_LEVEL_INFO, "line %d", i);
    }
    for (size_t i = 0; i < r->n_lines; i++)
        if (!strcmp(r->lines[i].text, "first"))
            repeats += r->lines[i].repeats;
    assert_int_equal(repeats, 1);
    assert_int_equal(r->n_lines, 1 + 40 + 1);
}

static void the_end_tells_what_is_left(void **state)
{
    struct rig *r = *state;

    open_log(r, LOG_LEVEL_INFO, LOG_FORMAT_TEXT);
    for (int i = 0; i < 3; i++)
        log_write(r->log, LOG_LEVEL_ERROR, "no");
    written(r);
    r->now_ns += 2 * S_NS;
    log_destroy(r->log);
    r->log = NULL;
    assert_string_equal(written(r),
                        "2026-11-21T20:15:11.123Z recon   error   no (2 times "
                        "more in 2 s, last 2 s ago)\n");
}

static void json_has_the_same_in_fields(void **state)
{
    struct rig *r = *state;

    open_log(r, LOG_LEVEL_INFO, LOG_FORMAT_JSON);
    log_write(r->log, LOG_LEVEL_WARNING, "a \"quoted\" text");
    log_write(r->log, LOG_LEVEL_WARNING, "a \"quoted\" text");
    r->now_ns += 10 * S_NS;
    log_tick(r->log);
    char *second = strchr(written(r), '\n');
    assert_non_null(second);
    *second++ = '\0';
    json_t *a = json_loads(r->text, 0, NULL), *b = json_loads(second, 0, NULL);
    assert_non_null(a);
    assert_non_null(b);
    assert_string_equal(json_string_value(json_object_get(a, "stamp")),
                        "2026-11-21T20:15:09.123Z");
    assert_string_equal(json_string_value(json_object_get(a, "level")), "warning");
    assert_string_equal(json_string_value(json_object_get(a, "node")), "recon");
    assert_string_equal(json_string_value(json_object_get(a, "text")),
                        "a \"quoted\" text");
    assert_null(json_object_get(a, "repeats"));
    assert_int_equal(json_integer_value(json_object_get(b, "repeats")), 1);
    assert_true(json_real_value(json_object_get(b, "repeats_s")) == 10.0);
    assert_true(json_real_value(json_object_get(b, "repeats_ago_s")) == 10.0);
    json_decref(a);
    json_decref(b);
}

static void the_longest_line_of_json_is_whole(void **state)
{
    struct rig *r = *state;
    char quotes[1001];

    memset(quotes, '"', 1000);
    quotes[1000] = '\0';
    open_log(r, LOG_LEVEL_INFO, LOG_FORMAT_JSON);
    log_write(r->log, LOG_LEVEL_INFO, "%s", quotes);
    json_t *o = json_loads(written(r), 0, NULL);
    assert_string_equal(json_string_value(json_object_get(o, "text")), quotes);
    json_decref(o);
}

static void what_is_written_is_read_again(void **state)
{
    struct rig *r = *state;
    struct log_line l;

    open_log(r, LOG_LEVEL_INFO, LOG_FORMAT_TEXT);
    for (int i = LOG_LEVEL_INFO; i <= LOG_LEVEL_ERROR; i++) {
        log_write(r->log, (enum log_level)i, "  two blanks before");
        char *line = (char *)written(r);
        line[strlen(line) - 1] = '\0';
        assert_int_equal(log_line_read(&l, line), 0);
        assert_int_equal(l.stamp_ns, START);
        assert_int_equal(l.level, i);
        assert_string_equal(l.node, "recon");
        assert_string_equal(l.text, "  two blanks before");
    }
}

static void other_text_is_not_taken_for_a_line(void **state)
{
    struct log_line l;
    static const char *const texts[] = {
        "",
        "warning mind the step",
        "2026-11-21T20:15:09.123Z",
        "2026-11-21T20:15:09.123Z recon",
        "2026-11-21T20:15:09.123Z recon loud text",
        "2026-11-21T20:15:09.123+ recon   info    text",
        "2026-11-21T20:15:09.123Z a-name-that-is-too-long info text",
        "==1234==ERROR: AddressSanitizer: heap-use-after-free",
    };

    (void)state;
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        assert_int_equal(log_line_read(&l, texts[i]), -EINVAL);
    assert_int_equal(log_line_read(&l, HEAD "recon   error   "), 0);
    assert_string_equal(l.text, "");
    assert_int_equal(log_line_read(&l, HEAD "recon info"), -EINVAL);
}

static void *write_much(void *ctx)
{
    struct rig *r = ctx;

    for (int i = 0; i < 5; i++)
        log_write(r->log, LOG_LEVEL_INFO, "%p %d", (void *)&i, i);
    return NULL;
}

static void threads_do_not_mix_their_lines(void **state)
{
    struct rig *r = *state;
    pthread_t threads[4];
    size_t n = 0;

    open_log(r, LOG_LEVEL_INFO, LOG_FORMAT_TEXT);
    for (int i = 0; i < 4; i++)
        assert_int_equal(pthread_create(&threads[i], NULL, write_much, r), 0);
    for (int i = 0; i < 4; i++)
        pthread_join(threads[i], NULL);
    written(r);
    for (char *line = strtok(r->text, "\n"); line; line = strtok(NULL, "\n"), n++)
        assert_int_equal(log_line_read(&(struct log_line){0}, line), 0);
    assert_int_equal(n, 20);
    assert_int_equal(r->n_lines, 20);
}

static void levels_and_formats_have_names(void **state)
{
    enum log_level level;
    enum log_format format;

    (void)state;
    for (int i = LOG_LEVEL_DEBUG; i <= LOG_LEVEL_ERROR; i++) {
        assert_int_equal(log_level_parse(&level, log_level_name((enum log_level)i)), 0);
        assert_int_equal(level, i);
    }
    assert_int_equal(log_level_parse(&level, "loud"), -EINVAL);
    assert_int_equal(log_format_parse(&format, "json"), 0);
    assert_int_equal(format, LOG_FORMAT_JSON);
    assert_int_equal(log_format_parse(&format, "text"), 0);
    assert_int_equal(format, LOG_FORMAT_TEXT);
    assert_int_equal(log_format_parse(&format, "yaml"), -EINVAL);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_line_says_when_who_and_how_bad),
        TEST(lines_below_the_level_are_left_out),
        TEST(listeners_get_info_and_above_whatever_is_written),
        TEST(a_text_of_two_lines_stays_one),
        TEST(what_is_no_utf8_becomes_question_marks),
        TEST(a_long_text_is_cut_and_still_a_line),
        TEST(a_repeated_text_is_written_once_then_counted),
        TEST(a_count_that_comes_late_says_how_long_ago_the_last_was),
        TEST(what_comes_when_its_count_is_due_is_one_line_with_it),
        TEST(counts_come_in_the_order_of_what_they_count),
        TEST(each_of_changes_is_written_and_none_is_counted),
        TEST(a_text_that_comes_back_later_is_new),
        TEST(levels_and_numbers_tell_texts_apart),
        TEST(repeats_are_told_before_they_are_forgotten),
        TEST(the_end_tells_what_is_left),
        TEST(json_has_the_same_in_fields),
        TEST(the_longest_line_of_json_is_whole),
        TEST(what_is_written_is_read_again),
        TEST(other_text_is_not_taken_for_a_line),
        TEST(threads_do_not_mix_their_lines),
        TEST(levels_and_formats_have_names),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
