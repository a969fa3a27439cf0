/* SPDX-License-Identifier: MIT */
/* What `anlos topic hz`, bw and delay count, on messages made by hand. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/anlos/topic/topic.h"
#include "nodes/rt/terminal.h"
#include "tests/nodes/near.h"

#define MS 1000000LL
#define T0 1795292109000000000LL

static struct tally tally;

static int open_tally(void **state)
{
    const struct topic *topics[] = {topic_ping(), topic_health()};

    (void)state;
    return tally_open(&tally, topics, 2, true);
}

static int close_tally(void **state)
{
    (void)state;
    tally_clear(&tally);
    return 0;
}

static struct bus_message message(const struct topic *t, const char *node,
                                  uint64_t sequence, uint32_t size)
{
    struct bus_message m = {.topic = t};

    snprintf(m.envelope.node, sizeof m.envelope.node, "%s", node);
    m.envelope.epoch_ns = 1;
    m.envelope.sequence = sequence;
    m.envelope.payload_size = size;
    return m;
}

static void add(const struct bus_message *m, int64_t at_ns)
{
    assert_int_equal(tally_add(&tally, m, at_ns), 0);
}

static void intervals_have_mean_extremes_and_deviation(void **state)
{
    static const int at_ms[] = {0, 100, 150, 400, 420};
    /* 100, 50, 250, 20: mean 105, variance ((5^2 + 55^2 + 145^2 + 85^2) / 4). */
    double std_s = 1e-3 * sqrt((25.0 + 3025.0 + 21025.0 + 7225.0) / 4.0);

    (void)state;
    for (int i = 0; i < 5; i++) {
        struct bus_message m = message(topic_ping(), "array", (uint64_t)i, 10);
        add(&m, T0 + at_ms[i] * MS);
    }
    const struct tally_row *r = &tally.rows[0];
    assert_string_equal(r->node, "array");
    assert_int_equal(r->messages, 5);
    assert_near(tally_interval_s(r), 0.105, 1e-9);
    assert_near(r->interval_min_s, 0.020, 1e-9);
    assert_near(r->interval_max_s, 0.250, 1e-9);
    assert_near(tally_interval_std_s(r), std_s, 1e-9);
}

static void one_message_has_no_interval(void **state)
{
    struct bus_message m = message(topic_ping(), "array", 0, 10);

    (void)state;
    assert_true(isnan(tally_interval_s(&tally.rows[0])));
    add(&m, T0);
    assert_true(isnan(tally_interval_s(&tally.rows[0])));
    assert_true(isnan(tally_interval_std_s(&tally.rows[0])));
}

static void each_sender_has_a_row_and_its_own_gaps(void **state)
{
    static const uint64_t dsp[] = {4, 5, 9}, recon[] = {0, 1, 2};

    (void)state;
    for (int i = 0; i < 3; i++) {
        struct bus_message a = message(topic_health(), "dsp", dsp[i], 100);
        struct bus_message b = message(topic_health(), "recon", recon[i], 50);
        add(&a, T0 + i * MS);
        add(&b, T0 + i * MS);
    }
    assert_int_equal(tally.n_rows, 3);
    assert_ptr_equal(tally.rows[0].topic, topic_ping());
    assert_string_equal(tally.rows[1].node, "dsp");
    assert_string_equal(tally.rows[2].node, "recon");
    assert_int_equal(tally.rows[1].gaps, 3); /* 6, 7 and 8 */
    assert_int_equal(tally.rows[2].gaps, 0);
    assert_int_equal(tally.rows[2].bytes, 150);
}

static void a_restarted_sender_is_not_a_gap(void **state)
{
    struct bus_message m = message(topic_ping(), "array", 3, 10);

    (void)state;
    add(&m, T0);
    m.envelope.epoch_ns = 2;
    m.envelope.sequence = 7;
    add(&m, T0 + MS);
    m.envelope.sequence = 9;
    add(&m, T0 + 2 * MS);
    assert_int_equal(tally.rows[0].gaps, 1);
}

static void sizes_have_extremes(void **state)
{
    static const uint32_t sizes[] = {200, 50, 120};

    (void)state;
    for (int i = 0; i < 3; i++) {
        struct bus_message m = message(topic_ping(), "array", (uint64_t)i, sizes[i]);
        add(&m, T0);
    }
    assert_int_equal(tally.rows[0].min_size, 50);
    assert_int_equal(tally.rows[0].max_size, 200);
    assert_int_equal(tally.rows[0].bytes, 370);
}

static void delays_have_quantiles(void **state)
{
    (void)state;
    for (int i = 100; i >= 1; i--) { /* captured 1..100 ms before they arrive */
        struct bus_message m = message(topic_ping(), "array", (uint64_t)(100 - i), 10);
        m.envelope.capture_ns = T0 - i * MS;
        m.envelope.publish_ns = T0 - 2 * MS;
        add(&m, T0);
    }
    const struct tally_row *r = &tally.rows[0];
    assert_near(tally_quantile_s(r->capture, 0.5), 0.050, 1e-9);
    assert_near(tally_quantile_s(r->capture, 0.99), 0.099, 1e-9);
    assert_near(tally_quantile_s(r->capture, 1.0), 0.100, 1e-9);
    assert_near(tally_quantile_s(r->published, 0.5), 0.002, 1e-9);
}

