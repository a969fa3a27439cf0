/* SPDX-License-Identifier: MIT */
/* The newest lines of a log, for who comes late. */
#include "tests/hal/scratch.h"

#include <unistd.h>

#include "nodes/rt/log_history.h"

#define MS INT64_C(1000000)

struct read {
    size_t n;
    char texts[LOG_HISTORY_LINES + 1][32];
    int64_t stamps_ns[LOG_HISTORY_LINES + 1];
};

static void take(void *ctx, const Anlos__Log *line)
{
    struct read *r = ctx;

    assert_true(r->n <= LOG_HISTORY_LINES);
    snprintf(r->texts[r->n], sizeof r->texts[0], "%s %s", line->node, line->text);
    r->stamps_ns[r->n++] = line->stamp_ns;
}

static void add(struct log_history *h, Anlos__Log__Level level, int i)
{
    Anlos__Log l = ANLOS__LOG__INIT;
    char text[32];

    snprintf(text, sizeof text, "line %d", i);
    l.level = level;
    l.stamp_ns = i;
    l.node = (char *)"dsp";
    l.text = text;
    log_history_add(h, &l);
}

static void read_back(struct scratch *s, struct read *r)
{
    r->n = 0;
    log_history_read(s->folder, take, r);
}

static void who_comes_late_gets_the_lines_in_their_order(void **state)
{
    struct scratch *s = *state;
    struct log_history h;
    struct read r;

    read_back(s, &r);
    assert_int_equal(r.n, 0); /* there is no launcher */
    log_history_open(&h, s->folder);
    assert_int_equal(log_history_tick(&h, 0), INT64_MAX);
    add(&h, ANLOS__LOG__LEVEL__WARNING, 1);
    add(&h, ANLOS__LOG__LEVEL__INFO, 2);
    assert_int_equal(log_history_tick(&h, 1000 * MS), INT64_MAX);
    read_back(s, &r);
    assert_int_equal(r.n, 2);
    assert_string_equal(r.texts[0], "dsp line 1");
    assert_string_equal(r.texts[1], "dsp line 2");
    assert_int_equal(r.stamps_ns[1], 2);
    add(&h, ANLOS__LOG__LEVEL__INFO, 3); /* soon after: not at once */
    assert_int_equal(log_history_tick(&h, 1001 * MS), 1200 * MS);
    assert_int_equal(log_history_tick(&h, 1200 * MS), INT64_MAX);
    read_back(s, &r);
    assert_int_equal(r.n, 3);
    log_history_close(&h);
    read_back(s, &r);
    assert_int_equal(r.n, 0);
}

static void a_flood_that_informs_leaves_the_warnings(void **state)
{
    struct scratch *s = *state;
    struct log_history h;
    struct read r;

    log_history_open(&h, s->folder);
    for (int i = 1; i <= 3; i++)
        add(&h, ANLOS__LOG__LEVEL__WARNING, i);
    for (int i = 4; i <= 1000; i++)
        add(&h, ANLOS__LOG__LEVEL__INFO, i);
    log_history_tick(&h, 0);
    read_back(s, &r);
    assert_int_equal(r.n, LOG_HISTORY_LINES);
    for (int i = 0; i < 3; i++)
        assert_int_equal(r.stamps_ns[i], i + 1);
    for (int i = 3; i < LOG_HISTORY_LINES; i++)
        assert_int_equal(r.stamps_ns[i], 1000 - LOG_HISTORY_LINES + i + 1);

    for (int i = 1001; i <= 1500; i++) /* of warnings the newest */
        add(&h, ANLOS__LOG__LEVEL__ERROR, i);
    log_history_tick(&h, 1000 * MS);
    read_back(s, &r);
    assert_int_equal(r.n, LOG_HISTORY_LINES);
    assert_int_equal(r.stamps_ns[0], 1500 - LOG_HISTORY_LINES + 1);
    log_history_close(&h);
}

/* Whoever reads trusts the folder, not what a crash or a disk left in it. */
static void a_file_that_is_none_is_read_up_to_there(void **state)
{
    struct scratch *s = *state;
    struct log_history h, next;
    struct read r;

    log_history_open(&h, s->folder);
    add(&h, ANLOS__LOG__LEVEL__ERROR, 1);
    add(&h, ANLOS__LOG__LEVEL__ERROR, 2);
    log_history_tick(&h, 0);
    FILE *f = fopen(scratch_path(s, "log.recent"), "r+");
    assert_non_null(f);
    assert_int_equal(fseek(f, 0, SEEK_END), 0);
    assert_int_equal(ftruncate(fileno(f), ftell(f) - 1), 0);
    fclose(f);
    read_back(s, &r);
    assert_int_equal(r.n, 1);
    scratch_write(s, "log.recent", "\xff\xff\xff\xff what is this");
    read_back(s, &r);
    assert_int_equal(r.n, 0);
    log_history_open(&next, s->folder); /* of a system before this one */
    assert_int_equal(access(scratch_path(s, "log.recent"), F_OK), -1);
    log_history_close(&next);
    log_history_close(&h);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(who_comes_late_gets_the_lines_in_their_order),
        TEST(a_flood_that_informs_leaves_the_warnings),
        TEST(a_file_that_is_none_is_read_up_to_there),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
