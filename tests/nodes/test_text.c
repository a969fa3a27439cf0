/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/anlos/text.h"

static char out[64];

static const char *count(uint64_t n)
{
    text_count(out, sizeof out, n);
    return out;
}

static const char *bytes(double n)
{
    text_bytes(out, sizeof out, n);
    return out;
}

static const char *rate(double hz, double expected_hz)
{
    text_rate(out, sizeof out, hz, expected_hz);
    return out;
}

static const char *latency(unsigned n, double median_s, double p99_s)
{
    struct table_latency l = {.n = n, .median_s = median_s, .p99_s = p99_s};
    text_latency(out, sizeof out, &l);
    return out;
}

static const char *duration(double s)
{
    text_duration(out, sizeof out, s);
    return out;
}

static const char *clean(const char *in)
{
    text_clean(out, sizeof out, in);
    return out;
}

static void counts_take_five_columns_at_most(void **state)
{
    (void)state;
    assert_string_equal(count(0), "0");
    assert_string_equal(count(99999), "99999");
    assert_string_equal(count(100000), "100k");
    assert_string_equal(count(999499), "999k");
    assert_string_equal(count(999500), "1.0M");
    assert_string_equal(count(UINT64_MAX), "18E");
}

static void bytes_are_scaled_by_thousands(void **state)
{
    (void)state;
    assert_string_equal(bytes(NAN), "-");
    assert_string_equal(bytes(0), "0");
    assert_string_equal(bytes(999), "999");
    assert_string_equal(bytes(1000), "1.0k");
    assert_string_equal(bytes(9940), "9.9k");
    assert_string_equal(bytes(9960), "10k");
    assert_string_equal(bytes(384000), "384k");
    assert_string_equal(bytes(2.5e9), "2.5G");
}

static void a_rate_stands_beside_what_is_expected(void **state)
{
    (void)state;
    assert_string_equal(rate(15.96, 16), "16.0/16");
    assert_string_equal(rate(0, 16), "0.0/16");
    assert_string_equal(rate(NAN, 16), "-/16");
    assert_string_equal(rate(0.25, 0), "0.2/-");
    assert_string_equal(rate(1234.4, 16), "1234/16");
    assert_string_equal(rate(123456, 16), "123k/16");
}

static void latencies_are_milliseconds_and_seconds_when_long(void **state)
{
    (void)state;
    assert_string_equal(latency(0, 1, 1), "-");
    assert_string_equal(latency(1, 0.0006, 0.0124), "0.6/12");
    assert_string_equal(latency(1, 0.1249, 1.5), "125/1500");
    assert_string_equal(latency(1, 99.4, 120), "99400/120s");
    assert_string_equal(latency(1, 1e9, 1e9), "1000000000s/1000000000s");
}

static void durations_name_their_units(void **state)
{
    (void)state;
    assert_string_equal(duration(NAN), "-");
    assert_string_equal(duration(59.9), "59s");
    assert_string_equal(duration(60), "1m00s");
    assert_string_equal(duration(3599.9), "59m59s");
    assert_string_equal(duration(3600), "1h00m");
    assert_string_equal(duration(36000 + 5 * 60), "10h05m");
}

static void good_utf8_stays_and_all_else_becomes_harmless(void **state)
{
    (void)state;
    assert_string_equal(clean("gr\xc3\xb6\xc3\x9f"
                              "er \xf0\x9f\x94\x8a"),
                        "gr\xc3\xb6\xc3\x9f"
                        "er \xf0\x9f\x94\x8a");
    assert_string_equal(clean("a\tb\nc\x1b[0m"), "a b c [0m");
    assert_string_equal(clean("\xc0\xaf"), "??");           /* '/', too long */
    assert_string_equal(clean("\xe0\x80\xaf"), "???");      /* the same */
    assert_string_equal(clean("\xed\xa0\x80"), "???");      /* half a surrogate pair */
    assert_string_equal(clean("\xf4\x90\x80\x80"), "????"); /* beyond U+10FFFF */
    assert_string_equal(clean("\xc2\x9b"), "??");           /* escape and '[' in one */
    assert_string_equal(clean("\xe2\x82"), "??");           /* cut off */
    assert_string_equal(clean("\xff\x7f"), "??");
}

static void cleaning_never_cuts_a_character_in_two(void **state)
{
    char small[6];

    (void)state;
    text_clean(small, sizeof small, "abc\xe2\x82\xac");
    assert_string_equal(small, "abc");
    text_clean(small, sizeof small, "ab\xe2\x82\xac");
    assert_string_equal(small, "ab\xe2\x82\xac");
}

static void columns_are_characters_not_bytes(void **state)
{
    char text[] = "\xc3\xb6\xc3\xb6\xe2\x82\xac-";

    (void)state;
    assert_int_equal(text_columns(text), 4);
    text_cut(text, 9);
    assert_int_equal(text_columns(text), 4);
    text_cut(text, 2);
    assert_string_equal(text, "\xc3\xb6\xc3\xb6");
    text_cut(text, 0);
    assert_string_equal(text, "");
}

static void a_line_ends_at_a_blank_or_in_a_word_that_is_too_long(void **state)
{
    static const struct {
        const char *text;
        size_t columns, bytes;
    } cases[] = {
        {"a bee sees", 10, 10},
        {"a bee sees", 9, 6},
        {"a bee sees", 5, 6},
        {"a bee sees", 4, 2},
        {"beehive", 3, 3},
        {"\xc3\xb6\xc3\xb6\xc3\xb6", 2, 4},
        {"", 3, 0},
        {"a", 1, 1},
    };

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        assert_int_equal(text_line(cases[i].text, cases[i].columns), cases[i].bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(counts_take_five_columns_at_most),
        cmocka_unit_test(bytes_are_scaled_by_thousands),
        cmocka_unit_test(a_rate_stands_beside_what_is_expected),
        cmocka_unit_test(latencies_are_milliseconds_and_seconds_when_long),
        cmocka_unit_test(durations_name_their_units),
        cmocka_unit_test(good_utf8_stays_and_all_else_becomes_harmless),
        cmocka_unit_test(cleaning_never_cuts_a_character_in_two),
        cmocka_unit_test(columns_are_characters_not_bytes),
        cmocka_unit_test(a_line_ends_at_a_blank_or_in_a_word_that_is_too_long),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