static void only_the_newest_delays_count(void **state)
{
    (void)state;
    for (int i = 0; i < 2 * TALLY_DELAYS; i++) {
        struct bus_message m = message(topic_ping(), "array", (uint64_t)i, 10);
        m.envelope.publish_ns = T0 - (i < TALLY_DELAYS ? 9 : 3) * MS;
        add(&m, T0);
    }
    assert_near(tally_quantile_s(tally.rows[0].published, 0.0), 0.003, 1e-9);
    assert_near(tally_quantile_s(tally.rows[0].published, 1.0), 0.003, 1e-9);
}

static void what_has_no_time_of_now_has_no_delay(void **state)
{
    struct bus_message silent = message(topic_ping(), "array", 0, 10), replayed = silent;

    (void)state;
    add(&silent, T0); /* capture_ns 0: of no sound */
    replayed.envelope.capture_ns = replayed.envelope.publish_ns = T0 - 86400000 * MS;
    replayed.envelope.replayed = true;
    add(&replayed, T0);
    assert_true(isnan(tally_quantile_s(tally.rows[0].capture, 0.5)));
    assert_true(isnan(tally_quantile_s(tally.rows[0].published, 0.5)));
    assert_int_equal(tally.rows[0].replayed, 1);
}

/* 48 kHz in slots of 1152 samples are 41.7 pings a second, twice that of two together. */
static void pings_are_expected_as_often_as_the_survey_says(void **state)
{
    Anlos__Survey survey = ANLOS__SURVEY__INIT;

    (void)state;
    assert_true(tally_expected_hz(&tally, topic_ping()) == topic_ping()->rate_hz);
    survey.sample_rate_hz = 48000;
    survey.slot_samples = 1152;
    tally_survey(&tally, &survey);
    assert_near(tally_expected_hz(&tally, topic_ping()), 41.667, 0.001);
    assert_near(tally_expected_hz(&tally, topic_traces()), 41.667, 0.001);
    assert_true(tally_expected_hz(&tally, topic_wall()) == topic_wall()->rate_hz);
    survey.together = 2;
    tally_survey(&tally, &survey);
    assert_near(tally_expected_hz(&tally, topic_ping()), 83.333, 0.001);
    survey.slot_samples = 0;
    tally_survey(&tally, &survey);
    assert_true(tally_expected_hz(&tally, topic_ping()) == topic_ping()->rate_hz);
}

static void many_senders_have_room(void **state)
{
    char name[ENVELOPE_NODE_SIZE];

    (void)state;
    for (int i = 0; i < 100; i++) {
        snprintf(name, sizeof name, "n%d", i);
        struct bus_message m = message(topic_health(), name, 0, 1);
        add(&m, T0);
    }
    assert_int_equal(tally.n_rows, 101);
    for (size_t i = 1; i < tally.n_rows; i++)
        assert_int_equal(tally.rows[i].messages, 1);
}

/* What stands on a terminal after text with ESC [ n A, ESC [ K and ESC [ J. */
static void show(const char *text, char lines[16][80])
{
    size_t at = 0, column = 0;

    memset(lines, 0, 16 * 80);
    for (const char *p = text; *p; p++) {
        if (*p == '\033') {
            int n = (int)strtol(p + 2, (char **)&p, 10);
            if (*p == 'A')
                at -= (size_t)n;
            else if (*p == 'K')
                memset(lines[at] + column, 0, 80 - column);
            else if (*p == 'J')
                memset(lines[at], 0, (16 - at) * 80);
        } else if (*p == '\n') {
            at++;
            column = 0;
        } else if (*p == '\r') {
            column = 0;
        } else {
            lines[at][column++] = *p;
        }
        assert_true(at < 16 && column < 80);
    }
}

static void a_table_is_drawn_over_the_one_before(void **state)
{
    char *text = NULL, lines[16][80];
    size_t size;
    FILE *f = open_memstream(&text, &size);
    struct live live = {.f = f};

    (void)state;
    assert_int_equal(live_draw(&live, "one\ntwo\nthree\n", 24, 80), 0);
    assert_int_equal(live_draw(&live, "1\nanother line\n", 24, 80), 0);
    fclose(f);
    show(text, lines);
    assert_string_equal(lines[0], "1");
    assert_string_equal(lines[1], "another line");
    assert_string_equal(lines[2], "");
    free(text);
}

static void a_table_too_large_for_the_terminal_is_cut(void **state)
{
    char *text = NULL, lines[16][80];
    size_t size;
    FILE *f = open_memstream(&text, &size);
    struct live live = {.f = f};

    (void)state;
    for (int i = 0; i < 2; i++)
        assert_int_equal(
            live_draw(&live, "a line of over 20 columns\nb\nc\nd\ne\n", 4, 21), 0);
    fclose(f);
    show(text, lines);
    assert_string_equal(lines[0], "a line of over 20 co");
    assert_string_equal(lines[1], "b");
    assert_string_equal(lines[2], "... and 3 lines more");
    assert_string_equal(lines[3], "");
    free(text);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, open_tally, close_tally)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(intervals_have_mean_extremes_and_deviation),
        TEST(one_message_has_no_interval),
        TEST(each_sender_has_a_row_and_its_own_gaps),
        TEST(a_restarted_sender_is_not_a_gap),
        TEST(sizes_have_extremes),
        TEST(delays_have_quantiles),
        TEST(only_the_newest_delays_count),
        TEST(what_has_no_time_of_now_has_no_delay),
        TEST(pings_are_expected_as_often_as_the_survey_says),
        TEST(many_senders_have_room),
        cmocka_unit_test(a_table_is_drawn_over_the_one_before),
        cmocka_unit_test(a_table_too_large_for_the_terminal_is_cut),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
